"""A fleet under way after any number of losses: who still flies what, from when, and with what left.

``build_remaining_problem`` looks at one loss of a plan that begins everywhere at once. Here the answer to a loss
becomes a state that can lose a vehicle itself: routes go on from the launch of the first plan, so that one clock counts
for all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.evaluate import completion_times_s, compute_legs
from planner.model import Instance, Plan, Route, renumber_visits, segment_of
from planner.moves import FloatArray
from planner.replan import (
    FreeVehicle,
    RemainingProblem,
    RouteStart,
    build_remaining_problem,
    build_survivor_start,
    reduce_instance,
    replan,
)
from planner.stop_rules import FirstFeasible, Iterations, combine_stop_rules


@dataclass(frozen=True, slots=True, eq=False)
class RouteProgress:
    """What a vehicle has done by when, if nothing happens to it: three ascending columns of the same moments."""

    time_s: FloatArray
    """(m,) float64: launches, ends of visits and landings since the launch of the fleet."""
    used_pct: FloatArray
    """(m,) float64: energy used by then, in percent of a full battery."""
    airborne_s: FloatArray
    """(m,) float64: seconds in the air by then."""


@dataclass(frozen=True, slots=True, eq=False)
class FleetAfterLosses:
    """The vehicles that are left, and how they inspect all that is theirs."""

    instance: Instance
    """Of these vehicles and of the segments of their present routes; its ``start_s`` counts from the fleet's launch."""
    plan: Plan
    """Over that instance: each vehicle's route since it last took off, with what is done of it."""
    fleet: tuple[int, ...]
    """For each vehicle its number in the first plan."""
    launched_s: tuple[float, ...]
    """When the present route of each took off, or will."""
    before: tuple[RouteProgress | None, ...]
    """What each had done until it landed before that; None for its first route."""

    def progress_of(self, vehicle: int) -> RouteProgress:
        """Return what a vehicle will have done by when; between the moments it is taken to grow evenly."""
        seconds, pct = compute_legs(self.instance, self.plan.routes[vehicle])
        start_s, before = self.launched_s[vehicle], self.before[vehicle]
        time_s, used_pct = np.append(start_s, np.cumsum(seconds)), np.append(0.0, np.cumsum(pct))
        airborne_s = time_s - start_s
        if before is None:
            return RouteProgress(time_s, used_pct, airborne_s)
        return RouteProgress(
            np.concatenate([before.time_s, time_s]),
            np.concatenate([before.used_pct, before.used_pct[-1] + used_pct]),
            np.concatenate([before.airborne_s, before.airborne_s[-1] + airborne_s]),
        )

    def visit_ends_s(self, vehicle: int) -> FloatArray:
        """Return (visits,) float64: when each visit of a vehicle's present route ends."""
        return np.array(completion_times_s(self.instance, self.plan.routes[vehicle]))

    def visit_values(self, vehicle: int) -> FloatArray:
        """Return (visits,) float64: what each visit of a vehicle's present route is worth."""
        return self.instance.value[[segment_of(visit) for visit in self.plan.routes[vehicle].visits]]

    def without_vehicles(self, vehicles: Sequence[int]) -> FleetAfterLosses:
        """Return the state when vehicles are lost that have nothing left to inspect."""
        kept = [vehicle for vehicle in range(len(self.fleet)) if vehicle not in vehicles]
        return _rebuild_state(self, kept, [self.plan.routes[vehicle].visits for vehicle in kept], {})

    def apply_plan(self, left: RemainingProblem, plan: Plan) -> FleetAfterLosses:
        """Return the state once a loss is answered by a plan for ``left.instance``.

        A vehicle that takes off for the new plan does so at ``left.at_s``, or as soon as it has landed. Until then it
        is on its way home; should it be lost there, its new visits are open again.
        """
        routes, again = [], {}
        for survivor, route in zip(left.survivors, plan.routes, strict=True):
            new = tuple(left.original_visit(visit) for visit in route.visits)
            if survivor.finishing is not None:
                routes.append((*survivor.completed, survivor.finishing, *new))
            elif not new:
                routes.append(survivor.completed)
            else:
                routes.append(new)
                again[survivor.vehicle] = survivor
        return _rebuild_state(self, [survivor.vehicle for survivor in left.survivors], routes, again)


def build_state_before_losses(instance: Instance, plan: Plan) -> FleetAfterLosses:
    """Return the state before any loss: the plan itself."""
    fleet = len(plan.routes)
    return FleetAfterLosses(instance, plan, tuple(range(fleet)), (0.0,) * fleet, (None,) * fleet)


def repair_plan(
    state: FleetAfterLosses, lost: int, at_s: float, *, effort: int, fly_again: bool = True
) -> tuple[RemainingProblem, Plan] | None:
    """Return what the loss of a vehicle leaves and a plan for it; None where none was found.

    The same arguments give the same plan.

    Args:
        state: when the vehicle is lost.
        lost: its number in ``state``.
        at_s: when, since the launch of the fleet.
        effort: iterations at most.
        fly_again: whether vehicles on the ground or on their way home may fly (again).
    """
    if len(state.fleet) == 1:
        return None
    left = build_remaining_problem(state.instance, state.plan, lost, at_s, fly_again=fly_again)
    result = replan(left.instance, warm=left.warm, stop=combine_stop_rules(FirstFeasible(), Iterations(effort)))
    return (left, result.plan) if result.feasible else None


def _rebuild_state(
    state: FleetAfterLosses, kept: Sequence[int], routes: Sequence[tuple[int, ...]], again: dict[int, FreeVehicle]
) -> FleetAfterLosses:
    """Return the state of some vehicles on new routes; those in ``again`` take off for theirs."""
    segments = sorted({segment_of(visit) for visits in routes for visit in visits})
    number = {segment: place for place, segment in enumerate(segments)}
    starts = [_build_route_start(state.instance, vehicle, again.get(vehicle)) for vehicle in kept]
    return FleetAfterLosses(
        reduce_instance(state.instance, kept, segments, starts),
        Plan(tuple(Route(place, renumber_visits(route, number)) for place, route in enumerate(routes))),
        tuple(state.fleet[vehicle] for vehicle in kept),
        tuple(again[vehicle].free_s if vehicle in again else state.launched_s[vehicle] for vehicle in kept),
        tuple(_collect_progress(state, vehicle, again.get(vehicle)) for vehicle in kept),
    )


def _build_route_start(instance: Instance, vehicle: int, again: FreeVehicle | None) -> RouteStart:
    if again is None:
        return RouteStart(
            instance.vehicles[vehicle], instance.start_s[vehicle], instance.start_pct[vehicle],
            float(instance.idle_s[vehicle]), float(instance.idle_pct[vehicle]),
        )  # fmt: skip
    start = build_survivor_start(instance, again)
    return replace(start, row_s=again.free_s + start.row_s, idle_s=again.free_s)


def _collect_progress(state: FleetAfterLosses, vehicle: int, again: FreeVehicle | None) -> RouteProgress | None:
    """Return what a vehicle has done before its present route."""
    if again is None:
        return state.before[vehicle]
    # A spare: as long as it stands its rows count from the launch of the fleet.
    is_spare = not again.completed and not state.instance.vehicles[vehicle].airborne
    return None if is_spare else state.progress_of(vehicle)
