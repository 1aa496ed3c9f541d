"""A table as a picture: the window over the tightness, one panel for each radius."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.table.cells import Cell
from benchmarks.table.report import COST_NAMES
from executor.analysis.pictures import save_figure
from executor.analysis.pictures.style import COLOURS, FAINT, INK, MARKERS, PAPER, WIDTH_IN

HEIGHT_IN = 3.9
CHOSEN = "chosen for the window"
SHOWN_STRETCHES = {0.05: (0, (1, 1.2)), 0.20: (0, (5, 1.5))}
"""Stretches shown, with their line styles."""


def draw_table(cells: Sequence[Cell], path: Path) -> None:
    """Draw the best window of each cost function over both solvers' plans, and the plans chosen for it."""
    radii = list(dict.fromkeys(cell.radius_m for cell in cells))
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), facecolor=PAPER, layout="constrained")
    panels = figure.subplots(1, len(radii), sharey=True, squeeze=False)[0]
    for axes, radius in zip(panels, radii, strict=True):
        _panel(axes, [cell for cell in cells if cell.radius_m == radius])
    panels[0].set_ylabel("re-plan window, % of the longest route")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=10)
    figure.suptitle("Largest re-plan window found, by cost function", color=INK, fontsize=13, fontweight="bold")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


def _panel(axes: Axes, cells: Sequence[Cell]) -> None:
    tightness = [cell.tightness for cell in cells]
    for number, (cost, name) in enumerate(COST_NAMES.items()):
        windows = [max(one.best.window_pct for one in cell.series if one.cost == cost) for cell in cells]
        axes.plot(tightness, windows, color=COLOURS[number], marker=MARKERS[number], label=name, lw=1.6, ms=6)
    for stretch, style in SHOWN_STRETCHES.items():
        chosen = [one.plan.window_pct for cell in cells for one in cell.windows if one.stretch == stretch]
        label = f"{CHOSEN}, {100 * stretch:g} % over MinMax"
        axes.plot(tightness, chosen, color=COLOURS[4], marker=MARKERS[3], label=label, lw=2.2, ms=6, ls=style)
    axes.set_title(f"{cells[0].radius_m:g} m, {cells[0].segments} segments", fontsize=10, color=INK)
    axes.set_xticks(tightness)
    axes.set_ylim(-3, 103)
    axes.grid(color=FAINT, alpha=0.3, lw=0.6)
    axes.set_xlabel("tightness")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
