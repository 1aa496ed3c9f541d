"""The picture of how a ground station's work grows with its fleet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from executor.bench.fleet import Flown


def draw_growth(flights: Sequence[Flown], path: Path) -> None:
    """Draw processor time, the loop's delays and memory over the number of vehicles."""
    from matplotlib.figure import Figure

    from executor.adapters.pictures.style import COLOURS, DPI, FAINT, MARKERS, PAPER

    figure = Figure(figsize=(12.0, 3.8), facecolor=PAPER, layout="constrained")
    counts = [one.vehicles for one in flights]
    rows = (
        ("of one core at real time, %", {"": [0.1 * one.cpu_ms * one.vehicles for one in flights]}),
        ("the event loop blocked, ms", {
            "at most": [one.blocked_ms[2] for one in flights], "99.99 %": [one.blocked_ms[1] for one in flights],
            "99 %": [one.blocked_ms[0] for one in flights],
        }),
        ("resident memory at the end, MiB", {"": [one.memory_mib[-1] for one in flights]}),
    )  # fmt: skip
    for axes, (label, lines) in zip(figure.subplots(1, 3), rows, strict=True):
        for place, (name, values) in enumerate(lines.items()):
            axes.plot(counts, values, color=COLOURS[place], marker=MARKERS[place], label=name)
        axes.set(xlabel="vehicles", ylabel=label)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.grid(color=FAINT, alpha=0.3, lw=0.5)
        if len(lines) > 1:
            axes.legend(frameon=False)
    figure.savefig(path, dpi=DPI)
