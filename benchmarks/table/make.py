"""Make a table: stage by stage, the pieces of a stage on all cores, each stored as soon as it exists."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass

from benchmarks.problems import network_of
from benchmarks.store import Json, Store
from benchmarks.table.cells import NEAR_S, Against, Cell, PlanFigures, Series, Stretched, best_mincomb
from benchmarks.table.settings import COSTS, SOLVERS, STRETCHES, TableSettings
from benchmarks.table.tasks import Routes, TableTask, TaskKind, do
from executor.adapters.interrupts import start_worker_pool
from executor.site.site_planning import PlanSolver
from planner import Cost, warm_up

Results = dict[TableTask, Json]
Told = Callable[[str, int, int], None]
"""Called with the stage, its finished pieces, and their total."""


@dataclass(frozen=True, slots=True)
class Maker:
    """Run a table's unfinished tasks."""

    table: TableSettings
    store: Store
    jobs: int
    told: Told

    def make_all(self, stage: str, tasks: Sequence[TableTask]) -> Results:
        """Return the results of all tasks: existing ones, and those made now."""
        found = {task: self.store.find_result(task.key, task.settings(self.table)) for task in tasks}
        results = {task: result for task, result in found.items() if result is not None}
        self.told(stage, len(results), len(tasks))
        for task, result in self._make_each([task for task in tasks if task not in results]):
            results[task] = self.store.keep(task.key, task.settings(self.table), result)
            self.told(stage, len(results), len(tasks))
        return {task: results[task] for task in tasks}

    def _make_each(self, tasks: Sequence[TableTask]) -> Iterator[tuple[TableTask, Json]]:
        if self.jobs == 1 or len(tasks) < 2:
            for task in tasks:
                yield task, do(task, self.table)
            return
        warm_up()  # so that the processes find compiled kernels
        pool = start_worker_pool(self.jobs)
        try:
            futures = {pool.submit(do, task, self.table): task for task in tasks}
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def make(maker: Maker) -> tuple[Cell, ...]:
    """Return all cells of a table."""
    table = maker.table
    free = maker.make_all("MinMax without budgets", [
        TableTask(TaskKind.PLAN, radius, solver=solver, cost=Cost.MINMAX, seed=seed)
        for radius in table.radii_m for solver in SOLVERS for seed in range(table.seeds)
    ])  # fmt: skip
    frames = [build_frame(radius, tightness, free) for radius in table.radii_m for tightness in table.tightness]
    plans = maker.make_all(
        "plans and their windows", [task for frame in frames for task in _plan_tasks(frame, free, table)]
    )
    bounds = maker.make_all("bounds", [frame.task(TaskKind.BOUND) for frame in frames])
    series = {frame: _series(frame, plans) for frame in frames}
    chosen = maker.make_all("plans chosen for their window", [
        *(_robust_task(frame, stretch, frame.best_routes) for frame in frames for stretch in STRETCHES),
        *(
            _robust_task(frame, _best_stretch(frame, series[frame], solver), _mincomb_routes(frame, plans, solver))
            for frame in frames for solver in SOLVERS
        ),
    ])  # fmt: skip
    return tuple(
        _cell(frame, table, series[frame], chosen, bounds[frame.task(TaskKind.BOUND)]["least_earliest_s"])
        for frame in frames
    )


@dataclass(frozen=True, slots=True)
class Frame:
    """A cell without results."""

    radius_m: float
    tightness: float
    budget_pct: float
    best_routes: Routes
    """Routes of the best MinMax plan of any solver."""
    best_s: float

    def task(self, kind: TaskKind) -> TableTask:
        """Return a task of this cell."""
        return TableTask(kind, self.radius_m, self.tightness, self.budget_pct, longest_s=self.best_s)


def build_frame(radius_m: float, tightness: float, free: Results) -> Frame:
    """Return a cell's budget, from the best of the MinMax plans without budgets."""
    of_radius = [result for task, result in free.items() if task.radius_m == radius_m]
    best = min(of_radius, key=lambda result: float(result["longest_pct"]))
    return Frame(radius_m, tightness, best["longest_pct"] / tightness, _routes(best), best["longest_s"])


def _plan_tasks(frame: Frame, free: Results, table: TableSettings) -> Iterator[TableTask]:
    """Yield the plans of a cell; a MinMax plan does not depend on the budget, its window does."""
    radius, tightness, budget = frame.radius_m, frame.tightness, frame.budget_pct
    for task, result in free.items():
        if task.radius_m == radius:
            yield TableTask(
                TaskKind.WINDOW, radius, tightness, budget, task.solver, task.cost, task.seed, routes=_routes(result)
            )
    for solver in SOLVERS:
        for cost in COSTS[1:]:
            for seed in range(table.seeds):
                yield TableTask(TaskKind.PLAN, radius, tightness, budget, solver, cost, seed)


def _robust_task(frame: Frame, stretch: float, initial: Routes) -> TableTask:
    return TableTask(
        TaskKind.ROBUST, frame.radius_m, frame.tightness, frame.budget_pct,
        stretch=stretch, routes=initial, longest_s=frame.best_s,
    )  # fmt: skip


def _mincomb_routes(frame: Frame, plans: Results, solver: PlanSolver) -> Routes:
    """Return the routes of a solver's best MinComb plan."""
    wanted = (frame.radius_m, frame.tightness, Cost.MINCOMB, solver)
    results = [
        result for task, result in plans.items() if (task.radius_m, task.tightness, task.cost, task.solver) == wanted
    ]
    return _routes(max(results, key=lambda result: (result["window_pct"], -float(result["earliest_s"]))))


def _series(frame: Frame, plans: Results) -> tuple[Series, ...]:
    def of(solver: PlanSolver, cost: Cost) -> tuple[PlanFigures, ...]:
        wanted = (frame.radius_m, frame.tightness, solver, cost)
        return tuple(
            PlanFigures.from_content(result)
            for task, result in plans.items()
            if (task.radius_m, task.tightness, task.solver, task.cost) == wanted
        )

    return tuple(Series(solver.value, cost.value, of(solver, cost)) for solver in SOLVERS for cost in COSTS)


def _best_stretch(frame: Frame, series: Sequence[Series], solver: PlanSolver) -> float:
    """Return the stretch of a solver's best MinComb plan; one shorter than MinMax has none."""
    longest_s = best_mincomb(series, solver.value).longest_s
    return max(0.0, longest_s / frame.best_s - 1.0)


def _cell(
    frame: Frame, table: TableSettings, series: tuple[Series, ...], chosen: Results, least_earliest_s: float
) -> Cell:
    def at(stretch: float) -> Stretched:
        # A plan counts wherever its longest route is short enough, at whatever stretch it was found.
        fitting = (
            PlanFigures.from_content(result)
            for task, result in chosen.items()
            if (task.radius_m, task.tightness) == (frame.radius_m, frame.tightness)
            and ((task.stretch or 0.0) <= stretch or result["longest_s"] <= (1.0 + stretch) * frame.best_s + NEAR_S)
        )
        return Stretched(stretch, min(fitting, key=lambda plan: plan.rank))

    return Cell(
        radius_m=frame.radius_m,
        segments=len(network_of(table.network, frame.radius_m).segments),
        tightness=frame.tightness,
        c_max_pct=frame.budget_pct,
        minmax_s=frame.best_s,
        series=series,
        windows=tuple(at(stretch) for stretch in STRETCHES),
        against=tuple(
            Against(
                solver.value,
                best_mincomb(series, solver.value),
                at(_best_stretch(frame, series, solver)),
                least_earliest_s,
            )
            for solver in SOLVERS
        ),
        least_earliest_s=least_earliest_s,
    )


def _routes(result: Json) -> Routes:
    return tuple(tuple(route) for route in result["routes"])
