"""Who flies when: a panel for each day, a row for each vehicle, a bar for each sortie in its base's colour."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MultipleLocator

from executor.analysis.pictures.style import COLOURS, FAINT, INK, PAPER, WIDTH_IN
from missions import DayPlanFile

HOUR_S = 3600.0
DAY_S = 24 * HOUR_S
ROW_IN = 0.3
HEAD_IN = 0.75
FOOT_IN = 0.6
GAP_IN = 0.55
MOST_DAYS = 12
"""Days that a picture shows; of more it shows the first, and says so."""
NARROW_S = 600.0
"""A sortie shorter than this has no room for words."""


def draw_gantt_figure(content: DayPlanFile) -> Figure:
    """Return the days of a plan, those on which somebody flies."""
    flown = [
        number for number, (begin, end) in enumerate(content.days)
        if any(begin <= one.start_s < end for own in content.plan.sorties for one in own)
    ]  # fmt: skip
    shown = flown[:MOST_DAYS] or [0]
    panel_in = ROW_IN * (len(content.vehicles) + 1)
    total_in = HEAD_IN + len(shown) * (panel_in + GAP_IN) + FOOT_IN
    figure = Figure(figsize=(WIDTH_IN, total_in), facecolor=PAPER)
    count, hours = content.evaluation.count, content.evaluation.flight_s / HOUR_S
    more = f", the first {MOST_DAYS} of {len(flown)} days" if len(flown) > MOST_DAYS else ""
    title = f"{count} sorties, {hours:.1f} h in the air, {len(flown)} days{more}"
    figure.text(0.01, 1.0 - 0.3 / total_in, title, fontsize=14, fontweight="bold", color=INK, va="center")
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
    for row, own in enumerate(content.plan.sorties):
        closed, at = [], begin
        for opens, closes in content.vehicles[row].windows:
            if begin <= opens < end:
                closed.append((at, opens - at))
                at = closes
        closed.append((at, end - at))
        axes.broken_barh([(start, long) for start, long in closed if long > 0], (row - 0.5, 1.0), color="#eeeeee", lw=0)
        for number, one in enumerate(own):
            if begin <= one.start_s < end:
                lasts_s = content.evaluation.lasts_s[row][number]
                axes.broken_barh(
                    [(one.start_s, lasts_s)], (row - 0.36, 0.72), color=_colour_of(one.base), ec=PAPER, lw=0.8
                )
                if lasts_s > NARROW_S * (end - begin) / (8 * HOUR_S):
                    words = f"{len(one.visits)}" if one.lands == one.base else f"{len(one.visits)} →"
                    axes.text(one.start_s + lasts_s / 2, row, words, fontsize=8, color=PAPER, ha="center", va="center")
    axes.set_xlim(begin, end)
    axes.set_ylim(len(content.vehicles) - 0.5, -0.5)
    axes.set_yticks(range(len(content.vehicles)), [own.name for own in content.vehicles], fontsize=9)
    axes.xaxis.set_major_locator(MultipleLocator(HOUR_S))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_clock(value)))
    axes.grid(axis="x", color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    axes.set_title(f"day {day + 1}: segments of each sortie", loc="left", fontsize=10, color=INK)
    for spine in axes.spines.values():
        spine.set_color(FAINT)


def format_clock(seconds: float) -> str:
    """Return the time of the day.

    >>> clock(86_400 + 30_630.0)
    '08:30'
    """
    minutes = int(seconds % DAY_S // 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def _colour_of(base: int) -> str:
    return COLOURS[base % len(COLOURS)]
