"""The operator's view in a terminal: a live table, and one line for each decision with its reason."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rich.console import Console as Terminal
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executor.core import energy
from executor.core.commands import Level
from executor.core.context import Context
from executor.core.preflight import Check, Severity
from executor.core.state import FleetState
from executor.core.vehicle import VehicleState

DRAWS_PER_S = 4.0
_STYLES = {Level.INFO: "", Level.WARNING: "yellow", Level.FAULT: "bold red"}
_MARKS = {Level.INFO: " ", Level.WARNING: "!", Level.FAULT: "X"}
_CHECK_MARKS = {
    Severity.OK: ("ok  ", "green"),
    Severity.WARNING: ("warn", "yellow"),
    Severity.STOP: ("STOP", "bold red"),
}


class TerminalConsole:
    """Draws with rich on a terminal; plain lines where the output is a file or a pipe."""

    def __init__(self, *, quiet: bool, yes: bool) -> None:
        """Choose how much is shown and whether questions are asked.

        Args:
            quiet: show nothing but questions; `--json` wants the output for itself.
            yes: take every question as answered.
        """
        self._terminal = Terminal(stderr=True, highlight=False, soft_wrap=True)
        self._quiet = quiet
        self._yes = yes
        self._live: Live | None = None
        self._view: tuple[Context, FleetState, float] | None = None

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show one line; the mark in front says what the colour says."""
        if self._quiet:
            return
        if level is Level.FAULT and self._terminal.is_terminal:
            self._terminal.bell()
        when = "       " if at_s is None else f"{at_s:6.1f} "
        self._terminal.print(Text(f"{when}{_MARKS[level]} {text}", style=_STYLES[level]))

    def progress(self, text: str) -> None:
        """Show how far something long has come; an empty text clears the line."""
        if self._quiet or not self._terminal.is_terminal:
            return
        self._terminal.print(Text(text), end="\r" if text else "\x1b[2K\r", overflow="crop")

    def checks(self, found: Sequence[Check]) -> None:
        """Show the checklist."""
        if self._quiet:
            return
        for check in found:
            mark, style = _CHECK_MARKS[check.severity]
            self._terminal.print(Text.assemble("  ", (mark, style), f"  {check.subject}: {check.text}"))

    def confirm(self, question: str) -> bool:
        """Ask before the take-off; without somebody to answer the answer is no."""
        if self._yes:
            return True
        if not sys.stdin.isatty():
            return False
        try:
            return self._terminal.input(f"{question} [y/N] ", markup=False).strip().lower() in {"y", "yes"}
        except EOFError:
            return False

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Keep the newest view; the terminal draws it a few times a second."""
        self._view = (context, state, now_s)
        if self._quiet or not self._terminal.is_terminal or self._live is not None:
            return
        self._live = Live(
            get_renderable=self._table, console=self._terminal, refresh_per_second=DRAWS_PER_S, transient=True
        )
        self._live.start()

    def done(self) -> None:
        """Stop drawing."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _table(self) -> Table:
        table = Table(title_justify="left")
        for column in ("vehicle", "state", "segment", "done", "battery", "to finish", "link"):
            table.add_column(column, justify="left" if column in {"vehicle", "state"} else "right")
        if self._view is None:
            return table
        context, state, now_s = self._view
        table.title = f"{len(state.inspected)} of {context.segments} segments inspected, {now_s:.0f} s"
        for vehicle in state.vehicles.values():
            table.add_row(*_row(state, vehicle, now_s), style=_style(vehicle))
        return table


def _style(vehicle: VehicleState) -> str:
    if vehicle.fault is not None:
        return "bold red"
    return "yellow" if vehicle.stale else ""


def _row(state: FleetState, vehicle: VehicleState, now_s: float) -> tuple[str, ...]:
    leg = vehicle.leg
    segment = "-"
    if leg is not None and leg.visit is not None and vehicle.board is not None and vehicle.airborne:
        segment = f"{vehicle.board.tracks[leg.visit].segment} ({leg.phase.value})"
    done = sum(name == vehicle.name for name in state.inspected.values())
    total = len(vehicle.board.visits) if vehicle.board is not None else 0
    remaining = vehicle.battery.remaining_pct
    return (
        vehicle.name,
        vehicle.stage.value + ("" if vehicle.fault is None else f", {vehicle.fault.kind.value} fault"),
        segment,
        f"{done}/{total}",
        "?" if remaining is None else f"{remaining:.0f} %",
        f"{energy.to_finish_pct(vehicle):.0f} %",
        "?" if vehicle.heard_s is None else f"{max(0.0, now_s - vehicle.heard_s):.1f} s",
    )
