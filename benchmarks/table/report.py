"""A table as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchmarks.data import PAPER, PaperRow
from benchmarks.machine import machine_line
from benchmarks.markdown import figure, markdown_page, markdown_table
from benchmarks.store import Json
from benchmarks.table.cells import LEAVES, Cell, PlanFigures, Series, Stretched, summary_of
from benchmarks.table.settings import DRONE, INSPECTION_M_S, SOLVERS, TRANSIT_M_S, VEHICLES, TableSettings

COST_NAMES = {"minmax": "MinMax", "minsum": "c-MinSum", "mincomb": "MinComb"}
OWN = "faultline's own network"


def report(cells: Sequence[Cell], settings: TableSettings, machine: Json, picture: str) -> str:
    """Return the page of a table."""
    radii = list(dict.fromkeys(cell.radius_m for cell in cells))
    return markdown_page(
        "Re-plan windows",
        _preamble(settings),
        machine_line(machine),
        "## In short",
        "\n".join(_summarize_solver(cells, solver.value) for solver in SOLVERS),
        f"![Windows by tightness, one panel for each radius]({picture})",
        *(
            part
            for solver in SOLVERS
            for part in (
                f"## Plans chosen for their window against the best MinComb plan of {solver.value}",
                _gains(cells, solver.value),
            )
        ),
        *[_radius(settings, [cell for cell in cells if cell.radius_m == radius]) for radius in radii],
    )


def _preamble(settings: TableSettings) -> str:
    name = OWN if settings.network is None else settings.network.name
    each = f"{settings.iterations} iterations" if settings.iterations is not None else f"{settings.seconds:g} s"
    window = each if settings.iterations is not None else f"{settings.window_seconds:g} s"
    return (
        f"Network: {name}; {VEHICLES} vehicles, none kept on the ground; the paper's model with {TRANSIT_M_S:g} m/s in "
        f"transit and {INSPECTION_M_S:g} m/s along the line, energy by the pen-and-paper model of the {DRONE}. "
        "The window is the share of the longest route's time in which the fleet can absorb any one loss: a re-plan was "
        "found and checked; t* is when it begins, so less is better. Tightness is the best MinMax found by anybody "
        "over C_max: the budget of each route is C_max.\n\n"
        f"Each plan by a cost function had {each} of processor time on one core, {settings.seeds} seeds each. GRASP is "
        "the paper's solver, of at most 50 runs, stopped by the same limit; search is faultline's own. "
        f"A plan chosen for its window (`window`) had {window}, one seed. *Stretch* is how much longer than the best "
        "MinMax plan's its longest route may be; a plan counts at every stretch that its longest route is short enough "
        "for. Of those the one with the earliest t* is taken, of equal t* the one with the shorter longest route: none "
        "of them with a longest route as short has an earlier t*, or a larger window in percent. A plan with a longer "
        "route may have the later t* and still the larger percentage; *at equal length* therefore gives the window as "
        "a share of the MinComb plan's longest route, and *dominates* names the plan of which neither t* nor the "
        "longest route is worse, and one is better. At the stretch of a solver's best MinComb plan the search begins "
        "with that plan besides its own. Bounds are certain: no window of that plan, or of any "
        "plan, begins before them."
    )


def _summarize_solver(cells: Sequence[Cell], solver: str) -> str:
    summary = summary_of(cells, solver)
    mean = "there is no such cell."
    if summary.mean_reduction is not None:
        mean = f"t* is {100 * summary.mean_reduction:.1f} % less on average (cells of that kind: {summary.open})"
    return (
        f"- At the stretch that the best MinComb plan of {solver} takes (by its window, over all seeds), the plan "
        f"chosen for its window has the earlier t* in {summary.earlier} of {summary.cells} cells. It dominates the "
        f"MinComb plan in {summary.dominates}, and is dominated in {summary.dominated}: neither t* nor the longest "
        f"route is worse, and one is better. Where the bound leaves {100 * LEAVES:.0f} % of "
        f"t* or more to gain: {mean}. Cells in which nothing is left to gain, for the best MinComb plan is as good as "
        f"the bound allows: {summary.settled} of {summary.cells}."
    )


def _gains(cells: Sequence[Cell], solver: str) -> str:
    compared = [(cell, cell.versus(solver)) for cell in cells]
    rows = [
        (
            f"{cell.radius_m:g}",
            f"{cell.tightness:.2f}",
            _pct(100 * one.chosen.stretch),
            _pct(one.mincomb.window_pct),
            _pct(one.chosen.plan.window_pct),
            _pct(one.window_pct),
            figure(one.mincomb.earliest_s, 0),
            figure(one.chosen.plan.earliest_s, 0),
            figure(one.least_earliest_s, 0),
            _pct(100 * one.reduction),
            _pct(100 * one.most_reduction),
            one.dominating,
        )
        for cell, one in compared
    ]
    columns = ("D_max m", "tightness", "stretch %", "MinComb %", "window %", "at equal length %", "MinComb t* s",
               "window t* s", "bound s", "t* less by %", "at most %", "dominates")  # fmt: skip
    return markdown_table(columns, rows)


def _radius(settings: TableSettings, cells: Sequence[Cell]) -> str:
    first = cells[0]
    parts = [
        f"## {first.radius_m:g} m, {first.segments} segments",
        f"The best MinMax plan takes {first.minmax_s:.0f} s and {first.c_max_pct * first.tightness:.1f} %.",
        "Windows in percent, best (mean) of the seeds:",
        _render_series(cells, lambda series: f"{_pct(series.best.window_pct)} ({_pct(series.mean_window_pct)})"),
        "t* in seconds, best (mean) of the seeds:",
        _render_series(cells, lambda series: f"{series.best_earliest_s:.0f} ({series.mean_earliest_s:.0f})"),
        "Chosen for the window, at each stretch: window in percent; t* in seconds with this plan's own bound:",
        _render_stretches(cells),
    ]
    row = next((row for row in PAPER if row.radius_m == first.radius_m), None)
    if settings.network is not None and row is not None:
        parts.append(_paper(row, first))
    return "\n\n".join(parts)


def _render_series(cells: Sequence[Cell], shown: Callable[[Series], str]) -> str:
    columns = ["tightness", "C_max %", *(f"{COST_NAMES[one.cost]}, {one.solver}" for one in cells[0].series)]
    rows = [
        [f"{cell.tightness:.2f}", _pct(cell.c_max_pct), *(shown(series) for series in cell.series)] for cell in cells
    ]
    return markdown_table(columns, rows)


def _render_stretches(cells: Sequence[Cell]) -> str:
    fixed = [f"stretch {100 * one.stretch:g} %" for one in cells[0].windows]
    rows = [
        [
            f"{cell.tightness:.2f}",
            *(_window(one.plan) for one in cell.windows),
            *(_format_stretch(one.chosen) for one in cell.against),
            f"{cell.least_earliest_s:.0f}",
        ]
        for cell in cells
    ]
    taken = (f"MinComb's stretch, {one.solver}" for one in cells[0].against)
    return markdown_table(["tightness", *fixed, *taken, "bound for any plan s"], rows)


def _window(plan: PlanFigures) -> str:
    return f"{_pct(plan.window_pct)}; {plan.earliest_s:.0f} (>= {plan.certified_earliest_s:.0f})"


def _format_stretch(one: Stretched) -> str:
    return f"{100 * one.stretch:.1f} %: {_window(one.plan)}"


def _paper(row: PaperRow, cell: Cell) -> str:
    return (
        f"The paper prints {row.minmax:g} / {row.minsum:g} / {row.mincomb:g} % for MinMax / c-MinSum / MinComb with "
        f"{row.segments} segments and C_max {row.c_max_pct:g} %. Its C_max cannot be compared with those here: the "
        f"paper does not print its energy parameters, and the public file of its network holds {cell.segments} "
        f"segments within this radius, {cell.segments - row.segments} more."
    )


def _pct(value: float) -> str:
    return figure(value, 1)
