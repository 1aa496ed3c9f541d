"""The definition of every figure of a plan: slow, obvious, and what the kernels must agree with."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.cost import Cost, budget_excess_pct
from planner.errors import PlanError
from planner.model import Instance, Plan, Route, segment_of
from planner.moves import FloatArray


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The figures of one plan."""

    value: float
    """The cost function's, in percent of a full battery."""
    durations_s: tuple[float, ...]
    energies_pct: tuple[float, ...]
    longest_route_s: float
    violations: tuple[str, ...]
    """In words; empty if every segment is inspected or named as uncovered, within all budgets."""


def compute_legs(instance: Instance, route: Route) -> tuple[FloatArray, FloatArray]:
    """Return (visits + 1,) float64 twice: seconds and percent of a full battery to each visit's end, then home.

    Of a route without a visit it is the vehicle's way home.

    Raises:
        PlanError: the vehicle or a visit is not in the instance.
    """
    number, visits = route.vehicle, np.array(route.visits, dtype=np.int64)
    if not 0 <= number < len(instance.vehicles):
        raise PlanError(f"route of vehicle {number}, the instance has {len(instance.vehicles)}")
    if len(visits) == 0:
        return instance.idle_s[[number]], instance.idle_pct[[number]]
    for visit in visits[(visits < 0) | (visits >= 2 * instance.segments)]:
        raise PlanError(f"visit {visit} is not in the instance of {instance.segments} segments")
    profile, consumption = instance.profile[number], instance.vehicles[number].consumption
    start, moves, home = (number, visits[:1]), (visits[:-1], visits[1:]), (number, visits[-1:])
    seconds = (instance.start_s[start], instance.moves.seconds(profile, *moves), instance.home_s[home])
    pct = (instance.start_pct[start], consumption * instance.moves.pct(profile, *moves), instance.home_pct[home])
    return np.concatenate(seconds), np.concatenate(pct)


def route_duration_s(instance: Instance, route: Route) -> float:
    """Return how long a route takes, landing place reached; of a route without a visit, the vehicle's way home."""
    return float(np.cumsum(compute_legs(instance, route)[0])[-1])


def route_energy_pct(instance: Instance, route: Route) -> float:
    """Return what a route uses, c(T), in percent of a full battery."""
    return float(np.cumsum(compute_legs(instance, route)[1])[-1])


def completion_times_s(instance: Instance, route: Route) -> tuple[float, ...]:
    """Return when each visit ends, in seconds from the route's start."""
    return tuple(np.cumsum(compute_legs(instance, route)[0])[:-1].tolist())


def energy_use_pct(instance: Instance, route: Route, visits: int) -> float:
    """Return what a vehicle has spent at the end of the first ``visits`` visits of its route, 0 before the first."""
    return float(np.cumsum(compute_legs(instance, route)[1])[visits - 1]) if visits > 0 else 0.0


def cost_of(instance: Instance, energies_pct: Sequence[float], cost: Cost) -> float:
    """Return the paper's cost of routes that use ``energies_pct``, one for each vehicle."""
    return cost.function.value(energies_pct, [vehicle.budget_pct for vehicle in instance.vehicles])


def evaluate(instance: Instance, plan: Plan, cost: Cost) -> Evaluation:
    """Return all figures of a plan.

    Visits that the instance does not have are violations and count for nothing else.

    Raises:
        PlanError: the plan is for another number of vehicles.
    """
    if len(plan.routes) != len(instance.vehicles):
        raise PlanError(f"the plan has {len(plan.routes)} routes, the instance {len(instance.vehicles)} vehicles")
    known = Plan(tuple(
        Route(route.vehicle, tuple(visit for visit in route.visits if 0 <= segment_of(visit) < instance.segments))
        for route in plan.routes
    ))  # fmt: skip
    durations = tuple(route_duration_s(instance, route) for route in known.routes)
    energies = tuple(route_energy_pct(instance, route) for route in known.routes)
    return Evaluation(
        value=cost_of(instance, energies, cost),
        durations_s=durations,
        energies_pct=energies,
        longest_route_s=max(durations),
        violations=tuple(_find_violations(instance, plan, energies)),
    )


def _find_violations(instance: Instance, plan: Plan, energies_pct: tuple[float, ...]) -> Iterator[str]:
    for vehicle, energy in zip(instance.vehicles, energies_pct, strict=True):
        if budget_excess_pct(energy, vehicle.budget_pct) > 0:
            yield f"{vehicle.name} spends {energy:.3f} % of its budget of {vehicle.budget_pct:.3f} %"
    accounted = {segment_of(visit) for route in plan.routes for visit in route.visits} | set(plan.uncovered)
    for segment in sorted(accounted - set(range(instance.segments))):
        yield f"segment {segment} is not in the instance"
    for segment in sorted(set(range(instance.segments)) - accounted):
        yield f"segment {segment} is neither visited nor named as uncovered"
