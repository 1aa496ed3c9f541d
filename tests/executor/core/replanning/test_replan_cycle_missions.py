"""How the missions of a re-plan are made, and how it comes to its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.interface.commands import Compose, Level, Say, Solve, Survivor
from executor.core.interface.events import MissionsWanted, NewRoute
from executor.core.replanning import replan_cycle
from executor.core.state.fleet_state import Replan, ReplanRecord
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.core.replanning.replans import without_paths
from tests.executor.core.steps import (
    SECOND,
    Stepped,
    flight_of,
    landed,
    new_mission,
    offer_of,
    outcome,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, flying

CONTEXT = FLEET.context
ON_ITS_WAY = flying()
UNMADE = plan_of(unmade=(NewRoute("uav1", (4,)),), pending=frozenset({"uav1"}))
PASSED = flying(waypoint=5)


def composed(plan: Replan, one: VehicleState = ON_ITS_WAY, revision: int = 4) -> tuple[object, ...]:
    before = flight_of(one, SECOND, replan=plan)
    return without_paths(
        outcome(before, replan_cycle.apply_missions_wanted(CONTEXT, before, MissionsWanted(revision), NOW_S))
    )


GIVEN = new_mission(2)


def closed(**given: Any) -> Stepped:
    before = flight_of(replan=plan_of(**{"missions": {"uav1": GIVEN}} | given), orphans_since_s=5.0)
    return outcome(before, replan_cycle.end_replan_if_done(before, NOW_S))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    ("missions of another re-plan", lambda: composed(UNMADE, revision=3), ([], {}, {})),
    (
        "the next mission",
        lambda: composed(UNMADE),
        (["upload uav1 4 True"], {}, {"replan": (replace(UNMADE, unmade=()), {"uav1": ((0, 4), False)})}),
    ),
    (
        "the next mission of who has flown on",
        lambda: composed(UNMADE, PASSED),
        (
            [
                Say(Level.INFO, "uav1: moved on before its new mission arrived; re-plan 4 is planned again for it"),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            {},
            {
                "urgent": True,
                "trigger": "uav1: moved on before its new mission arrived",
                "trigger_s": NOW_S,
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=True,
                        uncovered=(),
                        solve_s=0.5,
                        begun_s=NOW_S - 5.0,
                        ended_s=NOW_S,
                        upload_s=3.0,
                    ),
                ),
            },
        ),
    ),
    (
        "the next mission of who has left the plan",
        lambda: composed(replace(UNMADE, pending=frozenset({"uav2"}))),
        ([], {}, {"replan": (replace(UNMADE, unmade=(), pending=frozenset({"uav2"})), {})}),
    ),
    (
        "the next mission of who is on the ground",
        lambda: composed(
            replace(UNMADE, solve=replace(UNMADE.solve, survivors=(offer_of(airborne=False),))),
            landed(stage=Stage.LANDED),
        ),
        (
            ["upload uav1 4 False"],
            {},
            {
                "replan": (
                    replace(
                        UNMADE,
                        solve=Solve(
                            revision=4,
                            open_segments=(2, 3, 4),
                            survivors=(
                                Survivor(
                                    vehicle="uav1",
                                    start_m=(300.0, -5.0),
                                    budget_pct=60.0,
                                    consumption=1.0,
                                    airborne=False,
                                    tail=(2,),
                                    kept=3,
                                ),
                            ),
                            trigger="uav3: gone",
                        ),
                        unmade=(),
                    ),
                    {"uav1": ((4,), True)},
                )
            },
        ),
    ),
    (
        "all missions at once",
        lambda: {
            name: (mission.visits, mission.fresh)
            for name, mission in replan_cycle.build_all_missions(
                CONTEXT, flight_of(ON_ITS_WAY), replace(UNMADE, unmade=(*UNMADE.unmade, NewRoute("uav2", (6,))))
            ).missions.items()
        },
        {"uav1": ((0, 4), False)},
    ),
    (
        "all missions at once leave none to make",
        lambda: replan_cycle.build_all_missions(CONTEXT, flight_of(ON_ITS_WAY), UNMADE).unmade,
        (),
    ),
    ("a re-plan that goes on", lambda: closed(pending=frozenset({"uav1"})), ([], {}, {})),
    ("a re-plan that is not solved", lambda: closed(solve_s=None), ([], {}, {})),
    (
        "a re-plan that has ended",
        lambda: closed(uncovered=(3,)),
        (
            [Say(Level.INFO, "re-plan 4 is on board after 5.0 s")],
            {},
            {
                "orphans_since_s": None,
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=False,
                        uncovered=(3,),
                        solve_s=0.5,
                        begun_s=NOW_S - 5.0,
                        ended_s=NOW_S,
                        upload_s=3.0,
                    ),
                ),
            },
        ),
    ),
    (
        "a re-plan that has ended long after it was needed",
        lambda: closed(begun_s=NOW_S - 90.1),
        (
            [Say(Level.INFO, "re-plan 4 is on board")],
            {},
            {
                "orphans_since_s": None,
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=True,
                        uncovered=(),
                        solve_s=0.5,
                        begun_s=NOW_S - 90.1,
                        ended_s=NOW_S,
                        upload_s=3.0,
                    ),
                ),
            },
        ),
    ),
    (
        "a re-plan that has ended some time after it was needed",
        lambda: closed(begun_s=NOW_S - 90.0),
        (
            [Say(Level.INFO, "re-plan 4 is on board after 90.0 s")],
            {},
            {
                "orphans_since_s": None,
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=True,
                        uncovered=(),
                        solve_s=0.5,
                        begun_s=NOW_S - 90.0,
                        ended_s=NOW_S,
                        upload_s=3.0,
                    ),
                ),
            },
        ),
    ),
    (
        "a re-plan that ended without two",
        lambda: closed(failed=("uav1", "uav2")),
        (
            [Say(Level.INFO, "re-plan 4 ended; not uploaded to uav1, uav2")],
            {},
            {
                "orphans_since_s": None,
                "replan": None,
                "records": (
                    ReplanRecord(
                        revision=4,
                        trigger="uav3: gone",
                        feasible=True,
                        uncovered=(),
                        solve_s=0.5,
                        begun_s=NOW_S - 5.0,
                        ended_s=NOW_S,
                        upload_s=3.0,
                    ),
                ),
            },
        ),
    ),
    ("no re-plan", lambda: replan_cycle.end_replan_if_done(flight_of(replan=None), NOW_S)[1], ()),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


@pytest.mark.parametrize(("ways", "made"), [(6, 1), (7, 2), (12, 2), (13, 3)])
def test_so_many_ways_are_made_in_one_turn(ways: int, made: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replan_cycle, "WAYS_AT_ONCE", ways)
    names = ("uav1", "uav2", "uav3")
    plan = plan_of(
        *(offer_of(name, airborne=False) for name in names),
        unmade=tuple(NewRoute(name, (4,)) for name in names), pending=frozenset(names),
    )  # fmt: skip
    before = flight_of(replan=plan)
    after, commands = replan_cycle.apply_missions_wanted(CONTEXT, before, MissionsWanted(4), NOW_S)
    assert after.replanning.replan is not None
    assert [route.vehicle for route in after.replanning.replan.unmade] == list(names[made:])
    assert [one for one in commands if isinstance(one, Compose)] == [Compose(4)] * (made < 3)
