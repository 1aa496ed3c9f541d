"""Define a vehicle's style in every picture: distinct hue, lightness, and dash or marker, so that it works in grey."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, Normal, Stroke

Dashes = tuple[float, tuple[float, ...]]
"""Matplotlib's offset and on-off lengths, in units of the line's width."""

COLOURS = (
    "#1f3fa8",  # blue, lightness 31
    "#e8a010",  # orange, 71
    "#00806b",  # teal, 48
    "#cc6fb0",  # pink, 59
    "#38104c",  # dark purple, 14
    "#8fd3f2",  # sky, 81
    "#8a4a1c",  # brown, 38
    "#a3a300",  # olive, 65
)
"""At least 5 apart in CIE lightness, the first ones farthest; no red, which marks a loss."""
MARKERS = ("o", "^", "s", "D", "v", "P", "h")
DASHES: tuple[Dashes, ...] = (
    (0, (4.0, 1.6)), (0, (1.6, 1.2)), (0, (7.0, 1.6, 1.4, 1.6)), (0, (7.0, 3.0)), (0, (3.0, 1.2, 1.0, 1.2, 1.0, 1.2)),
    (0, (10.0, 2.0)), (0, (2.6, 2.6)),
)  # fmt: skip
"""As many as markers, and coprime to the number of colours: 56 distinct vehicles."""

LOSS = "#c81414"
"""Red for faults and losses."""
INK = "#222222"
FAINT = "#9a9a9a"
"""Grey of the network and other background."""
PAPER = "#ffffff"
DPI = 150
WIDTH_IN = 12.0
"""Figure width: 1800 pixels."""


@dataclass(frozen=True, slots=True)
class VehicleStyle:
    """Style of one vehicle."""

    colour: str
    marker: str
    dashes: Dashes
    """Dashes of its re-plans; a first plan is solid."""


def style_of(layer: int) -> VehicleStyle:
    """Return the style of the vehicle in a layer."""
    return VehicleStyle(COLOURS[layer % len(COLOURS)], MARKERS[layer % len(MARKERS)], DASHES[layer % len(DASHES)])


def make_figure(height_in: float, title: str, below: str = "") -> Figure:
    """Return an empty figure of the usual width with its title, and a smaller line below it."""
    figure = Figure(figsize=(WIDTH_IN, height_in), facecolor=PAPER)
    figure.text(0.01, 1.0 - 0.3 / height_in, title, fontsize=14, fontweight="bold", color=INK, va="center")
    figure.text(0.01, 1.0 - 0.58 / height_in, below, fontsize=9.5, color=INK, va="center")
    return figure


def make_white_edge(width_pt: float) -> list[AbstractPathEffect]:
    """Return a white edge around a line or a text, to set it off from the background."""
    return [Stroke(linewidth=width_pt, foreground=PAPER), Normal()]
