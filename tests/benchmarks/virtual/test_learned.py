"""What one flight teaches makes the prediction of the next one better: slow and thirsty vehicles, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.prediction import plan_with
from benchmarks.virtual_flight import FlightObservers, VirtualFlight, fly_virtual
from executor.adapters.run_directory import RunDirectory
from executor.core.context import Context
from executor.core.interface.events import Event
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.errors import LogError
from executor.site.learned_files import LearnedDocument, learn_from_flight
from executor.site.site_model import SiteModel
from missions import PlanFile, check_plan, read_plan, write_plan
from simulator.config import SimVehicle
from tests.benchmarks.virtual.short_line import short_ground


def planned(ground: SiteModel) -> PlanFile:
    return plan_with(ground, {"uav1": tuple(range(0, 20, 2))})


def thirsty(vehicle: SimVehicle) -> SimVehicle:
    return replace(vehicle, consumption=1.15)


def flown(ground: SiteModel) -> VirtualFlight:
    return fly_virtual(ground, planned(ground), seed=1, craft=thirsty)


def test_the_next_flight_is_predicted_better(tmp_path: Path) -> None:
    ground = short_ground(tmp_path, 1, "ardupilot")
    first = flown(ground)
    learn_from_flight(first.context, first.state, {}, "2026-01-02").write(RunDirectory(tmp_path).learned)
    document = LearnedDocument.read(RunDirectory(tmp_path).learned)
    [row] = document.vehicles
    assert row.consumption.mean == pytest.approx(1.15, abs=0.06)
    assert row.inspect.legs == 10
    known = replace(ground, learned=document.known_by_name)
    second = flown(known)
    [before], [after] = first.report.routes, second.report.routes
    assert before.energy_error_pct is not None
    assert after.energy_error_pct is not None
    assert abs(after.energy_error_pct) < 0.5 * abs(before.energy_error_pct)
    path = tmp_path / "plan.json"
    write_plan(path, planned(known))
    again = read_plan(path)
    assert again.vehicles[0].consumption == row.consumption.mean
    assert again.pricing is not None
    assert again.pricing.models["uav1"].pace == known.learned["uav1"].pace
    assert check_plan(again, search_window=False) == []


def slow(vehicle: SimVehicle) -> SimVehicle:
    return replace(vehicle, speed_reached=0.9)


def test_a_slow_vehicle_is_foreseen_in_its_flight_and_in_the_next_one(tmp_path: Path) -> None:
    ground, half = short_ground(tmp_path, 1, "ardupilot"), dict[str, float]()

    def halfway(_context: Context, _event: Event, state: FleetState, now_s: float) -> None:
        vehicle = state.vehicles["uav1"]
        board, learned = vehicle.assignment.board, vehicle.assignment.learned
        if half or board is None or learned is None or learned.inspect.legs < 5:
            return
        waypoint = vehicle.assignment.waypoint
        half["at"], half["left"] = now_s, legs.time_to_reach_s(vehicle, len(board.legs) - 1)
        half["planned"] = sum(leg.duration_s for leg in board.legs[waypoint:])

    first = fly_virtual(ground, planned(ground), seed=1, craft=slow, onlookers=FlightObservers(applied=halfway))
    [disarmed_s] = [truth.t_s for truth in first.truths if truth.what == "disarmed"]
    took_s = disarmed_s - half["at"]
    assert took_s > 1.04 * half["planned"], "by the plan it would have been faster"
    assert half["left"] == pytest.approx(took_s, rel=0.03)
    learn_from_flight(first.context, first.state, {}, "2026-01-02").write(RunDirectory(tmp_path).learned)
    document = LearnedDocument.read(RunDirectory(tmp_path).learned)
    # A tenth slower, but for its stops.
    assert 1.06 < document.vehicles[0].inspect.mean < 1.11
    known = replace(ground, learned=document.known_by_name)
    second = fly_virtual(known, planned(known), seed=2, craft=slow)
    [before], [after] = first.report.routes, second.report.routes
    assert before.time_error_pct is not None
    assert after.time_error_pct is not None
    assert before.time_error_pct > 4.0
    assert abs(after.time_error_pct) < 1.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [('"mean": ', '"mean": -', "mean"), ("faultline-learned/1", "faultline-learned/9", "format"), ("{", "[", "JSON")],
)
def test_a_wrong_file_is_named_with_its_key(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "learned.json"
    pace = '{"mean": 1.0, "sd": 0.1, "legs": 1}'
    path.write_text(
        '{"format": "faultline-learned/1", "date": "2026-01-02", "vehicles": [{"name": "a", "autopilot": "px4", '
        f'"drone": "x", "inspect": {pace}, "transit": {pace}, '
        '"consumption": {"mean": 1.0, "sd": 0.1, "minutes": 1.0}}]}',
        encoding="utf-8",
    )
    assert LearnedDocument.read(path).known_by_name["a"].inspect.legs == 1
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(LogError, match=said) as error:
        LearnedDocument.read(path)
    assert str(error.value).startswith(str(path))
    with pytest.raises(LogError, match="cannot be read"):
        LearnedDocument.read(tmp_path / "none.json")
