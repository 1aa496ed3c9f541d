"""Plans outside of a flight: the first plan of a site, and what a loss would make of a plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from executor import build
from executor.build import Ground
from missions import PlanFile, PlanFileError, Solved, Task, make_plan_file
from planner import Cost, NoImprovement, Plan, Progress, Remainder, Seconds, any_of, remaining, replan, solve

SOLVER = "search"
SETTLED = 50_000
"""Iterations without an improvement after which a first plan is good enough."""


def first_plan(
    ground: Ground,
    *,
    cost: Cost,
    seconds: float,
    seed: int,
    all_vehicles: bool,
    on_progress: Callable[[Progress], None] | None = None,
) -> PlanFile:
    """Plan a whole site."""
    task = build.task_of(ground)
    stop = any_of(Seconds(seconds), NoImprovement(SETTLED))
    result = solve(task.instance, cost=cost, stop=stop, seed=seed, all_vehicles=all_vehicles, on_progress=on_progress)
    solved = Solved(solver=SOLVER, seed=seed, seconds=result.seconds)
    return make_plan_file(ground.network, task, ground.travel, result.plan, cost, solved, inspection=ground.inspection)


def fits(plan: PlanFile, ground: Ground, source: str) -> None:
    """Check that a plan file is one for a site.

    Raises:
        PlanFileError: it has other vehicles, or other segments.
    """
    names = tuple(vehicle.name for vehicle in plan.vehicles)
    if names != ground.names:
        raise PlanFileError(f"{source}: vehicles: expected {', '.join(ground.names)}, got {', '.join(names)}")
    if len(plan.segments) != len(ground.network.segments):
        raise PlanFileError(
            f"{source}: segments: expected the site's {len(ground.network.segments)}, got {len(plan.segments)}"
        )


@dataclass(frozen=True, slots=True)
class WhatIf:
    """What a loss makes of a plan."""

    left: Remainder
    plan: PlanFile
    feasible: bool


def after_loss(plan: PlanFile, lost: str, at_s: float, *, cost: Cost, seconds: float, seed: int) -> WhatIf:
    """Re-plan a plan file for the loss of one vehicle at a time.

    Raises:
        PlanFileError: the plan has no such vehicle.
        planner.PlanError: nobody is left.
    """
    names = [vehicle.name for vehicle in plan.vehicles]
    if lost not in names:
        raise PlanFileError(f"{plan.source}: --lost: expected one of {', '.join(names)}, got {lost}")
    task = plan.task()
    left = remaining(task.instance, plan.plan, names.index(lost), at_s)
    stop = any_of(Seconds(seconds), NoImprovement(SETTLED))
    result = replan(left.instance, warm=left.warm, cost=cost, stop=stop, seed=seed)
    reduced = Task(left.instance, left.open_segments)
    solved = Solved(solver=SOLVER, seed=seed, seconds=result.seconds)
    content = make_plan_file(
        plan.network(), reduced, plan.travel, result.plan, cost, solved, inspection=plan.inspection
    )
    return WhatIf(left, content, result.feasible)


def segment_ids(plan: PlanFile, content: Plan) -> list[int]:
    """Return the ids of the segments that a plan over the file's segments leaves out."""
    return [plan.segments[number].id for number in content.uncovered]
