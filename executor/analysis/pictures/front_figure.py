"""Plans that no other one beats: how long, how early a loss may come, how much energy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from executor.analysis.pictures.style import FAINT, INK, PAPER, WIDTH_IN, make_white_edge

HEIGHT_IN = 7.2
PLOT = (0.07, 0.095, 0.79, 0.79)
BAR = (0.885, 0.095, 0.018, 0.79)
COLOURS = "viridis"
"""Even in lightness, so also in grey and for the colour-blind."""
MARKERS = ("X", "s", "^", "D", "v", "P")
"""Of the plans to compare with; those of the front are round."""
OFFSETS_PT = ((0, 13), (13, 6), (13, -7), (0, -14), (-13, 6), (-13, -7), (0, 26), (25, 12), (25, -13), (0, -27))
"""Where a number may stand, from its point; the first that is free is taken."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """One plan by its three figures; less is better in each."""

    longest_route_s: float
    earliest_s: float
    """When its re-plan window begins."""
    energy_pct: float
    """Of all routes together, in percent of a full battery."""


def draw_front_figure(front: Sequence[FrontPoint], references: Mapping[str, FrontPoint]) -> Figure:
    """Return earliest loss over longest route, coloured by energy; numbered from 1 in the order given."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), facecolor=PAPER)
    axes, bar = figure.add_axes(PLOT), figure.add_axes(BAR)
    points = [*front, *references.values()]
    energies = [point.energy_pct for point in points]
    scale = Normalize(min(energies), max(*energies, min(energies) + 0.1))
    shade = colormaps[COLOURS]
    _set_limits(axes, points)
    axes.grid(color="#e4e4e4", lw=0.8)
    axes.set_axisbelow(True)
    for point in front:
        axes.plot(point.longest_route_s, point.earliest_s, ls="", marker="o", ms=10, mfc=shade(scale(point.energy_pct)),
                  mec=INK, mew=0.8, zorder=3)  # fmt: skip
    for number, point in enumerate(references.values()):
        axes.plot(point.longest_route_s, point.earliest_s, ls="", marker=MARKERS[number % len(MARKERS)], ms=13,
                  mfc=shade(scale(point.energy_pct)), mec=INK, mew=1.6, zorder=2)  # fmt: skip
    axes.set_xlabel("longest route (s)")
    axes.set_ylabel("earliest time at which the fleet can absorb any one loss (s)")
    colours = figure.colorbar(ScalarMappable(scale, shade), cax=bar)
    colours.set_label("energy of all routes (% of a battery)")
    figure.text(0.01, 1.0 - 0.32 / HEIGHT_IN, "Plans that no other one beats in all three", fontsize=14,
                fontweight="bold", color=INK, va="center")  # fmt: skip
    figure.text(0.01, 1.0 - 0.58 / HEIGHT_IN, "left: sooner done; below: losses may come earlier; dark: less energy",
                fontsize=9.5, color=INK, va="center")  # fmt: skip
    handles = [
        Line2D([], [], ls="", marker=MARKERS[number % len(MARKERS)], ms=9, mfc=PAPER, mec=INK, mew=1.4, label=name)
        for number, name in enumerate(references)
    ]
    figure.legend(
        handles=handles, loc="upper right", ncols=max(1, len(handles)), frameon=False, fontsize=9.5,
        bbox_to_anchor=(PLOT[0] + PLOT[2], 0.955), borderaxespad=0.0,
    )  # fmt: skip
    _number_plans(figure, axes, front, [*references.values()])
    return figure


def _set_limits(axes: Axes, points: Sequence[FrontPoint]) -> None:
    for values, set_limits in (
        ([point.longest_route_s for point in points], axes.set_xlim),
        ([point.earliest_s for point in points], axes.set_ylim),
    ):
        room = 0.08 * (max(values) - min(values)) + 5.0
        set_limits(min(values) - room, max(values) + room)


def _number_plans(figure: Figure, axes: Axes, front: Sequence[FrontPoint], others: Iterable[FrontPoint]) -> None:
    """Write each plan's number beside its point, on no other point or number where there is room."""
    figure.draw_without_rendering()
    per_pt = figure.dpi / 72.0
    dots = axes.transData.transform([(p.longest_route_s, p.earliest_s) for p in [*front, *others]])
    half = 8.0 * per_pt
    taken = [(x - half, y - half, x + half, y + half) for x, y in dots]
    for number, (point, (x, y)) in enumerate(zip(front, dots, strict=False), start=1):
        wide, high = 4.5 * per_pt * len(str(number)), 6.0 * per_pt
        boxes = [
            (x + east * per_pt - wide, y + north * per_pt - high, x + east * per_pt + wide, y + north * per_pt + high)
            for east, north in OFFSETS_PT
        ]
        free = [place for place, box in enumerate(boxes) if not any(_has_overlap(box, other) for other in taken)]
        chosen = free[0] if free else 0
        taken.append(boxes[chosen])
        axes.add_artist(Annotation(
            str(number), xy=(point.longest_route_s, point.earliest_s), xytext=OFFSETS_PT[chosen],
            textcoords="offset points", ha="center", va="center", fontsize=10, color=INK,
            path_effects=make_white_edge(2.5),
            arrowprops=None if chosen < 6 else {"arrowstyle": "-", "color": FAINT, "linewidth": 0.8},
            zorder=6,
        ))  # fmt: skip


def _has_overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
