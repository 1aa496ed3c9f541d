"""What is left to fly and to spend, by the legs of the mission on board."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core import projection
from executor.core.battery import account
from executor.core.battery.kalman import BatteryEstimate
from executor.core.resume import blackout
from executor.core.vehicle import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.vehicles import CONTEXT, NOW_S, SETUP, at, flying, mission, pack

BOARD = mission()
LAST = len(BOARD.legs) - 1
LEVEL = [index for index in range(1, LAST + 1) if math.dist(BOARD.places_m[index - 1], BOARD.places_m[index]) > 1.0]


def on_leg(waypoint: int, share: float) -> VehicleState:
    """Return a vehicle that has so much of a leg behind it."""
    (east_a, north_a), (east_b, north_b) = BOARD.places_m[waypoint - 1], BOARD.places_m[waypoint]
    place_m = (east_a + share * (east_b - east_a), north_a + share * (north_b - north_a))
    return flying(waypoint=waypoint, fix=replace(at(), place_m=place_m))


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("waypoint", LEVEL)
def test_the_rest_of_the_way_is_the_rest_of_its_legs(waypoint: int, share: float) -> None:
    state = on_leg(waypoint, share)
    for goal in range(waypoint, LAST + 1):
        ahead = BOARD.legs[waypoint + 1 : goal + 1]
        here = BOARD.legs[waypoint]
        expected_s = (1.0 - share) * here.duration_s + sum(leg.duration_s for leg in ahead)
        expected_pct = (1.0 - share) * here.energy_pct + sum(leg.energy_pct for leg in ahead)
        assert projection.time_to_reach_s(state, goal) == pytest.approx(expected_s, abs=1e-4)
        assert projection.modelled_to_reach_pct(state, goal) == pytest.approx(expected_pct, abs=1e-4)
    assert projection.time_to_reach_s(state, waypoint - 1) == 0.0
    assert projection.modelled_to_reach_pct(state, waypoint - 1) == 0.0


def test_on_the_pad_the_whole_mission_is_ahead() -> None:
    whole_s, whole_pct = sum(leg.duration_s for leg in BOARD.legs), sum(leg.energy_pct for leg in BOARD.legs)
    for state in (flying(waypoint=0), flying(waypoint=0, fix=None)):
        assert projection.time_to_reach_s(state, LAST) == pytest.approx(whole_s)
        assert projection.modelled_to_reach_pct(state, LAST) == pytest.approx(whole_pct)
    assert projection.time_to_reach_s(flying(board=None), LAST) == 0.0
    assert projection.modelled_to_reach_pct(flying(board=None), LAST) == 0.0
    assert projection.to_finish_pct(flying(board=None)) == 0.0


def test_who_is_beside_its_leg_has_no_more_than_the_leg_to_fly() -> None:
    waypoint = LEVEL[0]
    far = flying(waypoint=waypoint, fix=replace(at(), place_m=(9000.0, 9000.0)))
    assert projection.time_to_reach_s(far, waypoint) == BOARD.legs[waypoint].duration_s


def thirsty(factor: float, remaining_pct: float = 60.0) -> VehicleState:
    known = replace(pack(remaining_pct, remaining_pct), estimate=BatteryEstimate(remaining_pct, factor, 0.1, 0.0, 0.01))
    return flying(battery=known, waypoint=LEVEL[0])


def test_what_is_learned_of_the_consumption_counts() -> None:
    state = thirsty(1.5)
    modelled_pct = projection.modelled_to_reach_pct(state, LAST)
    assert account.factor(state.power.battery) == 1.5
    assert projection.to_finish_pct(state) == pytest.approx(1.5 * modelled_pct)
    ahead = projection.at_landing(CONTEXT, state, SETUP)
    assert ahead is not None
    assert ahead.mean_pct == pytest.approx(60.0 - 1.5 * modelled_pct)


def test_the_way_home_is_straight_at_eight_metres_a_second_and_down_at_one() -> None:
    for east_m, up_m in [(80.0, 0.0), (80.0, 30.0), (0.0, 30.0), (80.0, -5.0)]:
        state = flying(fix=at(east_m=east_m, up_m=up_m))
        expected = CONTEXT.draw_pct_per_s(8.0, 0.0) * east_m / 8.0 + CONTEXT.draw_pct_per_s(0.0, 0.0) * max(0.0, up_m)
        assert projection.modelled_to_return_pct(CONTEXT, state, SETUP) == pytest.approx(expected)
    assert projection.modelled_to_return_pct(CONTEXT, flying(fix=None), SETUP) is None


def test_where_no_mission_is_known_it_is_the_way_home_that_counts() -> None:
    for state in (with_facts(thirsty(1.0), board=None), replace(thirsty(1.0), stage=Stage.RETURNING)):
        ahead, home_pct = (
            projection.at_landing(CONTEXT, state, SETUP),
            projection.modelled_to_return_pct(CONTEXT, state, SETUP),
        )
        assert ahead is not None
        assert home_pct is not None
        assert ahead.mean_pct == pytest.approx(60.0 - home_pct)
    assert projection.at_landing(CONTEXT, flying(board=None, fix=None), SETUP) is None


def test_a_landing_far_above_the_floor_is_no_question_and_one_below_it_is() -> None:
    home_pct = projection.modelled_to_return_pct(CONTEXT, flying(), SETUP)
    assert home_pct is not None

    def chance(remaining_pct: float, **changes: object) -> float | None:
        state = with_facts(thirsty(1.0, remaining_pct), board=None)
        return projection.landing_chance_below(CONTEXT, with_facts(state, **changes), SETUP, 15.0)

    assert chance(15.0 + 10.0 + 3.0 * home_pct + 0.1) == 0.0
    assert chance(15.0 + home_pct) == pytest.approx(0.5, abs=0.05)
    below = chance(10.0)
    assert below is not None
    assert below > 0.99
    assert chance(60.0, fix=None) is None


def test_who_has_not_reported_its_battery_is_taken_to_have_a_full_one() -> None:
    unknown, full = flying(battery=account.BatteryState()), flying(battery=pack(100.0))
    assert blackout.endures_s(CONTEXT, unknown) == blackout.endures_s(CONTEXT, full)
    assert blackout.endures_s(CONTEXT, flying(battery=pack(50.0))) == pytest.approx(
        blackout.endures_s(CONTEXT, full) / 2.0
    )
    assert blackout.endures_s(CONTEXT, full) == pytest.approx(1.5 * 100.0 / min(CONTEXT.draws_pct_s))


def test_nobody_flies_longer_than_its_battery() -> None:
    lasts_s = blackout.endures_s(CONTEXT, flying())
    assert blackout.may_fly(CONTEXT, flying(spoke_s=NOW_S - lasts_s + 0.1), NOW_S)
    assert not blackout.may_fly(CONTEXT, flying(spoke_s=NOW_S - lasts_s), NOW_S)
    assert not blackout.may_fly(CONTEXT, flying(spoke_s=None), NOW_S)
