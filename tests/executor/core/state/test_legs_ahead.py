"""What is left to fly and to spend, by the legs of the mission on board."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core.battery import account
from executor.core.battery.kalman import BatteryEstimate
from executor.core.resume import link_blackout
from executor.core.state.legs import (
    energy_to_finish_pct,
    energy_to_reach_pct,
    energy_to_return_pct,
    landing_chance_below,
    project_landing,
    time_to_reach_s,
)
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.core.vehicle_learning import LearnedFactors, PaceEstimate
from missions import Phase, apply_tunings, dialect_for
from simulator.config import AutopilotKind
from tests.executor.builders import fleet_of, with_facts
from tests.executor.core.vehicles import CONTEXT, NOW_S, SETUP, at, flying, mission, pack
from tests.simulator.harness import PX4_RTL, RTL, Operator, numbered, speed, takeoff, waypoint

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
        assert time_to_reach_s(state, goal) == pytest.approx(expected_s, abs=1e-4)
        assert energy_to_reach_pct(state, goal) == pytest.approx(expected_pct, abs=1e-4)
    assert time_to_reach_s(state, waypoint - 1) == 0.0
    assert energy_to_reach_pct(state, waypoint - 1) == 0.0


def test_on_the_pad_the_whole_mission_is_ahead() -> None:
    whole_s, whole_pct = sum(leg.duration_s for leg in BOARD.legs), sum(leg.energy_pct for leg in BOARD.legs)
    for state in (flying(waypoint=0), flying(waypoint=0, fix=None)):
        assert time_to_reach_s(state, LAST) == pytest.approx(whole_s)
        assert energy_to_reach_pct(state, LAST) == pytest.approx(whole_pct)
    assert time_to_reach_s(flying(board=None), LAST) == 0.0
    assert energy_to_reach_pct(flying(board=None), LAST) == 0.0
    assert energy_to_finish_pct(flying(board=None)) == 0.0


def test_a_vehicle_off_its_leg_has_at_most_the_leg_to_fly() -> None:
    waypoint = LEVEL[0]
    far = flying(waypoint=waypoint, fix=replace(at(), place_m=(9000.0, 9000.0)))
    assert time_to_reach_s(far, waypoint) == BOARD.legs[waypoint].duration_s


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_rest_of_a_landing_is_the_rest_of_its_height(share: float) -> None:
    high_m = BOARD.path.waypoints[LAST - 1].alt_rel_m
    state = flying(waypoint=LAST, fix=replace(at(up_m=(1.0 - share) * high_m), place_m=BOARD.places_m[LAST]))
    assert time_to_reach_s(state, LAST) == pytest.approx((1.0 - share) * BOARD.legs[LAST].duration_s)


def test_the_band_is_as_wide_as_consumption_and_pace_are_unknown() -> None:
    sure = PaceEstimate(var=1e-12)
    state = with_facts(thirsty(1.5), learned=LearnedFactors(sure, sure))
    known = project_landing(CONTEXT, state, SETUP)
    assert known is not None
    for phases, learned in (
        ({Phase.INSPECT}, LearnedFactors(PaceEstimate(var=0.04), sure)),
        ({Phase.TRANSIT, Phase.RETURN}, LearnedFactors(sure, PaceEstimate(var=0.04))),
    ):
        legs = zip(BOARD.path.waypoints[LEVEL[0] :], BOARD.legs[LEVEL[0] :], strict=True)
        ahead_pct = [leg.energy_pct for point, leg in legs if point.phase in phases]
        here = thirsty(1.5)
        place_m = BOARD.places_m[LEVEL[0] - 1]
        unsure = project_landing(CONTEXT, with_facts(here, learned=learned, fix=replace(at(), place_m=place_m)), SETUP)
        there = project_landing(CONTEXT, with_facts(state, fix=replace(at(), place_m=place_m)), SETUP)
        assert unsure is not None
        assert there is not None
        assert unsure.mean_pct == pytest.approx(there.mean_pct)
        more_pct = math.sqrt(unsure.sd_pct**2 - there.sd_pct**2)
        assert more_pct == pytest.approx(1.5 * 0.2 * sum(ahead_pct), rel=1e-3)


def test_before_any_leg_the_band_has_its_default_width() -> None:
    unknown, known = (
        project_landing(CONTEXT, thirsty(1.0), replace(SETUP, start=start))
        for start in (LearnedFactors(), LearnedFactors(PaceEstimate(var=1e-12), PaceEstimate(var=1e-12)))
    )
    assert unknown is not None
    assert known is not None
    assert unknown.sd_pct > known.sd_pct


def thirsty(factor: float, remaining_pct: float = 60.0) -> VehicleState:
    known = replace(pack(remaining_pct, remaining_pct), estimate=BatteryEstimate(remaining_pct, factor, 0.1, 0.0, 0.01))
    return flying(battery=known, waypoint=LEVEL[0])


def test_what_is_learned_of_the_consumption_counts() -> None:
    state = thirsty(1.5)
    modelled_pct = energy_to_reach_pct(state, LAST)
    assert account.consumption_factor(state.power.battery) == 1.5
    assert energy_to_finish_pct(state) == pytest.approx(1.5 * modelled_pct)
    ahead = project_landing(CONTEXT, state, SETUP)
    assert ahead is not None
    assert ahead.mean_pct == pytest.approx(60.0 - 1.5 * modelled_pct)


HOVER, HOME = CONTEXT.draw_pct_per_s(0.0, 0.0), CONTEXT.draw_pct_per_s(-10.0, 0.0)
HIGH_M = CONTEXT.return_height_m("uav1")
COMES_DOWN = HOVER * (2.7 + 11.6 / 0.5 - 11.6 / 1.5)  # slower below 11.6 m
FIFTH = HOVER * 5.0  # it waits over its pad
RAMP_S = 10.0 / 2.5 + 0.3 + 2.5 / 1.0


@pytest.mark.parametrize(
    ("east_m", "up_m", "expected"),
    [
        (80.0, HIGH_M, HOME * (8.0 + RAMP_S) + FIFTH + COMES_DOWN + HOVER * HIGH_M / 1.5),
        (80.0, HIGH_M + 9.0, HOME * (8.0 + RAMP_S) + FIFTH + COMES_DOWN + HOVER * (HIGH_M + 9.0) / 1.5),
        (
            80.0, HIGH_M - 5.0,
            HOVER * (2.0 + 5.0 * 0.04) + HOME * (8.0 + RAMP_S) + FIFTH + COMES_DOWN + HOVER * HIGH_M / 1.5,
        ),
        (3.0, 15.0, COMES_DOWN + HOVER * 15.0 / 1.5),
        (3.0, -5.0, HOVER * 2.7),
    ],
    ids=["level", "from above", "climbs first", "over its pad", "on it"],
)  # fmt: skip
def test_the_return_is_flown_as_its_autopilot_does(east_m: float, up_m: float, expected: float) -> None:
    state = flying(fix=at(east_m=east_m, up_m=up_m))
    assert energy_to_return_pct(CONTEXT, state, SETUP) == pytest.approx(expected, rel=1e-3)


def test_no_position_no_return() -> None:
    assert energy_to_return_pct(CONTEXT, flying(fix=None), SETUP) is None


def test_a_slow_vehicle_or_headwind_needs_more_for_the_return() -> None:
    state = flying(fix=at(east_m=800.0, up_m=HIGH_M))
    slow = with_facts(state, learned=LearnedFactors(transit=PaceEstimate(1.2)))
    usual_pct, slow_pct = (energy_to_return_pct(CONTEXT, one, SETUP) for one in (state, slow))
    assert usual_pct is not None
    assert slow_pct is not None
    assert slow_pct - usual_pct == pytest.approx(0.2 * HOME * (80.0 + RAMP_S))
    windy = replace(CONTEXT, wind_m_s=(5.0, 0.0))
    against_pct = energy_to_return_pct(windy, state, SETUP)
    assert against_pct is not None
    assert against_pct > usual_pct + (windy.draw_pct_per_s(-10.0, 0.0) - HOME) * 79.0


@pytest.mark.parametrize("kind", list(AutopilotKind))
@pytest.mark.parametrize("home_m_s", [3.0, 10.0])
def test_a_return_in_simulation_uses_what_was_said(kind: AutopilotKind, home_m_s: float) -> None:
    context, dialect = fleet_of(autopilot=kind.value).context, dialect_for(kind.value)
    rule, high_m = dialect.return_parameters, context.return_height_m("uav1")
    own = {rule.height: high_m / rule.unit_m, rule.cone: rule.cone_off}
    own |= {"RTL_SPEED": 100.0 * home_m_s} if kind is AutopilotKind.ARDUPILOT else {"MPC_XY_CRUISE": home_m_s}
    performance = apply_tunings(dialect.performance, dialect.tunings, own)
    model = replace(context.pricing.models["uav1"], performance=performance)
    context = replace(context, pricing=replace(context.pricing, models={"uav1": model}))
    op = Operator(kind, {"parameters": own, "drone": context.drone})
    first = takeoff() if kind is AutopilotKind.PX4 else replace(takeoff(), z=0.0)
    op.fly(numbered([first, takeoff(), speed(5.0), waypoint(0, 300, hold_s=60.0), waypoint(0, 400)]))
    frame = op.vehicle.frame
    op.run_until(lambda: frame.body.east_m > 297.0 and frame.body.ground_speed_m_s < 0.05)
    began_pct, here = frame.battery.charge_pct, at(east_m=frame.body.east_m, up_m=frame.body.up_m)
    assert op.mode(PX4_RTL if kind is AutopilotKind.PX4 else RTL) == 0
    op.run_until(lambda: not frame.armed)
    said_pct = energy_to_return_pct(context, flying(fix=here), context.vehicles["uav1"])
    assert said_pct == pytest.approx(began_pct - frame.battery.charge_pct, rel=0.03)


def test_where_no_mission_is_known_it_is_the_return_that_counts() -> None:
    for state in (with_facts(thirsty(1.0), board=None), replace(thirsty(1.0), stage=Stage.RETURNING)):
        ahead, home_pct = (
            project_landing(CONTEXT, state, SETUP),
            energy_to_return_pct(CONTEXT, state, SETUP),
        )
        assert ahead is not None
        assert home_pct is not None
        assert ahead.mean_pct == pytest.approx(60.0 - home_pct)
    assert project_landing(CONTEXT, flying(board=None, fix=None), SETUP) is None


def test_a_landing_far_above_the_floor_is_no_question_and_one_below_it_is() -> None:
    home_pct = energy_to_return_pct(CONTEXT, flying(), SETUP)
    assert home_pct is not None

    def chance(remaining_pct: float, **changes: object) -> float | None:
        state = with_facts(thirsty(1.0, remaining_pct), board=None)
        return landing_chance_below(CONTEXT, with_facts(state, **changes), SETUP, 15.0)

    assert chance(15.0 + 10.0 + 3.0 * home_pct + 0.1) == 0.0
    assert chance(15.0 + home_pct) == pytest.approx(0.5, abs=0.05)
    below = chance(10.0)
    assert below is not None
    assert below > 0.99
    assert chance(60.0, fix=None) is None


def test_an_unreported_battery_is_assumed_full() -> None:
    unknown, full = flying(battery=account.BatteryState()), flying(battery=pack(100.0))
    assert link_blackout.max_remaining_flight_s(CONTEXT, unknown) == link_blackout.max_remaining_flight_s(CONTEXT, full)
    assert link_blackout.max_remaining_flight_s(CONTEXT, flying(battery=pack(50.0))) == pytest.approx(
        link_blackout.max_remaining_flight_s(CONTEXT, full) / 2.0
    )
    assert link_blackout.max_remaining_flight_s(CONTEXT, full) == pytest.approx(1.5 * 100.0 / min(CONTEXT.draws_pct_s))


def test_no_vehicle_flies_longer_than_its_battery() -> None:
    lasts_s = link_blackout.max_remaining_flight_s(CONTEXT, flying())
    assert link_blackout.may_be_airborne(CONTEXT, flying(spoke_s=NOW_S - lasts_s + 0.1), NOW_S)
    assert not link_blackout.may_be_airborne(CONTEXT, flying(spoke_s=NOW_S - lasts_s), NOW_S)
    assert not link_blackout.may_be_airborne(CONTEXT, flying(spoke_s=None), NOW_S)
