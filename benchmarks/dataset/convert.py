"""Between the benchmark's files and the planner: instances, plans, and the re-plans behind a window."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.dataset.checker import SOLUTION_FORMAT, Instance
from benchmarks.store import Json
from planner import Instance as PlannerInstance
from planner import (
    Plan,
    Route,
    Travel,
    Vehicle,
    build_instance,
    build_remaining_problem,
    is_reversed,
    segment_of,
    visit_of,
)
from planner.evaluate import RepairStatus
from planner.window import iterate_losses


def build_planner_instance(instance: Instance) -> PlannerInstance:
    """Return the instance as the planner reads it, with equal vehicles that start at the depot."""
    fleet = [
        Vehicle(f"vehicle {number}", instance.depot_m, instance.budget_pct)
        for number in range(1, instance.vehicles + 1)
    ]
    travel = Travel(
        instance.transit_m_s, instance.inspection_m_s, instance.transit_pct_per_s, instance.inspection_pct_per_s
    )
    return build_instance(instance.segments_m, instance.depot_m, fleet, travel)


def build_plan(routes: Sequence[Sequence[int]]) -> Plan:
    """Return the planner's plan of a solution's routes."""
    return Plan(tuple(
        Route(vehicle, tuple(visit_of(abs(visit) - 1, visit < 0) for visit in route))
        for vehicle, route in enumerate(routes)
    ))  # fmt: skip


def name_visits(visits: Sequence[int]) -> list[int]:
    """Return the planner's visits as those of a solution: the number of a segment from 1, negative from b to a."""
    return [(segment_of(visit) + 1) * (-1 if is_reversed(visit) else 1) for visit in visits]


def format_solution(instance: Instance, objective: str, plan: Plan, **more: object) -> Json:
    """Return a solution as JSON; ``more`` says its value, who found it and what proves it."""
    return {
        "format": SOLUTION_FORMAT,
        "instance": instance.name,
        "objective": objective,
        **more,
        "routes": [name_visits(route.visits) for route in plan.routes],
    }


def find_repairs(instance: PlannerInstance, plan: Plan, earliest_s: float) -> list[Json]:
    """Return a re-plan, as JSON, for every loss from ``earliest_s`` on: what the planner's window rests on."""
    repairs = []
    for row in iterate_losses(instance, plan):
        if row.from_s < earliest_s - 1e-6:
            break
        if row.verdict is not RepairStatus.FEASIBLE or row.plan is None:
            raise AssertionError(f"the window begins at {earliest_s}, yet a loss at {row.from_s} has no re-plan")
        left = build_remaining_problem(instance, plan, row.vehicle, row.from_s)
        routes = {
            str(survivor.vehicle + 1): name_visits([left.original_visit(visit) for visit in route.visits])
            for survivor, route in zip(left.survivors, row.plan.routes, strict=True)
        }
        repairs.append({
            "lost": row.vehicle + 1,
            "from_s": round(row.from_s, 6),
            "routes": {number: route for number, route in routes.items() if route},
        })  # fmt: skip
    return repairs
