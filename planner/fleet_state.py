"""The state of a fleet after any number of losses: the vehicles that still fly, their visits, times and energies.

``build_remaining_problem`` handles one loss of a plan in which all routes begin at once. Here the plan after a loss
becomes a state that can lose another vehicle: all times are counted from the launch of the first plan.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.evaluate import completion_times_s, compute_legs_pct, compute_legs_s, route_duration_s
from planner.model import Instance, Plan, Route, lift_locks, renumber_visits, segment_of
from planner.moves import FloatArray
from planner.replan import SAME_TIME_S, FreeVehicle, RemainingProblem, RouteStart, build_survivor_start, reduce_instance


@dataclass(frozen=True, slots=True, eq=False)
class RouteProgress:
    """Progress of a vehicle over time without a loss: three ascending columns for the same moments."""

    time_s: FloatArray
    """(m,) float64: launches, ends of visits and landings, seconds since the launch of the fleet."""
    used_pct: FloatArray
    """(m,) float64: energy used by then, in percent of a full battery."""
    airborne_s: FloatArray
    """(m,) float64: seconds in the air by then."""


@dataclass(frozen=True, slots=True, eq=False)
class FleetAfterLosses:
    """The remaining vehicles, and their routes through all segments that they have to inspect."""

    instance: Instance
    """Instance of these vehicles and the segments of their current routes; ``start_s`` counts from fleet launch."""
    plan: Plan
    """Plan for that instance: each vehicle's route since its last take-off, completed visits included."""
    fleet: tuple[int, ...]
    """Number of each vehicle in the first plan."""
    launched_s: tuple[float, ...]
    """Take-off time of each current route."""
    before: tuple[RouteProgress | None, ...]
    """Progress of each vehicle until its last landing before that route; None for its first route."""

    def progress_of(self, vehicle: int) -> RouteProgress:
        """Return a vehicle's progress over time; linear between the moments."""
        route = self.plan.routes[vehicle]
        seconds, pct = np.array(compute_legs_s(self.instance, route)), np.array(compute_legs_pct(self.instance, route))
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
        """Return (visits,) float64: end time of each visit of a vehicle's current route."""
        return np.array(completion_times_s(self.instance, self.plan.routes[vehicle]))

    def visit_values(self, vehicle: int) -> FloatArray:
        """Return (visits,) float64: value of each visit of a vehicle's current route."""
        return self.instance.value[[segment_of(visit) for visit in self.plan.routes[vehicle].visits]]

    def drop_vehicles(self, kept: Sequence[int], open_segments: Sequence[int] = ()) -> FleetAfterLosses:
        """Return the state in which only some vehicles fly on, as planned; ``open_segments`` are on no route."""
        return _rebuild_state(self, kept, [self.plan.routes[one].visits for one in kept], {}, open_segments)

    def apply_plan(self, left: RemainingProblem, plan: Plan) -> FleetAfterLosses:
        """Return the state after a loss is repaired by a plan for ``left.instance``.

        A vehicle that takes off for the new plan does so at ``left.at_s``, or as soon as it has landed. Until then it
        is returning; if it is lost there, its new visits are open again.
        """
        routes, again = merge_routes(left, plan)
        return _rebuild_state(self, [survivor.vehicle for survivor in left.survivors], routes, again)


def event_times_s(instance: Instance, plan: Plan) -> tuple[float, ...]:
    """Return 0 and the times at which a visit ends or a vehicle lands, ascending; the last is the longest route's end.

    Nothing changes between two of them, whichever vehicle is lost. If survivors continue as planned for ``answer_s``,
    times that much earlier are included too.
    """
    times = [
        time_s for route in plan.routes
        for time_s in (*completion_times_s(instance, route), route_duration_s(instance, route))
    ]  # fmt: skip
    return merge_times(times, instance.answer_s)


def merge_times(times_s: Iterable[float], answer_s: float) -> tuple[float, ...]:
    """Return 0, the given times and those ``answer_s`` before them, ascending, without duplicates."""
    events = [0.0]
    for time_s in sorted(time_s for after_s in times_s for time_s in (after_s, after_s - answer_s)):
        if time_s > events[-1] + SAME_TIME_S:
            events.append(float(time_s))
    return tuple(events)


def build_state_before_losses(instance: Instance, plan: Plan) -> FleetAfterLosses:
    """Return the state before any loss: the plan itself."""
    fleet = len(plan.routes)
    return FleetAfterLosses(instance, plan, tuple(range(fleet)), (0.0,) * fleet, (None,) * fleet)


def merge_routes(left: RemainingProblem, plan: Plan) -> tuple[list[tuple[int, ...]], dict[int, FreeVehicle]]:
    """Return each survivor's route with a plan for ``left.instance``, and the survivors that take off for theirs.

    Visits are numbered as in the plan before the loss. The route of a survivor that takes off again begins there.
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
    return routes, again


def _rebuild_state(
    state: FleetAfterLosses,
    kept: Sequence[int],
    routes: Sequence[tuple[int, ...]],
    again: dict[int, FreeVehicle],
    open_segments: Sequence[int] = (),
) -> FleetAfterLosses:
    """Return the state of some vehicles on new routes; those in ``again`` take off for them."""
    segments = sorted({*open_segments, *(segment_of(visit) for visits in routes for visit in visits)})
    number = {segment: place for place, segment in enumerate(segments)}
    instance = lift_locks(state.instance, set(range(len(state.fleet))) - set(kept))
    starts = [_build_route_start(instance, vehicle, again.get(vehicle)) for vehicle in kept]
    return FleetAfterLosses(
        reduce_instance(instance, kept, segments, starts),
        Plan(
            tuple(Route(place, renumber_visits(route, number)) for place, route in enumerate(routes)),
            tuple(number[segment] for segment in open_segments),
        ),
        tuple(state.fleet[vehicle] for vehicle in kept),
        tuple(again[vehicle].free_s if vehicle in again else state.launched_s[vehicle] for vehicle in kept),
        tuple(_collect_progress(state, vehicle, again.get(vehicle)) for vehicle in kept),
    )


def _build_route_start(instance: Instance, vehicle: int, again: FreeVehicle | None) -> RouteStart:
    if again is None:
        row = np.array([instance.start_s[vehicle], instance.start_pct[vehicle]])
        idle = np.array([instance.idle_s[vehicle], instance.idle_pct[vehicle]])
        return RouteStart(instance.vehicles[vehicle], row, idle)
    start = build_survivor_start(instance, again)
    later_s = np.array([again.free_s, 0.0])
    return replace(start, row=start.row + later_s[:, np.newaxis], idle=later_s)


def _collect_progress(state: FleetAfterLosses, vehicle: int, again: FreeVehicle | None) -> RouteProgress | None:
    """Return a vehicle's progress before its current route."""
    if again is None:
        return state.before[vehicle]
    # A spare: while it is on the ground its rows count from the launch of the fleet.
    is_spare = not again.completed and not state.instance.vehicles[vehicle].airborne
    return None if is_spare else state.progress_of(vehicle)
