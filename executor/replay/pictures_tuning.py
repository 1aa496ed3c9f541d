"""Detection delay against false alarms, for every threshold that was moved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from executor.analysis.pictures.style import DPI, FAINT, INK, LOSS, PAPER, WIDTH_IN, style_of

Value = tuple[float, float | None, float, int, int, bool]
"""(value, mean delay in seconds or None, false alarms per flight hour, found, faults, whether it is in use)."""


@dataclass(frozen=True, slots=True)
class Curve:
    """One threshold."""

    name: str
    values: tuple[Value, ...]


def draw_tuning(curves: list[Curve], path: Path) -> None:
    """Write the picture: left delay against false alarms, right how many faults were found by each value."""
    figure = Figure(figsize=(WIDTH_IN, 5.5), facecolor=PAPER)
    trade, found = figure.subplots(1, 2)
    for number, curve in enumerate(curves):
        style = style_of(number)
        points = [(rate, delay) for _, delay, rate, *_ in curve.values if delay is not None]
        trade.plot(
            [rate for rate, _ in points], [delay for _, delay in points], marker=style.marker, color=style.colour,
            linestyle=style.dashes, label=curve.name, markersize=5,
        )  # fmt: skip
        for _, delay, rate, *_, chosen in curve.values:
            if chosen and delay is not None:
                trade.plot([rate], [delay], marker="o", markersize=11, markerfacecolor="none", markeredgecolor=LOSS)
        used = next((value for value, *_, chosen in curve.values if chosen), 1.0)
        found.plot(
            [value / used for value, *_ in curve.values], [100 * hits / max(1, of) for *_, hits, of, _ in curve.values],
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
    figure.savefig(path, dpi=DPI)
