"""A resumed flight: the ground station dies, the vehicles fly on, and no segment is lost or flown twice."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Solve, Start
from executor.core.interface.events import Found, Heard, Match, Reopened, Resumed, ReturnAllOrdered, UploadEnded
from executor.core.resume.reconciliation import compare_onboard_mission
from executor.core.state.vehicle_state import FaultKind, Stage
from missions import encode
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import EVERYTHING, story, under_way
from tests.fakes.flight import STEP_S, Story


def die(flight: Story, away_s: float) -> None:
    """Kill the ground station: what it was doing ends, the vehicles fly on."""
    flight._due.clear()
    flight.sleep_s(away_s)


def found(flight: Story, name: str) -> Found:
    """What a vehicle is found to carry."""
    craft = flight.crafts[name]
    if craft.mute:
        return Found(name, heard=False, seq=None, items=None, matches=())
    items = () if craft.path is None else encode(craft.path, flight.context.vehicles[name].dialect).items
    return compare_onboard_mission(
        flight.context, flight.state, name, items, craft.items[craft.leg] if craft.path else None
    )


def come_back(flight: Story, away_s: float, **strange: Found) -> None:
    """Start the ground station anew, listen for two seconds, and go on."""
    flight.happen(Reopened(1.8e9, away_s, ()))
    flight.ticking = False
    flight.pass_s(2.0)
    flight.ticking = True
    flight.happen(Resumed(tuple(strange.get(name, found(flight, name)) for name in flight.crafts)))


def killed(flight: Story, away_s: float) -> None:
    """Die, be away for a while, and come back."""
    die(flight, away_s)
    come_back(flight, away_s)


@pytest.mark.parametrize(("away_s", "autopilot"), [(0.0, "ardupilot"), (8.0, "px4"), (40.0, "ardupilot")])
def test_segments_flown_in_the_meantime_are_not_flown_again(away_s: float, autopilot: str) -> None:
    flight = under_way(fleet_of(autopilot=autopilot))
    killed(flight, away_s)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves() == []
    assert all(vehicle.fault is None for vehicle in flight.state.vehicles.values())
    assert flight.state.coverage.inferred  # the segment under way at least: its middle was not seen
    assert flight.state.coverage.inspected[2] == "uav2"


def test_a_vehicle_that_landed_during_the_outage_is_landed_and_its_segments_count() -> None:
    flight = under_way()
    killed(flight, 300.0)
    flight.finish()
    assert {vehicle.stage for vehicle in flight.state.vehicles.values()} == {Stage.LANDED}
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves() == []


@pytest.mark.parametrize(("speed", "why"), [(1.6, "it took"), (0.6, "it took")])
def test_a_time_that_does_not_fit_proves_nothing(speed: float, why: str) -> None:
    """Flown too fast, or with a stop somewhere: what nobody saw is flown again, whatever the index says."""
    flight = under_way()
    for craft in flight.crafts.values():
        craft.speed = speed
    die(flight, 40.0)
    for craft in flight.crafts.values():
        craft.speed = 1.0
    come_back(flight, 40.0)
    assert any(why in line for line in flight.said())
    assert flight.state.coverage.inferred == frozenset()
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves()


def test_a_vehicle_off_its_track_has_not_flown_it() -> None:
    flight = under_way()
    flight.crafts["uav2"].aside_m = 30.0
    killed(flight, 20.0)
    assert any("off its track" in line for line in flight.said(Level.WARNING))
    flight.crafts["uav2"].aside_m = 0.0
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_clock_that_was_set_back_changes_nothing() -> None:
    """Away for 40 s by the vehicles' clocks, for nothing by ours: theirs tell what was flown."""
    flight = under_way()
    die(flight, 40.0)
    come_back(flight, 0.0)
    assert flight.state.listening.absences[-1].pause_s == pytest.approx(42.0, abs=3.0)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves() == []


def test_our_absence_loses_no_vehicle_and_a_lost_one_is_detected() -> None:
    flight = under_way()
    die(flight, 40.0)
    flight.crafts["uav2"].mute = True
    come_back(flight, 40.0)
    back_s = flight.now_s
    assert any(line == "uav2: does not answer yet" for line in flight.said())
    flight.run(lambda: flight.state.vehicles["uav2"].fault is not None)
    timeout_s = flight.context.vehicles["uav2"].link_timeout_s
    assert flight.now_s - back_s == pytest.approx(timeout_s, abs=3.0)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert [name for name, vehicle in flight.state.vehicles.items() if vehicle.fault] == ["uav2"]


def test_a_link_lost_on_the_pad_during_an_upload_delays_no_other_vehicle() -> None:
    """uav1 has landed and is to fly again when the ground station dies, and never answers any more."""
    flight = under_way()
    flight.crafts["uav2"].speed = 0.4
    flight.run(lambda: flight.stage("uav1") is Stage.LANDED)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: any(one.vehicle == "uav1" and not one.airborne for one in flight.uploads()))
    flight.crafts["uav1"].mute = True
    killed(flight, 8.0)
    flight.finish()
    assert flight.state.replanning.replan is None
    assert any("uav1: upload of its new mission failed (it does not answer)" in line for line in flight.said())


def test_before_the_start_procedures_have_ended() -> None:
    """uav1 had taken off unheard, uav2 was about to: nobody starts twice, and nobody is forgotten."""
    flight = story()
    flight._due.clear()
    flight.crafts["uav1"].begin()
    die(flight, 5.0)
    come_back(flight, 5.0)
    starts = [command for _, command in flight.commands if isinstance(command, Start)]
    assert [start.vehicle for start in starts] == ["uav1", "uav2", "uav3", "uav2", "uav3"]
    assert flight.stage("uav1") is Stage.FLYING
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_that_flew_its_mission_before_its_start_was_reported_is_not_started_again() -> None:
    flight = story()
    flight._due.clear()
    flight.crafts["uav1"].begin()
    die(flight, 400.0)
    assert flight.crafts["uav1"].battery_pct < 97.0
    assert not flight.crafts["uav1"].armed
    come_back(flight, 400.0)
    assert flight.stage("uav1") is Stage.LANDED
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def lost_and_solved(autopilot: str = "ardupilot") -> Story:
    """A flight in which uav2 is lost, the re-plan is found, and nothing of it is on board yet."""
    flight = under_way(fleet_of(autopilot=autopilot))
    flight.upload_s = 3.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.uploads()))
    return flight


def test_a_re_plan_that_was_being_solved_is_solved_again() -> None:
    flight = under_way()
    flight.solve_s = 30.0
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.solves()))
    flight.solve_s = 0.4
    killed(flight, 3.0)
    flight.finish()
    assert [solve.revision for solve in flight.solves()][:2] == [1, 2]
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_an_upload_that_had_not_begun_is_made() -> None:
    flight = lost_and_solved()
    planned = {upload.vehicle for upload in flight.uploads()}
    killed(flight, 2.0)
    assert len(flight.uploads()) == 2 * len(planned)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert [record.revision for record in flight.state.replanning.records] == [1]


def test_an_upload_that_ended_unheard_is_not_repeated() -> None:
    flight = lost_and_solved()
    uploads = flight.uploads()
    die(flight, 2.0)
    for upload in uploads:
        flight.crafts[upload.vehicle].load(upload.path)
    come_back(flight, 2.0)
    assert len(flight.uploads()) == len(uploads)
    assert [record.revision for record in flight.state.replanning.records] == [1]
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def mixture(flight: Story, name: str, alike_new: int, seq: int, items: int = 9) -> Found:
    """A vehicle with the beginning of the new mission, and the rest of the old one where that was longer."""
    board = flight.state.vehicles[name].assignment.board
    assert board is not None
    matches = (Match(board.revision, 2, whole=False), Match(flight.state.replanning.revision, alike_new, whole=False))
    return Found(name, True, seq, items, matches)


def test_a_mixture_that_is_still_flown_at_its_new_beginning_is_made_whole() -> None:
    flight = lost_and_solved()
    name = flight.uploads()[0].vehicle
    die(flight, 1.0)
    come_back(flight, 1.0, **{name: mixture(flight, name, alike_new=6, seq=4)})
    again = [upload for upload in flight.uploads() if upload.vehicle == name]
    assert len(again) == 2
    assert again[0].path == again[1].path
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.sent_home() == []


def test_a_vehicle_on_the_end_of_a_mixed_mission_is_given_rtl() -> None:
    flight = lost_and_solved()
    name = flight.uploads()[0].vehicle
    die(flight, 1.0)
    come_back(flight, 1.0, **{name: mixture(flight, name, alike_new=3, seq=5)})
    fault = flight.state.vehicles[name].fault
    assert fault is not None
    assert fault.kind is FaultKind.INTERRUPTION
    assert flight.sent_home() == [name]
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


@pytest.mark.parametrize("seq", [0, 6])
def test_a_vehicle_hovering_at_the_end_of_half_a_mission_returns_and_flies_again(seq: int) -> None:
    """ArduPilot flies what came, says that its mission is complete, and a list that follows moves nothing."""
    flight = lost_and_solved()
    name = flight.uploads()[0].vehicle
    die(flight, 1.0)
    come_back(flight, 1.0, **{name: mixture(flight, name, alike_new=7, seq=seq, items=7)})
    assert flight.sent_home() == [name]
    assert any(f"{name}: reached the end of its partly uploaded mission" in line for line in flight.said())
    flight.finish()
    assert all(vehicle.fault is None for other, vehicle in flight.state.vehicles.items() if other != "uav2")
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_failsafe_rtl_with_half_a_new_mission_on_board_is_left_alone() -> None:
    """Its own failsafe may be landing it on the last of its battery."""
    flight = lost_and_solved()
    name = flight.uploads()[0].vehicle
    die(flight, 1.0)
    flight.crafts[name].go_home()
    come_back(flight, 1.0, **{name: mixture(flight, name, alike_new=7, seq=0, items=7)})
    assert flight.sent_home() == []
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_vehicle_with_an_unknown_mission_is_given_rtl() -> None:
    flight = under_way()
    die(flight, 5.0)
    come_back(flight, 5.0, uav2=Found("uav2", True, 3, 4, (Match(0, 2, whole=False),)))
    fault = flight.state.vehicles["uav2"].fault
    assert fault is not None
    assert "mission on board differs" in fault.reason
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING


def test_a_mission_that_cannot_be_read_is_taken_for_the_one_that_was_put_on_board() -> None:
    flight = under_way()
    die(flight, 5.0)
    come_back(flight, 5.0, uav2=Found("uav2", True, None, None, ()))
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.sent_home() == []


def test_a_vehicle_that_returned_during_our_absence_flies_again() -> None:
    """Their own failsafes brought all of them home: they are well, and finish what is left."""
    ready = fleet_of()
    vehicles = {name: replace(setup, failsafe_s=5.0) for name, setup in ready.context.vehicles.items()}
    flight = under_way(replace(ready, context=replace(ready.context, vehicles=vehicles)))
    die(flight, 6.0)
    for craft in flight.crafts.values():
        craft.go_home()
    flight.sleep_s(4.0)
    come_back(flight, 10.0)
    assert {flight.stage(name) for name in flight.crafts} <= {Stage.FLYING, Stage.RETURNING}
    flight.finish()
    assert all(vehicle.fault is None for vehicle in flight.state.vehicles.values())
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert any("offline; returning" in line for line in flight.said())


def test_without_such_a_failsafe_a_change_of_mode_is_a_fault() -> None:
    flight = under_way()
    die(flight, 6.0)
    flight.crafts["uav2"].go_home()
    flight.sleep_s(4.0)
    come_back(flight, 10.0)
    flight.finish()
    assert [name for name, vehicle in flight.state.vehicles.items() if vehicle.fault] == ["uav2"]


def test_an_order_to_return_that_never_left_is_given_again() -> None:
    flight = under_way()
    flight.happen(ReturnAllOrdered())
    before = len(flight.sent_home())
    killed(flight, 6.0)
    flight.finish()
    assert len(flight.sent_home()) >= 2 * before
    assert flight.state.progress.recalled


def test_the_ground_station_may_die_while_it_comes_back() -> None:
    flight = under_way()
    die(flight, 10.0)
    flight.happen(Reopened(1.8e9, 10.0, ()))
    flight.happen(Heard("uav2", flight.crafts["uav2"].position(flight.now_s)))
    killed(flight, 20.0)
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.solves() == []


@pytest.mark.parametrize(("dies_at_s", "away_s"), [(0.4, 25.0), (3.0, 2.0), (33.0, 25.0), (71.0, 2.0), (120.0, 25.0)])
def test_at_any_instant_of_a_flight_with_a_loss(dies_at_s: float, away_s: float) -> None:
    flight = story(fleet_of({**THREE, "uav4": ()}))
    silenced = False
    while flight.now_s < 10.0 + dies_at_s:
        if not silenced and flight.inspecting("uav2", 2):
            silenced = flight.crafts["uav2"].mute = True
        flight.step()
    killed(flight, away_s)
    if not silenced:
        flight.crafts["uav2"].mute = True
    flight.finish()
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert flight.state.progress.separation_m is None or flight.state.progress.separation_m >= 4.9
    assert all(
        vehicle.stage is Stage.LANDED or name in {"uav2", "uav4"} for name, vehicle in flight.state.vehicles.items()
    )


def test_a_stop_of_the_process_is_an_absence_too() -> None:
    """Suspended for 30 s: whose failsafe acted meanwhile comes home and may fly again, nobody is lost."""
    ready = fleet_of()
    vehicles = {name: replace(setup, failsafe_s=5.0) for name, setup in ready.context.vehicles.items()}
    flight = under_way(replace(ready, context=replace(ready.context, vehicles=vehicles)))
    flight.sleep_s(20.0)
    flight.crafts["uav1"].go_home()
    flight.sleep_s(10.0 - STEP_S)
    flight.finish()
    assert all(vehicle.fault is None for vehicle in flight.state.vehicles.values())
    assert set(flight.state.coverage.inspected) == EVERYTHING
    assert len(flight.state.listening.absences) == 1


_ = (Solve, UploadEnded)
