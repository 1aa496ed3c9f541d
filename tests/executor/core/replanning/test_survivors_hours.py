"""A day's hours: how long each vehicle may fly, and what a re-plan in the air may ask of it before they end."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from executor.core.context import Context, DayRules
from executor.core.interface.commands import Solve, Survivor
from executor.core.replanning import replan_cycle
from executor.core.replanning.survivors import build_survivor, find_remaining_hours, limit_to_hours, min_draw_pct
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import CLEARED_S
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import flight_of
from tests.executor.core.stories import under_way
from tests.executor.core.vehicles import FLEET, NOW_S, flying

FLOWN_S = 100.0
"""Since the launch."""
ON_ITS_WAY = flying()
STATE = flight_of(ON_ITS_WAY, launched_s=NOW_S - FLOWN_S)
HOME_S = legs.time_to_reach_s(ON_ITS_WAY, 99)


def until(*windows_s: tuple[float, float]) -> Context:
    """Return a day in which uav1 may fly then, counted from the launch."""
    return replace(FLEET.context, day=DayRules(30.0, {"uav1": "depot"}, {"uav1": windows_s}))


def offered(context: Context, state: FleetState = STATE) -> tuple[Survivor, Survivor]:
    """Return what uav1 offers by its battery, and what it does within its hours."""
    offer = build_survivor(context, state, state.vehicles["uav1"], NOW_S)
    assert offer is not None
    return offer, limit_to_hours(context, state, offer, NOW_S)


@pytest.mark.parametrize(
    ("context", "ahead_s", "found"),
    [
        (FLEET.context, 0.0, (math.inf, None)),
        (until((0.0, 400.0)), 0.0, (300.0, None)),
        (until((0.0, 400.0), (700.0, 900.0)), 0.0, (300.0, 700.0)),
        (until((0.0, 50.0), (150.0, 900.0)), 0.0, (0.0, 150.0)),
        (until((0.0, 50.0), (150.0, 900.0)), 50.0, (800.0, None)),
        (until((0.0, 50.0)), 0.0, (0.0, None)),
        (until(), 0.0, (0.0, None)),
    ],
)
def test_how_long_a_vehicle_may_fly(context: Context, ahead_s: float, found: tuple[float, float | None]) -> None:
    assert find_remaining_hours(context, STATE, "uav1", NOW_S, ahead_s=ahead_s) == found


def test_before_the_launch_the_hours_count_from_now() -> None:
    waiting = flight_of(ON_ITS_WAY, launched_s=None)
    assert find_remaining_hours(until((0.0, 400.0)), waiting, "uav1", NOW_S) == (400.0, None)


def test_a_vehicle_with_time_offers_its_whole_battery() -> None:
    for context in (FLEET.context, until((0.0, 1e5))):
        by_battery, in_hours = offered(context)
        assert in_hours == by_battery


def test_near_the_end_of_its_hours_it_offers_what_is_flown_in_them() -> None:
    left_s = HOME_S + 5.0
    context = until((0.0, FLOWN_S + left_s))
    by_battery, in_hours = offered(context)
    free_s = legs.time_to_reach_s(ON_ITS_WAY, by_battery.kept - 1)
    assert 0.0 < free_s < left_s
    assert in_hours.budget_pct == pytest.approx(min_draw_pct(context, left_s - free_s))
    assert in_hours.budget_pct < by_battery.budget_pct
    # What it carries ends in time, and stays its own.
    assert in_hours.most_pct == by_battery.most_pct
    assert replace(in_hours, budget_pct=by_battery.budget_pct) == by_battery


def test_a_vehicle_short_of_time_keeps_the_segments_that_fit() -> None:
    by_battery, in_hours = offered(until((0.0, FLOWN_S + HOME_S - 1.0)))
    assert in_hours.most_pct == in_hours.budget_pct < by_battery.budget_pct
    _, too_late = offered(until((0.0, FLOWN_S - 1.0)))
    assert (too_late.budget_pct, too_late.most_pct) == (0.0, 0.0)


def test_a_vehicle_sent_up_just_before_its_hours_may_use_them() -> None:
    begins_s = FLOWN_S + CLEARED_S
    by_battery, in_hours = offered(until((begins_s, 1e5)))
    assert in_hours == by_battery
    _, too_early = offered(until((begins_s + 1.0, 1e5)))
    assert too_early.most_pct == 0.0
    waits = limit_to_hours(until((begins_s, 1e5)), STATE, replace(by_battery, airborne=False), NOW_S)
    assert waits.most_pct == 0.0  # on the ground it has the time to wait for them


def test_re_plans_and_the_window_ask_within_the_hours() -> None:
    flight = under_way()
    flown_s = flight.now_s - (flight.state.progress.launched_s or 0.0)
    windows = dict.fromkeys(flight.context.vehicles, ((0.0, flown_s + 20.0),))
    context = replace(flight.context, day=DayRules(30.0, dict.fromkeys(windows, "depot"), windows))
    judged = replan_cycle.build_loss_problem(context, flight.state, "uav2", flight.now_s)
    lost = replace(flight.state.vehicles["uav2"], stage=Stage.LOST)
    needed = with_facts(flight.state.put(lost), urgent=True, trigger="why", trigger_s=flight.now_s)
    _, commands = replan_cycle.begin_replan(context, needed, flight.now_s)
    for solve in (judged, commands[-1]):
        assert isinstance(solve, Solve)
        assert [offer.vehicle for offer in solve.survivors] == ["uav1", "uav3"]
        assert all(offer.budget_pct <= min_draw_pct(context, 20.0) for offer in solve.survivors)
