"""The initial state of a flight, and of a re-plan."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.interface.commands import Solve
from executor.core.state.fleet_state import Briefing, FleetState, Replan
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a flight",
        lambda: flat(FleetState({})),
        {
            "vehicles": {},
            "inspected": {},
            "flown": {},
            "given_up": frozenset(),
            "left_over": frozenset(),
            "inspected_at_m": {},
            "caught_nearer": {},
            "attempts": {},
            "revision": 0,
            "launched_s": None,
            "tick_s": None,
            "late_s": 0.0,
            "orphans_since_s": None,
            "urgent": False,
            "trigger": "",
            "trigger_s": 0.0,
            "wait_until_s": -math.inf,
            "closer_s": -math.inf,
            "replan": None,
            "records": (),
            "considered": frozenset(),
            "silent_since_s": None,
            "silence_told_s": None,
            "recalled": False,
            "separation_m": None,
            "told": {},
            "absences": (),
            "inferred": frozenset(),
            "caught": {},
            "unseen": {},
            "not_seen": {},
            "finished": False,
            "said": (),
            "intents": {},
            "ordered": False,
            "mended": (),
            "outlook": {},
            "briefing": Briefing(),
            "offer": None,
            "offer_wanted_s": None,
            "offers_over": False,
            "closed_bases": frozenset(),
            "counted_packs": {},
            "channels": {},
        },
    ),
    (
        "a re-plan",
        lambda: flat(Replan(Solve(1, (), (), ""), 5.0)),
        {
            "solve": Solve(revision=1, open_segments=(), survivors=(), trigger=""),
            "low": {},
            "begun_s": 5.0,
            "solve_s": None,
            "solved_s": 0.0,
            "uncovered": (),
            "gain": None,
            "unmade": (),
            "missions": {},
            "pending": frozenset(),
            "failed": (),
            "let_go": (),
            "ordered": False,
            "closer": False,
        },
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
