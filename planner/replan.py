"""Re-plan after a loss: the remaining problem, the survivors, their plan, and whether it is worth new missions.

Every visit that the lost vehicle has not finished is open again, including the one under way. Each survivor finishes
the visit that it is on or flying to when it receives the re-plan, ``Instance.answer_s`` after the loss, then starts
from there with its budget less its energy spent by then. A survivor that has landed, or is returning, may fly again
from the landing place with its remaining energy. Locks of the lost vehicle are lifted; other locks remain.

A re-plan is compared with the plan that the vehicles have on board, and rejected if it is worse. Coverage decides
first, by number and by value, then the longest route. What the first plan left out counts last.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, compress

import numpy as np

from planner.errors import PlanError
from planner.evaluate import (
    Cost,
    Result,
    budget_excess_pct,
    completion_times_s,
    compute_legs_pct,
    compute_legs_s,
    evaluate,
    route_energy_pct,
)
from planner.model import (
    Instance,
    Plan,
    Route,
    Vehicle,
    build_part_instance,
    is_reversed,
    lift_locks,
    renumber_visits,
    segment_of,
    visit_of,
)
from planner.moves import FloatArray
from planner.solve import check_routes, check_tails, solve
from planner.stop_rules import StopRule

SAME_TIME_S = 1e-9
"""Time tolerance: a visit that ends within it after the loss counts as ended."""
SAME_S = 5.0
"""Tolerance for equal longest routes: a smaller gain is not worth a new mission."""
SAME_SHARE = 0.5
"""Share of a mean segment's value: with equally many segments, a smaller difference in value counts as none."""
SAME = 1e-6


@dataclass(frozen=True, slots=True)
class FreeVehicle:
    """A vehicle that continues, with the fixed part of its route."""

    vehicle: int
    """Its number in the original instance."""
    completed: tuple[int, ...]
    """Visits that have ended, in the original numbering."""
    finishing: int | None
    """The visit that it is on or flying to and finishes first; None if its route has no further one."""
    tail: tuple[int, ...]
    """The visits after that, open for the re-plan."""
    free_s: float
    """Start of its new route, in seconds from the start of the original plan."""
    spent_pct: float
    """Energy spent by then."""
    budget_left_pct: float
    """Energy limit from then on, at least 0; 0 for a vehicle that must not fly again."""


@dataclass(frozen=True, slots=True)
class RemainingProblem:
    """The problem that remains after a loss."""

    lost: int
    at_s: float
    completed: tuple[int, ...]
    """The lost vehicle's visits that had ended, in the original numbering."""
    survivors: tuple[FreeVehicle, ...]
    """Survivors in the order of the reduced instance's vehicles."""
    open_segments: tuple[int, ...]
    """The reduced instance's segments, in the original numbering."""
    instance: Instance
    """The reduced instance: survivors only, each starting where and when it becomes free."""
    warm: Plan
    """A plan for it: the survivors' tails, with other open segments inserted by regret within the budgets."""

    def original_visit(self, visit: int) -> int:
        """Return a visit of the reduced instance in the original numbering."""
        return visit_of(self.open_segments[segment_of(visit)], is_reversed(visit))


def build_remaining_problem(
    instance: Instance, plan: Plan, lost: int, at_s: float, *, fly_again: bool = True
) -> RemainingProblem:
    """Return the problem that remains when vehicle ``lost`` is lost ``at_s`` seconds after the plan's start.

    Args:
        instance: the instance of the plan.
        plan: the plan as flown until then; what it leaves uncovered is open too.
        lost: the number of the lost vehicle.
        at_s: seconds since all routes of the plan began.
        fly_again: whether vehicles that are on the ground or returning may fly (again).

    Raises:
        PlanError: the plan does not match the instance, the vehicle or time does not exist, or no vehicle survives.
    """
    check_routes(instance, plan)
    if not 0 <= lost < len(plan.routes):
        raise PlanError(f"vehicle {lost} is not in the plan of {len(plan.routes)}")
    if len(plan.routes) == 1:
        raise PlanError(f"{instance.vehicles[lost].name} is the only vehicle: nobody is left")
    if not (math.isfinite(at_s) and at_s >= 0):
        raise PlanError(f"the time of the loss is {at_s} s, expected zero or more")
    instance = lift_locks(instance, [lost])
    completed, survivors, open_segments = find_survivors(instance, plan, lost, at_s, fly_again=fly_again)
    starts = [build_survivor_start(instance, survivor) for survivor in survivors]
    reduced = reduce_instance(instance, [survivor.vehicle for survivor in survivors], open_segments, starts)
    number = {segment: place for place, segment in enumerate(open_segments)}
    tails = [renumber_visits(survivor.tail, number) for survivor in survivors]
    return RemainingProblem(lost, at_s, completed, survivors, open_segments, reduced, warm_start(reduced, tails))


def find_survivors(
    instance: Instance, plan: Plan, lost: int, at_s: float, *, fly_again: bool
) -> tuple[tuple[int, ...], tuple[FreeVehicle, ...], tuple[int, ...]]:
    """Return the lost vehicle's completed visits, the survivors, and the open segments."""
    until_s, others = at_s + instance.answer_s, [route for route in plan.routes if route.vehicle != lost]
    survivors = tuple(_build_survivor(instance, route, until_s, fly_again=fly_again) for route in others)
    ends_s = completion_times_s(instance, plan.routes[lost])
    ended = (end_s <= at_s + SAME_TIME_S for end_s in ends_s)
    completed = tuple(compress(plan.routes[lost].visits, ended))
    settled = {segment_of(visit) for visit in completed}
    for survivor in survivors:
        settled.update(segment_of(visit) for visit in survivor.completed)
        if survivor.finishing is not None:
            settled.add(segment_of(survivor.finishing))
    return completed, survivors, tuple(segment for segment in range(instance.segments) if segment not in settled)


def warm_start(instance: Instance, tails: Sequence[Sequence[int]]) -> Plan:
    """Return a plan that keeps ``tails`` and inserts open segments by regret, all within the budgets.

    Args:
        instance: the problem, usually a reduced one.
        tails: the visits that each vehicle already has, in the numbering of ``instance``. Visits that no longer fit
            into a budget are removed from the tail.

    Raises:
        PlanError: the tails do not belong to the instance.
    """
    check_tails(instance, tails)
    if instance.segments == 0:
        return Plan(tuple(Route(vehicle, ()) for vehicle in range(len(tails))))
    # Imported here, as in solve.py: it loads numba.
    from planner.plan_search import build_first_state, build_kernel_problem, build_plan

    return build_plan(build_first_state(build_kernel_problem(instance), Cost.MINSUM, tails))


def replan(instance: Instance, *, warm: Plan, cost: Cost = Cost.MINCOMB, stop: StopRule, seed: int = 0) -> Result:
    """Return the best plan found for a reduced instance, starting from a warm plan.

    If necessary conditions show that not everything can be inspected, ``Result.impossible`` gives the reason and a stop
    rule ``FirstFeasible`` ends at once; with other rules the search continues for the most valuable part.

    Raises:
        PlanError: ``warm`` is not a plan for the instance.
    """
    return solve(instance, cost=cost, stop=stop, seed=seed, initial=warm)


def _build_survivor(instance: Instance, route: Route, at_s: float, *, fly_again: bool) -> FreeVehicle:
    ends_s = list(accumulate(compute_legs_s(instance, route)))
    spent_pct = list(accumulate(compute_legs_pct(instance, route)))
    done = sum(end_s <= at_s + SAME_TIME_S for end_s in ends_s[:-1])
    left_pct = max(0.0, instance.vehicles[route.vehicle].budget_pct - spent_pct[done])
    if done < len(route.visits):
        return FreeVehicle(
            route.vehicle, route.visits[:done], route.visits[done], route.visits[done + 1 :], ends_s[done],
            spent_pct[done], left_pct,
        )  # fmt: skip
    free_s = max(at_s, ends_s[-1])
    return FreeVehicle(
        route.vehicle, route.visits, None, (), free_s, spent_pct[done], left_pct if fly_again else 0.0
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class RouteStart:
    """Start of a vehicle's route: the vehicle, its moves to all original visits, and its return from there."""

    vehicle: Vehicle
    row: FloatArray
    """(2, 2n) float64: seconds and percent."""
    idle: FloatArray
    """(2,) float64: seconds and percent."""


def reduce_instance(
    instance: Instance, fleet: Sequence[int], segments: Sequence[int], starts: Sequence[RouteStart]
) -> Instance:
    """Return some vehicles and segments of an instance, each vehicle with a new start."""
    visits = [visit_of(segment, reverse) for segment in segments for reverse in (False, True)]
    return replace(
        build_part_instance(instance, fleet, segments),
        vehicles=tuple(start.vehicle for start in starts),
        start_s=np.array([start.row[0, visits] for start in starts]),
        idle_s=np.array([start.idle[0] for start in starts]),
        start_pct=np.array([start.row[1, visits] for start in starts]),
        idle_pct=np.array([start.idle[1] for start in starts]),
    )


def build_survivor_start(instance: Instance, survivor: FreeVehicle) -> RouteStart:
    """Return the start of a survivor's next route: the end of a visit, its own start or the landing place."""
    number, visit = survivor.vehicle, survivor.finishing
    profile, every = instance.profile[number], np.arange(2 * instance.segments)
    vehicle = replace(instance.vehicles[number], budget_pct=survivor.budget_left_pct)
    if visit is not None:
        end_m = instance.end_m[visit].tolist()
        along_m = (instance.end_m[visit] - instance.end_m[visit ^ 1]).tolist()
        row = (
            instance.moves.seconds(profile, visit, every),
            vehicle.consumption * instance.moves.pct(profile, visit, every),
        )
        home = np.array([instance.home_s[number, visit], instance.home_pct[number, visit]])
        return RouteStart(
            replace(vehicle, start_m=tuple(end_m[:2]), start_up_m=end_m[2], facing_m=tuple(along_m[:2]), airborne=True),
            np.array(row), home,
        )  # fmt: skip
    if not survivor.completed and not vehicle.airborne:
        return RouteStart(vehicle, np.array([instance.start_s[number], instance.start_pct[number]]), np.zeros(2))
    return RouteStart(
        replace(vehicle, start_m=instance.landing_m, start_up_m=0.0, facing_m=(0.0, 0.0), airborne=False),
        np.array([instance.depot_s[number], vehicle.consumption * instance.depot_pct[number]]), np.zeros(2),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class OnboardPlan:
    """The routes that vehicles have on board, as far as their budgets last."""

    plan: Plan
    short: tuple[int, ...]
    """Vehicles whose budgets do not cover their whole route: it ends after the last visit that fits."""


@dataclass(frozen=True, slots=True)
class PlanRating:
    """The figures by which plans are compared."""

    segments: int
    """Number of covered segments, spare ones excluded."""
    value: float
    """Value of these segments."""
    spare_segments: int
    spare_value: float
    grain: float
    """Smallest difference in value that counts."""
    longest_s: float
    largest_pct: float


def grant_onboard_budgets(instance: Instance, tails: Sequence[Sequence[int]], most_pct: Sequence[float]) -> Instance:
    """Return the instance with budgets that let vehicles continue the routes on board.

    Budgets are for planning, and rounded down: a vehicle that exceeds its budget a little with its route on board
    continues as long as its battery lasts for the whole route.

    Args:
        instance: the problem.
        tails: the visits that each vehicle has on board.
        most_pct: the maximum energy of each vehicle's battery.
    """
    vehicles = []
    for number, (vehicle, tail, most) in enumerate(zip(instance.vehicles, tails, most_pct, strict=True)):
        needed = route_energy_pct(instance, Route(number, tuple(tail)))
        budget = max(vehicle.budget_pct, needed) if needed <= most else vehicle.budget_pct
        vehicles.append(replace(vehicle, budget_pct=budget))
    return replace(instance, vehicles=tuple(vehicles))


def build_onboard_plan(instance: Instance, tails: Sequence[Sequence[int]]) -> OnboardPlan:
    """Return the plan in which all vehicles continue with their routes on board.

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
    """Return the figures by which a plan is compared.

    Args:
        instance: the instance of the plan.
        plan: a plan within its budgets.
        spare: segments that only break ties.
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
    """Return whether one plan is better than another in some figure and not worse in any figure before it."""
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
    """Return the best of some plans: the carried one unless another is better.

    Args:
        instance: the instance of all plans.
        carried: the plan that is flown without a re-plan.
        others: alternative plans, in order of preference.
        spare: segments that only break ties.
    """
    best, best_worth = carried, rate_plan(instance, carried, spare)
    for plan in others:
        found = rate_plan(instance, plan, spare)
        if is_better_rating(found, best_worth):
            best, best_worth = plan, found
    return best


def _trim_to_budget(instance: Instance, vehicle: int, tail: tuple[int, ...]) -> tuple[int, ...]:
    """Return the longest first part of a route that fits into a vehicle's budget, its return included."""
    budget_pct = instance.vehicles[vehicle].budget_pct
    kept = tail
    while kept and budget_excess_pct(route_energy_pct(instance, Route(vehicle, kept)), budget_pct) > 0:
        kept = kept[:-1]
    return kept
