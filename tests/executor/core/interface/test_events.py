"""Outcomes of orders and requests: the defaults."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.events import Asked, OrderEnded, ReturnEnded, StartEnded
from executor.core.interface.intents import Action
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "outcome of an order",
        lambda: [
            flat(one)
            for one in (
                OrderEnded("uav1", Action.HOLD, True, ""),
                ReturnEnded("uav1", True, ""),
                StartEnded("uav1", True, ""),
                Asked("prepare", ""),
            )
        ],
        [
            {
                "vehicle": "uav1",
                "action": Action.HOLD,
                "accepted": True,
                "reason": "",
                "lost": False,
                "refused": False,
                "code": None,
            },
            {"vehicle": "uav1", "accepted": True, "reason": "", "lost": False, "refused": False, "code": None},
            {"vehicle": "uav1", "accepted": True, "reason": "", "armed": False, "code": None},
            {"question": "prepare", "text": "", "lines": ()},
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
