"""Plan files: round trips, the check of every figure, and every reason to refuse one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from missions import (
    Inspection,
    PlanFile,
    PlanFileError,
    SolverRecord,
    Window,
    build_plan_document,
    check_plan,
    is_day_plan,
    make_plan_file,
    read_any_plan,
    read_day_plan,
    read_network,
    read_plan,
    write_plan,
)
from missions.plan_parts import PlanCost, PlanRoute
from missions.readers import default_network_path
from planner import Cost, Plan, Route, SteadyWind, Travel, Vehicle
from planner.moves import Dynamics
from tests.missions.builders import depot_vehicle, line_east, paper_task, whole_task

TRAVEL = Travel(transit_speed_m_s=10.0, inspection_speed_m_s=2.0, transit_pct_per_s=0.1, inspection_pct_per_s=0.2)
SOLVED = SolverRecord("search", 7, 1.5)
INSPECTION_KEYS = ("height_m", "standoff_m", "speed_m_s", "transit_speed_m_s", "layer_m")


def small() -> PlanFile:
    """Two vehicles over a line of three segments; the first does segments 0 and 1, the second nothing, 2 is left."""
    network = line_east()
    task = whole_task(network, [depot_vehicle("uav1", 80.0), depot_vehicle("uav2", 70.0)], TRAVEL)
    plan = Plan((Route(0, (0, 2)), Route(1, ())), uncovered=(2,))
    return make_plan_file(network, task, TRAVEL, plan, Cost.MINMAX, SOLVED)


def routes_of(**figures: Any) -> tuple[PlanRoute, ...]:
    """Return its routes, the first with other figures."""
    first, second = small().routes
    return replace(first, **figures), second


def test_figures_come_from_the_definition() -> None:
    content = small()
    # 100 m out, 200 m of inspection, 300 m home: 10 + 100 + 30 s.
    assert content.durations_s == pytest.approx((140.0, 0.0), abs=1e-6)
    assert content.energies_pct == pytest.approx((24.0, 0.0), abs=1e-6)
    assert content.cost.value == pytest.approx(24.0, abs=1e-6)
    assert check_plan(content) == []


def full(tmp_path: Path) -> tuple[Path, PlanFile]:
    """A file that uses everything: heights, an airborne worn vehicle, dynamics, wind, a window, an inspection."""
    network = read_network(default_network_path(), radius_m=500.0)
    wind = SteadyWind(3.0, -1.5, (0.0, 5.0, 10.0, 20.0), (0.11, 0.1, 0.13, 0.3))
    travel = replace(TRAVEL, dynamics=Dynamics(2.0, 0.5), wind=wind)
    vehicles = [Vehicle("uav1", (120.5, -30.25), 55.5, 1.1, airborne=True), depot_vehicle("uav2", 90.0)]
    task = paper_task(network, [3, 7, 8, 20], vehicles, travel)
    plan = Plan((Route(0, (1, 2)), Route(1, (4,))), uncovered=(3,))
    content = make_plan_file(network, task, travel, plan, Cost.MINCOMB, SOLVED, inspection=Inspection(height_m=18.0))
    longest_s = max(content.durations_s)
    content = replace(content, window=Window(25.0, 0.75 * longest_s, longest_s))
    path = tmp_path / "plan.json"
    write_plan(path, content)
    return path, content


def test_a_file_reads_back_as_it_was_written(tmp_path: Path) -> None:
    path, content = full(tmp_path)
    again = read_plan(path)
    assert again == content
    assert again.source == str(path)
    assert check_plan(again, search_window=False) == []
    assert again.build_task().segment_ids == (3, 7, 8, 20)
    # Written again it is the same file, and nothing else is left beside it.
    write_plan(tmp_path / "again.json", again)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["again.json", "plan.json"]


KEPT = sorted((Path(__file__).parent / "plans" / "v1").iterdir())


@pytest.mark.parametrize("kept", KEPT, ids=lambda path: str(path.stem))
def test_a_file_of_version_1_is_read_and_written_as_version_2_always_was(kept: Path, tmp_path: Path) -> None:
    """With heights, wind, dynamics, a worn vehicle in the air, windows, a flat ground, areas, a relief; and days."""
    now, written = tmp_path / "plan.json", kept.parents[1] / "v2" / kept.name
    for read in (kept, written):
        write_plan(now, read_any_plan(read))
        assert now.read_bytes() == written.read_bytes()
    old, new = json.loads(kept.read_bytes()), json.loads(written.read_bytes())
    for key in {"depot", "segments", "uncovered", "seed", "solver", "seconds", "window"} & {*old}:
        assert new[key] == old[key]


@pytest.mark.parametrize("version", ["v1", "v2"])
def test_every_figure_of_kept_files_is_right(version: str) -> None:
    priced, days = (KEPT[0].parents[1] / version / name for name in ("priced.json", "days.json"))
    assert check_plan(read_plan(priced)) == []
    assert check_plan(read_day_plan(days)) == []
    assert (is_day_plan(priced), is_day_plan(days)) == (False, True)


@pytest.mark.parametrize("version", ["v1", "v2"])
def test_a_plan_of_another_kind_is_refused_in_one_line(version: str) -> None:
    folder = KEPT[0].parents[1] / version
    with pytest.raises(PlanFileError, match=r"days\.json: days: expected a plan for a single flight, got a day plan$"):
        read_plan(folder / "days.json")
    with pytest.raises(
        PlanFileError, match=r"small\.json: days: expected a day plan, got the plan of a single flight$"
    ):
        read_day_plan(folder / "small.json")


@pytest.mark.parametrize(
    ("name", "keys", "reason"),
    [
        ("priced", ("model", "tracks"), "content: expected what faultline-plan/1 has: expected 'tracks', but it is"),
        ("priced", ("model", "relief", "step_m"), "content: expected what faultline-plan/1 has: expected 'step_m'"),
        ("priced", ("model", "vehicles", 1), "model: expected bases and models of uav1, uav2"),
        ("priced", ("depot",), "content: expected what faultline-plan/1 has: expected 'depot'"),
        ("days", ("vehicles", 0, "pads"), "content: expected what faultline-dayplan/1 has: expected 'pads'"),
        ("days", ("objective",), "content: expected what faultline-dayplan/1 has: expected 'objective'"),
        ("days", ("finish_s",), "content: expected what faultline-dayplan/1 has: expected 'finish_s'"),
    ],
)
def test_what_a_file_of_version_1_lacks_is_named(tmp_path: Path, name: str, keys: Any, reason: str) -> None:
    document = json.loads((KEPT[0].parent / f"{name}.json").read_bytes())
    _delete(*keys)(document)
    (tmp_path / "plan.json").write_text(json.dumps(document))
    with pytest.raises(PlanFileError, match=reason) as caught:
        read_any_plan(tmp_path / "plan.json")
    assert "\n" not in str(caught.value)


def test_an_unknown_key_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(build_plan_document(small()) | {"colour": "red"}))
    assert read_plan(path) == small()


def test_a_plan_chosen_by_its_window_reads_back(tmp_path: Path) -> None:
    content = small()
    longest_s = max(content.durations_s)
    window = Window(0.0, longest_s, longest_s)  # it leaves a segment out
    chosen = replace(content, cost=PlanCost("window", window.earliest_s), window=window)
    path = tmp_path / "plan.json"
    write_plan(path, chosen)
    assert json.loads(path.read_text())["cost"] == {"name": "window", "value": window.earliest_s}
    assert read_plan(path) == chosen
    assert check_plan(chosen) == []
    assert "cost.value (window) is 1, its content gives 140" in check_plan(
        replace(chosen, cost=PlanCost("window", 1.0))
    )


def test_a_plan_chosen_by_a_window_has_one(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    document = build_plan_document(small()) | {"cost": {"name": "window", "value": 3.0}}
    path.write_text(json.dumps(document))
    with pytest.raises(PlanFileError, match="window: expected the window that the plan was chosen by"):
        read_plan(path)


def test_a_file_is_as_the_design_has_it(tmp_path: Path) -> None:
    path, _ = full(tmp_path)
    document = json.loads(path.read_text(encoding="utf-8"))
    assert document["format"] == "faultline-plan/2"
    assert document["depot"] == {"lat_deg": 49.5985, "lon_deg": 15.6137, "alt_m": 462.0}
    assert document["vehicles"][0]["name"] == "uav1"
    assert document["vehicles"][0]["start"] == [120.5, -30.25]
    assert document["routes"][0]["visits"] == [{"segment": 3, "reversed": True}, {"segment": 7, "reversed": False}]
    assert document["uncovered"] == [20]
    assert document["cost"]["name"] == "mincomb"
    assert (document["solver"], document["seed"], document["seconds"]) == ("search", 7, 1.5)
    segment = document["segments"][0]
    assert (segment["id"], segment["name"]) == (3, "V102.1")
    assert len(segment["a"]) == len(segment["b"]) == 3
    assert segment["pylons"] == ["V102-01", "V102-02"]
    assert set(document["window"]) == {"window_pct", "earliest_s", "longest_route_s"}


def test_a_plan_files_network_can_be_flown(tmp_path: Path) -> None:
    path, content = full(tmp_path)
    network = read_plan(path).build_network()
    assert network.has_heights
    assert [network.segment_name(number) for number in range(4)] == ["V102.1", "V103.2", "V103.3", "V105B.2"]
    assert np.allclose(network.ends_m, content.ends_m, atol=1e-6)


def test_optional_keys_may_be_missing(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    write_plan(path, small())
    document = json.loads(path.read_text(encoding="utf-8"))
    for vehicle in document["vehicles"]:
        del vehicle["consumption"], vehicle["airborne"]
    for segment in document["segments"]:
        del segment["elevation_m"], segment["height_m"]
    path.write_text(json.dumps(document), encoding="utf-8")
    assert read_plan(path) == small()


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        ({"routes": routes_of(duration_s=141.0)}, "route of uav1: duration_s is 141, its content gives 140"),
        ({"routes": routes_of(energy_pct=24.1)}, "route of uav1: energy_pct is 24.1, its content gives 24"),
        ({"cost": PlanCost("minmax", 23.0)}, "cost.value (minmax) is 23, its content gives 24"),
        ({"cost": PlanCost("mincomb", 24.0)}, "cost.value (mincomb) is 24, its content gives 36"),
        ({"uncovered": ()}, "segment 2 is neither visited nor named as uncovered"),
        ({"window": Window(50.0, 70.0, 150.0)}, "window.longest_route_s is 150, its content gives 140"),
        ({"window": Window(60.0, 70.0, 140.0)}, "window.window_pct is 60, its content gives 50"),
        (
            {"vehicles": (replace(small().vehicles[0], budget_pct=20.0), small().vehicles[1])},
            "route of uav1: spends 24.000 %, its budget is 20.000 %",
        ),
    ],
)
def test_a_figure_that_its_content_does_not_bear_out_is_reported(change: dict[str, Any], finding: str) -> None:
    assert finding in check_plan(replace(small(), **change))


def test_places_and_lengths_are_checked() -> None:
    content = small()
    first, *others = content.segments
    moved = replace(first, a_enu_m=(99.0, 0.0, 0.0))
    findings = check_plan(replace(content, segments=(moved, *others)))
    assert "segment 0: a and a_lat_lon_deg are 1.00 m apart" in findings
    assert "segment 0: length_m is 100, its ends are 101 m apart" in findings


def test_a_window_is_searched_for_again() -> None:
    content, longest_s = small(), small().durations_s[0]
    assert check_plan(replace(content, window=Window(0.0, longest_s, longest_s))) == []
    wrong = replace(content, window=Window(50.0, 70.0, longest_s))
    assert check_plan(wrong) == ["window.earliest_s is 70, its content gives 140"]
    assert check_plan(wrong, search_window=False) == []


def test_a_plan_of_one_vehicle_has_no_window() -> None:
    network = line_east()
    task = whole_task(network, [depot_vehicle("uav1", 80.0)], TRAVEL)
    plan = Plan((Route(0, (0, 2, 4)),))
    content = make_plan_file(network, task, TRAVEL, plan, Cost.MINMAX, SOLVED)
    longest_s = content.durations_s[0]
    (finding,) = check_plan(replace(content, window=Window(0.0, longest_s, longest_s)))
    assert finding.startswith("window: uav1 is the only vehicle")


def _set(*keys: Any, value: object) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


def _delete(*keys: Any) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        del document[keys[-1]]

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_set("format", value="faultline-plan/3"), "format: expected 'faultline-plan/2', got 'faultline-plan/3'"),
        (_delete("format"), "format: expected this key, but it is missing"),
        (_delete("depot"), "depot: expected this key, but it is missing"),
        (_set("depot", "lat_deg", value="49"), r"depot\.lat_deg: expected a number, got '49'"),
        (_set("depot", "lat_deg", value=90.0), r"depot\.lat_deg: expected less than or equal to 89, got 90"),
        (_set("segments", value={}), r"segments: expected a list, got \{\}"),
        (_set("segments", 1, "id", value=0), r"segments\[1\]\.id: expected one of its own, got 0"),
        (_set("segments", 1, "id", value=1.5), r"segments\[1\]\.id: expected a whole number, got 1\.5"),
        (_set("segments", 1, "a", value=[1, 2]), r"segments\[1\]\.a\[2\]: expected one more value"),
        (_set("segments", 1, "b", 0, value=float("nan")), r"segments\[1\]\.b\[0\]: expected a finite number, got nan"),
        (_set("segments", 1, "pylons", value=["p1"]), r"segments\[1\]\.pylons\[1\]: expected one more value"),
        (_set("segments", 1, "height_m", value=[1.0]), r"segments\[1\]\.height_m\[1\]: expected one more value"),
        (_set("segments", 1, "height_m", value=[1.0, "x"]), r"segments\[1\]\.height_m\[1\]: expected a number"),
        (_set("vehicles", value=[]), "vehicles: expected at least one vehicle"),
        (_set("vehicles", 1, "name", value="uav1"), r"vehicles\[1\]\.name: expected one of its own, got uav1"),
        (_set("vehicles", 1, "name", value=""), r"vehicles\[1\]\.name: expected .*pattern.*, got ''"),
        (_set("vehicles", 1, "budget_pct", value=True), r"vehicles\[1\]\.budget_pct: expected a number, got True"),
        (_set("vehicles", 1, "airborne", value=1), r"vehicles\[1\]\.airborne: expected true or false, got 1"),
        (_set("routes", 1, "vehicle", value="uav3"), r"routes\[1\]\.vehicle: expected one of uav1, uav2, got uav3"),
        (_set("routes", 1, "vehicle", value="uav1"), "routes: expected one each for uav1, uav2, in that order"),
        (_set("routes", 1, "lands", value="barn"), r"routes\[1\]\.lands: expected one of depot, got barn"),
        (_set("bases", value=[]), "bases: expected at least one base"),
        (_set("routes", 0, "visits", 1, "segment", value=9), r"routes\[0\]\.visits\[1\]\.segment: expected the id"),
        (_delete("routes", 0, "visits", 1, "reversed"), r"routes\[0\]\.visits\[1\]\.reversed: expected this key"),
        (_set("routes", 0, "visits", 1, "segment", value=0), "routes: expected every segment at most once"),
        (_set("routes", 0, "duration_s", value=None), r"routes\[0\]\.duration_s: expected a number, got None"),
        (_set("uncovered", value=["2"]), r"uncovered\[0\]: expected a whole number, got '2'"),
        (_set("uncovered", value=[5]), "uncovered: expected the id of a segment, got 5"),
        (_set("cost", "name", value="best"), r"cost\.name: expected 'minmax', .*'window' or 'coverage', got 'best'"),
        (_set("travel", "transit_speed_m_s", value=0), r"travel\.transit_speed_m_s is 0.0, expected a positive number"),
        (_set("travel", "dynamics", value=1), r"travel\.dynamics: expected keys with values, got 1"),
        (_set("window", value={"window_pct": 1}), r"window\.earliest_s: expected this key, but it is missing"),
        (
            _set("inspection", value=dict.fromkeys(INSPECTION_KEYS, -1)),
            r"inspection\.height_m: expected greater than 0, got -1",
        ),
        (_delete("solver"), "solver: expected this key, but it is missing"),
        (_set("solver", value=""), "solver: expected at least 1 character, got ''"),
        (_set("seed", value=2**31), "seed: expected less than or equal to 2147483647, got 2147483648"),
        (_set("seed", value=True), "seed: expected a whole number, got True"),
        (_set("seconds", value=10**400), "seconds: expected "),
        (_set("seconds", value=1e13), r"seconds: expected less than or equal to 1000000000000, got 1"),
        (_set("segments", 2, "id", value=-1), r"segments\[2\]\.id: expected greater than or equal to 0, got -1"),
        (_set("segments", 2, "name", value=""), r"segments\[2\]\.name: expected at least 1 character"),
        (_set("travel", "wind", value={"east_m_s": 1, "north_m_s": 1, "airspeed_m_s": [0], "pct_per_s": [1]}),
         r"travel\.wind: expected as many rates as air speeds, two at least"),
        (_set("inspection", value=dict.fromkeys(INSPECTION_KEYS, 9) | {"flat": "hilly"}),
         "inspection.flat: expected true or false, got 'hilly'"),
    ],
)  # fmt: skip
def test_a_broken_file_is_named(tmp_path: Path, change: Callable[[Any], None], reason: str) -> None:
    path = tmp_path / "plan.json"
    write_plan(path, small())
    document = json.loads(path.read_text(encoding="utf-8"))
    change(document)
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(PlanFileError, match=reason) as caught:
        read_plan(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b'{"format":\n', "content: expected JSON: .* at line 2"),
        (b"[]", r"content: expected keys with values, got \[\]"),
        (b"\xff", "encoding: expected UTF-8 text, found other bytes at 0"),
    ],
)
def test_a_file_that_is_no_plan_is_named(tmp_path: Path, content: bytes, reason: str) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(content)
    with pytest.raises(PlanFileError, match=rf"plan\.json: {reason}"):
        read_plan(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlanFileError, match=r"none\.json: file: expected a readable plan file: No such file"):
        read_plan(tmp_path / "none.json")


def test_a_figure_that_is_no_number_is_never_written(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    with pytest.raises(PlanFileError, match=r"plan\.json: cost\.value: expected a finite number, got nan"):
        write_plan(path, replace(small(), cost=PlanCost("minmax", float("nan"))))
    assert not path.exists()


def test_vehicles_that_make_no_problem_are_named() -> None:
    first, second = small().vehicles
    broken = replace(small(), vehicles=(replace(first, start_m=(float("inf"), 0.0)), second))
    with pytest.raises(PlanFileError, match=r"^plan: .*start_m"):
        check_plan(broken)
