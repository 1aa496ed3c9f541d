"""Requests for streams."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.inflight.faults import watch_view
from executor.core.inflight.faults.watch_view import WatchView
from tests.executor.core.inflight.faults.watch_views import CONTEXT, PLANNED
from tests.executor.core.steps import rounded
from tests.executor.core.vehicles import NOW_S, at, flying, pack

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "vehicles whose streams are requested",
        lambda: [
            watch_view.list_streams_to_ask(WatchView(CONTEXT, PLANNED, flying(**given), False, NOW_S)) is not None
            for given in (
                {},
                {"item_s": NOW_S - 30.0},
                {"item_s": NOW_S - 30.0, "streams_asked_s": NOW_S - 6.0},
                {"item_s": NOW_S - 30.0, "streams_asked_s": NOW_S - 5.9},
                {"item_s": NOW_S - 30.0, "heard_s": NOW_S - 3.0},
                {"battery": pack(90.0, age_s=7.0)},
                {"battery": pack(90.0, age_s=6.9)},
                {"heartbeat_s": NOW_S - 3.5},
                {"fix": at(age_s=3.0)},
            )
        ],
        [False, True, True, False, False, True, False, True, True],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
