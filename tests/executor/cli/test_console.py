"""The operator's terminal: a fault sounds the bell, and a script gets none."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path
from subprocess import PIPE

import pytest
from rich.console import Console, Group

from executor.cli.console import TerminalConsole, render_fleet
from executor.core.fleet_view import OfferView, TakenView, build_fleet_view
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.interface.commands import Level
from executor.supervised import watch_internal_errors
from tests.executor.core.stories import under_way

BELL = "\a"


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make standard error a terminal, as far as rich asks."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")


@pytest.mark.usefixtures("terminal")
def test_the_bell_rings_at_a_fault_alone(capsys: pytest.CaptureFixture[str]) -> None:
    console = TerminalConsole(quiet=False, yes=True)
    for level in (Level.INFO, Level.WARNING):
        console.say(level, "uav2: no message for 3.1 s", 302.4)
        assert BELL not in capsys.readouterr().err
    console.say(Level.FAULT, "uav2: link lost for 10.1 s", 309.4)
    said = capsys.readouterr().err
    assert said.count(BELL) == 1
    assert "X uav2: link lost for 10.1 s" in said


def test_a_file_gets_no_bell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    TerminalConsole(quiet=False, yes=True).say(Level.FAULT, "uav2: link lost for 10.1 s", 309.4)
    assert capsys.readouterr().err == "   T+5:09 X uav2: link lost for 10.1 s\n"


@pytest.mark.usefixtures("terminal")
def test_quiet_is_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    TerminalConsole(quiet=True, yes=True).say(Level.FAULT, "uav2: link lost for 10.1 s", 309.4)
    assert capsys.readouterr().err == ""


def test_before_the_take_off_no_time_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    TerminalConsole(quiet=False, yes=True).say(Level.INFO, "waiting for 3 vehicles")
    assert capsys.readouterr().err == "            waiting for 3 vehicles\n"


def test_what_a_terminal_would_obey_is_not_passed_on(capsys: pytest.CaptureFixture[str]) -> None:
    console = TerminalConsole(quiet=False, yes=True)
    console.say(Level.INFO, "uav1: \x1b[2Jcrash\r\nuav2: ready\u202e", 0.0)
    console.show_checks([Check(Severity.OK, "a\x07b", "[bold]as it is[/bold]", CheckCode.PLAN)])
    said = capsys.readouterr().err
    assert not {"\x1b", "\r", "\x07", "\u202e"} & set(said)
    assert "crash uav2: ready" in said
    assert "[bold]as it is[/bold]" in said


@contextmanager
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Give the program a terminal to read from; yields the end at which somebody types."""
    typed, read = os.openpty()
    with os.fdopen(read, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield typed
        os.close(typed)


async def answered(console: TerminalConsole, typed: int, text: bytes) -> bool:
    """Type once the question is there."""
    answer = asyncio.create_task(console.ask("Take off?"))
    await asyncio.sleep(0)
    os.write(typed, text)
    return await answer


@pytest.mark.parametrize(
    ("text", "expected"), [(b"y\n", True), (b"YES\n", True), (b"n\n", False), (b"\n", False), (b"yo\n", False)]
)
@pytest.mark.asyncio
async def test_a_question_shows_how_it_is_answered(
    text: bytes, expected: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with keyboard(monkeypatch) as typed:
        assert await answered(TerminalConsole(quiet=False, yes=False), typed, text) is expected
    assert capsys.readouterr().err == "Take off? [y/N] "


@pytest.mark.asyncio
async def test_what_was_typed_before_the_question_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    with keyboard(monkeypatch) as typed:
        os.write(typed, b"y\n")
        assert not await answered(TerminalConsole(quiet=False, yes=False), typed, b"n\n")


@pytest.mark.usefixtures("terminal")
@pytest.mark.asyncio
async def test_a_line_that_comes_in_the_meantime_leaves_the_question_last(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    console = TerminalConsole(quiet=False, yes=False)
    with keyboard(monkeypatch) as typed:
        answer = asyncio.create_task(console.ask("Take off?"))
        await asyncio.sleep(0)
        console.say(Level.WARNING, "uav2: no message for 3.1 s")
        os.write(typed, b"y\n")
        assert await answer
    assert capsys.readouterr().err.split("\n")[-1] == "Take off? [y/N] "


@pytest.mark.asyncio
async def test_a_question_that_was_answered_elsewhere_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    with keyboard(monkeypatch):
        answer = asyncio.create_task(TerminalConsole(quiet=False, yes=False).ask("Take off?"))
        await asyncio.sleep(0)
        answer.cancel()
        await asyncio.gather(answer, return_exceptions=True)
    assert answer.cancelled()


def test_ctrl_c_is_no(tmp_path: Path) -> None:
    """In a process of its own, on a terminal of its own: no traceback, and the line is ended."""
    script = tmp_path / "ask.py"
    text = "print(TerminalConsole(quiet=False, yes=False).confirm('Take off?'))"
    script.write_text(f"from executor.cli.console import TerminalConsole\n{text}\n", encoding="utf-8")
    typed, read = os.openpty()
    command = [sys.executable, str(script)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdin=read, stdout=PIPE, stderr=PIPE, env=environment) as process:
        assert process.stderr is not None
        said = b""
        while b"[y/N] " not in said:
            said += os.read(process.stderr.fileno(), 100)
        process.send_signal(signal.SIGINT)
        out, rest = process.communicate()
    os.close(typed)
    os.close(read)
    assert out == b"False\n"
    assert rest.endswith(b"\n")
    assert b"Traceback" not in rest


def test_no_one_to_ask_means_no() -> None:
    assert not TerminalConsole(quiet=False, yes=False).confirm("Take off?")
    assert TerminalConsole(quiet=False, yes=True).confirm("Take off?")


@pytest.mark.asyncio
async def test_a_flight_without_a_terminal_waits_for_the_page() -> None:
    asked = asyncio.ensure_future(TerminalConsole(quiet=True, yes=False, on_page=True).ask("Take off?"))
    for _ in range(10):
        await asyncio.sleep(0)
    assert not asked.done()
    asked.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asked


def test_the_table_speaks_of_spans_states_and_places() -> None:
    flight = under_way()
    view = build_fleet_view(flight.context, flight.state, flight.now_s)
    first, second, third = view.vehicles
    first = replace(first, state="holding", gps_fix=3, satellites=14, lands_in_s=187.0)
    first = replace(first, progress=replace(first.progress, done=3, total=7, inspected=10, segment_name="P4-P5"))
    second = replace(second, state="pilot", taken=TakenView(flight.now_s, 24.0, returned=False))
    third = replace(third, state="down", fault="down, armed", fault_kind="down")
    offer = OfferView(("uav4",), (5,), "uav4 can take over 1 span. Is its pad clear of people?")
    terminal = Console(width=140, record=True, file=StringIO())
    terminal.print(render_fleet(replace(view, vehicles=(first, second, third), offer=offer)))
    shown = terminal.export_text()
    rows = [" ".join(line.split()) for line in shown.splitlines()]
    assert rows[0].startswith("T+1:")
    assert "segments inspected" in rows[0]
    assert any("uav1 holding inspects P4-P5 3 of 7 10" in row and "3D, 14 sat" in row and "3:07" in row for row in rows)
    assert any(row.startswith("uav2 with its pilot: last at 49.5999") for row in rows)
    assert "uav2: not commanded; its segments are kept for 0:24" in rows
    assert any(row.startswith("uav3 down: keep away: last at 49.5999") and row.endswith("ago") for row in rows)
    assert rows[-1] == "? uav4 can take over 1 span. Is its pad clear of people?"


@pytest.mark.asyncio
async def test_a_mistake_in_the_table_is_reported_and_the_drawing_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    said, flight = list[str](), under_way()
    console = TerminalConsole(quiet=False, yes=True)
    console._view = (flight.context, flight.state, flight.now_s)
    with watch_internal_errors(said.append, None):
        monkeypatch.setattr("executor.cli.console.render_fleet", lambda _: 1 // 0)
        broken = console._render_view()
        monkeypatch.undo()
        await asyncio.sleep(0)
    assert shown(broken) == "fleet display failed; decisions are still shown\n"
    assert [line.partition(": ")[2] for line in said] == [
        "ZeroDivisionError: integer division or modulo by zero",
    ]
    assert "uav1" in shown(console._render_view())


def shown(group: Group) -> str:
    out = StringIO()
    Console(file=out, width=200).print(group)
    return out.getvalue()
