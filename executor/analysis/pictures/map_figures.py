"""Draw maps of a network and of a plan."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from executor.analysis import flight_record
from executor.analysis.pictures import map_sheet
from executor.analysis.pictures.style import COLOURS, FAINT, INK, PAPER, VehicleStyle, make_white_edge, style_of
from executor.site.ground_view import GroundView
from missions import NetworkImport, PlanFile
from missions.geo import FloatArray
from missions.geometry import sample_leg
from missions.pricing import DEPOT_M

FONT_PT = 9.0
_CHAR_IN, _LINE_IN = 0.62 * FONT_PT / 72.0, 1.9 * FONT_PT / 72.0
INSPECTING_PT, TRANSIT_PT = 2.8, 0.8
"""Line widths of inspections and transits."""
GAP = (np.nan, np.nan)
"""Place between two pieces of a drawn line."""


def draw_plan_figure(content: PlanFile, ground: GroundView | None = None) -> Figure:
    """Return the map of a plan, over the background if known."""
    styles = {vehicle.name: style_of(layer) for layer, vehicle in enumerate(content.vehicles)}
    routes = flight_record.build_launch_revision(content).routes
    handles = [
        *_build_plan_handles(styles),
        Line2D([], [], color=FAINT, lw=0.9, marker="o", ms=2.6, mfc="#555555", mec="#555555", label="line and pylons"),
        Line2D([], [], ls="", marker="*", ms=11, mfc=INK, mec=PAPER, label="depot"),
        *map_sheet.build_area_handles(content.areas),
    ]
    places = np.concatenate(
        [content.ends_m.reshape(-1, 2), *(leg for route in routes for leg in route.legs_m), [DEPOT_M]]
    )
    count, covered = len(content.segments) + len(content.unreachable), sum(len(route.segments) for route in routes)
    title = f"{covered} of {count} segments for {len(routes)} vehicles, {_describe_choice(content)}"
    sheet = map_sheet.make_sheet(places, title, "Plan", handles)
    sheet = map_sheet.draw_below(sheet, ground, content.areas)
    map_sheet.draw_ground(sheet.axes, content.ends_m)
    for route in routes:
        _draw_route(sheet, route, styles[route.vehicle])
    _name_vehicles(sheet, content.ends_m, routes, styles)
    return sheet.figure


def _describe_choice(content: PlanFile) -> str:
    if content.window is not None:
        number = "one" if content.window.losses is None else "two"
        return f"any {number} may be lost from {content.window.earliest_s:.0f} s on"
    return f"{content.cost.name} {content.cost.value:.2f}"


def _name_vehicles(
    sheet: map_sheet.MapSheet,
    ends_m: FloatArray,
    routes: Sequence[flight_record.PlannedRoute],
    styles: Mapping[str, VehicleStyle],
) -> None:
    """Write each vehicle's name next to its inspection that is farthest from those of others, off all lines."""
    lines = itertools.chain(ends_m, ((leg[0], leg[-1]) for route in routes for leg in route.legs_m))
    drawn = [sample_leg(np.stack(ends), 0.05 * sheet.m_per_in) for ends in lines]
    placer = map_sheet.LabelPlacer(np.concatenate(drawn), sheet.low_m, sheet.high_m)
    middles = {
        route.vehicle: np.array([np.mean(ends, axis=0) for ends in route.legs_m[1::2]]).reshape(-1, 2)
        for route in routes
    }
    for name, places in middles.items():
        others = [np.zeros((0, 2)), *(other for key, other in middles.items() if key != name)]
        best = map_sheet.find_farthest(places, np.concatenate(others))
        size_m = (sheet.m_per_in * (_CHAR_IN * len(name) + 0.1), sheet.m_per_in * _LINE_IN)
        anchor_m, middle_m = placer.place_label(places[best : best + 1], size_m)
        colour = styles[name].colour
        sheet.axes.annotate(
            name, xy=(anchor_m[0], anchor_m[1]), xytext=(middle_m[0], middle_m[1]), fontsize=FONT_PT, color=INK,
            ha="center", va="center", zorder=12,
            bbox={"boxstyle": "round,pad=0.25", "facecolor": PAPER, "edgecolor": colour, "linewidth": 1.4},
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 1.2, "shrinkB": 2},
        )  # fmt: skip


def _draw_route(sheet: map_sheet.MapSheet, route: flight_record.PlannedRoute, style: VehicleStyle) -> None:
    for legs, width_pt in ((route.legs_m[::2], TRANSIT_PT), (route.legs_m[1::2], INSPECTING_PT)):
        broken = np.array([place for leg in legs for place in (*leg, GAP)]).reshape(-1, 2)
        # On a coloured background lines need a white edge.
        effects = make_white_edge(width_pt + 1.6) if sheet.busy else []
        sheet.axes.plot(broken[:, 0], broken[:, 1], color=style.colour, lw=width_pt, zorder=4, path_effects=effects,
                        solid_capstyle="round")  # fmt: skip


def _build_plan_handles(styles: Mapping[str, VehicleStyle]) -> list[Artist]:
    return [
        *(Line2D([], [], color=style.colour, lw=4.0, label=name) for name, style in styles.items()),
        Line2D([], [], color=INK, lw=INSPECTING_PT, label="planned inspection"),
        Line2D([], [], color=INK, lw=TRANSIT_PT, label="planned transit"),
    ]


NAMED_POLES = 60
"""Most poles with names; more would overlap."""
DOTTED_POLES = 1000
"""Most poles with dots; more would hide the lines' colours."""
LETTERS = 24
"""Most characters of a line's name below the map."""


def draw_network_figure(understood: NetworkImport) -> Figure:
    """Return the map of a network; the longest lines have their own colours."""
    network = understood.network
    lines = [understood.lines.get(segment.label, "") for segment in network.segments]
    lengths_m: dict[str, float] = {}
    for line, length_m in zip(lines, network.lengths_m.tolist(), strict=True):
        lengths_m[line] = lengths_m.get(line, 0.0) + length_m
    longest = sorted(lengths_m, key=lambda line: -lengths_m[line])[: len(COLOURS)]
    colours = {line: COLOURS[number] for number, line in enumerate(longest)}
    handles: list[Artist] = [
        Line2D([], [], color=colour, lw=3.0, label=_shorten_name(line)) for line, colour in colours.items()
    ]
    if len(lengths_m) > len(longest):
        handles.append(Line2D([], [], color=FAINT, lw=3.0, label=f"{len(lengths_m) - len(longest)} more lines"))
    if len(network.pylons) <= DOTTED_POLES:
        handles.append(Line2D([], [], ls="", marker="o", ms=4, mfc=INK, mec=INK, label="poles"))
    if understood.has_depot:
        handles.append(Line2D([], [], ls="", marker="*", ms=11, mfc=INK, mec=PAPER, label="depot"))
    shown_m = network.positions_m
    if understood.has_depot:
        shown_m = np.concatenate((shown_m, np.zeros((1, 2))))
    title = f"{len(network.segments)} spans, {network.lengths_m.sum() / 1000:.1f} km, {len(network.pylons)} poles"
    sheet = map_sheet.make_sheet(shown_m, title, "Network", handles)
    axes = sheet.axes
    shades = [colours.get(line, FAINT) for line in lines]
    axes.add_collection(LineCollection(list(network.ends_m), colors=shades, linewidths=2.0, zorder=2), autolim=False)
    if len(network.pylons) <= DOTTED_POLES:
        axes.plot(network.positions_m[:, 0], network.positions_m[:, 1], ls="", marker="o", ms=3.0, color=INK, zorder=3)
    if understood.has_depot:
        axes.plot([0.0], [0.0], ls="", marker="*", ms=13, mfc=INK, mec=PAPER, mew=0.8, zorder=8)
    if len(network.pylons) <= NAMED_POLES:
        for pylon, (east_m, north_m) in zip(network.pylons, network.positions_m.tolist(), strict=True):
            axes.annotate(_shorten_name(pylon.id), (east_m, north_m), xytext=(4, 4),
            textcoords="offset points", fontsize=7,
                          color=INK, path_effects=make_white_edge(2.0), zorder=5)  # fmt: skip
    return sheet.figure


def _shorten_name(name: str) -> str:
    """Return a name short enough for the legend; a dollar sign would begin a formula."""
    text = name if len(name) <= LETTERS else f"{name[: LETTERS - 3]}..."
    return text.replace("$", r"\$") or "no line's name"
