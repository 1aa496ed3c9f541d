"""Windows against two losses: by hand on a line, and every claimed pair solved anew from first principles."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from planner import (
    Cost,
    Instance,
    Iterations,
    Plan,
    PlanError,
    Route,
    build_remaining_problem,
    replan_window,
    solve,
    solve_window,
)
from planner.evaluate import BUDGET_TOLERANCE_PCT, CriticalLoss
from planner.exact import find_covering_plan
from planner.fleet_state import event_times_s, merge_routes
from planner.loss_scan import LossScan
from planner.second_loss import SecondLosses
from tests.planner.builders import fleet, line, random_instance

# Segments 0-10, 10-20, ... m east of the depot; a metre is a second is a percent.
# a: 0, 1 end at 10, 20 s, home at 40. b: 2 ends at 30 s, home at 60. c: 3 ends at 40 s, home at 80.
PLAN = Plan((Route(0, (0, 2)), Route(1, (4,)), Route(2, (6,))))
SAME_S = 1e-9


def test_ample_budgets_absorb_any_two() -> None:
    window = replan_window(line(4, 200.0, 200.0, 200.0), PLAN, losses=2)
    assert (window.earliest_s, window.window_pct, window.losses, window.then) == (0, 100, 2, None)


def test_the_pair_that_ends_the_window_is_named() -> None:
    # One more flight to segment 3 takes 80 s. Lost in [30, 40), c leaves it: b, at 60 s when home, has 140. If b is
    # lost too, by then on its way home, a takes it: 40 + 80 = 120 s, one more than it has.
    instance = line(4, 119.0, 150.0, 119.0)
    assert replan_window(instance, PLAN).earliest_s == 0
    window = replan_window(instance, PLAN, losses=2)
    assert window.breaking is not None
    assert window.then is not None
    assert {window.breaking.vehicle, window.then.vehicle} == {1, 2}
    assert (window.earliest_s, window.certified_earliest_s) == (40, 40)
    assert replan_window(line(4, 120.0, 150.0, 119.0), PLAN, losses=2).earliest_s < 40


def test_the_second_loss_counts_after_the_end_of_the_longest_route() -> None:
    # c is lost at 35 s; b takes off again for segment 3 at 60 s, and is over it at 100 s. Lost there, only a is left.
    enough, little = (replan_window(line(4, budget, 150.0, 150.0), PLAN, losses=2) for budget in (120.0, 60.0))
    assert enough.earliest_s < little.earliest_s == 40


def test_one_loss_without_a_re_plan_has_no_second() -> None:
    instance = line(4, 119.0, 90.0, 119.0)
    one, two = (replan_window(instance, PLAN, losses=count) for count in (1, 2))
    assert one.breaking == CriticalLoss(2, 30, 40)
    assert (two.breaking, two.then) == (one.breaking, None)
    assert (two.earliest_s, two.certified_earliest_s) == (one.earliest_s, one.certified_earliest_s) == (40, 40)


def test_somebody_must_be_left() -> None:
    pair, three = line(4, 200.0, 200.0), line(4, 200.0, 200.0, 200.0)
    with pytest.raises(PlanError, match="expected 3 or more"):
        replan_window(pair, Plan((Route(0, (0, 2)), Route(1, (4, 6)))), losses=2)
    with pytest.raises(PlanError, match="expected 3 or more"):
        solve_window(pair, stretch=0.1, stop=Iterations(1), losses=2)
    with pytest.raises(PlanError, match="expected 1 or 2"):
        replan_window(three, PLAN, losses=3)


def test_a_plan_chosen_against_pairs_holds_against_them() -> None:
    instance = random_instance(3, 8, fleet(60.0, 60.0, 60.0, 60.0))
    for_one, for_two = (
        solve_window(instance, stretch=0.1, stop=Iterations(20_000), seed=1, losses=count) for count in (1, 2)
    )
    assert for_two.window == replan_window(instance, for_two.plan, losses=2)
    assert for_two.window.earliest_s <= replan_window(instance, for_one.plan, losses=2).earliest_s
    assert for_one.window.earliest_s <= replan_window(instance, for_two.plan).earliest_s


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("answer_s", [0.0, 7.0])
def test_every_claimed_pair_survives_when_it_is_solved_anew(seed: int, answer_s: float) -> None:
    budgets = ((34.0, 40.0, 46.0), (26.0, 26.0, 26.0, 26.0))[seed % 2]
    instance = replace(random_instance(seed + 10, 5, fleet(*budgets)), answer_s=answer_s)
    plan = solve(instance, cost=Cost.MINCOMB, stop=Iterations(300), seed=seed, all_vehicles=seed % 2 == 1).plan
    window = replan_window(instance, plan, losses=2)
    assert replan_window(instance, plan).earliest_s <= window.earliest_s
    assert window.certified_earliest_s <= window.earliest_s
    chance, pairs = np.random.default_rng(seed), 0
    for first, replanned in claimed_replans(instance, plan, window.earliest_s):
        for at_s in (first.from_s, *chance.uniform(first.from_s, first.to_s - SAME_S, 3)):
            assert find_covering_plan(build_remaining_problem(instance, plan, first.vehicle, at_s).instance) is not None
            for left, boats in pair_problems(instance, plan, first.vehicle, float(at_s), replanned, chance):
                pairs += 1
                assert can_finish(instance, left, boats), (first, at_s, left)
    assert pairs > 50


def claimed_replans(instance: Instance, plan: Plan, since_s: float) -> Iterator[tuple[CriticalLoss, Plan]]:
    """Yield the first losses of a window with the re-plans that it was claimed for."""
    scan = LossScan(instance, plan, event_times_s(instance, plan), seed=0, fly_again=True)
    second = SecondLosses(scan, instance, plan, effort=10_000, seed=0, fly_again=True)
    for row in scan.iterate_rows(10_000):
        if row.from_s < since_s:
            return
        replanned = second.find_replan(row)
        assert isinstance(replanned, Plan)
        yield row, replanned


@dataclass(frozen=True)
class Craft:
    """One vehicle's flight: its visits with the time and energy at their ends, and its landing."""

    vehicle: int
    begins_s: float
    visits: tuple[int, ...]
    ends_s: tuple[float, ...]
    spent_pct: tuple[float, ...]
    home_s: float
    home_pct: float
    again: bool
    """Whether it began after a landing."""


def fly(
    instance: Instance, vehicle: int, visits: Sequence[int], before: Craft | None = None, at_s: float = 0.0
) -> Craft:
    """Return a flight from the vehicle's start, or another one after a landing."""
    profile, used = instance.profile[vehicle], instance.vehicles[vehicle].consumption
    again = before is not None and bool(before.visits)
    now_s, pct = (at_s, before.home_pct) if before is not None else (0.0, 0.0)
    ends_s, spent = [], []
    for number, visit in enumerate(visits):
        if number == 0 and again:
            step_s, step_pct = instance.depot_s[vehicle, visit], used * instance.depot_pct[vehicle, visit]
        elif number == 0:
            step_s, step_pct = instance.start_s[vehicle, visit], instance.start_pct[vehicle, visit]
        else:
            step_s = instance.moves.seconds(profile, visits[number - 1], visit)
            step_pct = used * instance.moves.pct(profile, visits[number - 1], visit)
        now_s, pct = now_s + float(step_s), pct + float(step_pct)
        ends_s.append(now_s)
        spent.append(pct)
    if visits:
        now_s += float(instance.home_s[vehicle, visits[-1]])
        pct += float(instance.home_pct[vehicle, visits[-1]])
    begins_s = 0.0 if before is None else at_s
    return Craft(vehicle, begins_s, tuple(visits), tuple(ends_s), tuple(spent), now_s, pct, again)


def pair_problems(
    instance: Instance, plan: Plan, lost: int, at_s: float, replanned: Plan, chance: np.random.Generator
) -> Iterator[tuple[set[int], list[tuple[Craft, float]]]]:
    """Yield what any second loss leaves: the open segments, and the survivors with the time of their next mission."""
    planned = [fly(instance, route.vehicle, route.visits) for route in plan.routes]
    done = {visit >> 1 for visit, end_s in zip(planned[lost].visits, planned[lost].ends_s, strict=True)
            if end_s <= at_s + SAME_S}  # fmt: skip
    ready_s = at_s + instance.answer_s
    routes, _ = merge_routes(build_remaining_problem(instance, plan, lost, at_s), replanned)
    anew = []
    for craft, route in zip([one for one in planned if one.vehicle != lost], routes, strict=True):
        takes_off = bool(route) and (not craft.visits or craft.ends_s[-1] <= ready_s + SAME_S) and route != craft.visits
        if takes_off:
            flown = fly(instance, craft.vehicle, route, craft, max(ready_s, craft.home_s))
            done |= {visit >> 1 for visit in craft.visits}
            anew.append(flown)
        else:
            anew.append(fly(instance, craft.vehicle, route))
    everything = set(range(instance.segments))
    # Before the first re-plan is on board, then after it.
    for crafts, low_s, high_s in (
        ([one for one in planned if one.vehicle != lost], at_s, ready_s),
        (anew, ready_s, max(one.home_s for one in anew)),
    ):
        ends = [time_s for one in crafts for time_s in (*one.ends_s, one.home_s)]
        moments = {low_s, *(time_s + shift for time_s in ends for shift in (0.0, -1e-6, -instance.answer_s))}
        moments |= set(chance.uniform(low_s, max(low_s, high_s), 5).tolist())
        for second_s in sorted(time_s for time_s in moments if low_s <= time_s <= high_s):
            if crafts is not anew and second_s >= ready_s and second_s > at_s:
                continue
            for gone in crafts:
                if gone.home_s <= second_s + SAME_S:
                    continue
                next_s = second_s + instance.answer_s
                settled = done | {visit >> 1 for visit, end_s in zip(gone.visits, gone.ends_s, strict=True)
                                  if end_s <= second_s + SAME_S}  # fmt: skip
                others = [one for one in crafts if one is not gone]
                for one in others:
                    count = sum(end_s <= next_s + SAME_S for end_s in one.ends_s)
                    settled |= {visit >> 1 for visit in one.visits[: count + 1]}
                yield everything - settled, [(one, next_s) for one in others]


def can_finish(instance: Instance, left: set[int], crafts: Sequence[tuple[Craft, float]]) -> bool:
    """Return whether some shares, orders and directions of the open segments fit the budgets: all are tried."""
    for owners in itertools.product(range(len(crafts)), repeat=len(left)):
        shares = [[segment for segment, owner in zip(sorted(left), owners, strict=True) if owner == number]
                  for number in range(len(crafts))]  # fmt: skip
        if all(fits(instance, *crafts[number], share) for number, share in enumerate(shares)):
            return True
    return False


def fits(instance: Instance, craft: Craft, next_s: float, share: Sequence[int]) -> bool:
    """Return whether a survivor can inspect some segments in some order and come home."""
    vehicle = craft.vehicle
    most, used = (
        instance.vehicles[vehicle].budget_pct + 2 * BUDGET_TOLERANCE_PCT,
        instance.vehicles[vehicle].consumption,
    )
    count = sum(end_s <= next_s + SAME_S for end_s in craft.ends_s)
    for order in itertools.permutations(share):
        for turned in itertools.product((0, 1), repeat=len(order)):
            visits = [2 * segment + turn for segment, turn in zip(order, turned, strict=True)]
            if count < len(craft.visits):
                pct, here = craft.spent_pct[count], craft.visits[count]
            elif not visits:
                return True
            else:
                first = instance.start_pct if not craft.visits else used * instance.depot_pct
                pct, here = craft.home_pct + float(first[vehicle, visits[0]]), visits.pop(0)
            for visit in visits:
                pct += used * float(instance.moves.pct(instance.profile[vehicle], here, visit))
                here = visit
            if pct + float(instance.home_pct[vehicle, here]) <= most:
                return True
    return False
