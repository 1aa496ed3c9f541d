"""A vehicle is lost: what is left to do, who is left to do it, and the plan for that.

Every visit that the lost vehicle has not finished is open again, the one under way included. Each survivor finishes
the visit that it is on or flying to when it is given the re-plan, ``Instance.answer_s`` after the loss, then starts
from there with its budget less what it will have spent. A survivor that has landed, or is on its way home, may fly
again from the landing place with what it then has left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cost import Cost
from planner.errors import PlanError
from planner.evaluate import completion_times_s, energy_use_pct, route_duration_s, route_energy_pct
from planner.model import (
    Instance,
    Plan,
    Route,
    Vehicle,
    build_part_instance,
    is_reversed,
    renumber_visits,
    segment_of,
    visit_of,
)
from planner.moves import FloatArray
from planner.result import Result
from planner.solve import check_tails, solve
from planner.stop_rules import StopRule

SAME_TIME_S = 1e-9
"""A visit that ends this little after the loss has ended."""


@dataclass(frozen=True, slots=True)
class FreeVehicle:
    """A vehicle that goes on, with the part of its route that stands."""

    vehicle: int
    """Its number in the original instance."""
    completed: tuple[int, ...]
    """Visits that have ended, in the original numbering."""
    finishing: int | None
    """The visit that it is on or flying to and finishes first; None if its route holds no further one."""
    tail: tuple[int, ...]
    """The visits after that, open for the re-plan."""
    free_s: float
    """When it can begin its new route, in seconds from the start of the original plan."""
    spent_pct: float
    """What it will have spent by then."""
    budget_left_pct: float
    """What it may spend from then on, at least 0; 0 for one that must not fly again."""


@dataclass(frozen=True, slots=True)
class RemainingProblem:
    """What a loss leaves."""

    lost: int
    at_s: float
    completed: tuple[int, ...]
    """The lost vehicle's visits that had ended, in the original numbering."""
    survivors: tuple[FreeVehicle, ...]
    """In the order of the reduced instance's vehicles."""
    open_segments: tuple[int, ...]
    """The reduced instance's segments, in the original numbering."""
    instance: Instance
    """The reduced instance: survivors only, each starting where and when it becomes free."""
    warm: Plan
    """A plan for it: the survivors' tails, what else is open inserted by regret within the budgets."""

    def original_visit(self, visit: int) -> int:
        """Return a visit of the reduced instance in the original numbering."""
        return visit_of(self.open_segments[segment_of(visit)], is_reversed(visit))


def build_remaining_problem(
    instance: Instance, plan: Plan, lost: int, at_s: float, *, fly_again: bool = True
) -> RemainingProblem:
    """Return what is left when vehicle ``lost`` is lost ``at_s`` seconds after the plan's start.

    Args:
        instance: of the plan.
        plan: as flown until then; what it leaves uncovered is open too.
        lost: the number of the lost vehicle.
        at_s: seconds since all routes of the plan began.
        fly_again: whether vehicles on the ground or on their way home may fly (again).

    Raises:
        PlanError: the plan is not one for the instance, the vehicle or time does not exist, or nobody survives.
    """
    check_tails(instance, [route.visits for route in plan.routes])
    if not 0 <= lost < len(plan.routes):
        raise PlanError(f"vehicle {lost} is not in the plan of {len(plan.routes)}")
    if len(plan.routes) == 1:
        raise PlanError(f"{instance.vehicles[lost].name} is the only vehicle: nobody is left")
    if not (math.isfinite(at_s) and at_s >= 0):
        raise PlanError(f"the time of the loss is {at_s} s, expected zero or more")
    completed, survivors, open_segments = find_survivors(instance, plan, lost, at_s, fly_again=fly_again)
    starts = [build_survivor_start(instance, survivor) for survivor in survivors]
    reduced = reduce_instance(instance, [survivor.vehicle for survivor in survivors], open_segments, starts)
    number = {segment: place for place, segment in enumerate(open_segments)}
    tails = [renumber_visits(survivor.tail, number) for survivor in survivors]
    return RemainingProblem(lost, at_s, completed, survivors, open_segments, reduced, warm_start(reduced, tails))


def find_survivors(
    instance: Instance, plan: Plan, lost: int, at_s: float, *, fly_again: bool
) -> tuple[tuple[int, ...], tuple[FreeVehicle, ...], tuple[int, ...]]:
    """Return the lost vehicle's visits that have ended, who goes on, and the segments that are open."""
    until_s, others = at_s + instance.answer_s, [route for route in plan.routes if route.vehicle != lost]
    survivors = tuple(_build_survivor(instance, route, until_s, fly_again=fly_again) for route in others)
    completed = _find_completed_visits(instance, plan.routes[lost], at_s)
    settled = {segment_of(visit) for visit in completed}
    for survivor in survivors:
        settled.update(segment_of(visit) for visit in survivor.completed)
        if survivor.finishing is not None:
            settled.add(segment_of(survivor.finishing))
    return completed, survivors, tuple(segment for segment in range(instance.segments) if segment not in settled)


def warm_start(instance: Instance, tails: Sequence[Sequence[int]]) -> Plan:
    """Return a plan that keeps ``tails`` and inserts by regret what they leave open, all within the budgets.

    Args:
        instance: the problem, as a rule a reduced one.
        tails: the visits that each vehicle already has, in the numbering of ``instance``. What a budget no longer
            carries is taken out of a tail.

    Raises:
        PlanError: the tails do not belong to the instance.
    """
    check_tails(instance, tails)
    if instance.segments == 0:
        return Plan(tuple(Route(vehicle, ()) for vehicle in range(len(tails))))
    # Only here, as in solve.py: it loads numba.
    from planner.construct import build_first_state, build_kernel_problem, build_plan

    return build_plan(build_first_state(build_kernel_problem(instance), Cost.MINSUM, tails))


def replan(instance: Instance, *, warm: Plan, cost: Cost = Cost.MINCOMB, stop: StopRule, seed: int = 0) -> Result:
    """Return the best plan found for a reduced instance, beginning with a warm plan.

    Where necessary conditions show that not everything can be inspected, ``Result.impossible`` says why and a stop
    rule ``FirstFeasible`` ends at once; other rules let the search go on for the most valuable part.

    Raises:
        PlanError: ``warm`` is not a plan for the instance.
    """
    return solve(instance, cost=cost, stop=stop, seed=seed, initial=warm)


def _find_completed_visits(instance: Instance, route: Route, at_s: float) -> tuple[int, ...]:
    ends = completion_times_s(instance, route)
    return tuple(visit for visit, end_s in zip(route.visits, ends, strict=True) if end_s <= at_s + SAME_TIME_S)


def _build_survivor(instance: Instance, route: Route, at_s: float, *, fly_again: bool) -> FreeVehicle:
    budget = instance.vehicles[route.vehicle].budget_pct
    completed = _find_completed_visits(instance, route, at_s)
    done = len(completed)
    if done < len(route.visits):
        spent = energy_use_pct(instance, route, done + 1)
        free_s = completion_times_s(instance, route)[done]
        return FreeVehicle(
            route.vehicle, completed, route.visits[done], route.visits[done + 1 :], free_s, spent,
            max(0.0, budget - spent),
        )  # fmt: skip
    spent = route_energy_pct(instance, route)
    free_s = max(at_s, route_duration_s(instance, route))
    left = max(0.0, budget - spent) if fly_again else 0.0
    return FreeVehicle(route.vehicle, completed, None, (), free_s, spent, left)


@dataclass(frozen=True, slots=True)
class RouteStart:
    """Where a vehicle's route starts: the vehicle, its rows over all original visits, its way home from there."""

    vehicle: Vehicle
    row_s: FloatArray
    row_pct: FloatArray
    idle_s: float
    idle_pct: float


def reduce_instance(
    instance: Instance, fleet: Sequence[int], segments: Sequence[int], starts: Sequence[RouteStart]
) -> Instance:
    """Return some vehicles and segments of an instance, each vehicle with a start of its own."""
    visits = [visit_of(segment, reverse) for segment in segments for reverse in (False, True)]
    return replace(
        build_part_instance(instance, fleet, segments),
        vehicles=tuple(start.vehicle for start in starts),
        start_s=np.array([start.row_s[visits] for start in starts]),
        idle_s=np.array([start.idle_s for start in starts]),
        start_pct=np.array([start.row_pct[visits] for start in starts]),
        idle_pct=np.array([start.idle_pct for start in starts]),
    )


def build_survivor_start(instance: Instance, survivor: FreeVehicle) -> RouteStart:
    """Return where a survivor's next route starts: from the end of a visit, its own start or the landing place."""
    number, visit = survivor.vehicle, survivor.finishing
    profile, every = instance.profile[number], np.arange(2 * instance.segments)
    vehicle = replace(instance.vehicles[number], budget_pct=survivor.budget_left_pct)
    if visit is not None:
        east_m, north_m, up_m = (float(coordinate) for coordinate in instance.end_m[visit])
        east_along_m, north_along_m = (
            float(along) for along in (instance.end_m[visit] - instance.end_m[visit ^ 1])[:2]
        )
        return RouteStart(
            replace(
                vehicle,
                start_m=(east_m, north_m),
                start_up_m=up_m,
                facing_m=(east_along_m, north_along_m),
                airborne=True,
            ),
            instance.moves.seconds(profile, visit, every),
            vehicle.consumption * instance.moves.pct(profile, visit, every),
            float(instance.home_s[number, visit]),
            float(instance.home_pct[number, visit]),
        )
    if not survivor.completed and not vehicle.airborne:
        return RouteStart(vehicle, instance.start_s[number], instance.start_pct[number], 0.0, 0.0)
    return RouteStart(
        replace(vehicle, start_m=instance.landing_m, start_up_m=0.0, facing_m=(0.0, 0.0), airborne=False),
        instance.depot_s[number],
        vehicle.consumption * instance.depot_pct[number],
        0.0,
        0.0,
    )
