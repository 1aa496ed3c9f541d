"""The chance of finishing over the mean time between failures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from executor.analysis.pictures.battery_figure import spread_heights
from executor.analysis.pictures.style import FAINT, INK, PAPER, WIDTH_IN, make_white_edge, style_of
from executor.site.campaign_runner import describe_policy
from planner import RiskEstimate

HEIGHT_IN = 6.6
PLOT = (0.065, 0.11, 0.665, 0.78)
"""Left, bottom, width and height as shares of the figure; names of the curves stand to its right."""
LABEL_STEP = 0.085
"""Least distance of two names of two lines each, as a share of the plot's height."""


def draw_risk_figure(swept: Sequence[RiskEstimate], given: RiskEstimate) -> Figure:
    """Return the probability that everything gets inspected, one curve for each number of re-plans.

    Args:
        swept: answers in ascending order of their mean time between failures.
        given: the answer for the time that was asked for, from more flights; it is marked, and its figures stand
            beside the curves.
    """
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), facecolor=PAPER)
    axes = figure.add_axes(PLOT)
    hours = [risk.mtbf_h for risk in swept]
    axes.set_xscale("log")
    axes.set_xlim(hours[0], hours[-1])
    lowest = min(100 * chance.low for risk in swept for chance in risk.finished)
    floor = max(0.0, 10.0 * math.floor(lowest / 10.0 - 0.3))
    axes.set_ylim(floor, 100.0 + 0.03 * (100.0 - floor))
    axes.xaxis.set_major_locator(FixedLocator(hours))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    axes.axvline(given.mtbf_h, color=FAINT, lw=1.2, zorder=1)
    for replans in range(len(given.finished)):
        look = style_of(replans)
        curve = [risk.finished[replans] for risk in swept]
        axes.fill_between(
            hours, [100 * one.low for one in curve], [100 * one.high for one in curve],
            color=look.colour, alpha=0.2, lw=0, zorder=2,
        )  # fmt: skip
        axes.plot(
            hours, [100 * one.estimate for one in curve], color=look.colour, lw=2.0, marker=look.marker, ms=6.5,
            mec=PAPER, mew=0.8, ls="-" if replans == 0 else look.dashes, zorder=3 + replans, clip_on=False,
        )  # fmt: skip
        axes.plot(
            given.mtbf_h, 100 * given.finished[replans].estimate, color=look.colour, marker=look.marker, ms=10.5,
            mec=INK, mew=1.4, ls="", zorder=10,
        )  # fmt: skip
    _label_curves(figure, swept[-1], given)
    axes.set_xlabel("mean time between failures of one vehicle (flight hours)")
    axes.set_ylabel("everything inspected (% of flights)")
    axes.annotate(
        f"asked for: {given.mtbf_h:g} h", xy=(given.mtbf_h, 0.0), xycoords=("data", "axes fraction"), xytext=(6.0, 6.0),
        textcoords="offset points", fontsize=9.5, color=INK, path_effects=make_white_edge(2.0),
    )  # fmt: skip
    figure.text(0.01, 1.0 - 0.32 / HEIGHT_IN, "Chance that everything is inspected", fontsize=14, fontweight="bold",
                color=INK, va="center")  # fmt: skip
    figure.text(0.01, 1.0 - 0.58 / HEIGHT_IN, f"curves: {swept[0].flights} flights a point; bands: 95 % confidence",
                fontsize=9.5, color=INK, va="center")  # fmt: skip
    return figure


def _label_curves(figure: Figure, last: RiskEstimate, given: RiskEstimate) -> None:
    """Write what each curve is to the right of its end, and its figure for the time that was asked for."""
    (axes,) = figure.axes
    ends = sorted((100 * chance.estimate, replans) for replans, chance in enumerate(last.finished))
    low, high = axes.get_ylim()
    heights = spread_heights([(end - low) / (high - low) for end, _ in ends], LABEL_STEP)
    above = max(0.0, heights[-1] - 1.0)
    for (end, replans), height in zip(ends, heights, strict=True):
        chance, look = given.finished[replans], style_of(replans)
        axes.annotate(
            f"{describe_policy(replans)}\n{100 * chance.estimate:.2f} % at {given.mtbf_h:g} h "
            f"({100 * chance.low:.2f} to {100 * chance.high:.2f} %)",
            xy=(1.0, end), xycoords=("axes fraction", "data"),
            xytext=(1.035, height - above), textcoords="axes fraction",
            fontsize=9, color=INK, va="center", annotation_clip=False,
            arrowprops={
                "arrowstyle": "-", "color": look.colour, "linewidth": 1.2, "relpos": (0.0, 0.5), "shrinkA": 2,
                "shrinkB": 4,
            },
        )  # fmt: skip
