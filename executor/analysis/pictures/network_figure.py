"""The map of a network as it was understood from its file: a colour a line."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from executor.analysis.pictures.map_sheet import draw_legend, make_sheet
from executor.analysis.pictures.style import COLOURS, FAINT, INK, PAPER, make_white_edge
from missions import NetworkImport

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
    sheet = make_sheet(shown_m, title, ["Network"], len(handles))
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
    draw_legend(sheet, handles)
    return sheet.figure


def _shorten_name(name: str) -> str:
    """Return a name that has room; a dollar sign would begin a formula."""
    text = name if len(name) <= LETTERS else f"{name[: LETTERS - 3]}..."
    return text.replace("$", r"\$") or "no line's name"
