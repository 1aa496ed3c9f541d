"""The maps: of a network, of a plan, and of a flight beside the plan that it began with."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from executor.analysis import flight_record
from executor.analysis.pictures import map_sheet
from executor.analysis.pictures.style import (
    COLOURS,
    FAINT,
    INK,
    LOSS,
    PAPER,
    VehicleStyle,
    make_dark_edge,
    make_white_edge,
    style_of,
)
from executor.core.formatting import format_flight_time
from executor.site.ground_view import GroundView
from missions import NetworkImport, PlanFile
from missions.geo import FloatArray
from missions.geometry import sample_leg
from missions.pricing import DEPOT_M

FONT_PT = 9.0
LEFT_PT = 8.0
"""Width of the outline about what a lost vehicle left."""
LINE_LETTERS = 20
_CHAR_IN, _LINE_IN = 0.62 * FONT_PT / 72.0, 1.9 * FONT_PT / 72.0


@dataclass(frozen=True, slots=True)
class _RouteStyle:
    """How routes of one kind are drawn."""

    inspecting_pt: float
    transit_pt: float
    dashed: bool
    cased: bool = False
    """Whether they have a white edge: over the colours of the ground they need one."""


FIRST = _RouteStyle(2.8, 0.8, dashed=False)
AGAIN = _RouteStyle(1.5, 1.0, dashed=True)


def draw_plan_figure(content: PlanFile, ground: GroundView | None = None) -> Figure:
    """Return the map of a plan, over the ground if that is known."""
    styles = {vehicle.name: style_of(layer) for layer, vehicle in enumerate(content.vehicles)}
    routes = flight_record.build_launch_revision(content).routes
    handles = [
        *_build_plan_handles(styles),
        *_build_ground_handles(pads=False),
        *map_sheet.build_area_handles(content.areas),
    ]
    places = np.concatenate((content.ends_m.reshape(-1, 2), *(route.places_m for route in routes), [DEPOT_M]))
    count, covered = len(content.segments) + len(content.unreachable), sum(len(route.segments) for route in routes)
    title = f"{covered} of {count} segments for {len(routes)} vehicles, {_describe_choice(content)}"
    sheet = map_sheet.make_sheet(places, title, ["Plan"], handles)
    sheet = map_sheet.draw_below(sheet, ground, content.areas)
    _draw_first(sheet, content.ends_m, routes, styles, ())
    return sheet.figure


def draw_flight_figure(record: flight_record.FlightRecord, ground: GroundView | None = None) -> Figure:
    """Return the first plan, and beside it what was flown and what was planned anew; over the ground if it is known."""
    styles = {vehicle.name: style_of(vehicle.layer) for vehicle in record.vehicles}
    ends = np.array([(one.a_m, one.b_m) for one in record.segments]).reshape(-1, 2, 2)
    pads = [vehicle.pad_m for vehicle in record.vehicles]
    handles = [
        *_build_plan_handles(styles),
        *_build_flown_handles(record),
        *_build_ground_handles(pads=True),
        *map_sheet.build_area_handles(record.areas),
    ]
    tracks = [vehicle.track[:, 1:3] for vehicle in record.vehicles]
    shown = np.concatenate((ends.reshape(-1, 2), np.array(pads).reshape(-1, 2), *tracks))
    sheet = map_sheet.make_sheet(shown, _compose_title(record), ["First plan", "As flown"], handles)
    sheet = map_sheet.draw_below(sheet, ground, record.areas)
    _draw_first(sheet, ends, record.revisions[0].routes, styles, pads)
    _draw_flown(sheet, record, styles, ends, pads)
    return sheet.figure


def _describe_choice(content: PlanFile) -> str:
    if content.window is not None:
        return f"any one may be lost from {content.window.earliest_s:.0f} s on"
    return f"{content.cost.name} {content.cost.value:.2f}"


def _compose_title(record: flight_record.FlightRecord) -> str:
    total, missing = (count + len(record.never) for count in (len(record.segments), len(record.uncovered_segments)))
    text = f"{total - missing} of {total} segments inspected"
    lost = [f"{vehicle.name} lost at {format_flight_time(fault.detected_s)}" for vehicle, fault in record.losses]
    return "; ".join([text, *lost]) if len(lost) <= 2 else f"{text}; {len(lost)} vehicles lost"


@dataclass(frozen=True, slots=True)
class _Panel:
    """One map of a sheet, where every callout finds room off the lines."""

    axes: Axes
    m_per_in: float
    placer: map_sheet.LabelPlacer

    def call_out(self, anchors_m: FloatArray, words: str, colour: str) -> None:
        """Write words beside one of (n, 2) places."""
        lines = words.split("\n")
        size_in = (_CHAR_IN * max(map(len, lines)) + 0.1, _LINE_IN * len(lines))
        anchor_m, middle_m = self.placer.place_label(
            anchors_m, (self.m_per_in * size_in[0], self.m_per_in * size_in[1])
        )
        self.axes.annotate(
            words, xy=(anchor_m[0], anchor_m[1]), xytext=(middle_m[0], middle_m[1]), fontsize=FONT_PT, color=INK,
            ha="center", va="center", zorder=12,
            bbox={"boxstyle": "round,pad=0.25", "facecolor": PAPER, "edgecolor": colour, "linewidth": 1.4},
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 1.2, "shrinkB": 2},
        )  # fmt: skip

    def name_vehicles(self, middles: Mapping[str, FloatArray], styles: Mapping[str, VehicleStyle]) -> None:
        """Write each vehicle's name beside the one of its places that lies the farthest from those of the others."""
        for name, places in middles.items():
            others = [np.zeros((0, 2)), *(other for key, other in middles.items() if key != name)]
            best = map_sheet.find_farthest(places, np.concatenate(others))
            self.call_out(places[best : best + 1], name, styles[name].colour)


def _begin_panel(
    sheet: map_sheet.MapSheet,
    axes: Axes,
    ends_m: FloatArray,
    pads_m: Sequence[flight_record.Place],
    ways_m: Iterable[FloatArray],
) -> _Panel:
    """Draw segments and pads; callouts keep off the segments and off (n, 2) ways."""
    map_sheet.draw_ground(axes, ends_m, pads_m)
    lines = itertools.chain(ends_m, *(itertools.pairwise(way) for way in ways_m))
    drawn = [sample_leg(np.stack(ends), 0.05 * sheet.m_per_in) for ends in lines]
    return _Panel(axes, sheet.m_per_in, map_sheet.LabelPlacer(np.concatenate(drawn), sheet.low_m, sheet.high_m))


def _draw_first(
    sheet: map_sheet.MapSheet,
    ends_m: FloatArray,
    routes: Sequence[flight_record.PlannedRoute],
    styles: Mapping[str, VehicleStyle],
    pads_m: Sequence[flight_record.Place],
) -> None:
    panel = _begin_panel(sheet, sheet.panels[0], ends_m, pads_m, (np.array(route.way_m) for route in routes))
    for route in routes:
        _draw_route(panel.axes, route, styles[route.vehicle], replace(FIRST, cased=sheet.busy))
    inspected = {route.vehicle: zip(route.way_m[1:-1:2], route.way_m[2:-1:2], strict=True) for route in routes}
    panel.name_vehicles({name: _compute_middles_m(lines) for name, lines in inspected.items()}, styles)


def _draw_flown(
    sheet: map_sheet.MapSheet,
    record: flight_record.FlightRecord,
    styles: Mapping[str, VehicleStyle],
    ends_m: FloatArray,
    pads_m: Sequence[flight_record.Place],
) -> None:
    panel = _begin_panel(
        sheet, sheet.panels[1], ends_m, pads_m, (vehicle.track[::4, 1:3] for vehicle in record.vehicles)
    )
    axes = panel.axes
    for segment, _ in flight_record.find_abandoned_segments(record):
        axes.plot(*segment.line_m, color=PAPER, lw=LEFT_PT, zorder=2, path_effects=make_dark_edge(LEFT_PT))
    for vehicle in record.vehicles:
        _draw_track(axes, vehicle, styles[vehicle.name], edged=sheet.busy)
    for revision in record.revisions[1:]:
        for route in revision.routes:
            _draw_route(axes, route, styles[route.vehicle], AGAIN)
    for segment in record.uncovered_segments:
        axes.plot(*segment.line_m, color=LOSS, lw=2.6, ls=(0, (1.0, 1.0)), zorder=5)
    _label_events(panel, record, styles)
    inspected: dict[str, list[flight_record.SegmentRecord]] = {}
    for segment in record.segments:
        if segment.inspected_by is not None:
            inspected.setdefault(segment.inspected_by, []).append(segment)
    panel.name_vehicles({name: _find_middles_m(segments) for name, segments in inspected.items()}, styles)


def _draw_route(axes: Axes, route: flight_record.PlannedRoute, style: VehicleStyle, look: _RouteStyle) -> None:
    way = np.array(route.way_m)
    # From the start on, every other leg is an inspection; the rest is transit.
    for first, width_pt in ((0, look.transit_pt), (1, look.inspecting_pt)):
        legs = [way[index : index + 2] for index in range(first, len(way) - 1, 2)]
        if first == 0 and route.turns_m:
            legs = [
                np.array([leg[0], *turns, leg[1]]) for leg, turns in zip(legs, route.turns_m, strict=True)
            ]  # fmt: skip
        broken = np.concatenate([np.vstack((leg, [np.nan, np.nan])) for leg in legs]) if legs else np.zeros((0, 2))
        ls = style.dashes if look.dashed else "-"
        effects = make_white_edge(width_pt + 1.6) if look.dashed or look.cased else []
        axes.plot(broken[:, 0], broken[:, 1], color=style.colour, lw=width_pt, ls=ls, zorder=4, path_effects=effects,
                  solid_capstyle="round")  # fmt: skip


def _draw_track(axes: Axes, vehicle: flight_record.VehicleRecord, style: VehicleStyle, *, edged: bool) -> None:
    track = vehicle.track
    if len(track) == 0:
        return
    gaps = np.flatnonzero(np.diff(track[:, 0]) > flight_record.GAP_S) + 1
    shown = np.insert(track[:, 1:3], gaps, np.nan, axis=0)
    effects = make_white_edge(5.4) if edged else []
    axes.plot(shown[:, 0], shown[:, 1], color=style.colour, lw=3.4, alpha=0.5, zorder=3, solid_capstyle="round",
              path_effects=effects)  # fmt: skip


def _label_events(panel: _Panel, record: flight_record.FlightRecord, styles: Mapping[str, VehicleStyle]) -> None:
    for vehicle, fault in record.losses:
        row = flight_record.find_last_row(vehicle, fault.detected_s)
        if row is not None:
            place_m = vehicle.track[row, 1:3]
            panel.axes.plot(*place_m, ls="", marker="X", ms=15, mfc=LOSS, mec=PAPER, mew=1.4, zorder=10)
            words = f"{vehicle.name} lost: {fault.kind.value}\n{format_flight_time(fault.detected_s)}"
            panel.call_out(place_m[np.newaxis], words, LOSS)
    for left_by, by, segments in _group_handovers(record):
        panel.call_out(_find_middles_m(segments), f"{by} took over {len(segments)}\nfrom {left_by}", styles[by].colour)
    for group in group_connected(record.uncovered_segments):
        ids = ", ".join(segment.display_name for segment in group)
        words = "\n".join(["not inspected:", *textwrap.wrap(ids, LINE_LETTERS)])
        panel.call_out(_find_middles_m(group), words, LOSS)


def _group_handovers(record: flight_record.FlightRecord) -> list[tuple[str, str, list[flight_record.SegmentRecord]]]:
    found: dict[tuple[str, str], list[flight_record.SegmentRecord]] = {}
    for segment, left_by in flight_record.find_abandoned_segments(record):
        if segment.inspected_by is not None:
            found.setdefault((left_by, segment.inspected_by), []).append(segment)
    return [(left_by, by, segments) for (left_by, by), segments in found.items()]


def group_connected(segments: Iterable[flight_record.SegmentRecord]) -> list[list[flight_record.SegmentRecord]]:
    """Return the segments in groups that hang together, each in the order given."""
    groups: list[tuple[set[flight_record.Place], list[flight_record.SegmentRecord]]] = []
    for segment in segments:
        ends = {(round(end[0], 1), round(end[1], 1)) for end in (segment.a_m, segment.b_m)}
        touched = [group for group in groups if group[0] & ends]
        groups = [group for group in groups if not group[0] & ends]
        groups.append((ends.union(*(places for places, _ in touched)), [one for _, held in touched for one in held]))
        groups[-1][1].append(segment)
    return [held for _, held in groups]


def _find_middles_m(segments: Iterable[flight_record.SegmentRecord]) -> FloatArray:
    return _compute_middles_m((segment.a_m, segment.b_m) for segment in segments)


def _compute_middles_m(ends_m: Iterable[tuple[flight_record.Place, flight_record.Place]]) -> FloatArray:
    return np.array([np.mean(pair, axis=0) for pair in ends_m]).reshape(-1, 2)


def _build_plan_handles(styles: Mapping[str, VehicleStyle]) -> list[Artist]:
    return [
        *(Line2D([], [], color=style.colour, lw=4.0, label=name) for name, style in styles.items()),
        Line2D([], [], color=INK, lw=FIRST.inspecting_pt, label="planned inspection"),
        Line2D([], [], color=INK, lw=FIRST.transit_pt, label="planned transit"),
    ]


def _build_flown_handles(record: flight_record.FlightRecord) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=INK, lw=3.4, alpha=0.4, label="flown")]
    if len(record.revisions) > 1:
        handles.append(Line2D([], [], color=INK, lw=AGAIN.inspecting_pt, ls=style_of(0).dashes, label="re-planned"))
    if record.losses:
        handles.append(Line2D([], [], ls="", marker="X", ms=11, mfc=LOSS, mec=PAPER, label="lost"))
    if flight_record.find_abandoned_segments(record):
        handles.append(
            Line2D([], [], color=PAPER, lw=6.0, label="left by a lost vehicle", path_effects=make_dark_edge(6.0))
        )
    if record.uncovered_segments:
        handles.append(Line2D([], [], color=LOSS, lw=2.6, ls=(0, (1.0, 1.0)), label="not inspected"))
    return handles


def _build_ground_handles(*, pads: bool) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=FAINT, lw=0.9, marker="o", ms=2.6, mfc="#555555", mec="#555555", label="line and pylons"),
        Line2D([], [], ls="", marker="*", ms=11, mfc=INK, mec=PAPER, label="depot"),
    ]
    if pads:
        handles.append(Line2D([], [], ls="", marker="s", ms=4.5, mfc=PAPER, mec=INK, label="pads"))
    return handles


NAMED_POLES = 60
"""Beyond so many, their names hide each other."""
DOTTED_POLES = 1000
"""Beyond so many, their dots hide the lines' colours."""
LETTERS = 24
"""Of a line's name below the map."""


def draw_network_figure(understood: NetworkImport) -> Figure:
    """Return the map of a network; the longest lines have colours of their own."""
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
    sheet = map_sheet.make_sheet(shown_m, title, ["Network"], handles)
    axes = sheet.panels[0]
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
    """Return a name that has room; a dollar sign would begin a formula."""
    text = name if len(name) <= LETTERS else f"{name[: LETTERS - 3]}..."
    return text.replace("$", r"\$") or "no line's name"
