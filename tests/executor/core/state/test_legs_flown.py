"""When legs of missions began and ended, through whole flights and by single messages."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.state.legs import end_landing_leg, track_legs
from executor.core.state.vehicle_parts import FlownLeg
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import Phase
from tests.executor.builders import THREE, fleet_of, vehicle, with_facts
from tests.executor.core.steps import beat
from tests.executor.core.stories import FLEET, story, under_way


def lasted_s(leg: FlownLeg) -> float:
    assert leg.began is not None
    assert leg.ended is not None
    return leg.ended.at_s - leg.began.at_s


def assert_joined(legs: tuple[FlownLeg, ...]) -> None:
    """Every leg begins when the one before it ends."""
    assert [leg.began for leg in legs[1:]] == [leg.ended for leg in legs[:-1]]


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_every_leg_of_a_flight_is_on_record(autopilot: str) -> None:
    ready = fleet_of(autopilot=autopilot)
    flight = story(ready)
    flight.finish()
    for name, visits in THREE.items():
        legs, board = flight.vehicle(name).assignment.flown, ready.boards[name]
        assert board is not None
        assert [leg.waypoint for leg in legs] == list(range(len(board.legs)))
        assert [leg.planned for leg in legs] == list(board.legs)
        assert [leg.segment for leg in legs if leg.phase is Phase.INSPECT] == [visit >> 1 for visit in visits]
        assert_joined(legs)
        # 100 m at 3 m/s, and a hold of a second.
        assert [lasted_s(leg) for leg in legs if leg.phase is Phase.INSPECT] == pytest.approx([34.3, 34.3], abs=1.5)
        assert flight.vehicle(name).assignment.leg_began is None


def test_what_the_battery_gave_is_known_beside_the_time() -> None:
    flight = story()
    flight.finish()
    legs = flight.vehicle("uav1").assignment.flown
    first, last = legs[0].began, legs[-1].ended
    assert first is not None
    assert last is not None
    assert first.given_pct == pytest.approx(0.0, abs=0.3)
    assert last.given_pct == pytest.approx(100.0 - flight.crafts["uav1"].battery_pct, abs=0.6)


def test_a_re_plan_continues_where_the_mission_before_it_was() -> None:
    flight = under_way()
    flight.crafts["uav2"].mute = True
    flight.finish()
    legs = flight.vehicle("uav1").assignment.flown
    assert sorted({leg.revision for leg in legs}) == [0, 1]
    assert [leg.waypoint for leg in legs] == list(range(len(legs)))
    assert legs[-1].phase is Phase.LAND
    assert_joined(legs)
    lost = flight.vehicle("uav2").assignment.flown
    assert {leg.revision for leg in lost} == {0}
    assert lost[-1].phase is not Phase.LAND


def at(state: VehicleState, waypoint: int) -> VehicleState:
    return replace(state, assignment=replace(state.assignment, waypoint=waypoint))


def in_the_air() -> VehicleState:
    """Return a vehicle that took off at 10 s."""
    stands = vehicle(FLEET, stage=Stage.FLYING)
    return track_legs(stands, with_facts(stands, took_off=True), 10.0)


def test_on_the_ground_nothing_has_begun() -> None:
    stands = vehicle(FLEET, stage=Stage.FLYING)
    assert track_legs(stands, stands, 5.0) == stands
    began = in_the_air().assignment.leg_began
    assert began is not None
    assert (began.at_s, began.given_pct) == (10.0, None)


def test_of_unobserved_legs_only_the_ends_are_known() -> None:
    before = in_the_air()
    state = track_legs(before, at(before, 3), 60.0)
    flown = state.assignment.flown
    assert [(leg.began and leg.began.at_s, leg.ended and leg.ended.at_s) for leg in flown] == [
        (10.0, None), (None, None), (None, 60.0)
    ]  # fmt: skip
    assert state.assignment.leg_began is not None
    assert state.assignment.leg_began.at_s == 60.0


def test_a_mission_that_starts_again_ends_no_leg() -> None:
    before = at(in_the_air(), 4)
    state = track_legs(before, at(before, 2), 60.0)
    assert state.assignment.flown == ()
    assert state.assignment.leg_began is not None
    assert state.assignment.leg_began.at_s == 60.0


def test_one_that_returns_by_its_failsafe_ends_no_leg() -> None:
    before = at(in_the_air(), 4)
    home = replace(before, stage=Stage.RETURNING)
    assert track_legs(home, at(home, 5), 60.0) == at(home, 5)
    assert end_landing_leg(home, 70.0) == home


def test_the_climb_begins_with_the_motors_and_again_after_a_stop() -> None:
    stands = vehicle(FLEET, stage=Stage.FLYING)
    armed = with_facts(stands, heartbeat=beat())
    runs = track_legs(stands, armed, 3.0)
    assert runs.assignment.leg_began is not None
    assert runs.assignment.leg_began.at_s == 3.0
    stopped = track_legs(runs, with_facts(runs, heartbeat=beat(armed=False)), 9.0)
    assert stopped.assignment.leg_began is None
    again = track_legs(stopped, with_facts(stopped, heartbeat=beat()), 20.0)
    assert again.assignment.leg_began is not None
    assert again.assignment.leg_began.at_s == 20.0


def test_the_landing_ends_with_the_motors() -> None:
    board = in_the_air().assignment.board
    assert board is not None
    down = with_facts(at(in_the_air(), len(board.legs) - 1), heartbeat=beat(), on_ground=True)
    assert track_legs(down, down, 70.0).assignment.flown == ()
    (landing,) = track_legs(down, with_facts(down, heartbeat=beat(armed=False)), 72.0).assignment.flown
    assert landing.ended is not None
    assert (landing.phase, landing.ended.at_s) == (Phase.LAND, 72.0)
