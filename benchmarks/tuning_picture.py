"""Detection delay against false alarms, for every swept threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from executor.analysis.pictures import save_figure
from executor.analysis.pictures.style import FAINT, INK, LOSS, PAPER, WIDTH_IN, style_of


@dataclass(frozen=True, slots=True)
class ThresholdPoint:
    """One value of one threshold, over all flights."""

    threshold: str
    value: float
    chosen: bool
    """Whether it is the value in use."""
    found: int
    faults: int
    mean_delay_s: float | None
    """Mean over the detected faults."""
    false_alarms: int
    flight_hours: float

    @property
    def false_per_hour(self) -> float:
        """False alarms per flight hour."""
        return self.false_alarms / self.flight_hours if self.flight_hours else 0.0


def draw_tuning(points: Sequence[ThresholdPoint], path: Path) -> None:
    """Draw the picture: left delay against false alarms, right the faults found at each value."""
    figure = Figure(figsize=(WIDTH_IN, 5.5), facecolor=PAPER)
    trade, found = figure.subplots(1, 2)
    for number, name in enumerate(dict.fromkeys(point.threshold for point in points)):
        style, curve = style_of(number), [point for point in points if point.threshold == name]
        late = [(one.false_per_hour, one.mean_delay_s) for one in curve if one.mean_delay_s is not None]
        trade.plot(
            [rate for rate, _ in late], [delay for _, delay in late], marker=style.marker, color=style.colour,
            linestyle=style.dashes, label=name, markersize=5,
        )  # fmt: skip
        for one in curve:
            if one.chosen and one.mean_delay_s is not None:
                at = [one.false_per_hour], [one.mean_delay_s]
                trade.plot(*at, marker="o", markersize=11, markerfacecolor="none", markeredgecolor=LOSS)
        used = next((one.value for one in curve if one.chosen), 1.0)
        found.plot(
            [one.value / used for one in curve], [100 * one.found / max(1, one.faults) for one in curve],
            marker=style.marker, color=style.colour, linestyle=style.dashes, markersize=5,
        )  # fmt: skip
    trade.set_xlabel("false alarms per flight hour", color=INK)
    trade.set_ylabel("mean delay of what was found (s)", color=INK)
    trade.set_title("circled: the values in use", fontsize=9)
    trade.legend(fontsize=8, frameon=False)
    found.set_xlabel("threshold, relative to the one in use", color=INK)
    found.set_ylabel("faults found (%)", color=INK)
    found.set_ylim(-5.0, 105.0)
    for axis in (trade, found):
        axis.grid(visible=True, color=FAINT, alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    save_figure(figure, path)
