"""What becomes of the answer to a re-plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.interface.commands import Level, Say, Solve, Survivor
from executor.core.interface.events import NewRoute, SolveEnded
from executor.core.replanning import replan_cycle
from executor.core.state.fleet_state import Replan, ReplanRecord
from executor.core.state.vehicle_state import VehicleState
from tests.executor.core.replanning.replans import without_paths
from tests.executor.core.steps import (
    SECOND,
    flight_of,
    offer_of,
    outcome,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, flying

CONTEXT = FLEET.context
ON_ITS_WAY = flying()
UNSOLVED = plan_of(solve_s=None, solved_s=0.0)
TWO = plan_of(offer_of(), offer_of("uav2", tail=()), solve_s=None, solved_s=0.0)
PASSED = flying(waypoint=5)


def solved(
    plan: Replan,
    *routes: NewRoute,
    one: VehicleState = ON_ITS_WAY,
    uncovered: tuple[int, ...] = (),
    failed: bool = False,
    revision: int = 4,
) -> tuple[object, ...]:
    """Return everything that comes of the solver's answer."""
    before = flight_of(one, SECOND, replan=plan, given_up=frozenset({0}))
    event = SolveEnded(revision, None if failed else routes, uncovered, 0.25, "it died" if failed else "")
    return without_paths(outcome(before, replan_cycle.apply_solution(CONTEXT, before, event, NOW_S)))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("an answer to another question", lambda: solved(UNSOLVED, revision=3), ([], {}, {})),
    ("an answer that came before", lambda: solved(plan_of()), ([], {}, {})),
    (
        "no answer",
        lambda: solved(replace(UNSOLVED, ordered=True), failed=True),
        (
            [Say(Level.WARNING, "re-plan 4 failed: it died; trying again")],
            {},
            {
                "urgent": True,
                "trigger": "uav3: gone",
                "trigger_s": NOW_S - 5.0,
                "wait_until_s": NOW_S + 5.0,
                "replan": None,
                "ordered": True,
            },
        ),
    ),
    (
        "an answer that comes too late",
        lambda: solved(TWO, NewRoute("uav1", (4,)), one=PASSED),
        (
            [Say(Level.INFO, "re-plan 4 came too late for uav1; planning again")],
            {},
            {"urgent": True, "trigger": "uav3: gone", "trigger_s": NOW_S - 5.0, "replan": None},
        ),
    ),
    (
        "an answer for one",
        lambda: solved(UNSOLVED, NewRoute("uav1", (4,))),
        (
            [Say(Level.INFO, "re-plan 4 found in 0.25 s; new missions for uav1"), "upload uav1 4 True"],
            {"uav1": {"pending": 4}},
            {
                "replan": (
                    replace(UNSOLVED, solve_s=0.25, solved_s=NOW_S, pending=frozenset({"uav1"})),
                    {"uav1": ((0, 4), False)},
                )
            },
        ),
    ),
    (
        "an answer that leaves everybody as it is",
        lambda: solved(UNSOLVED, NewRoute("uav1", (2,))),
        (
            [
                Say(Level.INFO, "re-plan 4 found in 0.25 s; new missions for no vehicle"),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            {},
            {
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=True,
                        uncovered=(),
                        solve_s=0.25,
                        begun_s=NOW_S - 5.0,
                        ended_s=NOW_S,
                        upload_s=0.0,
                    ),
                ),
            },
        ),
    ),
    (
        "an answer without a route is one home",
        lambda: solved(UNSOLVED, uncovered=(3, 4)),
        (
            [
                Say(Level.INFO, "re-plan 4 found in 0.25 s; new missions for uav1"),
                Say(Level.WARNING, "remaining battery does not cover segments 3, 4"),
                "upload uav1 4 True",
            ],
            {"uav1": {"pending": 4}},
            {
                "given_up": frozenset({0, 3, 4}),
                "replan": (
                    Replan(
                        solve=Solve(
                            revision=4,
                            open_segments=(2, 3, 4),
                            survivors=(
                                Survivor(
                                    vehicle="uav1",
                                    start_m=(300.0, -5.0),
                                    budget_pct=60.0,
                                    consumption=1.0,
                                    airborne=True,
                                    tail=(2,),
                                    kept=3,
                                ),
                            ),
                            trigger="uav3: gone",
                        ),
                        begun_s=NOW_S - 5.0,
                        solve_s=0.25,
                        solved_s=NOW_S,
                        uncovered=(3, 4),
                        pending=frozenset({"uav1"}),
                    ),
                    {"uav1": ((0,), False)},
                ),
            },
        ),
    ),
    (
        "an answer for two",
        lambda: solved(TWO, NewRoute("uav1", (2, 4)), NewRoute("uav2", (6,)), uncovered=(3,)),
        (
            [
                Say(Level.INFO, "re-plan 4 found in 0.25 s; new missions for uav1, uav2"),
                Say(Level.WARNING, "remaining battery does not cover segment 3"),
                "upload uav1 4 True",
                "upload uav2 4 True",
            ],
            {"uav1": {"pending": 4}, "uav2": {"pending": 4}},
            {
                "given_up": frozenset({0, 3}),
                "replan": (
                    Replan(
                        solve=Solve(
                            revision=4,
                            open_segments=(2, 3, 4),
                            survivors=(
                                Survivor(
                                    vehicle="uav1",
                                    start_m=(300.0, -5.0),
                                    budget_pct=60.0,
                                    consumption=1.0,
                                    airborne=True,
                                    tail=(2,),
                                    kept=3,
                                ),
                                Survivor(
                                    vehicle="uav2",
                                    start_m=(300.0, -5.0),
                                    budget_pct=60.0,
                                    consumption=1.0,
                                    airborne=True,
                                    tail=(),
                                    kept=3,
                                ),
                            ),
                            trigger="uav3: gone",
                        ),
                        begun_s=NOW_S - 5.0,
                        solve_s=0.25,
                        solved_s=NOW_S,
                        uncovered=(3,),
                        pending=frozenset({"uav1", "uav2"}),
                    ),
                    {"uav1": ((0, 2, 4), False), "uav2": ((4, 6), False)},
                ),
            },
        ),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
