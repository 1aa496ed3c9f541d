"""Losses one after another: what counts, what is under way, and that nothing is known before its time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenarios import (
    Day,
    DayLeft,
    TimedTrip,
    build_day_left,
    build_day_left_with_foresight,
    day_after,
    least_last_end_s,
    open_tasks,
    replan_losses,
)
from benchmarks.scenarios.road_graph import build_road_graph
from planner import InstanceError, Iterations, Plan, PlanError, Route
from planner.sorties import SortieInstance, solve_sorties
from tests.benchmarks.scenarios.builders import instance_of, random_day

ROW = build_road_graph(5, [(place, place + 1, 10.0) for place in range(4)])
DAY = Day(ROW, tuple((place, place + 1) for place in range(4)), (0, 4), (0, 4), 80.0, 5.0)
"""Five places in a row, a depot at each end, everything to do; two vehicles."""
PLAN = (DAY.time_walks([(0, 1, 0), (0, 1, 2, 1, 0)]), DAY.time_walks([(4, 3, 4), (4, 3, 2, 3, 4)]))
"""Each does the outer task, and the inner one after it: from 25 s on."""


def replanned(instance: SortieInstance, tails: tuple[Route, ...]) -> Plan:
    return solve_sorties(instance, stop=Iterations(200), seed=1, initial=tails).plan


def test_trips_follow_each_other_with_the_turnaround_between() -> None:
    assert [(trip.start_s, trip.lasts_s, trip.end_s) for trip in PLAN[0]] == [(0.0, 20.0, 20.0), (25.0, 40.0, 65.0)]
    assert open_tasks(DAY, PLAN) == ()
    with pytest.raises(PlanError, match="along no edge"):
        DAY.time_walks([(0, 2, 0)])


@pytest.mark.parametrize(
    ("at_s", "counts"),
    [
        (10.0, 0),  # under way: lost with what it had on board
        (24.0, 0),  # landed, the turnaround is not over
        (25.0, 0),  # nor is it before the loss
        (25.5, 1),
        (70.0, 1),
        (70.5, 2),
    ],
)
def test_of_a_lost_vehicle_only_landed_data_counts(at_s: float, counts: int) -> None:
    left = build_day_left(DAY, PLAN, [0], at_s)
    assert left.kept[0] == PLAN[0][:counts]
    assert left.survivors == (1,)


def test_a_survivor_ends_its_trip_and_may_be_given_another_after_its_turnaround() -> None:
    left = build_day_left(DAY, PLAN, [0], 12.0)
    assert left.kept[1] == PLAN[1][:1]
    assert left.open == (0, 1, 2)
    assert left.instance is not None
    assert [(DAY.bases[own.base], own.ready_s) for own in left.instance.vehicles] == [(4, 25.0)]
    assert left.tails == (Route(0, (5,), 1, 1, 25.0),)  # the third of what is open, towards the start
    # One that has long been ready begins at the loss, where its next trip is not under way.
    waiting = (PLAN[0], PLAN[1][:1])
    later = build_day_left(DAY, waiting, [0], 60.0)
    assert later.instance is not None
    assert [(DAY.bases[own.base], own.ready_s) for own in later.instance.vehicles] == [(4, 60.0)]


def test_a_trip_that_begins_at_the_loss_has_not_begun() -> None:
    assert build_day_left(DAY, PLAN, [0], 25.0).kept[1] == PLAN[1][:1]
    assert build_day_left(DAY, PLAN, [0], 25.1).kept[1] == PLAN[1]


def test_one_that_was_lost_before_keeps_what_it_had() -> None:
    left = build_day_left(DAY, PLAN, [1, 0], 500.0)
    assert left.kept[1] == PLAN[1]
    assert (left.survivors, left.instance) == ((), None)


def test_the_last_vehicle_finishes_alone() -> None:
    history = replan_losses(DAY, PLAN, [(0, 12.0)], replanned)
    (now,) = history
    assert now[0] == ()
    assert now[1][0] == PLAN[1][0]
    assert open_tasks(DAY, now) == ()
    assert now[1][1:] == (TimedTrip(25.0, 40.0, (4, 3, 2, 1, 0)),)  # it lands at the other depot


def test_without_survivors_what_is_left_stays_left() -> None:
    history = replan_losses(DAY, PLAN, [(0, 12.0), (1, 13.0)], replanned)
    assert history[-1] == ((), ())
    assert open_tasks(DAY, history[-1]) == (0, 1, 2, 3)


def test_times_of_replans_are_reported() -> None:
    took: list[float] = []
    replan_losses(DAY, PLAN, [(0, 12.0), (1, 13.0)], replanned, took.append)
    assert len(took) == 2
    assert min(took) >= 0.0


def test_an_unknown_vehicle_is_refused() -> None:
    with pytest.raises(PlanError, match="of 2 vehicles"):
        build_day_left(DAY, PLAN, [2], 12.0)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(2, 4), st.integers(1, 3))
def test_a_loss_is_unknown_before_its_time(seed: int, vehicles: int, depots: int) -> None:
    """The day up to a loss is the same whatever comes later; what has begun is never changed."""
    day = random_day(seed, 6, vehicles, depots)
    chance = np.random.default_rng(seed)
    plan = solve_sorties(instance_of(day), stop=Iterations(200), seed=1).plan
    everybody = day_after(day, _whole(day), plan)
    end_s = max((trip.end_s for own in everybody for trip in own), default=1.0)
    lost = chance.permutation(vehicles).tolist()
    times = np.sort(chance.uniform(0.0, 1.5 * end_s, vehicles)).tolist()
    losses = list(zip(lost, times, strict=True))
    history = replan_losses(day, everybody, losses, replanned)
    assert history[:1] == replan_losses(day, everybody, losses[:1], replanned)
    for number, (before, now, (vehicle, at_s)) in enumerate(zip((everybody, *history), history, losses, strict=False)):
        for own, (old, new) in enumerate(zip(before, now, strict=True)):
            if own not in lost[: number + 1]:
                begun = tuple(trip for trip in old if trip.start_s < at_s)
                assert new[: len(begun)] == begun
                assert all(trip.start_s >= at_s for trip in new[len(begun) :])
            elif own == vehicle:
                assert new == tuple(trip for trip in old if trip.end_s + day.turnaround_s < at_s)
            else:
                assert new == old
            _flies_as_it_can(day, own, new)


def _flies_as_it_can(day: Day, vehicle: int, trips: tuple[TimedTrip, ...]) -> None:
    place, ready_s = day.starts[vehicle], 0.0
    for trip in trips:
        assert trip.places[0] == place
        assert trip.places[-1] in day.depots
        assert trip.lasts_s <= day.capacity_s + 1e-6
        assert trip.start_s >= ready_s - 1e-6
        place, ready_s = trip.places[-1], trip.end_s + day.turnaround_s


def test_shortest_ways_lead_along_edges() -> None:
    ways = build_road_graph(4, [(0, 1, 9.0), (1, 0, 4.0), (1, 2, 1.0), (0, 2, 7.0)])
    assert ways.along_s[0, 1] == 4.0  # of parallel edges the shorter
    assert ways.times_s[0, 2] == 5.0
    assert ways.find_way(2, 0) == (2, 1, 0)
    assert ways.find_way(3, 3) == (3,)
    with pytest.raises(InstanceError, match="no way leads"):
        ways.find_way(0, 3)
    for edge in ((0, 4, 1.0), (1, 1, 1.0)):
        with pytest.raises(InstanceError, match="expected two places from 0 to 3"):
            build_road_graph(4, [edge])
    with pytest.raises(InstanceError, match="expected 0 seconds or more"):
        build_road_graph(4, [(0, 1, -1.0)])


def test_a_plan_for_no_vehicle_changes_nothing() -> None:
    left = build_day_left(DAY, PLAN, [0], 500.0)
    assert left.instance is None
    assert day_after(DAY, left, Plan(())) == left.kept


def test_foresight_uses_no_vehicle_that_will_be_lost() -> None:
    left, until_s = build_day_left_with_foresight(DAY, PLAN, [(0, 10.0), (1, 24.0)])
    assert (left.kept, left.survivors, left.open) == (((), ()), (), (0, 1, 2, 3))
    left, until_s = build_day_left_with_foresight(DAY, PLAN, [(0, 10.0), (1, 50.0)])
    # Its first trip is home by 25; until 50 nothing else but a trip of 20 with its turnaround would be.
    assert (left.kept, left.survivors, left.open) == (((), PLAN[1][:1]), (1,), (0, 1, 2))
    assert until_s == (50.0,)
    left, until_s = build_day_left_with_foresight(DAY, PLAN, [(0, 30.0)])
    assert (left.kept, left.open, until_s) == ((PLAN[0][:1], PLAN[1]), (1,), (np.inf,))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_no_answer_falls_below_the_bound_with_foresight(seed: int) -> None:
    chance = np.random.default_rng(seed)
    day = random_day(seed, 5, 3, 2, places=6)
    alone = solve_sorties(instance_of(day), stop=Iterations(200), seed=1)
    if alone.plan.uncovered:
        return
    first = day_after(day, _whole(day), alone.plan)
    horizon = int(max(alone.evaluation.finish_s, 2.0))
    times = np.sort(chance.integers(1, horizon, 2)).tolist()
    losses = list(zip(chance.permutation(3)[:2].tolist(), times, strict=True))
    last = replan_losses(day, first, losses, replanned)[-1]
    left, until_s = build_day_left_with_foresight(day, first, losses)
    ends = [trip.end_s for own in left.kept for trip in own]
    if left.instance is not None:
        ends.append(least_last_end_s(left.instance, until_s))
    if not open_tasks(day, last):
        assert max(trip.end_s for own in last for trip in own) >= max(ends) - 1e-6


def _whole(day: Day) -> DayLeft:
    fleet, tasks = len(day.starts), len(day.tasks)
    return DayLeft(((),) * fleet, tuple(range(fleet)), tuple(range(tasks)), instance_of(day), ())
