"""Ctrl-C, and closed pipes: one line at most, no traceback, and no process is left behind."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from executor.adapters.interrupts import defer_ctrl_c
from executor.cli import exit_codes, main
from tests.executor.cli.test_main import Place, place
from tests.patience import PATIENCE_S

__all__ = ["place"]

ROOT = Path(__file__).parents[3]


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
        out, err = process.communicate(timeout=PATIENCE_S)
    # Python itself ends by the signal where it was compiling something at that moment; for a shell both are 130.
    assert process.returncode in {exit_codes.INTERRUPTED, -signal.SIGINT}
    assert "faultline: interrupted" in err
    assert "Traceback" not in seen + err + out, seen + err + out


def test_sigterm_ends_one_that_a_script_started_in_the_background(place: Place) -> None:
    """A shell that is not interactive has Ctrl-C ignored by what it starts with `&`."""
    command = ["plan", place.path("site.toml"), "--cost", "window", "--seconds", "60"]
    quoted = shlex.join([sys.executable, "-m", "executor", *command])
    with subprocess.Popen(
        ["/bin/sh", "-c", f"trap '' INT; exec {quoted}"], cwd=ROOT, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        while "planning " not in (line := process.stderr.readline()):
            assert line
        process.terminate()
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == exit_codes.INTERRUPTED
    assert "faultline: interrupted" in err


def test_ctrl_c_while_the_program_loads(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(main, "_run", interrupted)
    before = signal.getsignal(signal.SIGINT)
    try:
        with pytest.raises(SystemExit) as ended:
            main.main(["plan"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == exit_codes.INTERRUPTED
    assert capsys.readouterr().err == "faultline: interrupted\n"


def test_a_closed_pipe() -> None:
    with started("init", "default", "--vehicles", "50") as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        err = process.stderr.read()
        assert (process.wait(timeout=PATIENCE_S), err) == (exit_codes.NO_READER, "")


def test_ctrl_c_waits_until_processes_are_started() -> None:
    reached = []

    def start() -> None:
        with defer_ctrl_c():
            signal.raise_signal(signal.SIGINT)
            reached.append(True)

    with pytest.raises(KeyboardInterrupt):
        start()
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def ended_with(script: str, tmp_path: Path) -> tuple[int, str]:
    """Run a program; returns its exit code and its standard error."""
    path = tmp_path / "program.py"
    path.write_text(script, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, path, "window", "nowhere.json"],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    return done.returncode, done.stderr


HANGING_THREAD = """
import threading, time
from executor.cli import main as cli
cli.ENDS_S = 0.5
threading.Thread(target=time.sleep, args=(3600,), name="a disk that never answers").start()
cli.main()
"""


def test_a_thread_that_hangs_does_not_keep_the_program_from_ending_with_its_exit_code(tmp_path: Path) -> None:
    code, err = ended_with(HANGING_THREAD, tmp_path)
    assert code == 2
    assert "nowhere.json" in err
    assert err.endswith("faultline: ended while waiting for a disk that never answers\n")


HANGING_WORK = """
import asyncio, os, time
from executor.adapters import clock
clock.THREADS_END_S = 0.5

async def fly():
    asyncio.get_running_loop().run_in_executor(None, time.sleep, 3600)
    return 7

os._exit(clock.run_on_fair_loop(fly()))
"""


def test_work_in_a_thread_that_hangs_does_not_keep_a_flight_from_ending(tmp_path: Path) -> None:
    assert ended_with(HANGING_WORK, tmp_path)[0] == 7
