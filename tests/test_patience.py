"""No test fails because a computer is busy: it waits long in real time, or its time is virtual."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S

TESTS = Path(__file__).parent
WAITS = re.compile(r"(?:asyncio\.timeout\(|\.wait\(|\.join\(|timeout=)([0-9]+(?:\.[0-9]+)?)\b")
LEAST_S = 100.0
OWN_TIME = ("looptime", "run_virtual")
"""Where one of these stands, seconds are those of an event loop that does not wait for them."""
APART = ("sitl", "peers", "dialogues", "storm/__main__.py", "test_patience.py")
"""What flies other programs and has a patience of its own, and what is no test."""


def short_waits(text: str) -> list[float]:
    """Return the seconds of waits that a busy computer may overrun."""
    if any(mark in text for mark in OWN_TIME):
        return []
    return [seconds for seconds in map(float, WAITS.findall(text)) if 0.0 < seconds < LEAST_S]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("async with asyncio.timeout(10):", [10.0]),
        ("process.communicate(timeout=30)", [30.0]),
        ("assert heard.wait(0.5)", [0.5]),
        ("async with asyncio.timeout(PATIENCE_S):", []),
        ("subprocess.run(command, timeout=200)", []),
        ("import looptime\nasyncio.timeout(10)", []),
    ],
)
def test_short_waits_are_found(text: str, found: list[float]) -> None:
    assert short_waits(text) == found


def test_every_wait_is_long_or_in_virtual_time() -> None:
    files = {path.relative_to(TESTS).as_posix(): path for path in TESTS.rglob("*.py")}
    found = {
        name: waits
        for name, path in files.items()
        if not name.startswith(APART) and (waits := short_waits(path.read_text(encoding="utf-8")))
    }
    assert found == {}
    assert PATIENCE_S >= LEAST_S
