"""How much of what vehicles say is shown."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.commands import Command, Say
from executor.core.interface.messages import ComponentText, StatusText
from executor.core.state.vehicle_parts import TextWindow
from executor.core.telemetry import status_texts
from tests.executor.builders import with_facts
from tests.executor.core.steps import flight_of, rounded
from tests.executor.core.vehicles import CONTEXT, flying


def shown(*said: tuple[float, int, str], alarmed: bool = False, aboard: bool = False) -> list[str]:
    """Return which of the texts (seconds, severity, words) are shown, and what is said at the end."""
    state, found = flight_of(flying()), list[Command]()
    for at_s, severity, what in said:
        one = with_facts(state.vehicles["uav1"], alarm=(what, at_s)) if alarmed else state.vehicles["uav1"]
        if aboard:
            state, more = status_texts.show_text(state, one, ComponentText(100, severity, what), at_s)
        else:
            state, more = status_texts.show_text(state, one, StatusText(severity, what), at_s)
        found += more
    found += status_texts.report_suppressed_texts(CONTEXT, state, 110.0)[1]
    return [one.text for one in found if isinstance(one, Say)]


def many(count: int, severity: int, at_s: float = 100.0) -> list[tuple[float, int, str]]:
    return [(at_s, severity, f"text {number}") for number in range(count)]


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "number of warnings shown",
        lambda: [shown(*many(count, 4)) for count in (6, 7, 8)],
        [
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 10 s",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 2 more texts in 10 s",
            ],
        ],
    ),
    ("number of important texts shown", lambda: [len(shown(*many(count, 2))) for count in (12, 13)], [12, 13]),
    (
        "number of texts of an alarm shown",
        lambda: [len(shown(*many(count, 6), alarmed=True)) for count in (12, 13)],
        [12, 13],
    ),
    (
        "number of texts of other components shown",
        lambda: [shown(*many(count, 0), aboard=True) for count in (3, 4)],
        [
            [
                "uav1, its component 100 says: text 0",
                "uav1, its component 100 says: text 1",
                "uav1, its component 100 says: text 2",
            ],
            [
                "uav1, its component 100 says: text 0",
                "uav1, its component 100 says: text 1",
                "uav1, its component 100 says: text 2",
                "uav1: 1 more text in 10 s",
            ],
        ],
    ),
    (
        "a text of low severity is not shown",
        lambda: [shown((100.0, severity, "a"), aboard=aboard) for severity in (4, 5) for aboard in (False, True)],
        [["uav1 says: a"], ["uav1, its component 100 says: a"], [], []],
    ),
    (
        "a text that is repeated",
        lambda: [shown((100.0, 4, "a"), (at_s, 4, "a")) for at_s in (130.0, 130.1)],
        [["uav1 says: a"], ["uav1 says: a", "uav1 says: a"]],
    ),
    (
        "a text that is repeated again and again",
        lambda: shown((50.0, 4, "a"), (75.0, 4, "a"), (100.0, 4, "a")),
        ["uav1 says: a"],
    ),
    (
        "a text that names another motor each time",
        lambda: shown((100.0, 4, "Thrust Loss (3)"), (101.0, 4, "Thrust Loss (1)"), (102.0, 4, "Motor 1 (4)")),
        ["uav1 says: Thrust Loss (3)", "uav1 says: Motor 1 (4)"],
    ),
    (
        "a new window",
        lambda: [shown(*many(7, 4), (at_s, 4, "b")) for at_s in (109.9, 110.0, 125.0)],
        [
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 2 more texts in 10 s",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 10 s",
                "uav1 says: b",
            ],
            [
                "uav1 says: text 0",
                "uav1 says: text 1",
                "uav1 says: text 2",
                "uav1 says: text 3",
                "uav1 says: text 4",
                "uav1 says: text 5",
                "uav1: 1 more text in 25 s",
                "uav1 says: b",
            ],
        ],
    ),
    (
        "a window that has not ended",
        lambda: status_texts.report_suppressed_texts(
            CONTEXT, flight_of(flying(texts=TextWindow(since_s=100.1, passed_over=3))), 110.0
        )[1],
        (),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
