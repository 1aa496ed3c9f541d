"""Flights with two links to every vehicle: one that dies is no lost vehicle, and both that die are one."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from benchmarks.virtual_flight import VirtualFlight, VirtualRun, fly_virtual
from benchmarks.virtual_site import build_virtual_site
from executor.core.interface.codes import CheckCode
from executor.simulated.simulated_fleet import build_vehicle_tables
from tests.benchmarks.virtual.short_line import shared, write_line

AUTOPILOTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
PORTS = (20_000, 20_001)


def connections_of(number: int) -> list[str]:
    return [f"udpin://127.0.0.1:{PORTS[number]}", f"udpin://127.0.0.1:{21_000 + number}"]


def flown(folder: Path, autopilot: str, *faults: str, radio: str = "sik-ecc-mended,lte") -> VirtualFlight:
    tables = build_vehicle_tables(PORTS, autopilot)
    vehicles = [one | {"connection": connections_of(number)} for number, one in enumerate(tables)]
    site = {"vehicle": vehicles, "link": {"one_radio": True}}
    ground = build_virtual_site(write_line(folder / "line.geojson"), None, 2, autopilot, tables=site)
    return fly_virtual(
        ground, shared(ground), faults=faults, seed=1, limit_s=600.0, make=partial(VirtualRun, radio=radio)
    )


@AUTOPILOTS
def test_a_vehicle_flies_on_while_its_links_fail_in_turn(autopilot: str, tmp_path: Path) -> None:
    flight = flown(tmp_path, autopilot, "uav1.1:silent@10s", "uav2.2:silent=15s@10s", "uav2.1:silent=15s@40s")
    assert flight.report.finished
    assert flight.report.faults == ()
    assert flight.report.not_counted == ()
    assert not any("no message" in line.text or "regained" in line.text for _, line in flight.said)
    [row, other] = flight.report.vehicles
    assert [one.connection for one in row.links] == connections_of(0)
    assert row.links[0].frames_received < row.links[1].frames_received
    assert row.frames_received == sum(one.frames_received for one in row.links)
    assert all(one.frames_missing <= 0.3 * one.frames_received for one in (*row.links, *other.links))


@AUTOPILOTS
def test_a_vehicle_without_any_link_is_lost(autopilot: str, tmp_path: Path) -> None:
    flight = flown(tmp_path, autopilot, "uav1.1:silent@10s", "uav1.2:silent@20s")
    assert [one.vehicle for one in flight.report.faults] == ["uav1"]
    assert flight.report.faults[0].detected_s > 20.0


@AUTOPILOTS
def test_the_checklist_says_over_which_links_a_vehicle_is_heard(autopilot: str, tmp_path: Path) -> None:
    flight = flown(tmp_path, autopilot, "uav2.2:silent@0s")
    lines = [one.text for one in flight.report.checks if one.code is CheckCode.RADIO and one.subject.startswith("uav")]
    first, second = connections_of(1)
    assert lines[0].startswith("heard over all 2 links, orders go over udpin://127.0.0.1:2")
    assert lines[1] == f"no message over {second}, orders go over {first}"
