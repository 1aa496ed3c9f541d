"""How far a long run is: without a terminal it says so once a minute, and when a stage is done."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.progress import ShownProgress


def test_without_a_terminal_a_line_a_minute_says_how_far_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    times_s: Iterator[float] = iter((0.0, 20.0, 61.0, 70.0, 80.0))
    with ShownProgress(clock_s=lambda: next(times_s)) as shown:
        for done in range(1, 5):
            shown.show_stage("flights", done, 4)
    assert capsys.readouterr().err.split("\n") == ["flights: 2 of 4", "flights: 4 of 4", ""]
