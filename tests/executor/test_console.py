"""The operator's terminal: a fault is heard, and a script hears nothing."""

from __future__ import annotations

import io

import pytest

from executor.console import TerminalConsole
from executor.core.commands import Level

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
        console.say(level, "uav2: nothing heard for 3.1 s", 302.4)
        assert BELL not in capsys.readouterr().err
    console.say(Level.FAULT, "uav2: link, silent for 10.1 s", 309.4)
    said = capsys.readouterr().err
    assert said.count(BELL) == 1
    assert "X uav2: link, silent for 10.1 s" in said


def test_a_file_gets_no_bell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    TerminalConsole(quiet=False, yes=True).say(Level.FAULT, "uav2: link, silent for 10.1 s", 309.4)
    assert capsys.readouterr().err == " 309.4 X uav2: link, silent for 10.1 s\n"


@pytest.mark.usefixtures("terminal")
def test_quiet_is_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    TerminalConsole(quiet=True, yes=True).say(Level.FAULT, "uav2: link, silent for 10.1 s", 309.4)
    assert capsys.readouterr().err == ""


class Typed(io.StringIO):
    """What somebody types at a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("typed", "answer"), [("y\n", True), ("n\n", False), ("\n", False), ("", False)])
def test_a_question_shows_how_it_is_answered(
    typed: str, answer: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", Typed(typed))
    assert TerminalConsole(quiet=False, yes=False).confirm("Take off?") is answer
    assert "Take off? [y/N] " in "".join(capsys.readouterr())
