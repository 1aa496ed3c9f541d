"""Flights in virtual time: the executor's own decisions, in seconds, and the same every time."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from benchmarks.errors import FlightNotFlown
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, VirtualRun, fly_virtual
from executor.core.interface.events import Heard, LaunchOrdered
from executor.site.flight_keys import FenceTable
from simulator.errors import FaultSpecError, SimulatorError
from tests.benchmarks.virtual.short_line import shared, short_ground
from tests.stories.world import Sink


def flown(folder: Path, autopilot: str, *faults: str, sink: Sink | None = None) -> VirtualFlight:
    ground = short_ground(folder, 2, autopilot)
    onlookers = None if sink is None else FlightObservers(sink=sink)
    return fly_virtual(ground, shared(ground), faults=faults, seed=1, onlookers=onlookers)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_loss_is_replanned_and_everything_inspected(tmp_path: Path, autopilot: str) -> None:
    flight = flown(tmp_path, autopilot, "uav2:crash@40s")
    report = flight.report
    assert flight.ended
    assert (report.finished, report.segments_total, report.segments_inspected) == (True, 4, 4)
    [fault], [replan] = report.faults, report.replans
    assert fault.vehicle == "uav2"
    assert fault.happened_s is not None
    assert 0.0 < fault.detected_s - fault.happened_s < 5.0
    assert (replan.feasible, replan.solve_s) == (True, 0.5)
    lost, survivor = flight.crafts["uav2"], flight.crafts["uav1"]
    assert (lost.wrecked, survivor.wrecked, survivor.armed) == (True, False, False)
    assert survivor.from_pad_m < 1.0
    assert any("re-plan 1 is on board" in line.text for _, line in flight.said)
    # What the ground station heard of the survivor's flight is what was.
    at_s = {truth.what: truth.t_s for truth in flight.truths if truth.vehicle == "uav1"}
    rows = [row for row in report.routes if row.vehicle == "uav1"]
    assert rows[0].began_s == pytest.approx(at_s["armed"] - flight.launched_s, abs=2.0)
    assert rows[-1].ended_s == pytest.approx(at_s["disarmed"] - flight.launched_s, abs=2.0)


def test_the_same_flight_is_the_same_to_the_last_event(tmp_path: Path) -> None:
    one, two = Sink(), Sink()
    first = flown(tmp_path, "px4", "uav1:silent@30s", sink=one)
    again = flown(tmp_path, "px4", "uav1:silent@30s", sink=two)
    assert one.written == two.written
    assert any(isinstance(event, LaunchOrdered) for _, event in one.written)
    assert sum(isinstance(event, Heard) for _, event in one.written) > 1000
    assert (first.report, first.truths, first.crafts) == (again.report, again.truths, again.crafts)


def test_wind_costs_what_the_speed_through_the_air_does(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 1, "ardupilot")
    plan = shared(ground)

    def used_pct(wind_m_s: tuple[float, float]) -> float:
        flight = fly_virtual(ground, plan, craft=lambda craft: replace(craft, wind_m_s=wind_m_s))
        return 100.0 - flight.crafts["uav1"].charge_pct

    still, windy = used_pct((0.0, 0.0)), used_pct((12.0, 0.0))
    assert windy > 1.02 * still


def test_a_flight_is_left_at_its_limit(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 1, "px4")
    flight = fly_virtual(ground, shared(ground), limit_s=30.0)
    assert not flight.ended
    assert flight.flown_s == pytest.approx(30.0, abs=0.5)
    assert not flight.report.finished


def test_what_cannot_be_flown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FaultSpecError, match="no vehicle 'uav9'"):
        flown(tmp_path, "px4", "uav9:crash@40s")
    ground = short_ground(tmp_path, 1, "ardupilot")
    with pytest.raises(FlightNotFlown, match=r"uav1: .*expected at least the reserve of 15 %"):
        fly_virtual(ground, shared(ground), craft=lambda craft: replace(craft, charge_pct=16.0))


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_fence_is_flown_with_and_widened_for_a_replan(tmp_path: Path, autopilot: str) -> None:
    ground = short_ground(tmp_path, 2, autopilot)
    site = ground.site.model_copy(update={"fence": FenceTable(enabled=True, action="return")})
    ground = replace(ground, site=site)
    flight = fly_virtual(ground, shared(ground), faults=("uav2:crash@40s",), seed=1)
    assert flight.report.finished
    assert [fault.kind.value for fault in flight.report.faults] == ["interruption"]
    assert any("fence widened first" in line.text for _, line in flight.said)
    assert not any("fence" in truth.what for truth in flight.truths), "nobody left its fence"


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_three_vehicles_on_one_telemetry_radio(tmp_path: Path, autopilot: str) -> None:
    ground = short_ground(tmp_path, 3, autopilot)
    flight = fly_virtual(
        ground, shared(ground), faults=("uav2:crash@40s",), seed=1, make=partial(VirtualRun, radio="sik")
    )
    report = flight.report
    assert (flight.ended, report.finished, report.segments_inspected, report.segments_total) == (True, True, 6, 6)
    assert [(fault.vehicle, fault.happened_s is not None) for fault in report.faults] == [("uav2", True)]
    assert [replan.feasible for replan in report.replans] == [True]
    assert [craft.wrecked for craft in flight.crafts.values()] == [False, True, False]


def test_a_radio_that_there_is_not_is_refused(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 1, "px4")
    with pytest.raises(SimulatorError, match="unknown profile 'sick'"):
        fly_virtual(ground, shared(ground), make=partial(VirtualRun, radio="sick"))
