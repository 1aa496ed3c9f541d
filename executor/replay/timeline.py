"""Draw a replayed flight over time, with its page: battery with band, voltage, link age, progress, declared faults."""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from executor.adapters.templates import render_template, write_page
from executor.analysis.pictures import save_figure
from executor.analysis.pictures.style import FAINT, INK, LOSS, PAPER, WIDTH_IN, style_of
from executor.core.state.vehicle_state import FaultKind
from executor.replay.replay_result import LogReplay, VehicleReplay

ROW_IN = 1.9
BAND_SD = 2.0
KIND_COLOURS = {FaultKind.LINK: "#1f3fa8", FaultKind.BATTERY: "#e8a010", FaultKind.INTERRUPTION: "#00806b",
                FaultKind.OPERATOR: "#5a5a5a", FaultKind.FENCE: "#8a2a8a"}  # fmt: skip
ROWS = ("battery (%)", "voltage (V)", "link age (s)", "progress")
MOST_LETTERS = 100
LEGEND_PCT, DECLARED_PCT = -32.0, -16.0
"""Lower limits of the battery axis: for the legend below the curves, and for the declared faults above it."""
HEADROOM = 0.25


def draw_replay(replay: LogReplay, path: Path) -> None:
    """Write the timeline of a log, four rows for each vehicle."""
    count = max(1, len(replay.vehicles))
    figure = Figure(figsize=(WIDTH_IN, ROW_IN * len(ROWS) * count + 1.0), facecolor=PAPER)
    axes = figure.subplots(len(ROWS) * count, 1, sharex=True, squeeze=False)[:, 0]
    for number, vehicle in enumerate(replay.vehicles):
        rows = list(axes[number * len(ROWS) : (number + 1) * len(ROWS)])
        _draw_vehicle(replay, vehicle, rows, style_of(number).colour)
        for axis in rows:
            _draw_moments(replay, vehicle, axis, named=axis is rows[0])
    for axis in axes:
        axis.margins(x=0.01)
        axis.grid(visible=True, color=FAINT, alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("seconds since the log began", color=INK)
    figure.suptitle(_compose_title(replay), color=INK, fontsize=11)
    figure.tight_layout()
    save_figure(figure, path)


def _compose_title(replay: LogReplay) -> str:
    declared = [
        f"{vehicle.name}: {one.kind.value}, {one.reason}" for vehicle in replay.vehicles for one in vehicle.declarations
    ]
    return f"{replay.path.name}: " + ("; ".join(declared) if declared else "nothing to declare")


def _draw_vehicle(replay: LogReplay, vehicle: VehicleReplay, rows: list[Axes], colour: str) -> None:
    def series(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.array([getattr(one, name) for one in vehicle.samples], dtype=np.float64)

    at_s, estimate, band = series("at_s"), series("estimate_pct"), BAND_SD * series("sd_pct")
    battery, voltage, link, progress = rows
    battery.fill_between(at_s, estimate - band, estimate + band, color=colour, alpha=0.2, linewidth=0)
    battery.plot(at_s, estimate, color=colour, linewidth=1.4, label="estimated, with two standard deviations")
    battery.plot(at_s, series("remaining_pct"), ".", color=INK, markersize=2.5, label="reported")
    battery.plot(at_s, series("landing_pct"), "--", color=colour, linewidth=1.0, label="at the landing, or at home")
    battery.set_ylim(LEGEND_PCT - 8.0, 105.0)
    battery.set_yticks(range(0, 101, 25))
    voltage.plot(at_s, series("voltage_v"), color=colour, linewidth=1.2)
    link.plot(at_s, series("link_age_s"), color=colour, linewidth=1.2, label="any message")
    link.plot(at_s, series("heartbeat_age_s"), ":", color=INK, linewidth=1.0, label="HEARTBEAT")
    progress.step(at_s, series("item"), where="post", color=colour, linewidth=1.2, label="mission item")
    progress.plot(at_s, series("height_m"), color=FAINT, linewidth=1.0, label="height (m)")
    for axis, words in zip(rows, ROWS, strict=True):
        axis.set_ylabel(f"{vehicle.name}\n{words}", color=INK, fontsize=8)
        if axis is not voltage and len(at_s):
            if axis is not battery:  # room for the legend above the curves; for the battery it is below
                bottom, top = axis.get_ylim()
                axis.set_ylim(bottom, top + HEADROOM * (top - bottom))
            corner = (0.0, 0.0) if axis is battery else (0.0, 1.0 - HEADROOM / (1.0 + HEADROOM))
            axis.legend(loc=corner, fontsize=7, frameon=False, ncols=3, borderaxespad=0.1)
    for one in vehicle.degraded:
        row = link if one.kind is FaultKind.LINK else battery if one.kind is FaultKind.BATTERY else progress
        since, until = ((usec - replay.began_usec) / 1e6 for usec in (one.from_usec, one.to_usec))
        row.axvspan(since, until, color=KIND_COLOURS[one.kind], alpha=0.12, linewidth=0)


def _draw_moments(replay: LogReplay, vehicle: VehicleReplay, axis: Axes, *, named: bool) -> None:
    for one in vehicle.declarations:
        at_s = (one.t_usec - replay.began_usec) / 1e6
        axis.axvline(at_s, color=LOSS, linewidth=1.4)
        if named:
            late = at_s > replay.lasted_s / 2
            words = shorten(f"{one.kind.value}: {one.evidence}", MOST_LETTERS, placeholder=" ...")
            axis.text(
                at_s, DECLARED_PCT, f"{words} " if late else f" {words}", color=LOSS, fontsize=7,
                ha="right" if late else "left",
            )  # fmt: skip


def write_replay_page(replay: LogReplay, picture: Path, path: Path) -> None:
    """Write the page of a log, with its picture embedded."""
    write_page(path, render_template("replay.html", replay=replay, picture=picture.read_bytes()))
