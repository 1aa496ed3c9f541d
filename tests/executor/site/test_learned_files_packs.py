"""A site that names its vehicles' packs flies by what earlier flights said of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executor.errors import LogError, SiteError
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model
from executor.site.learned_files import PacksDocument, load_site_packs
from executor.site.site_file import Site, check_site, read_site
from executor.site.site_model import SiteModel
from missions import SolverRecord, make_plan_file
from planner import Cost, Plan, Route
from tests.e2e.flights import site_file
from tests.executor.builders import ground_for
from tests.missions.builders import line_east

ENTRY: dict[str, Any] = {
    "log": "a.tlog", "vehicle": "uav1", "pack": 1, "label": "A7", "began_usec": 1_800_000_000_000_000, "minutes": 12.0,
    "cells": 4, "rest_cell_v": 4.18, "end_cell_v": 3.7, "began_pct": 100.0, "ended_pct": 50.0, "sag_cell_v": 0.12,
    "ohm": 0.024, "ohm_sd": 0.001, "counted_ah": 2.5, "set_ah": 5.0, "least_ah": 3.2, "most_ah": 3.5,
}  # fmt: skip


def written(folder: Path, *entries: dict[str, Any]) -> Path:
    path = folder / "packs.json"
    path.write_text(json.dumps({"format": "faultline-packs/1", "flights": entries}))
    return path


def site_with(**vehicle: object) -> Site:
    tables: list[dict[str, Any]] = [
        {"name": name, "connection": f"udpin://127.0.0.1:{14550 + number}", "sysid": number, "autopilot": "ardupilot"}
        for number, name in ((1, "uav1"), (2, "uav2"))
    ]
    tables[0] |= vehicle
    energy = {"capacity_ah": 5.0, "packs": "packs.json"}
    return check_site({"network": {"file": "line"}, "vehicle": tables, "energy": energy}, "test")


def ground_with(folder: Path, **vehicle: object) -> SiteModel:
    site = site_with(**vehicle)
    return replace(ground_for(site, line_east(7)), packs=load_site_packs(site, folder))


def test_a_worn_pack_shortens_the_budget_and_raises_the_reserve_of_its_vehicle_alone(tmp_path: Path) -> None:
    written(tmp_path, ENTRY, {**ENTRY, "label": "B1", "most_ah": 2.0}, {**ENTRY, "label": None, "most_ah": 1.0})
    ground = ground_with(tmp_path, pack="A7")
    task = site_model.build_first_task(ground)
    context = site_model.build_context(ground, ground.setup, task)
    assert [one.budget_pct for one in task.instance.vehicles] == pytest.approx([55.0, 75.0])
    first, second = (context.vehicles[name] for name in ("uav1", "uav2"))
    assert (first.budget_pct, first.reserve_pct, first.empty_pct) == pytest.approx((55.0, 45.0, 30.0))
    assert first.pack.share == pytest.approx(0.7)
    assert first.pack.ohm == pytest.approx((0.024, 0.0048))
    assert first.history is not None
    assert (second.budget_pct, second.reserve_pct, second.history) == (75.0, 15.0, None)


def test_a_pack_that_is_put_in_later_is_known_by_its_label(tmp_path: Path) -> None:
    written(tmp_path, ENTRY, {**ENTRY, "label": "B1", "most_ah": 4.0})
    ground = ground_with(tmp_path, pack="A7")
    context = site_model.build_context(ground, ground.setup, site_model.build_first_task(ground))
    for setup in context.vehicles.values():
        found = {label: setup.with_pack(label) for label in ("A7", "B1", "", "C3")}
        budgets = {label: (one.budget_pct, one.reserve_pct) for label, one in found.items()}
        assert budgets["A7"] == pytest.approx((55.0, 45.0))
        assert budgets["B1"] == pytest.approx((65.0, 35.0))
        assert budgets[""] == budgets["C3"] == (75.0, 15.0)
        assert [one.name for one in found.values()] == [setup.name] * 4


def test_without_a_label_nothing_is_reckoned_with(tmp_path: Path) -> None:
    written(tmp_path, ENTRY)
    ground = ground_with(tmp_path)
    assert [one.budget_pct for one in site_model.build_first_task(ground).instance.vehicles] == [75.0, 75.0]


def test_its_last_flights_count_by_their_dates(tmp_path: Path) -> None:
    day = 86_400_000_000
    old = [{**ENTRY, "most_ah": 4.9, "began_usec": ENTRY["began_usec"] - (9 - one) * day} for one in range(9)]
    new = [{**ENTRY, "began_usec": ENTRY["began_usec"] + one * day} for one in range(5)]
    undated = {**ENTRY, "most_ah": 5.0, "began_usec": 61_000_000}
    written(tmp_path, *new, undated, *old)
    known = load_site_packs(site_with(pack="A7"), tmp_path).fitted["uav1"]
    assert known.flights == 15
    assert known.capacity_ah is not None
    assert known.capacity_ah[0] == 3.5


def test_what_was_written_before_there_were_labels_is_read(tmp_path: Path) -> None:
    entry = {key: value for key, value in ENTRY.items() if key != "label"}
    assert PacksDocument.read(written(tmp_path, entry)).flights[0].label is None


@pytest.mark.parametrize("label", ["", "A 7", "x" * 33, "-7"])
def test_a_label_is_letters_and_digits(label: str) -> None:
    with pytest.raises(SiteError, match=r"vehicle\[1\]\.pack: expected|vehicle\[0\]\.pack: expected"):
        site_with(pack=label)


def test_a_file_that_is_missing_or_wrong_is_named(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"packs\.json: cannot be read"):
        load_site_packs(site_with(pack="A7"), tmp_path)
    (tmp_path / "packs.json").write_text('{"format": "faultline-packs/1", "flights": [{"log": 5}]}')
    with pytest.raises(LogError, match=r"packs\.json: flights"):
        load_site_packs(site_with(pack="A7"), tmp_path)


def test_a_flight_keeps_what_it_reckoned_with(tmp_path: Path) -> None:
    """A run directory is carried elsewhere, and taken up there."""
    path, _ = site_file(tmp_path, pylons=6, vehicles=2, speedup=1.0)
    content = path.read_text().replace(
        "[[vehicle]]", '[energy]\ncapacity_ah = 5.0\npacks = "packs.json"\n[[vehicle]]', 1
    )
    path.write_text(content.replace('name = "uav1"', 'name = "uav1"\npack = "A7"', 1))
    written(tmp_path, ENTRY)
    site, run = read_site(path), tmp_path / "run"
    run.mkdir()
    ground = site_model.load_site_model(site, tmp_path)
    task = site_model.build_first_task(ground)
    plan = make_plan_file(
        ground.network, task, ground.travel, Plan((Route(0, (0, 2)), Route(1, (4, 6, 8))), ()), Cost.MINMAX,
        SolverRecord("search", 1, 0.1), inspection=ground.inspection,
    )  # fmt: skip
    assert [one.budget_pct for one in plan.build_task().instance.vehicles] == pytest.approx([55.0, 75.0])
    write_run_start(FlightRequest(site, tmp_path, ground, plan, run, lambda _: ()))
    (tmp_path / "packs.json").unlink()
    again = site_model.load_site_model(read_site(run / "site.toml"), run)
    assert again.packs == ground.packs
    context = site_model.build_context(again, again.setup, site_model.build_first_task(again))
    assert context.vehicles["uav1"].budget_pct == pytest.approx(55.0)
