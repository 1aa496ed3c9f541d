"""Ctrl-C, and readers that go away: one line at most, no traceback, and nobody is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from executor import cli
from executor.interrupts import held_back
from tests.executor.test_cli import Place, place

__all__ = ["place"]

ROOT = Path(__file__).parents[2]


def started(*arguments: str) -> subprocess.Popen[str]:
    """Start the command line as a terminal does: in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "executor", *arguments],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
        start_new_session=True,
    )  # fmt: skip


SOON = {
    "solving": (["plan", "SITE", "--cost", "window", "--seconds", "60"], "planning "),
    "trade-offs": (["plan", "SITE", "--front", "--seconds", "60"], "planning "),
    "starting the solver": (["fly", "SITE", "--plan", "PLAN", "--run", "RUN"], "the plan is that of "),
    "connecting": (["fly", "SITE", "--plan", "PLAN", "--run", "RUN"], "waiting for "),
    "asking": (["preflight", "SITE", "--plan", "PLAN"], "the plan is that of "),
}


@pytest.mark.parametrize(("command", "said"), SOON.values(), ids=SOON)
def test_ctrl_c_ends_it_with_a_line(place: Place, command: list[str], said: str) -> None:
    names = {"SITE": place.path("site.toml"), "PLAN": place.planned(), "RUN": place.path("run")}
    with started(*(names.get(word, word) for word in command)) as process:
        assert process.stderr is not None
        seen = ""
        while said not in seen:
            line = process.stderr.readline()
            assert line, seen
            seen += line
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=30)
    # Python itself ends by the signal where it was compiling something at that moment; for a shell both are 130.
    assert process.returncode in {cli.INTERRUPTED, -signal.SIGINT}
    assert "faultline: interrupted" in err
    assert "Traceback" not in seen + err + out


def test_ctrl_c_while_the_program_loads(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_run", interrupted)
    before = signal.getsignal(signal.SIGINT)
    try:
        with pytest.raises(SystemExit) as ended:
            cli.main(["plan"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == cli.INTERRUPTED
    assert capsys.readouterr().err == "faultline: interrupted\n"


def test_nobody_reads_any_more() -> None:
    with started("init", "default", "--vehicles", "50") as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        err = process.stderr.read()
        assert (process.wait(timeout=30), err) == (cli.NO_READER, "")


def test_ctrl_c_waits_until_processes_are_started() -> None:
    reached = []

    def start() -> None:
        with held_back():
            signal.raise_signal(signal.SIGINT)
            reached.append(True)

    with pytest.raises(KeyboardInterrupt):
        start()
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
