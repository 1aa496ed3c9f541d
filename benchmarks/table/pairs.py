"""Windows against any two losses: what they cost, compared with plans chosen against one loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from benchmarks.machine import machine, machine_line
from benchmarks.markdown import figure, markdown_page, markdown_table
from benchmarks.problems import network_of
from benchmarks.progress import ShownProgress
from benchmarks.store import Json, Store, write_result, write_text
from benchmarks.table.cells import PlanFigures
from benchmarks.table.make import Maker, build_frame
from benchmarks.table.settings import DRONE, INSPECTION_M_S, STRETCHES, TRANSIT_M_S, VEHICLES, TableSettings
from benchmarks.table.tasks import TableTask, TaskKind
from executor.site.site_planning import PlanSolver
from planner import Cost

PRICED_STRETCH = 0.05
"""Stretch of the plan chosen against one loss whose t* is to be reached against two."""


@dataclass(frozen=True, slots=True)
class ChosenPlan:
    """A plan chosen for its window against one loss or two, with its windows against either."""

    stretch: float
    losses: int
    seconds: float
    """Processor time of the search."""
    one: PlanFigures
    two: PlanFigures


@dataclass(frozen=True, slots=True)
class PairCell:
    """One radius with one budget."""

    radius_m: float
    segments: int
    tightness: float
    c_max_pct: float
    minmax_s: float
    """The longest route of the best MinMax plan."""
    plans: tuple[ChosenPlan, ...]

    def choose_plan(self, stretch: float, losses: int) -> ChosenPlan:
        """Return the best plan for a number of losses whose longest route is short enough."""
        limit_s = (1.0 + stretch) * self.minmax_s * (1.0 + 1e-9)
        fitting = [plan for plan in self.plans if plan.one.longest_s <= limit_s or plan.stretch <= stretch]
        return min(fitting, key=lambda plan: (plan.one if losses == 1 else plan.two).rank)

    @property
    def price_s(self) -> float | None:
        """The shortest longest route found whose t* against two losses is no later than the priced plan's against one.

        None if no plan reaches it.
        """
        aim_s = self.choose_plan(PRICED_STRETCH, 1).one.earliest_s
        return min((plan.two.longest_s for plan in self.plans if plan.two.earliest_s <= aim_s + 1e-6), default=None)


def make_pairs(settings: TableSettings, out: Path, *, jobs: int, fresh: bool) -> tuple[PairCell, ...]:
    """Measure plans against one loss and two, and write pairs.md and pairs.json.

    Raises:
        BenchError: the directory cannot be written.
        missions.MissionsError: the network cannot be used.
    """
    store = Store(out / "pairs", fresh=fresh)
    with ShownProgress() as shown:
        cells = make_cells(Maker(settings, store, jobs, shown.show_stage))
    about, network = machine(), "own" if settings.network is None else settings.network.name
    content = {
        "machine": about, "settings": {**asdict(settings), "network": network},
        "cells": [asdict(cell) | {"price_s": cell.price_s} for cell in cells],
    }  # fmt: skip
    write_result(out / "pairs.json", content)
    write_text(out / "pairs.md", report_pairs(cells, settings, about))
    return cells


def make_cells(maker: Maker) -> tuple[PairCell, ...]:
    """Return the cells; the search against two losses begins with the plan against one besides its own."""
    table = maker.table
    free = maker.make_all("MinMax without budgets", [
        TableTask(TaskKind.PLAN, radius, solver=PlanSolver.SEARCH, cost=Cost.MINMAX, seed=seed)
        for radius in table.radii_m for seed in range(table.seeds)
    ])  # fmt: skip
    frames = [build_frame(radius, tightness, free) for radius in table.radii_m for tightness in table.tightness]
    single = {
        (frame, stretch): replace(
            frame.task(TaskKind.PAIRS), stretch=stretch, routes=frame.best_routes, longest_s=frame.best_s
        )
        for frame in frames for stretch in STRETCHES
    }  # fmt: skip
    found = maker.make_all("plans against one loss", list(single.values()))
    double = {at: replace(task, losses=2, routes=_routes(found[task]["windows"][0])) for at, task in single.items()}
    found |= maker.make_all("plans against two losses", list(double.values()))
    return tuple(
        PairCell(
            frame.radius_m, len(network_of(table.network, frame.radius_m).segments), frame.tightness,
            frame.budget_pct, frame.best_s,
            tuple(
                _chosen(tasks[frame, stretch], found[tasks[frame, stretch]])
                for tasks in (single, double) for stretch in STRETCHES
            ),
        )
        for frame in frames
    )  # fmt: skip


def _chosen(task: TableTask, result: Json) -> ChosenPlan:
    one, two = (PlanFigures.from_content(content) for content in result["windows"])
    return ChosenPlan(task.stretch or 0.0, task.losses, result["seconds"], one, two)


def _routes(content: Json) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(route) for route in content["routes"])


def report_pairs(cells: Sequence[PairCell], settings: TableSettings, about: Json) -> str:
    """Return the page."""
    each = f"{settings.iterations} iterations" if settings.iterations is not None else (
        f"{settings.window_seconds:g} s of processor time on one core"
    )  # fmt: skip
    return markdown_page(
        "Re-plan windows against two losses",
        f"`faultline bench table --losses 2`: {VEHICLES} vehicles, none kept on the ground, {TRANSIT_M_S:g} m/s in "
        f"transit and {INSPECTION_M_S:g} m/s along the line, energy of the {DRONE}. t* is when a window begins, so "
        "less is better: against one loss, or against any two, one after the other with a re-plan in between, or at "
        "once ([exactly](../explanations/replan-window.md#two-losses)). Each plan was chosen for its window against "
        f"one loss, or against two, in {each}, one seed; the search against two begins with the plan against one "
        "besides its own. Tightness is the best MinMax over the budget of each route, *stretch* how much longer than "
        "that plan's the longest route may be; a plan counts wherever its longest route is short enough. Of those the "
        "one with the earliest t* is taken, of equal t* the one with the shorter longest route. The bound is certain "
        "for that plan.",
        machine_line(about),
        "## The price of a second loss",
        f"The longest route of the plan against one loss, {100 * PRICED_STRETCH:g} % stretch, and the shortest one "
        "found with which any two vehicles may be lost as early.",
        markdown_table(
            ("segments", "tightness", "best MinMax s", "t* s", "against one loss s", "against two s", "over it %"),
            [_price_row(cell) for cell in cells],
        ),
        *(
            part
            for cell in cells
            for part in (
                f"## {cell.segments} segments ({cell.radius_m:g} m), tightness {cell.tightness:.2f}",
                f"C_max {cell.c_max_pct:.1f} %; the best MinMax plan takes {cell.minmax_s:.0f} s.",
                markdown_table(COLUMNS, [_row(cell, stretch) for stretch in STRETCHES]),
            )
        ),
    )


COLUMNS = (
    "stretch %", "against one: longest route s", "its t* for one s", "its t* for two s", "against two: longest route s",
    "its t* for one s", "its t* for two s", "bound for two s", "window for two %",
)  # fmt: skip


def _price_row(cell: PairCell) -> tuple[str, ...]:
    one = cell.choose_plan(PRICED_STRETCH, 1).one
    price_s = cell.price_s
    more = "not found" if price_s is None else figure(100.0 * (price_s / one.longest_s - 1.0), 1)
    return (
        str(cell.segments), f"{cell.tightness:.2f}", figure(cell.minmax_s, 0), figure(one.earliest_s, 0),
        figure(one.longest_s, 0), figure(price_s, 0), more,
    )  # fmt: skip


def _row(cell: PairCell, stretch: float) -> tuple[str, ...]:
    one, two = cell.choose_plan(stretch, 1), cell.choose_plan(stretch, 2)
    return (
        figure(100 * stretch, 0), figure(one.one.longest_s, 0), figure(one.one.earliest_s, 0),
        figure(one.two.earliest_s, 0), figure(two.two.longest_s, 0), figure(two.one.earliest_s, 0),
        figure(two.two.earliest_s, 0), figure(two.two.certified_earliest_s, 0), figure(two.two.window_pct, 1),
    )  # fmt: skip
