"""A flight much faster than real time on a busy computer: slower, with the same result."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.e2e.flights import demo

pytestmark = pytest.mark.asyncio

SPEEDUP = 25.0


@contextmanager
def busy() -> Iterator[None]:
    """Have two programs a processor that never rest."""
    with ExitStack() as stack:
        for _ in range(2 * (os.cpu_count() or 1)):
            loop = stack.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            stack.callback(loop.kill)
        yield


async def test_no_vehicle_is_given_up_on_a_busy_computer(tmp_path: Path) -> None:
    with busy():
        flown = await demo(tmp_path / "run", "uav2:silent@40%", speedup=SPEEDUP, patience_s=280.0)
    report = flown.report
    assert flown.code == 0, flown.said
    assert report["segments_inspected"] == report["segments_total"] > 0
    assert [(fault["vehicle"], fault["kind"]) for fault in report["faults"]] == [("uav2", "link")]
    assert [one["frames_missing"] for one in report["vehicles"] if one["name"] != "uav2"] == [0, 0, 0]
