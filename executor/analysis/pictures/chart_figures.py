"""Draw plans as charts: trade-offs, probability of finishing, a day's schedule, and height profiles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MultipleLocator

from executor.analysis.height_profile import HeightProfile, build_profiles
from executor.analysis.pictures import style
from executor.analysis.pictures.battery_figure import LineEnd, label_lines
from executor.analysis.pictures.map_sheet import LabelPlacer
from executor.site.campaigns import describe_policy
from executor.site.plan_summary import format_day_time
from executor.site.site_model import build_paths
from missions import DayPlanFile, FlightSetup, PlanFile
from planner import RiskEstimate

FRONT_HEIGHT_IN = 7.2
FRONT_PLOT = (0.07, 0.095, 0.79, 0.79)
FRONT_BAR = (0.885, 0.095, 0.018, 0.79)
FRONT_COLOURS = "viridis"
"""Perceptually uniform, so that it works in grey and for the colour-blind."""
MARKERS = ("X", "s", "^", "D", "v", "P")
"""Markers of the plans to compare with; plans of the front are round."""
DOT_PT = (-6.0, 0.0, 6.0)
"""Offsets around a point that its number must not cover."""


def draw_front_figure(front: Sequence[PlanFile], references: Mapping[str, PlanFile]) -> Figure:
    """Return earliest loss over longest route, coloured by energy; numbered from 1 in the order given."""
    figure = style.make_figure(
        FRONT_HEIGHT_IN, "Plans that no other one beats in all three",
        "left: sooner done; below: losses may come earlier; dark: less energy",
    )  # fmt: skip
    axes, bar = figure.add_axes(FRONT_PLOT), figure.add_axes(FRONT_BAR)
    plans = (*front, *references.values())
    points = [(max(one.durations_s), 0.0 if one.window is None else one.window.earliest_s) for one in plans]
    energies = [sum(one.energies_pct) for one in plans]
    scale = Normalize(min(energies), max(*energies, min(energies) + 0.1))
    shade = colormaps[FRONT_COLOURS]
    axes.margins(0.1)
    axes.grid(color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    markers = [MARKERS[number % len(MARKERS)] for number in range(len(references))]
    for number, (point, energy_pct) in enumerate(zip(points, energies, strict=True)):
        compared = number - len(front)
        look = ("o", 10, 0.8, 3) if compared < 0 else (markers[compared], 13, 1.6, 2)
        marker, size_pt, edge_pt, above = look
        axes.plot(*point, ls="", marker=marker, ms=size_pt, mfc=shade(scale(energy_pct)), mec=style.INK, mew=edge_pt,
                  zorder=above)  # fmt: skip
    axes.set_xlabel("longest route (s)")
    axes.set_ylabel("earliest time at which the fleet can absorb any one loss (s)")
    colours = figure.colorbar(ScalarMappable(scale, shade), cax=bar)
    colours.set_label("energy of all routes (% of a battery)")
    handles = [
        Line2D([], [], ls="", marker=marker, ms=9, mfc=style.PAPER, mec=style.INK, mew=1.4, label=name)
        for name, marker in zip(references, markers, strict=True)
    ]
    figure.legend(
        handles=handles, loc="upper right", ncols=max(1, len(handles)), frameon=False, fontsize=9.5,
        bbox_to_anchor=(FRONT_PLOT[0] + FRONT_PLOT[2], 0.955), borderaxespad=0.0,
    )  # fmt: skip
    _number_plans(figure, axes, points, len(front))
    return figure


def _number_plans(figure: Figure, axes: Axes, points: Sequence[tuple[float, float]], count: int) -> None:
    """Write the numbers of the first `count` points next to them, on no other point or number where there is room."""
    figure.draw_without_rendering()
    pt_per_px = 72.0 / figure.dpi
    dots, around = axes.transData.transform(points) * pt_per_px, np.stack(np.meshgrid(DOT_PT, DOT_PT), axis=-1)
    corners = axes.get_window_extent().get_points() * pt_per_px
    placer = LabelPlacer((dots[:, np.newaxis] + around.reshape(-1, 2)).reshape(-1, 2), *corners)
    for number, (point, dot) in enumerate(zip(points[:count], dots, strict=False), start=1):
        _, middle = placer.place_label(dot[np.newaxis], (9.0 * len(str(number)), 12.0))
        axes.annotate(
            str(number), xy=point, xytext=(middle[0], middle[1]), textcoords="figure points", ha="center", va="center",
            fontsize=10, color=style.INK, path_effects=style.make_white_edge(2.5), zorder=6,
            arrowprops={"arrowstyle": "-", "color": style.FAINT, "linewidth": 0.8, "shrinkA": 1, "shrinkB": 6},
        )  # fmt: skip


RISK_HEIGHT_IN = 6.6
RISK_PLOT = (0.065, 0.11, 0.665, 0.78)
"""Left, bottom, width and height as shares of the figure; curve names stand to its right."""
CURVE_LABEL_STEP = 0.066
"""Least distance between two names of two lines, as a share of the figure's height."""


def draw_risk_figure(swept: Sequence[RiskEstimate], given: RiskEstimate) -> Figure:
    """Return the probability of inspecting everything, one curve for each number of re-plans.

    Args:
        swept: Results in ascending order of their mean time between failures.
        given: Result for the requested time, from more flights; it is marked, and its figures are next to the curves.
    """
    below = f"curves: {swept[0].flights} flights a point; bands: 95 % confidence"
    figure = style.make_figure(RISK_HEIGHT_IN, "Chance that everything is inspected", below)
    axes = figure.add_axes(RISK_PLOT)
    hours = [risk.mtbf_h for risk in swept]
    axes.set_xscale("log")
    axes.set_xlim(hours[0], hours[-1])
    lowest = min(100 * chance.low for risk in swept for chance in risk.finished)
    floor = max(0.0, 10.0 * math.floor(lowest / 10.0 - 0.3))
    axes.set_ylim(floor, 100.0 + 0.03 * (100.0 - floor))
    axes.set_xticks(hours, [f"{value:g}" for value in hours])
    axes.minorticks_off()
    axes.grid(color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    axes.axvline(given.mtbf_h, color=style.FAINT, lw=1.2, zorder=1)
    for replans in range(len(given.finished)):
        look = style.style_of(replans)
        curve = [risk.finished[replans] for risk in swept]
        axes.fill_between(
            hours, [100 * one.low for one in curve], [100 * one.high for one in curve],
            color=look.colour, alpha=0.2, lw=0, zorder=2,
        )  # fmt: skip
        axes.plot(
            hours, [100 * one.estimate for one in curve], color=look.colour, lw=2.0, marker=look.marker, ms=6.5,
            mec=style.PAPER, mew=0.8, ls="-" if replans == 0 else look.dashes, zorder=3 + replans, clip_on=False,
        )  # fmt: skip
        axes.plot(
            given.mtbf_h, 100 * given.finished[replans].estimate, color=look.colour, marker=look.marker, ms=10.5,
            mec=style.INK, mew=1.4, ls="", zorder=10,
        )  # fmt: skip
    ends = [
        LineEnd(
            hours[-1], 100 * last.estimate,
            f"{describe_policy(replans)}\n{100 * chance.estimate:.2f} % at {given.mtbf_h:g} h "
            f"({100 * chance.low:.2f} to {100 * chance.high:.2f} %)", style.style_of(replans).colour,
        )
        for replans, (last, chance) in enumerate(zip(swept[-1].finished, given.finished, strict=True))
    ]  # fmt: skip
    label_lines(axes, ends, CURVE_LABEL_STEP)
    axes.set_xlabel("mean time between failures of one vehicle (flight hours)")
    axes.set_ylabel("everything inspected (% of flights)")
    axes.annotate(
        f"requested: {given.mtbf_h:g} h", xy=(given.mtbf_h, 0.0), xycoords=("data", "axes fraction"), xytext=(6.0, 6.0),
        textcoords="offset points", fontsize=9.5, color=style.INK, path_effects=style.make_white_edge(2.0),
    )  # fmt: skip
    return figure


HOUR_S = 3600.0
ROW_IN = 0.3
HEAD_IN = 0.75
FOOT_IN = 0.6
GAP_IN = 0.55
MOST_DAYS = 12
"""Most days in a picture; it names how many it leaves out."""
NARROW_S = 600.0
"""Shortest sortie with room for a label."""


def draw_gantt_figure(content: DayPlanFile) -> Figure:
    """Return the schedule of a plan's days, those with sorties."""
    flown = [day for day in range(len(content.days)) if content.routes_on(day)]
    shown = flown[:MOST_DAYS] or [0]
    panel_in = ROW_IN * (len(content.vehicles) + 1)
    total_in = HEAD_IN + len(shown) * (panel_in + GAP_IN) + FOOT_IN
    count, hours = len(content.routes), content.flight_s / HOUR_S
    more = f", the first {MOST_DAYS} of {len(flown)} days" if len(flown) > MOST_DAYS else ""
    title = f"{count} sorties, {hours:.1f} h in the air, {len(flown)} days{more}"
    figure = style.make_figure(total_in, title)
    for place, day in enumerate(shown):
        top_in = total_in - HEAD_IN - place * (panel_in + GAP_IN)
        axes = figure.add_axes((0.09, (top_in - panel_in) / total_in, 0.89, panel_in / total_in))
        _draw_day(axes, content, day)
    handles = [Patch(color=_colour_of(number), label=base.name) for number, base in enumerate(content.bases)]
    figure.legend(handles=handles, loc="lower center", ncols=8, frameon=False, fontsize=9,
                  title="take-off from")  # fmt: skip
    return figure


def _draw_day(axes: Axes, content: DayPlanFile, day: int) -> None:
    begin, end = content.days[day]
    for row, vehicle in enumerate(content.vehicles):
        closed, at = [], begin
        for opens, closes in vehicle.hours:
            if begin <= opens < end:
                closed.append((at, opens - at))
                at = closes
        closed.append((at, end - at))
        axes.broken_barh([(start, long) for start, long in closed if long > 0], (row - 0.5, 1.0), color="#eeeeee", lw=0)
        for one in content.routes_on(day):
            if one.vehicle == vehicle.name:
                lasts_s, colour = one.duration_s, _colour_of(content.base_names.index(one.base))
                axes.broken_barh([(one.start_s, lasts_s)], (row - 0.36, 0.72), color=colour, ec=style.PAPER, lw=0.8)
                if lasts_s > NARROW_S * (end - begin) / (8 * HOUR_S):
                    words = f"{len(one.visits)}" if one.lands == one.base else f"{len(one.visits)} →"
                    axes.text(
                        one.start_s + lasts_s / 2, row, words, fontsize=8, color=style.PAPER, ha="center", va="center"
                    )
    axes.set_xlim(begin, end)
    axes.set_ylim(len(content.vehicles) - 0.5, -0.5)
    axes.set_yticks(range(len(content.vehicles)), [own.name for own in content.vehicles], fontsize=9)
    axes.xaxis.set_major_locator(MultipleLocator(HOUR_S))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_day_time(value)[-5:]))
    axes.grid(axis="x", color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_title(f"day {day + 1}: segments of each sortie", loc="left", fontsize=10, color=style.INK)
    for spine in axes.spines.values():
        spine.set_color(style.FAINT)


def _colour_of(base: int) -> str:
    return style.COLOURS[base % len(style.COLOURS)]


PANEL_IN = 2.6
LEGEND_IN = 0.9
GROUND = "#c9bda7"
UNSURE = "#e6ddcd"
MOST_PANELS = 12
"""Most vehicles in a picture; more would make it metres long."""


def draw_profile_figure(setup: FlightSetup, routes: Mapping[str, tuple[int, ...]]) -> Figure:
    """Return one panel for each flight, with the same heights, metres above sea level over kilometres flown.

    Args:
        setup: Heights and pads.
        routes: Visits of the network, by vehicle name.
    """
    shown = build_profiles(setup, build_paths(setup, routes).values())[:MOST_PANELS]
    height_in = PANEL_IN * max(1, len(shown)) + LEGEND_IN
    figure = Figure(figsize=(style.WIDTH_IN, height_in), facecolor=style.PAPER)
    low_m = min((float(np.nanmin(one.ground_m)) for one in shown), default=0.0)
    high_m = max((max(float(one.flown_m.max()), one.return_m) for one in shown), default=1.0)
    for number, one in enumerate(shown):
        bottom = (LEGEND_IN + PANEL_IN * (len(shown) - 1 - number) + 0.45) / height_in
        axes = figure.add_axes((0.07, bottom, 0.9, (PANEL_IN - 0.85) / height_in))
        _draw_profile(axes, one, number)
        axes.set_ylim(low_m - 10.0, high_m + 0.08 * (high_m - low_m) + 5.0)
    handles = [
        Patch(fc=GROUND, label="ground of the raster"), Patch(fc=UNSURE, label="cells around, and its uncertainty"),
        Line2D([], [], color=style.INK, lw=0.9, ls=":", label="clearance of every leg above them"),
        Line2D([], [], color=style.INK, lw=2.8, label="inspection"),
        Line2D([], [], color=style.INK, lw=1.2, label="transit"),
        Line2D([], [], color=style.INK, lw=1.0, ls="--", label="RTL, level"),
        Line2D([], [], color=style.LOSS, marker="v", ls="", label="lowest over the ground"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _draw_profile(axes: Axes, one: HeightProfile, layer: int) -> None:
    colour, along_km = style.style_of(layer).colour, one.along_m / 1000.0
    bottom_m = float(np.nanmin(one.ground_m)) - 1000.0
    axes.fill_between(along_km, bottom_m, one.most_m, color=UNSURE, lw=0)
    axes.fill_between(along_km, bottom_m, one.ground_m, color=GROUND, lw=0)
    axes.plot(along_km, one.least_m, color=style.INK, lw=0.9, ls=":")
    axes.plot(along_km, one.flown_m, color=colour, lw=1.2)
    inspected_m = np.where(one.inspecting > 0, one.flown_m, np.nan)
    axes.plot(along_km, inspected_m, color=colour, lw=2.8, solid_capstyle="butt")
    axes.plot(one.waypoints_m[:, 0] / 1000.0, one.waypoints_m[:, 1], ls="", marker=".", ms=3, color=colour)
    axes.axhline(one.return_m, color=colour, lw=1.0, ls="--")
    at_m, up_m, over_m = one.lowest_point
    if not np.isnan(over_m):
        axes.plot(at_m / 1000.0, up_m, ls="", marker="v", ms=7, color=style.LOSS, zorder=4)
        axes.annotate(
            f"{over_m:.0f} m", (at_m / 1000.0, up_m), xytext=(0, 8), textcoords="offset points", ha="center",
            color=style.LOSS, fontsize=9, path_effects=style.make_white_edge(2.0),
        )  # fmt: skip
    axes.set_xlim(0.0, max(float(along_km[-1]), 0.01))
    axes.set_title(one.vehicle, loc="left", fontsize=10, color=colour)
    axes.set_ylabel("m above sea level", fontsize=9)
    axes.set_xlabel("flown (km)", fontsize=9)
    axes.grid(color="#eeeeee", lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
