"""A sheet of maps: panels of one scale side by side or above each other, a title, and a legend below all of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle

from executor.analysis.flight_record import Place
from executor.analysis.pictures.style import FAINT, INK, LOSS, PAPER, WIDTH_IN, make_white_edge
from missions.areas import Area, AreaKind
from missions.geo import FloatArray

MARGIN_IN = 0.15
TITLE_IN = 0.5
PANEL_TITLE_IN = 0.3
LEGEND_ROW_IN = 0.21
LEGEND_COLUMNS = 5
STRIP_IN = 0.45
"""Below the map of each panel, for scale and north: they cover nothing."""
HEIGHTS_IN = (3.0, 8.0)
"""The least and the greatest height of a panel's map."""
WIDE = 2.2
"""Maps wider than so many times their height are put above each other."""
ROOM = 0.07
"""Around what is drawn, for words."""


@dataclass(frozen=True, slots=True, eq=False)
class MapSheet:
    """The figure and its panels, with the scale that they share."""

    figure: Figure
    panels: tuple[Axes, ...]
    m_per_in: float
    low_m: Place
    """South-western corner of what may hold words; the strip for the scale lies below."""
    high_m: Place
    busy: bool = False
    """Whether the ground is drawn below: what is over it needs an edge."""


def make_sheet(shown_m: FloatArray, title: str, panels: Sequence[str], legend_entries: int) -> MapSheet:
    """Return empty panels that show (n, 2) places, with room for a legend of so many entries."""
    low, high = shown_m.min(axis=0), shown_m.max(axis=0)
    # A line due east has no height of its own.
    size = np.maximum(high - low, 0.25 * float(max(high - low)) + 1.0)
    middle = (low + high) / 2.0
    size *= 1.0 + 2.0 * ROOM
    beside = len(panels) if size[0] < WIDE * size[1] else 1
    rows = math.ceil(len(panels) / beside)
    width_in = (WIDTH_IN - MARGIN_IN * (beside + 1)) / beside
    height_in = min(max(width_in * size[1] / size[0], HEIGHTS_IN[0]), HEIGHTS_IN[1])
    m_per_in = float(max(size[0] / width_in, size[1] / height_in))
    half = m_per_in * np.array([width_in, height_in]) / 2.0
    low, high = middle - half, middle + half

    legend_in = LEGEND_ROW_IN * math.ceil(legend_entries / LEGEND_COLUMNS) + MARGIN_IN
    row_in = PANEL_TITLE_IN + height_in + STRIP_IN + MARGIN_IN
    total_in = TITLE_IN + rows * row_in + legend_in
    figure = Figure(figsize=(WIDTH_IN, total_in), facecolor=PAPER)
    figure.text(
        MARGIN_IN / WIDTH_IN, 1.0 - 0.3 / total_in, title, fontsize=14, fontweight="bold", color=INK, va="center"
    )
    made = []
    for index, name in enumerate(panels):
        row, column = divmod(index, beside)
        left_in = MARGIN_IN + column * (width_in + MARGIN_IN)
        bottom_in = total_in - TITLE_IN - row * row_in - PANEL_TITLE_IN - height_in - STRIP_IN
        axes = figure.add_axes(
            (left_in / WIDTH_IN, bottom_in / total_in, width_in / WIDTH_IN, (height_in + STRIP_IN) / total_in)
        )
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1] - STRIP_IN * m_per_in, high[1])
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set_color("#cccccc")
        axes.set_title(name, loc="left", fontsize=11, color=INK)
        _draw_scale_and_north(axes, m_per_in)
        made.append(axes)
    return MapSheet(figure, tuple(made), m_per_in, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def draw_legend(sheet: MapSheet, handles: Sequence[Artist]) -> None:
    """Explain all panels at the bottom of the sheet."""
    sheet.figure.legend(
        handles=list(handles),
        loc="lower center",
        ncols=LEGEND_COLUMNS,
        frameon=False,
        fontsize=9,
        borderaxespad=0.3,
        handlelength=3.2,
        columnspacing=1.6,
    )


def draw_ground(axes: Axes, ends_m: FloatArray, pads_m: Sequence[Place]) -> None:
    """Draw the (n, 2, 2) segments thin and grey with their pylons as dots, the depot and the pads."""
    axes.add_collection(LineCollection(list(ends_m), colors=FAINT, linewidths=0.9, zorder=1), autolim=False)
    pylons = np.unique(np.round(ends_m.reshape(-1, 2), 2), axis=0)
    axes.plot(pylons[:, 0], pylons[:, 1], ls="", marker="o", ms=2.6, color="#555555", zorder=6)
    if pads_m:
        east, north = zip(*pads_m, strict=True)
        axes.plot(east, north, ls="", marker="s", ms=4.5, mfc=PAPER, mec=INK, mew=0.9, zorder=7)
    axes.plot([0.0], [0.0], ls="", marker="*", ms=13, mfc=INK, mec=PAPER, mew=0.8, zorder=8)


def draw_areas(axes: Axes, areas: Iterable[Area]) -> None:
    """Draw areas hatched, those with a height limit pale, with their names."""
    for area in areas:
        limited = area.kind is AreaKind.HEIGHT_LIMIT
        hatch, alpha = ("", 0.08) if limited else ("///", 0.16)
        for ring in area.polygons_m():
            axes.add_patch(Polygon(ring, facecolor=LOSS, edgecolor="none", alpha=alpha, zorder=0))
            axes.add_patch(
                Polygon(ring, fill=False, edgecolor=LOSS, lw=0.8, ls="--" if limited else "-", hatch=hatch, alpha=0.45,
                        zorder=0.5)
            )  # fmt: skip
        (west, south), (east, north) = np.min(area.edges_m(), axis=(0, 1)), np.max(area.edges_m(), axis=(0, 1))
        axes.text((west + east) / 2, (south + north) / 2, area.name, fontsize=8, color=LOSS, ha="center", va="center",
                  clip_on=True, path_effects=make_white_edge(2.0), zorder=7)  # fmt: skip


def build_area_handles(areas: Sequence[Area]) -> list[Artist]:
    """Return what explains areas; nothing where there are none."""
    if not areas:
        return []
    return [Patch(facecolor=LOSS, alpha=0.3, hatch="///", label="areas that flights keep out of")]


def _draw_scale_and_north(axes: Axes, m_per_in: float) -> None:
    west, _ = axes.get_xlim()
    _, east = axes.get_xlim()
    south, _ = axes.get_ylim()
    length_m = round_length_m(1.3 * m_per_in)
    left, base = west + 0.2 * m_per_in, south + 0.2 * m_per_in
    thick = 0.05 * m_per_in
    # Two halves, dark and light, so that half of the length can be read too.
    for begin, colour in ((left, INK), (left + length_m / 2.0, PAPER)):
        box = Rectangle((begin, base), length_m / 2.0, thick, facecolor=colour, edgecolor=INK, linewidth=0.8, zorder=9)
        axes.add_patch(box)
    words = f"{length_m:g} m" if length_m < 1000 else f"{length_m / 1000:g} km"
    axes.text(left + length_m + 0.1 * m_per_in, base + thick / 2, words, fontsize=9, color=INK, va="center")
    x = east - 0.25 * m_per_in
    axes.annotate(
        "",
        xy=(x, south + 0.45 * m_per_in),
        xytext=(x, south + 0.1 * m_per_in),
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=9,
    )
    axes.text(x - 0.1 * m_per_in, south + 0.25 * m_per_in, "N", fontsize=10, color=INK, ha="right", va="center",
              path_effects=make_white_edge(2.0))  # fmt: skip


def round_length_m(most_m: float) -> float:
    """Return the longest of 1, 2, 5, 10, 20, 50 ... metres that is no longer than a length.

    >>> round_length_m(487.0)
    200.0
    """
    power = 10.0 ** math.floor(math.log10(most_m))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most_m)
