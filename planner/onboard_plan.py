"""What everybody carries, as a plan to compare a re-plan with: an answer that is worse is none.

More covered first, by number and by value, then the longest route. What the first plan left out counts after all else.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

from planner.cost import Cost, budget_excess_pct
from planner.evaluate import evaluate, route_energy_pct
from planner.model import Instance, Plan, Route, segment_of
from planner.solve import check_tails

SAME_S = 5.0
"""Longest routes that differ by no more are as long as each other: nobody is given a new mission for that."""
SAME_SHARE = 0.5
"""Of a mean segment's value: as many segments that are worth no more beyond others than this are worth as much."""
SAME = 1e-6


@dataclass(frozen=True, slots=True)
class OnboardPlan:
    """The routes that vehicles have on board, as far as their budgets last."""

    plan: Plan
    short: tuple[int, ...]
    """Vehicles whose budgets do not last for all that they carry: theirs ends with the last visit that they do."""


@dataclass(frozen=True, slots=True)
class PlanRating:
    """What a plan is compared by."""

    segments: int
    """Covered, without those to spare."""
    value: float
    """Of them."""
    spare_segments: int
    spare_value: float
    grain: float
    """What a difference in value must be more than."""
    longest_s: float
    largest_pct: float


def grant_onboard_budgets(instance: Instance, tails: Sequence[Sequence[int]], most_pct: Sequence[float]) -> Instance:
    """Return the instance with budgets by which vehicles may go on with what they carry.

    Budgets are for planning, and rounded down: a vehicle that spends a little more with what it has on board flies on
    with it, as long as its battery lasts for all of it.

    Args:
        instance: the problem.
        tails: the visits that each vehicle has on board.
        most_pct: what the battery of each gives at most.
    """
    vehicles = []
    for number, (vehicle, tail, most) in enumerate(zip(instance.vehicles, tails, most_pct, strict=True)):
        needed = route_energy_pct(instance, Route(number, tuple(tail)))
        budget = max(vehicle.budget_pct, needed) if needed <= most else vehicle.budget_pct
        vehicles.append(replace(vehicle, budget_pct=budget))
    return replace(instance, vehicles=tuple(vehicles))


def build_onboard_plan(instance: Instance, tails: Sequence[Sequence[int]]) -> OnboardPlan:
    """Return the plan of everybody going on with what is on board.

    Raises:
        PlanError: the tails do not belong to the instance.
    """
    check_tails(instance, tails)
    routes = tuple(Route(number, _trim_to_budget(instance, number, tuple(tail))) for number, tail in enumerate(tails))
    covered = {segment_of(visit) for route in routes for visit in route.visits}
    uncovered = tuple(segment for segment in range(instance.segments) if segment not in covered)
    short = tuple(route.vehicle for route, tail in zip(routes, tails, strict=True) if len(route.visits) < len(tail))
    return OnboardPlan(Plan(routes, uncovered), short)


def rate_plan(instance: Instance, plan: Plan, spare: Collection[int] = ()) -> PlanRating:
    """Return what a plan is compared by.

    Args:
        instance: of the plan.
        plan: within its budgets.
        spare: segments that count only where all else is equal.
    """
    covered = {segment_of(visit) for route in plan.routes for visit in route.visits}
    own, extra = sorted(covered - set(spare)), sorted(covered & set(spare))
    figures = evaluate(instance, plan, Cost.MINMAX)
    return PlanRating(
        len(own), float(instance.value[own].sum()), len(extra), float(instance.value[extra].sum()),
        SAME_SHARE * float(instance.value.mean()) if instance.segments else 0.0,
        figures.longest_route_s, max(figures.energies_pct),
    )  # fmt: skip


def is_better_rating(one: PlanRating, other: PlanRating) -> bool:
    """Return whether one plan is better than another, and worse in nothing that comes before."""
    if one.segments < other.segments or one.value < other.value - SAME:
        return False
    if one.segments > other.segments or one.value > other.value + one.grain + SAME:
        return True
    if one.spare_segments < other.spare_segments or one.spare_value < other.spare_value - SAME:
        return False
    if one.spare_segments > other.spare_segments:
        return True
    return one.longest_s < other.longest_s - SAME_S and budget_excess_pct(one.largest_pct, other.largest_pct) <= 0


def select_best_plan(instance: Instance, carried: Plan, others: Iterable[Plan], spare: Collection[int] = ()) -> Plan:
    """Return the best of some plans: what is carried unless another one is better.

    Args:
        instance: of them all.
        carried: what is flown without a re-plan.
        others: what might be flown instead, the most wanted first.
        spare: segments that count only where all else is equal.
    """
    best, best_worth = carried, rate_plan(instance, carried, spare)
    for plan in others:
        found = rate_plan(instance, plan, spare)
        if is_better_rating(found, best_worth):
            best, best_worth = plan, found
    return best


def _trim_to_budget(instance: Instance, vehicle: int, tail: tuple[int, ...]) -> tuple[int, ...]:
    """Return as much of a route, from its beginning, as a vehicle's budget lasts for, its way home included."""
    budget_pct = instance.vehicles[vehicle].budget_pct
    kept = tail
    while kept and budget_excess_pct(route_energy_pct(instance, Route(vehicle, kept)), budget_pct) > 0:
        kept = kept[:-1]
    return kept
