"""A flight with a terminated process or a closed terminal: it ends as with Ctrl-C, or continues."""

from __future__ import annotations

import asyncio
import fcntl
import json
import os
import signal
import termios
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.flights import FAULTLINE, called, ended, log_lines, notes, said_in, site_file
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.asyncio
LEFT = "supervision ends"


@asynccontextmanager
async def on_a_terminal(*arguments: str, own: bool) -> AsyncIterator[tuple[asyncio.subprocess.Process, int]]:
    """Call the command line on a terminal; yields the end that a window has. Only its `own` tells of its end."""
    window, terminal = os.openpty()

    def takes_it() -> None:
        os.setsid()
        if own:
            fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)

    process = await asyncio.create_subprocess_exec(
        *FAULTLINE, *arguments, stdin=terminal, stdout=terminal, stderr=terminal, preexec_fn=takes_it
    )
    os.close(terminal)
    try:
        yield process, window
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def seen_in(window: int, words: str) -> None:
    """Read what a terminal shows until it shows this; only few bytes of it are kept."""
    seen = b""
    async with asyncio.timeout(PATIENCE_S):
        while words.encode() not in seen:
            seen = seen[-4096:] + await asyncio.to_thread(os.read, window, 4096)


def said(run: Path) -> list[str]:
    return [note["said"] for note in notes(run)] + [line["told"] for line in log_lines(run) if "told" in line]


async def test_a_polite_end_before_any_answer(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=8, vehicles=2, speedup=10.0)
    async with called("fly", str(site), "--yes", "--run", str(tmp_path / "run")) as flight:
        await said_in(flight.stderr, "waiting for 2 vehicles")
        flight.send_signal(signal.SIGTERM)
        _, err = await ended(flight)
    assert (flight.returncode, err) == (130, "faultline: interrupted\n")


async def test_a_polite_end_in_flight_is_one_ctrl_c_however_often_it_comes(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=8, vehicles=2, speedup=5.0)
    async with (
        called("simulate", str(site)) as simulation,
        called("fly", str(site), "--yes", "--run", str(tmp_path / "run")) as flight,
    ):
        await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
        flight.send_signal(signal.SIGTERM)
        await said_in(
            flight.stderr, "SIGTERM: the vehicles stay on their missions; Ctrl-C within 5 s commands RTL to all"
        )
        for _ in range(3):
            flight.send_signal(signal.SIGTERM)
            await asyncio.sleep(0)
        _, err = await ended(flight)
        assert simulation.returncode is None
    assert flight.returncode == 1
    assert LEFT in err
    assert "sends everybody home" not in err
    assert "Traceback" not in err


@pytest.mark.parametrize("moment", ["before the take-off", "in flight"])
async def test_a_terminal_that_closes_is_one_ctrl_c(moment: str, tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=8, vehicles=2, speedup=5.0)
    run = tmp_path / "run"
    asks = moment == "before the take-off"
    fly = ["fly", str(site), "--run", str(run)] + ["--yes"] * (not asks)
    async with called("simulate", str(site)), on_a_terminal(*fly, own=True) as (flight, window):
        await seen_in(window, "[y/N]" if asks else "uav2: flies its mission")
        os.close(window)
        async with asyncio.timeout(PATIENCE_S):
            code = await flight.wait()
    assert not (run / "mistakes.txt").exists()
    if asks:
        assert code == 2
        assert not (run / "events.jsonl").exists()
    else:
        assert code == 1
        report = json.loads((run / "report.json").read_text(encoding="utf-8"))
        assert not any(vehicle["landed"] for vehicle in report["vehicles"])
        assert (run / "report.html").exists(), "what is done after a flight is done without a terminal too"
        assert not any("home" in line for line in said(run))


async def test_a_terminal_that_is_gone_without_a_word_ends_no_supervision(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=5, vehicles=2, speedup=20.0)
    run = tmp_path / "run"
    fly = ["fly", str(site), "--yes", "--run", str(run)]
    async with called("simulate", str(site)), on_a_terminal(*fly, own=False) as (flight, window):
        await seen_in(window, "uav1: flies its mission")
        os.close(window)
        async with asyncio.timeout(PATIENCE_S):
            code = await flight.wait()
    assert code == 0
    assert json.loads((run / "report.json").read_text(encoding="utf-8"))["finished"]
    assert not any("internal error" in line for line in said(run))
    assert not (run / "mistakes.txt").exists()
