"""Work units of a table: each makes one plan and its figures, in its own process."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from pathlib import Path

from benchmarks.problems import line_instance, network_of, with_budget
from benchmarks.solvers import run_solver
from benchmarks.store import Json
from benchmarks.table.settings import DRONE, INSPECTION_M_S, TRANSIT_M_S, VEHICLES, TableSettings
from executor.site.site_planning import PlanSolver
from planner import (
    PRESETS,
    Cost,
    Instance,
    Plan,
    ReplanWindow,
    Route,
    evaluate,
    replan_window,
    solve_window,
    stop_rules,
    travel_for,
)
from planner.evaluate import WindowResult
from planner.proofs import bound_earliest_window_s

Routes = tuple[tuple[int, ...], ...]


class TaskKind(StrEnum):
    """Kind of work."""

    PLAN = "plan"
    """A plan by a cost function, and its window if there is a budget."""
    WINDOW = "window"
    """Window of an existing plan."""
    ROBUST = "robust"
    """A plan chosen for its window."""
    PAIRS = "pairs"
    """A plan chosen for its window against one loss or two, and its windows against either."""
    BOUND = "bound"
    """Lower bound of the begin of any plan's window."""


@dataclass(frozen=True, slots=True)
class TableTask:
    """One work unit."""

    kind: TaskKind
    radius_m: float
    tightness: float | None = None
    """None: without a budget."""
    budget_pct: float | None = None
    solver: PlanSolver | None = None
    cost: Cost | None = None
    seed: int = 0
    stretch: float | None = None
    """Allowed extra length of the longest route, relative to that of the best MinMax plan."""
    routes: Routes = ()
    """The plan to evaluate, or an initial one."""
    longest_s: float = 0.0
    """Longest route of the best MinMax plan."""
    losses: int = 1
    """Number of losses that a plan is chosen against."""

    @property
    def key(self) -> str:
        """Unique name within a table."""
        parts: list[object] = [self.kind.value, f"{self.radius_m:g}"]
        parts += [] if self.tightness is None else [f"{self.tightness:g}"]
        parts += [part.value for part in (self.solver, self.cost) if part is not None]
        parts += [self.losses] if self.kind is TaskKind.PAIRS else []
        return "-".join(map(str, [*parts, self.seed if self.stretch is None else f"{self.stretch:.4f}"]))

    def settings(self, table: TableSettings) -> Mapping[str, object]:
        """Return all settings on which the result depends."""
        content: dict[str, object] = {
            "network": table.network.name if table.network is not None else "own",
            "budget_pct": self.budget_pct,
            "routes": self.routes,
            "longest_s": self.longest_s,
            "seed": self.seed,
        }
        if self.kind is TaskKind.PLAN:
            content |= {"seconds": table.seconds, "iterations": table.iterations}
        if self.kind in {TaskKind.ROBUST, TaskKind.PAIRS}:
            content |= {"window_seconds": table.window_seconds, "iterations": table.iterations}
        return content


def do(task: TableTask, table: TableSettings) -> Json:
    """Run a work unit; its figures are recomputed from the definition for every plan."""
    with _use_processor_time():
        return _do(task, table)


@contextmanager
def _use_processor_time() -> Iterator[None]:
    """Count the time limits of searches in processor time, which other programs on the machine do not change."""
    usual, stop_rules.clock_s = stop_rules.clock_s, time.process_time
    try:
        yield
    finally:
        stop_rules.clock_s = usual


def _do(task: TableTask, table: TableSettings) -> Json:
    instance = _instance(table.network, task.radius_m)
    if task.budget_pct is not None:
        instance = with_budget(instance, task.budget_pct)
    match task.kind:
        case TaskKind.PLAN:
            return _plan(task, table, instance)
        case TaskKind.WINDOW:
            return _figures(instance, _plan_of(task.routes))
        case TaskKind.ROBUST:
            return _robust(task, table, instance)
        case TaskKind.PAIRS:
            return _pairs(task, table, instance)
        case TaskKind.BOUND:
            return {"least_earliest_s": bound_earliest_window_s(instance, task.longest_s)}


def _plan(task: TableTask, table: TableSettings, instance: Instance) -> Json:
    if task.solver is None or task.cost is None:
        raise AssertionError(f"{task.key}: a plan is made by a solver, by a cost")
    result = run_solver(task.solver, instance, cost=task.cost, stop=table.stop(), seed=task.seed, all_vehicles=True)
    return {
        "value": result.evaluation.value,
        "seconds": result.seconds,
        "iterations": result.iterations,
        "stopped_by": result.stopped_by,
        **(_figures(instance, result.plan) if task.budget_pct is not None else _lengths(instance, result.plan)),
    }


def _robust(task: TableTask, table: TableSettings, instance: Instance) -> Json:
    result = _choose(task, table, instance)
    return _figures(instance, result.plan, result.window)


def _pairs(task: TableTask, table: TableSettings, instance: Instance) -> Json:
    result = _choose(task, table, instance)
    return {
        "seconds": result.seconds,
        "windows": [_figures(instance, result.plan, replan_window(instance, result.plan, losses=n)) for n in (1, 2)],
    }


def _choose(task: TableTask, table: TableSettings, instance: Instance) -> WindowResult:
    return solve_window(
        instance,
        stretch=task.stretch or 0.0,
        stop=table.window_stop(),
        seed=task.seed,
        all_vehicles=True,
        longest_s=task.longest_s,
        initial=[_plan_of(task.routes)] if task.routes else (),
        losses=task.losses,
    )


def _figures(instance: Instance, plan: Plan, window: ReplanWindow | None = None) -> Json:
    """Return a plan with its figures and its window."""
    window = replan_window(instance, plan) if window is None else window
    return {
        **_lengths(instance, plan),
        "window_pct": window.window_pct,
        "earliest_s": window.earliest_s,
        "certified_earliest_s": window.certified_earliest_s,
    }


def _lengths(instance: Instance, plan: Plan) -> Json:
    evaluation = evaluate(instance, plan, Cost.MINMAX)
    return {
        "routes": [list(route.visits) for route in plan.routes],
        "feasible": not plan.uncovered and not evaluation.violations,
        "longest_pct": evaluation.value,
        "longest_s": evaluation.longest_route_s,
        "total_pct": sum(evaluation.energies_pct),
    }


def _plan_of(routes: Sequence[Sequence[int]]) -> Plan:
    return Plan(tuple(Route(vehicle, tuple(visits)) for vehicle, visits in enumerate(routes)))


@lru_cache(maxsize=8)
def _instance(network: Path | None, radius_m: float) -> Instance:
    travel = travel_for(PRESETS[DRONE], TRANSIT_M_S, INSPECTION_M_S)
    return line_instance(network_of(network, radius_m).ends_m, VEHICLES, travel)
