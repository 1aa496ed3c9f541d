"""Flights from the side: ground, what the raster is not sure of, the flight, and its level way home."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from executor.analysis.height_profile import HeightProfile
from executor.analysis.pictures.style import INK, LOSS, PAPER, WIDTH_IN, make_white_edge, style_of

PANEL_IN = 2.6
LEGEND_IN = 0.9
GROUND = "#c9bda7"
UNSURE = "#e6ddcd"
MOST_PANELS = 12
"""More vehicles than these are not drawn: the picture would be metres long."""


def draw_profile_figure(profiles: Sequence[HeightProfile]) -> Figure:
    """Return one panel for each flight, with the same heights, metres above sea level over kilometres flown."""
    shown = profiles[:MOST_PANELS]
    height_in = PANEL_IN * max(1, len(shown)) + LEGEND_IN
    figure = Figure(figsize=(WIDTH_IN, height_in), facecolor=PAPER)
    low_m = min((float(np.nanmin(one.ground_m)) for one in shown), default=0.0)
    high_m = max((max(float(one.flown_m.max()), one.return_m) for one in shown), default=1.0)
    for number, one in enumerate(shown):
        bottom = (LEGEND_IN + PANEL_IN * (len(shown) - 1 - number) + 0.45) / height_in
        axes = figure.add_axes((0.07, bottom, 0.9, (PANEL_IN - 0.85) / height_in))
        _draw_profile(axes, one, number)
        axes.set_ylim(low_m - 10.0, high_m + 0.08 * (high_m - low_m) + 5.0)
    handles = [
        Patch(fc=GROUND, label="ground of the raster"), Patch(fc=UNSURE, label="cells around, and its uncertainty"),
        Line2D([], [], color=INK, lw=0.9, ls=":", label="what every leg keeps over them"),
        Line2D([], [], color=INK, lw=2.8, label="inspection"), Line2D([], [], color=INK, lw=1.2, label="transit"),
        Line2D([], [], color=INK, lw=1.0, ls="--", label="RTL, level"),
        Line2D([], [], color=LOSS, marker="v", ls="", label="lowest over the ground"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _draw_profile(axes: Axes, one: HeightProfile, layer: int) -> None:
    colour, along_km = style_of(layer).colour, one.along_m / 1000.0
    bottom_m = float(np.nanmin(one.ground_m)) - 1000.0
    axes.fill_between(along_km, bottom_m, one.most_m, color=UNSURE, lw=0)
    axes.fill_between(along_km, bottom_m, one.ground_m, color=GROUND, lw=0)
    axes.plot(along_km, one.least_m, color=INK, lw=0.9, ls=":")
    axes.plot(along_km, one.flown_m, color=colour, lw=1.2)
    inspected_m = np.where(one.inspecting > 0, one.flown_m, np.nan)
    axes.plot(along_km, inspected_m, color=colour, lw=2.8, solid_capstyle="butt")
    axes.plot(one.waypoints_m[:, 0] / 1000.0, one.waypoints_m[:, 1], ls="", marker=".", ms=3, color=colour)
    axes.axhline(one.return_m, color=colour, lw=1.0, ls="--")
    at_m, up_m, over_m = one.lowest_point
    if not np.isnan(over_m):
        axes.plot(at_m / 1000.0, up_m, ls="", marker="v", ms=7, color=LOSS, zorder=4)
        axes.annotate(
            f"{over_m:.0f} m", (at_m / 1000.0, up_m), xytext=(0, 8), textcoords="offset points", ha="center",
            color=LOSS, fontsize=9, path_effects=make_white_edge(2.0),
        )  # fmt: skip
    axes.set_xlim(0.0, max(float(along_km[-1]), 0.01))
    axes.set_title(one.vehicle, loc="left", fontsize=10, color=colour)
    axes.set_ylabel("m above sea level", fontsize=9)
    axes.set_xlabel("flown (km)", fontsize=9)
    axes.grid(color="#eeeeee", lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
