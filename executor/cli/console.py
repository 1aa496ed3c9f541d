"""Draw the operator's terminal view: a live table, and one line for each decision with its reason."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TextIO, cast

from rich.console import Console as Terminal
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from executor.adapters.interrupts import discard_output
from executor.core import formatting
from executor.core.context import Context
from executor.core.fleet_view import FleetView, PositionView, TakenView, VehicleView, build_fleet_view
from executor.core.interface.codes import Check, Severity
from executor.core.interface.commands import Level
from executor.core.state.fleet_state import FleetState

DRAWS_PER_S = 4.0
LEFT_ALIGNED = frozenset({"vehicle", "state", "where"})
COLUMNS = ("vehicle", "state", "where", "route", "inspected", "battery", "GPS", "link", "home in")
FOUND_BY_PLACE = frozenset({"lost", "down", "pilot"})
"""States in which a crew may have to walk to the vehicle."""
_STYLES = {Level.INFO: "", Level.WARNING: "yellow", Level.FAULT: "bold red"}
_MARKS = {Level.INFO: " ", Level.WARNING: "!", Level.FAULT: "X"}
_PHASES = {"takeoff": "takes off", "transit": "to", "inspect": "inspects", "return": "home", "land": "lands"}
_CHECK_MARKS = {
    Severity.OK: ("ok  ", "green"),
    Severity.WARNING: ("warn", "yellow"),
    Severity.STOP: ("STOP", "bold red"),
}


PROXIED = "rich_proxied_file"
"""Attribute that rich reads on streams that may be its own proxies."""


class _Screen:
    """Standard error, ignoring a closed terminal: that must not end a flight."""

    @property
    def _stream(self) -> TextIO:
        """Standard error itself, also while rich replaces it to draw."""
        return cast("TextIO", getattr(sys.stderr, PROXIED, sys.stderr))

    def write(self, text: str) -> int:
        with self._ignore_closed_terminal():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with self._ignore_closed_terminal():
            self._stream.flush()

    def __getattr__(self, name: str) -> object:
        if name == PROXIED:
            raise AttributeError(name)
        return getattr(self._stream, name)

    @contextmanager
    def _ignore_closed_terminal(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError) as error:
            if isinstance(error, UnicodeError):
                raise  # rich handles this one
            discard_output(self._stream)


class TerminalConsole:
    """Console that draws with rich on a terminal, and prints plain lines to a file or a pipe."""

    def __init__(self, *, quiet: bool, yes: bool, on_page: bool = False) -> None:
        """Choose the amount of output, and whether questions are asked.

        Args:
            quiet: Show questions only; `--json` uses the output itself.
            yes: Answer yes to every question.
            on_page: Leave every question to the page; there is no person at a terminal.
        """
        self._terminal = Terminal(file=cast("IO[str]", _Screen()), highlight=False, soft_wrap=True)
        self._quiet = quiet
        self._yes = yes
        self._on_page = on_page
        self._live: Live | None = None
        self._view: tuple[Context, FleetState, float] | None = None
        self._asked: Text | None = None
        self._offer = ""
        self._rings = False
        """Whether an offer has appeared without a bell yet."""

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        """Show one line; the mark in front repeats the meaning of the colour.

        Args:
            level: Severity; a fault rings the bell.
            text: The line.
            at_s: Seconds since the take-off order; None before it.
        """
        if self._quiet:
            return
        if level is Level.FAULT and self._terminal.is_terminal:
            self._terminal.bell()
        line = Text(
            f"{formatting.format_flight_time(at_s):>9} {_MARKS[level]} {formatting.escape_controls(text)}",
            style=_STYLES[level],
        )
        self._print(line)

    def show_progress(self, text: str) -> None:
        """Show the progress of a long task; an empty text clears the line."""
        if self._quiet or not self._terminal.is_terminal:
            return
        self._terminal.print(Text(text), end="\r" if text else "\x1b[2K\r", overflow="crop")

    def show_checks(self, found: Sequence[Check]) -> None:
        """Show the checklist."""
        if self._quiet:
            return
        for check in found:
            mark, style = _CHECK_MARKS[check.severity]
            about = f"  {formatting.escape_controls(check.subject)}: {formatting.escape_controls(check.text)}"
            self._print(Text.assemble("  ", (mark, style), about))

    def confirm(self, question: str) -> bool:
        """Ask while nothing else runs; Ctrl-C means no."""
        try:
            return asyncio.run(self.ask(question))
        except KeyboardInterrupt:
            return False

    async def ask(self, question: str) -> bool:
        """Ask while everything else continues; without a terminal the answer is no.

        The caller may cancel the wait if the question was answered elsewhere.
        """
        if self._yes:
            return True
        if self._on_page:
            await asyncio.get_running_loop().create_future()  # until answered elsewhere
        if not sys.stdin.isatty():
            return False
        loop = asyncio.get_running_loop()
        line: asyncio.Future[str] = loop.create_future()

        def typed() -> None:
            if not line.done():
                try:
                    line.set_result(sys.stdin.readline())
                except (OSError, ValueError):
                    line.set_result("")  # the terminal is closed: no person is there to say yes

        with self._show_question(question):
            loop.add_reader(sys.stdin.fileno(), typed)
            try:
                return (await line).strip().lower() in {"y", "yes"}
            except asyncio.CancelledError:
                self._terminal.print()
                raise
            finally:
                loop.remove_reader(sys.stdin.fileno())

    @contextmanager
    def _show_question(self, question: str) -> Iterator[None]:
        _drop_typed_input()
        self._asked = Text(f"{formatting.escape_controls(question)} [y/N] ")
        self._terminal.print(self._asked, end="")
        try:
            yield
        finally:
            self._asked = None

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        """Store the newest view; the terminal draws it a few times a second, from the take-off on."""
        self._view = (context, state, now_s)
        if self._quiet or not self._terminal.is_terminal or state.progress.launched_s is None:
            return
        if self._rings:
            self._rings = False
            self._terminal.bell()
        if self._live is not None:
            return
        self._live = Live(
            get_renderable=self._render_view, console=self._terminal, refresh_per_second=DRAWS_PER_S, transient=True
        )
        self._live.start()

    def stop_drawing(self) -> None:
        """Stop drawing."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _print(self, line: Text) -> None:
        """Show a line; a pending question stays the last line."""
        if self._asked is None:
            self._terminal.print(line)
            return
        if not self._terminal.is_terminal:
            self._terminal.print()
            self._terminal.print(line)
            return
        self._terminal.print("", end="\r\x1b[2K")
        self._terminal.print(line)
        self._terminal.print(self._asked, end="")

    def _render_view(self) -> Group:
        """Draw the newest view; called by the terminal's own thread, which must survive an error in it."""
        if self._view is None:
            return Group(Table(*COLUMNS))
        try:
            view = build_fleet_view(*self._view)
            offer = "" if view.offer is None else view.offer.text
            if offer != self._offer:
                self._offer, self._rings = offer, bool(offer)
            return render_fleet(view)
        except Exception as error:  # noqa: BLE001 - boundary of that thread
            died = (type(error), error, error.__traceback__, threading.current_thread())
            threading.excepthook(threading.ExceptHookArgs(died))
            return Group(Text("fleet display failed; decisions are still shown"))


def render_fleet(view: FleetView) -> Group:
    """Return the fleet as a table, with positions of vehicles to be found and questions to the crew below it."""
    table = Table(title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in COLUMNS:
        table.add_column(column, justify="left" if column in LEFT_ALIGNED else "right")
    clock = formatting.format_flight_time(view.flight_s)
    table.title = f"{clock}  {len(view.inspected)} of {view.segments_total} segments inspected"
    for vehicle in view.vehicles:
        table.add_row(*(Text(cell) for cell in _build_row(vehicle)), style=_style_of(vehicle))
    return Group(table, *(Text(line, style="bold") for line in _build_notes(view)))


def _style_of(vehicle: VehicleView) -> str:
    if vehicle.fault is not None:
        return "bold red"
    return "yellow" if vehicle.stale or vehicle.taken is not None else ""


def _build_row(vehicle: VehicleView) -> tuple[str, ...]:
    progress, left_pct = vehicle.progress, vehicle.battery.measured_pct
    shows = vehicle.fault_kind is not None and vehicle.state != "down"
    where = _PHASES.get(progress.phase or "", "-")
    if progress.segment_name is not None:
        where = f"{where} {formatting.escape_controls(progress.segment_name)}"
    return (
        vehicle.name,
        formatting.format_state_word(vehicle.state) + (f", {vehicle.fault_kind}" if shows else ""),
        where,
        f"{progress.done} of {progress.total}",
        str(progress.inspected),
        "?" if left_pct is None else f"{left_pct:.0f} %",
        formatting.format_gps_fix(vehicle.gps_fix, vehicle.satellites),
        "?" if vehicle.link_age_s is None else f"{vehicle.link_age_s:.1f} s",
        "-" if vehicle.lands_in_s is None else formatting.format_duration(vehicle.lands_in_s),
    )


def _build_notes(view: FleetView) -> Iterator[str]:
    for vehicle in view.vehicles:
        if vehicle.state in FOUND_BY_PLACE:
            place = "position unknown" if vehicle.position is None else _describe_last_place(vehicle.position)
            yield f"{vehicle.name} {formatting.format_state_word(vehicle.state)}: {place}"
        if vehicle.turn is not None and vehicle.turn.text:
            mark = "?" if vehicle.turn.awaited else " "
            yield f"{mark} {vehicle.name}: {formatting.escape_controls(vehicle.turn.text)}"
        if vehicle.taken is not None:
            yield f"{vehicle.name}: {_describe_other_control(vehicle.taken)}"
    if view.offer is not None:
        yield f"? {formatting.escape_controls(view.offer.text)}"


def _describe_last_place(at: PositionView) -> str:
    place = formatting.format_known_place(at.lat_deg, at.lon_deg, at.known, at.accuracy_m)
    reported = f"last at {place}, {at.relative_alt_m:.0f} m, {formatting.format_age(at.age_s)}"
    if (fix := at.last_fix) is None:
        return reported
    gps = formatting.format_lat_lon(fix.lat_deg, fix.lon_deg, fix.accuracy_m)
    return f"last GPS fix {gps}, {formatting.format_age(fix.age_s)}, at {fix.ground_speed_m_s:.0f} m/s; {reported}"


def _describe_other_control(hands: TakenView) -> str:
    if hands.returned:
        return "its pilot has put it back on its mission; include it to continue"
    if hands.kept_s > 0.0:
        return f"not commanded; its segments are kept for {formatting.format_duration(hands.kept_s)}"
    return "not commanded; its segments are released"


def _drop_typed_input() -> None:
    """Drop input typed before the question was shown: it answers nothing."""
    if sys.platform == "win32":
        return  # on systems that do not fly
    with suppress(ImportError, OSError, ValueError):
        import termios

        with suppress(termios.error):
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
