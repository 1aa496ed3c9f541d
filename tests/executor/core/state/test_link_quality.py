"""Links in figures, report by report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.messages import Radio, Traffic
from executor.core.state import link_quality
from executor.core.state.link_quality import LinkQuality
from tests.executor.core.steps import rounded


def linked(*counts: tuple[float, int, int]) -> LinkQuality:
    """Return a link after counts of (seconds since the last, frames that came, frames that did not)."""
    state, now_s = LinkQuality(), 100.0
    for elapsed_s, came, lost in counts:
        now_s += elapsed_s
        state = link_quality.add_traffic(state, Traffic(came, lost), now_s, 12.0)
    return state


def radio(**given: Any) -> Radio:
    return replace(Radio(80, 60, 20, 20, 90), **given)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a link that loses little",
        lambda: linked(*[(1.0, 10, 0)] * 5, (1.0, 10, 2)),
        LinkQuality(
            window=((101.0, 10, 0), (102.0, 10, 0), (103.0, 10, 0), (104.0, 10, 0), (105.0, 10, 0), (106.0, 10, 2)),
            lost=0.0322581,
            usual=0.000533179,
        ),
    ),
    (
        "a link that loses much for a while",
        lambda: linked(*[(1.0, 10, 0)] * 5, *[(10.0, 20, 20)] * 3),
        LinkQuality(window=((125.0, 20, 20), (135.0, 20, 20)), lost=0.5, usual=0.178401),
    ),
    (
        "a link that gets better",
        lambda: linked(*[(1.0, 10, 10)] * 5, *[(1.0, 40, 0)] * 2),
        LinkQuality(
            window=(
                (101.0, 10, 10),
                (102.0, 10, 10),
                (103.0, 10, 10),
                (104.0, 10, 10),
                (105.0, 10, 10),
                (106.0, 40, 0),
                (107.0, 40, 0),
            ),
            lost=0.277778,
            usual=0.277778,
        ),
    ),
    ("a link of few frames", lambda: [linked((1.0, 19, 0)).lost, linked((1.0, 19, 1)).lost], [None, 0.05]),
    (
        "counts of a link",
        lambda: [len(linked((1.0, 19, 0), (after_s, 1, 0)).window) for after_s in (11.9, 12.0)],
        [2, 1],
    ),
    (
        "increase in the losses of a link",
        lambda: [
            LinkQuality(lost=lost, usual=usual).worse
            for lost, usual in ((None, 0.1), (0.1, None), (0.3, 0.1), (0.1, 0.3), (1.0, 0.98))
        ],
        [0.0, 0.0, 0.222222, 0.0, 0.4],
    ),
    (
        "faults reported by a radio",
        lambda: [
            LinkQuality(radio=one).weak
            for one in (
                None,
                radio(),
                radio(rssi=30),
                radio(rssi=29),
                radio(remote_rssi=29),
                radio(free_buffer_pct=20),
                radio(free_buffer_pct=19),
                radio(free_buffer_pct=None),
                radio(rssi=None, noise=None, remote_rssi=None, remote_noise=None),
            )
        ],
        [
            "",
            "",
            "",
            "radio signal 29 over noise 20 here",
            "radio signal 29 over noise 20 at the vehicle",
            "",
            "radio buffer 19 % free",
            "",
            "",
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
