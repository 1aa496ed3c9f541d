"""Draw battery consumption over time: planned and measured for a flight, with re-plans after losses for a plan."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MultipleLocator

from executor.analysis.flight_record import FlightRecord, compute_used_pct, draw_at_pct
from executor.analysis.pictures.style import INK, LOSS, PAPER, VehicleStyle, make_figure, make_white_edge, style_of
from executor.core.formatting import format_duration, format_flight_time
from missions import PlanFile
from planner import Plan, RemainingProblem, ReplanWindow
from planner.fleet_state import RouteProgress, build_state_before_losses

LEFT, RIGHT = 0.055, 0.815
"""Left and right edge of the plot as shares of the figure; line names are to its right, event names above."""
PLOT_IN, BELOW_IN, TITLE_IN, MOMENT_IN = 5.0, 1.0, 0.55, 0.2
"""Heights of the plot, of the part below it, of the title, and of each line of text above the plot."""
STRIP_IN = 0.85
"""Height of the separate strip for limits that lie far above the consumption."""
FAR = 1.6
"""Ratio of limit to consumption above which limits get a separate strip."""
MARKS = 14
"""Approximate number of markers on a measured line."""
LABEL_STEP = 0.035
"""Least distance between two names, as a share of the figure's height."""
LEAST_SPAN_PCT = 5.0
CHARACTER = 0.0085
"""Width of a character above the plot, as a share of the plot's width."""
TIME_STEPS_S = (5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
"""Possible steps between time labels."""
MOST_TIMES = 12
LEGEND_COLUMNS = 6
LEGEND_ROW_IN = 0.21


@dataclass(frozen=True, slots=True)
class LineEnd:
    """End of a line in plot coordinates, with its label."""

    along: float
    height: float
    words: str
    colour: str


TimeMark = tuple[float, str, str]
"""A vertical line: time, text above the plot, colour."""


def draw_battery_figure(record: FlightRecord) -> Figure:
    """Return percent used over seconds since the launch.

    Plans are solid, re-plans dashed and measurements thin with markers, in each vehicle's colour. Red lines are losses,
    the black one is the longest route of the first plan; budgets and reserves are horizontal.
    """
    styles = {vehicle.name: style_of(vehicle.layer) for vehicle in record.vehicles}
    end_s = _end_s(record)
    figure, panels = _make_chart(
        "Battery consumption: planned and measured", end_s, _highest_pct(record), _collect_limits(record),
        _collect_time_marks(record), _build_legend(record),
    )  # fmt: skip
    axes = panels[0]
    _draw_plans(axes, record, styles)
    _draw_measured(axes, record, styles)
    _draw_losses(panels, record)
    label_lines(axes, _collect_line_ends(record, styles))
    _format_time_axis(panels, end_s)
    axes.set_xlabel("time since the order to take off (min:s)")
    return figure


def _make_chart(
    title: str,
    end_s: float,
    highest_pct: float,
    limits: Mapping[str, float],
    marks: Sequence[TimeMark],
    handles: Sequence[Artist],
) -> tuple[Figure, list[Axes]]:
    """Return a plot of percent used over time with limits, marks and a legend, and a strip above it for far limits.

    Args:
        title: Title of the figure.
        end_s: End of the time axis.
        highest_pct: Highest consumption.
        limits: Horizontal lines, by label.
        marks: Vertical lines.
        handles: Handles of the legend.
    """
    words_lines = _stack_words(marks, end_s)
    below_in = BELOW_IN + LEGEND_ROW_IN * ((len(handles) - 1) // LEGEND_COLUMNS)
    height_in = below_in + PLOT_IN + MOMENT_IN * (1 + max(words_lines)) + TITLE_IN
    figure = make_figure(height_in, title)
    far = bool(limits) and min(limits.values()) > FAR * highest_pct
    lower_in = PLOT_IN - (STRIP_IN + 0.08 if far else 0.0)
    axes = figure.add_axes((LEFT, below_in / height_in, RIGHT - LEFT, lower_in / height_in))
    axes.set_xlim(0.0, end_s)
    axes.set_ylim(0.0, 1.08 * (highest_pct if far else max([highest_pct, *limits.values()])))
    axes.set_ylabel("battery used (%)")
    panels = [axes]
    if far:
        place = (LEFT, (below_in + PLOT_IN - STRIP_IN) / height_in, RIGHT - LEFT, STRIP_IN / height_in)
        panels.append(_add_strip(figure.add_axes(place), axes, limits))
    for name, limit in limits.items():
        panels[-1].axhline(limit, color=INK, lw=1.2, ls=(0, (8.0, 2.0, 1.0, 2.0)), zorder=1)
        panels[-1].text(
            0.006 * end_s, limit, name, fontsize=9, color=INK, va="bottom", path_effects=make_white_edge(2.0)
        )
    for (t_s, words, colour), line in zip(marks, words_lines, strict=True):
        for panel in panels:
            panel.axvline(t_s, color=colour, lw=1.8, zorder=2)
        panels[-1].annotate(
            words, xy=(t_s, 1.0), xycoords=("data", "axes fraction"), xytext=(0.0, 4.0 + 72.0 * MOMENT_IN * line),
            textcoords="offset points", ha="center", fontsize=9.5, color=colour,
        )  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=LEGEND_COLUMNS, frameon=False, fontsize=9)
    return figure, panels


def _stack_words(marks: Sequence[TimeMark], end_s: float) -> list[int]:
    """Return for each mark the lowest free line of text above the plot; 0 is the lowest of all."""
    taken_s, lines = [-math.inf] * len(marks), [0] * len(marks)
    for index, (t_s, words, _) in sorted(enumerate(marks), key=lambda row: row[1]):
        half_s = 0.5 * CHARACTER * end_s * len(words)
        lines[index] = next(number for number, until_s in enumerate(taken_s) if until_s < t_s - half_s)
        taken_s[lines[index]] = t_s + half_s
    return lines


def _format_time_axis(panels: Sequence[Axes], end_s: float) -> None:
    """Label the time axis as the terminal, the page and the report show times."""
    step_s = next((step for step in TIME_STEPS_S if end_s / step <= MOST_TIMES), TIME_STEPS_S[-1])
    for axes in panels:
        axes.xaxis.set_major_locator(MultipleLocator(step_s))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda t_s, _: format_duration(t_s)))


def _highest_pct(record: FlightRecord) -> float:
    planned = [used_pct for revision in record.revisions for route in revision.routes for _, used_pct in route.energy]
    measured = [
        float(compute_used_pct(vehicle.battery)[:, 1].max()) for vehicle in record.vehicles if len(vehicle.battery)
    ]
    return max([LEAST_SPAN_PCT, *planned, *measured])


def _end_s(record: FlightRecord) -> float:
    planned = [t_s for revision in record.revisions for route in revision.routes for t_s, _ in route.energy]
    return 1.01 * max([1.0, record.duration_s, *planned])


def _collect_limits(record: FlightRecord) -> Mapping[str, float]:
    """Return budgets and reserves as percent used, by the label of their lines.

    A reserve is drawn for the emptiest of the batteries that share it: 'used' counts from the level at the launch.
    """
    rows = []
    for vehicle in record.vehicles:
        full_pct = float(vehicle.battery[0, 1]) if len(vehicle.battery) else 100.0
        rows += [
            (f"budget, {vehicle.budget_pct:g} % used", vehicle.budget_pct, vehicle.name),
            (f"reserve, {vehicle.reserve_pct:g} % left", full_pct - vehicle.reserve_pct, vehicle.name),
        ]
    return _group_limits(rows, len(record.vehicles))


def _group_limits(rows: Iterable[tuple[str, float, str]], everybody: int) -> dict[str, float]:
    """Return the least limit by label, with the names of its vehicles unless it applies to all.

    Args:
        rows: Label, limit, and name of its vehicle.
        everybody: Number of all vehicles.
    """
    limits: dict[str, float] = {}
    names: dict[str, list[str]] = {}
    for words, limit, name in rows:
        limits[words] = min(limit, limits.get(words, limit))
        names.setdefault(words, []).append(name)
    return {
        words if len(names[words]) == everybody else f"{words} ({', '.join(names[words])})": limit
        for words, limit in limits.items()
    }


def _add_strip(axes: Axes, below: Axes, limits: Mapping[str, float]) -> Axes:
    """Make axes the upper part of a broken scale, for limits far above the consumption."""
    axes.set_xlim(below.get_xlim())
    axes.set_ylim(min(limits.values()) - 8.0, max(limits.values()) + 8.0)
    axes.set_yticks(sorted({round(limit, 1) for limit in limits.values()}))
    axes.tick_params(bottom=False, labelbottom=False)
    axes.spines["bottom"].set_visible(False)
    below.spines["top"].set_visible(False)
    for part, height in ((axes, 0.0), (below, 1.0)):
        part.plot(
            [0.0, 1.0], [height, height], transform=part.transAxes, clip_on=False,
            ls="", marker=[(-1.0, -0.6), (1.0, 0.6)], ms=10, color=INK, mew=1.2,
        )  # fmt: skip
    return axes


def _draw_plans(axes: Axes, record: FlightRecord, styles: Mapping[str, VehicleStyle]) -> None:
    for revision in record.revisions:
        for route in revision.routes:
            t_s, used_pct = zip(*route.energy, strict=True)
            style = styles[route.vehicle]
            if revision.number == 0:
                axes.plot(t_s, used_pct, color=style.colour, lw=2.2, zorder=3)
            else:
                axes.plot(t_s, used_pct, color=style.colour, lw=2.2, ls=style.dashes, zorder=4)
                axes.plot(t_s[:1], used_pct[:1], color=style.colour, marker="|", ms=12, mew=1.6, zorder=4)


def _draw_measured(axes: Axes, record: FlightRecord, styles: Mapping[str, VehicleStyle]) -> None:
    for vehicle in record.vehicles:
        if len(vehicle.battery) == 0:
            continue
        account = compute_used_pct(vehicle.battery)
        style = styles[vehicle.name]
        # Markers of different vehicles are offset, so that all stay visible on overlapping lines.
        every = max(1, len(account) // MARKS)
        first = every * (vehicle.layer % len(styles)) // len(styles)
        axes.plot(
            account[:, 0], account[:, 1], color=style.colour, lw=0.9, zorder=5,
            marker=style.marker, ms=6.0, mec=PAPER, mew=0.7, markevery=(first, every),
        )  # fmt: skip


def _draw_losses(panels: Sequence[Axes], record: FlightRecord) -> None:
    for vehicle, fault in record.losses:
        place = (fault.detected_s, draw_at_pct(vehicle, fault.detected_s))
        panels[0].plot(*place, ls="", marker="X", ms=13, mfc=LOSS, mec=PAPER, mew=1.2, zorder=6)
        if fault.happened_s is not None:
            for axes in panels:
                axes.axvline(fault.happened_s, color=LOSS, lw=1.0, ls=(0, (1.0, 2.0)), zorder=2)


def _collect_time_marks(record: FlightRecord) -> list[TimeMark]:
    longest = (record.longest_route_s, f"longest route, {format_duration(record.longest_route_s)}", INK)
    return [longest] + [
        (fault.detected_s, f"{vehicle.name} lost ({fault.kind.value}), {format_flight_time(fault.detected_s)}", LOSS)
        for vehicle, fault in record.losses
    ]


def _collect_line_ends(record: FlightRecord, styles: Mapping[str, VehicleStyle]) -> list[LineEnd]:
    ends = []
    for vehicle in record.vehicles:
        routes = [route for revision in record.revisions for route in revision.routes if route.vehicle == vehicle.name]
        words = vehicle.name
        place = None
        if routes:
            place = routes[-1].energy[-1]
            words += f": planned {place[1]:.0f} %"
        if len(vehicle.battery):
            t_s, used_pct = compute_used_pct(vehicle.battery)[-1].tolist()
            place = (t_s, used_pct)
            words += f", used {used_pct:.0f} %"
        if place is not None:
            ends.append(LineEnd(*place, words, styles[vehicle.name].colour))
    return ends


def label_lines(axes: Axes, ends: Sequence[LineEnd], step: float = LABEL_STEP) -> None:
    """Label lines to the right of the plot at the height of their ends, without overlap.

    Args:
        axes: The plot.
        ends: Ends of its lines.
        step: Least distance of two labels, as a share of the figure's height.
    """
    place, (low, high) = axes.get_position(), axes.get_ylim()
    ends = sorted(ends, key=lambda end: end.height)
    heights = spread_heights([place.y0 + place.height * (end.height - low) / (high - low) for end in ends], step)
    above = max(0.0, *heights, place.y1) - place.y1
    for end, height in zip(ends, heights, strict=True):
        axes.annotate(
            end.words, xy=(end.along, end.height), xytext=(place.x1 + 0.015, height - above),
            textcoords="figure fraction", fontsize=9, color=INK, va="center", annotation_clip=False,
            # From the text's left edge to the end of the line.
            arrowprops={
                "arrowstyle": "-", "color": end.colour, "linewidth": 0.7, "relpos": (0.0, 0.5), "shrinkA": 2,
                "shrinkB": 3,
            },
        )  # fmt: skip


def spread_heights(heights: Sequence[float], least: float) -> list[float]:
    """Return ascending heights moved apart to a least distance, with the same mean.

    >>> spread_heights([0.0, 1.0], 2.0)
    [-0.5, 1.5]
    """
    moved: list[float] = []
    for height in heights:
        moved.append(max(height, moved[-1] + least) if moved else height)
    shift = (sum(moved) - sum(heights)) / len(moved) if moved else 0.0
    return [height - shift for height in moved]


def _build_legend(record: FlightRecord) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=INK, lw=2.2, label=record.first_words)]
    if len(record.revisions) > 1:
        handles.append(Line2D([], [], color=INK, lw=2.2, ls=style_of(0).dashes, label="re-plan"))
    handles.append(Line2D([], [], color=INK, lw=0.9, marker="o", ms=6.0, mec=PAPER, label="measured"))
    if record.losses:
        handles.append(Line2D([], [], color=LOSS, lw=1.8, label="loss declared"))
    if any(fault.happened_s is not None for _, fault in record.losses):
        handles.append(Line2D([], [], color=LOSS, lw=1.0, ls=(0, (1.0, 2.0)), label="loss happened"))
    handles.append(Line2D([], [], color=INK, lw=1.8, marker="|", ls="", ms=14, mew=1.8, label="longest route, planned"))
    return handles


SHADE = "#f3e3c3"

Repair = tuple[RemainingProblem, Plan]
"""Remaining problem after a loss, and its plan."""


def draw_window_figure(content: PlanFile, found: ReplanWindow, repairs: Sequence[Repair]) -> Figure:
    """Return percent used over seconds since the launch, as in the paper's figure of re-plans.

    Plans are solid. Re-plans are dashed: a line's colour is the vehicle that flies it, its dashes show the lost
    vehicle.
    """
    state = build_state_before_losses(content.build_instance(), content.plan)
    planned = [state.progress_of(vehicle) for vehicle in range(len(state.fleet))]
    anew = [line for repair in repairs for line in _compute_replanned_lines(content, repair)]
    drawn = [*planned, *(line.flown for line in anew)]
    end_s = 1.01 * max(1.0, *(float(flown.time_s[-1]) for flown in drawn))
    budgets = [(f"budget, {one.budget_pct:g} %", one.budget_pct, one.name) for one in content.vehicles]
    marks = [
        (found.earliest_s, f"window begins, {found.earliest_s:.0f} s", LOSS),
        (found.longest_route_s, f"longest route, {found.longest_route_s:.0f} s", INK),
    ]
    figure, (axes, *_) = _make_chart(
        _compose_window_title(found), end_s, max(float(flown.used_pct[-1]) for flown in drawn),
        _group_limits(budgets, len(content.vehicles)), marks, _build_window_legend(content, found, repairs),
    )  # fmt: skip
    axes.axvspan(found.earliest_s, found.longest_route_s, color=SHADE, lw=0, zorder=0)
    _draw_lines(axes, planned, anew)
    if 0 < found.certified_earliest_s < found.earliest_s:
        axes.axvline(found.certified_earliest_s, color=LOSS, lw=1.2, ls=(0, (1.0, 2.0)), zorder=2)
    label_lines(axes, _collect_window_ends(content, planned, anew))
    axes.set_xlabel("time since launch (s)")
    return figure


@dataclass(frozen=True, slots=True, eq=False)
class _ReplannedLine:
    """Line of a survivor's progress after a re-plan."""

    vehicle: int
    lost: int
    flown: RouteProgress
    """Progress at which the vehicle can follow the re-plan."""


def _compute_replanned_lines(content: PlanFile, repair: Repair) -> Iterator[_ReplannedLine]:
    left, plan = repair
    state = build_state_before_losses(content.build_instance(), content.plan).apply_plan(left, plan)
    for place, survivor in enumerate(left.survivors):
        if plan.routes[place].visits or survivor.finishing is not None:
            whole = state.progress_of(place)
            since = np.flatnonzero(whole.time_s >= survivor.free_s - 1e-6)
            part = RouteProgress(whole.time_s[since], whole.used_pct[since], whole.airborne_s[since])
            yield _ReplannedLine(survivor.vehicle, left.lost, part)


def _draw_lines(axes: Axes, planned: Sequence[RouteProgress], anew: Sequence[_ReplannedLine]) -> None:
    for vehicle, flown in enumerate(planned):
        axes.plot(flown.time_s, flown.used_pct, color=style_of(vehicle).colour, lw=2.4, zorder=3)
    for line in anew:
        colour, of_lost, flown = style_of(line.vehicle).colour, style_of(line.lost), line.flown
        axes.plot(flown.time_s, flown.used_pct, color=colour, lw=1.5, ls=of_lost.dashes, zorder=4)
        axes.plot(flown.time_s[-1:], flown.used_pct[-1:], ls="", marker=of_lost.marker, ms=5.5, mfc=colour,
                  mec=PAPER, mew=0.6, zorder=5)  # fmt: skip


def _collect_window_ends(
    content: PlanFile, planned: Sequence[RouteProgress], anew: Sequence[_ReplannedLine]
) -> list[LineEnd]:
    ends = []
    for vehicle, flown in enumerate(planned):
        words = f"{content.vehicles[vehicle].name}: plan {flown.used_pct[-1]:.0f} %"
        if again := [float(line.flown.used_pct[-1]) for line in anew if line.vehicle == vehicle]:
            words += f", re-plan {max(again):.0f} %"
        ends.append(LineEnd(float(flown.time_s[-1]), float(flown.used_pct[-1]), words, style_of(vehicle).colour))
    return ends


def _compose_window_title(found: ReplanWindow) -> str:
    title = f"Re-plan window {found.window_pct:.1f} %"
    if found.earliest_s >= found.longest_route_s:
        return f"{title}: at no time can the fleet absorb every loss"
    return f"{title}: from {found.earliest_s:.0f} s the fleet can absorb any one loss"


def _build_window_legend(content: PlanFile, found: ReplanWindow, repairs: Sequence[Repair]) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=INK, lw=2.4, label="plan")]
    for left, _ in repairs:
        lost = left.lost
        look, name = style_of(lost), content.vehicles[lost].name
        handles.append(Line2D([], [], color=INK, lw=1.5, ls=look.dashes, marker=look.marker, ms=5.5, mec=PAPER,
                              label=f"re-plan without {name}"))  # fmt: skip
    handles.append(Patch(color=SHADE, lw=0, label="re-plan window"))
    if 0 < found.certified_earliest_s < found.earliest_s:
        words = f"certain: none begins before {found.certified_earliest_s:.0f} s"
        handles.append(Line2D([], [], color=LOSS, lw=1.2, ls=(0, (1.0, 2.0)), label=words))
    return handles
