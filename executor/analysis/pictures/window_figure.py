"""A plan's re-plan window: battery consumption over time, and how it goes on when a vehicle is lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from executor.analysis.pictures.battery_figure import (
    BELOW_IN,
    LEFT,
    MOMENT_IN,
    PLOT_IN,
    RIGHT,
    TITLE_IN,
    LineEnd,
    draw_limits,
    draw_time_marks,
    label_lines,
    stack_time_marks,
)
from executor.analysis.pictures.style import INK, LOSS, PAPER, WIDTH_IN, style_of
from missions import PlanFile
from planner import Plan, RemainingProblem, ReplanWindow
from planner.risk import RouteProgress, build_state_before_losses

Repair = tuple[RemainingProblem, Plan]
"""What a loss leaves, and the plan for it."""
SHADE = "#f3e3c3"
LEGEND_COLUMNS = 5
LEGEND_ROW_IN = 0.21


def draw_window_figure(content: PlanFile, found: ReplanWindow, repairs: Sequence[Repair]) -> Figure:
    """Return percent used over seconds since the launch, as in the paper's figure of re-plans.

    Plans are solid. Re-plans are dashed: a line's colour is the vehicle that flies it, its dashes say who is lost.
    """
    state = build_state_before_losses(content.build_instance(), content.plan)
    planned = [state.progress_of(vehicle) for vehicle in range(len(state.fleet))]
    anew = [_compute_replanned_progress(content, repair) for repair in repairs]
    drawn = planned + [flown for lines in anew for _, flown in lines]
    end_s = 1.01 * max(1.0, *(float(flown.time_s[-1]) for flown in drawn))
    limits = _collect_limits(content)
    moments = stack_time_marks(
        [
            (found.earliest_s, f"window begins, {found.earliest_s:.0f} s", LOSS),
            (found.longest_route_s, f"longest route, {found.longest_route_s:.0f} s", INK),
        ],
        end_s,
    )
    handles = _build_legend(content, found, repairs)
    below_in = BELOW_IN + LEGEND_ROW_IN * ((len(handles) - 1) // LEGEND_COLUMNS)
    height_in = below_in + PLOT_IN + MOMENT_IN * (1 + max(moment.line for moment in moments)) + TITLE_IN
    figure = Figure(figsize=(WIDTH_IN, height_in), facecolor=PAPER)
    axes = figure.add_axes((LEFT, below_in / height_in, RIGHT - LEFT, PLOT_IN / height_in))
    axes.set_xlim(0.0, end_s)
    axes.set_ylim(0.0, 1.08 * max([*limits.values(), *(float(flown.used_pct[-1]) for flown in drawn)]))
    axes.axvspan(found.earliest_s, found.longest_route_s, color=SHADE, lw=0, zorder=0)
    draw_limits(axes, limits, end_s)
    _draw_lines(axes, planned, repairs, anew)
    if 0 < found.certified_earliest_s < found.earliest_s:
        axes.axvline(found.certified_earliest_s, color=LOSS, lw=1.2, ls=(0, (1.0, 2.0)), zorder=2)
    draw_time_marks([axes], moments)
    label_lines(axes, _collect_line_ends(content, planned, repairs, anew))
    axes.set_xlabel("time since launch (s)")
    axes.set_ylabel("battery used (%)")
    figure.text(
        0.01, 1.0 - 0.3 / height_in, _compose_title(found), fontsize=14, fontweight="bold", color=INK, va="center"
    )  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=LEGEND_COLUMNS, frameon=False, fontsize=9)
    return figure


def _compute_replanned_progress(content: PlanFile, repair: Repair) -> list[tuple[int, RouteProgress]]:
    """Return what each survivor will have done by when, from when it can follow the re-plan."""
    left, plan = repair
    state = build_state_before_losses(content.build_instance(), content.plan).apply_plan(left, plan)
    lines = []
    for place, survivor in enumerate(left.survivors):
        if not plan.routes[place].visits and survivor.finishing is None:
            continue
        whole = state.progress_of(place)
        since = np.flatnonzero(whole.time_s >= survivor.free_s - 1e-6)
        part = RouteProgress(whole.time_s[since], whole.used_pct[since], whole.airborne_s[since])
        lines.append((survivor.vehicle, part))
    return lines


def _draw_lines(
    axes: Axes,
    planned: Sequence[RouteProgress],
    repairs: Sequence[Repair],
    anew: Sequence[list[tuple[int, RouteProgress]]],
) -> None:
    for vehicle, flown in enumerate(planned):
        axes.plot(flown.time_s, flown.used_pct, color=style_of(vehicle).colour, lw=2.4, zorder=3)
    for (left, _), lines in zip(repairs, anew, strict=True):
        lost = left.lost
        for vehicle, flown in lines:
            colour, dashes = style_of(vehicle).colour, style_of(lost).dashes
            axes.plot(flown.time_s, flown.used_pct, color=colour, lw=1.5, ls=dashes, zorder=4)
            axes.plot(flown.time_s[-1:], flown.used_pct[-1:], ls="", marker=style_of(lost).marker, ms=5.5, mfc=colour,
                      mec=PAPER, mew=0.6, zorder=5)  # fmt: skip


def _collect_limits(content: PlanFile) -> dict[str, float]:
    """Return the budgets by what is to be written on their lines."""
    names: dict[float, list[str]] = {}
    for vehicle in content.vehicles:
        names.setdefault(vehicle.budget_pct, []).append(vehicle.name)
    everybody = len(content.vehicles)
    return {
        f"budget, {budget:g} %" + ("" if len(who) == everybody else f" ({', '.join(who)})"): budget
        for budget, who in names.items()
    }


def _collect_line_ends(
    content: PlanFile,
    planned: Sequence[RouteProgress],
    repairs: Sequence[Repair],
    anew: Sequence[list[tuple[int, RouteProgress]]],
) -> list[LineEnd]:
    ends = []
    for vehicle, flown in enumerate(planned):
        words = f"{content.vehicles[vehicle].name}: plan {flown.used_pct[-1]:.0f} %"
        most = max(
            (float(part.used_pct[-1]) for lines in anew for who, part in lines if who == vehicle), default=None
        )  # fmt: skip
        if most is not None and repairs:
            words += f", re-plan {most:.0f} %"
        ends.append(LineEnd(float(flown.time_s[-1]), float(flown.used_pct[-1]), words, style_of(vehicle).colour))
    return ends


def _compose_title(found: ReplanWindow) -> str:
    title = f"Re-plan window {found.window_pct:.1f} %"
    if found.earliest_s >= found.longest_route_s:
        return f"{title}: at no time can the fleet absorb every loss"
    return f"{title}: from {found.earliest_s:.0f} s the fleet can absorb any one loss"


def _build_legend(content: PlanFile, found: ReplanWindow, repairs: Sequence[Repair]) -> list[Artist]:
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
