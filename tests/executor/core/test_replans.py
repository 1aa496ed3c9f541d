"""When a re-plan begins, what becomes of its answer, and how it comes to its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.commands import Compose, Level, Say, Solve, Survivor, Upload
from executor.core.context import Context
from executor.core.events import MissionsWanted, NewRoute, SolveEnded
from executor.core.replan import replanning
from executor.core.state import Replan, ReplanRecord
from executor.core.vehicle import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.faults.test_watchpoints import FLEET, NOW_S, flying
from tests.executor.core.steps import (
    BATTERY_FAULT,
    CREW,
    HOMEWARD,
    SECOND,
    Changes,
    Stepped,
    differences,
    flight_of,
    landed,
    new_mission,
    offer_of,
    outcome,
    plan_of,
    rounded,
)

CONTEXT = FLEET.context
WANTS: Changes = {"urgent": True, "trigger": "uav3: gone", "trigger_s": NOW_S - 2.0}
ON_ITS_WAY = flying()
ITS_OFFER = Survivor("uav1", (200.0, -5.0), 72.1888, 1.12826, airborne=True, tail=(2,), kept=3)
PROVEN = dict.fromkeys(range(6), "uav3")
UNSOLVED = plan_of(solve_s=None, solved_s=0.0)
TWO = plan_of(offer_of(), offer_of("uav2", tail=()), solve_s=None, solved_s=0.0)
UNMADE = plan_of(unmade=(NewRoute("uav1", (4,)),), pending=frozenset({"uav1"}))
PASSED = flying(waypoint=5)


def begun(*vehicles: VehicleState, context: Context = CONTEXT, **given: Any) -> Stepped:
    """Return what comes of the need; of the re-plan beside its question, since when it is needed and who asked."""
    before = flight_of(*vehicles, **given)
    commands, ones, flight = outcome(before, replanning.begin(context, before, NOW_S))
    plan = flight.get("replan")
    if isinstance(plan, Replan):
        assert plan.solve == commands[-1]
        flight["replan"] = (plan.begun_s, plan.ordered)
    return commands, ones, flight


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
    return without_paths(outcome(before, replanning.solved(CONTEXT, before, event, NOW_S)))


def without_paths(of: Stepped) -> tuple[object, ...]:
    """Return what comes of something without the paths of missions, which are shown elsewhere."""
    commands, ones, flight = of
    told = [
        f"upload {one.vehicle} {one.revision} {one.airborne}" if isinstance(one, Upload) else one for one in commands
    ]
    plan = flight.get("replan")
    if plan is not None:
        visits = {name: (mission.visits, mission.fresh) for name, mission in plan.missions.items()}
        flight = {**flight, "replan": (replace(plan, missions={}), visits)}
    return told, ones, flight


def composed(plan: Replan, one: VehicleState = ON_ITS_WAY, revision: int = 4) -> tuple[object, ...]:
    before = flight_of(one, SECOND, replan=plan)
    return without_paths(outcome(before, replanning.composed(CONTEXT, before, MissionsWanted(revision), NOW_S)))


GIVEN = new_mission(2)


def closed(**given: Any) -> Stepped:
    before = flight_of(replan=plan_of(**{"missions": {"uav1": GIVEN}} | given), orphans_since_s=5.0)
    return outcome(before, replanning.ended_if_done(before, NOW_S))


def again(one: VehicleState = ON_ITS_WAY, **given: Any) -> tuple[Changes, Changes]:
    left = ReplanRecord(3, "why", False, (1, 2), 0.5, 5.0, 9.0, 1.0)
    before = flight_of(one, **{"given_up": frozenset({2, 5}), "records": (left,), **given})
    return differences(before, replanning.heard_again(before, one, NOW_S))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "there is no need",
        lambda: begun(ON_ITS_WAY, inspected=PROVEN, orphans_since_s=5.0, **WANTS),
        ([], {}, {"orphans_since_s": None, "urgent": False}),
    ),
    ("there is need since now", lambda: begun(ON_ITS_WAY), ([], {}, {"orphans_since_s": NOW_S})),
    (
        "there is need for five seconds",
        lambda: begun(ON_ITS_WAY, orphans_since_s=NOW_S - 5.0),
        (
            [
                Say(
                    Level.INFO,
                    (
                        "re-plan 1: 4 segments without a vehicle (not proven to be inspected: segments 2, 3, 4, "
                        "5); planning for uav1"
                    ),
                ),
                Solve(
                    revision=1,
                    open_segments=(1, 2, 3, 4, 5),
                    survivors=(replace(ITS_OFFER, budget_pct=72.1886),),
                    trigger="not proven to be inspected: segments 2, 3, 4, 5",
                ),
            ],
            {},
            {
                "attempts": {2: 1, 3: 1, 4: 1, 5: 1},
                "revision": 1,
                "replan": (NOW_S, False),
                "considered": frozenset({"uav1"}),
            },
        ),
    ),
    ("there is need for less", lambda: begun(ON_ITS_WAY, orphans_since_s=NOW_S - 4.9), ([], {}, {})),
    (
        "there is need and a reason",
        lambda: begun(ON_ITS_WAY, **WANTS),
        (
            [
                Say(Level.INFO, "re-plan 1: 4 segments without a vehicle (uav3: gone); planning for uav1"),
                Solve(
                    revision=1,
                    open_segments=(1, 2, 3, 4, 5),
                    survivors=(replace(ITS_OFFER, budget_pct=72.1886),),
                    trigger="uav3: gone",
                ),
            ],
            {},
            {
                "revision": 1,
                "orphans_since_s": NOW_S,
                "urgent": False,
                "replan": (NOW_S - 2.0, False),
                "considered": frozenset({"uav1"}),
            },
        ),
    ),
    (
        "a re-plan is asked for",
        lambda: begun(ON_ITS_WAY, inspected=PROVEN, ordered=True, trigger="page asks for it", trigger_s=NOW_S - 1.0),
        (
            [
                Say(Level.INFO, "re-plan 1: 0 segments without a vehicle (page asks for it); planning for uav1"),
                Solve(
                    revision=1,
                    open_segments=(),
                    survivors=(replace(ITS_OFFER, budget_pct=72.1886),),
                    trigger="page asks for it",
                ),
            ],
            {},
            {
                "revision": 1,
                "orphans_since_s": NOW_S,
                "replan": (NOW_S - 1.0, True),
                "considered": frozenset({"uav1"}),
                "ordered": False,
            },
        ),
    ),
    (
        "a re-plan is asked for and there is nothing to share",
        lambda: begun(flying(waypoint=4), inspected=PROVEN, ordered=True),
        ([], {}, {"orphans_since_s": NOW_S, "ordered": False}),
    ),
    (
        "a re-plan is asked for and nobody can",
        lambda: begun(flying(held_s=5.0), inspected=PROVEN, ordered=True),
        ([], {}, {"orphans_since_s": NOW_S, "ordered": False}),
    ),
    (
        "it has to wait",
        lambda: begun(ON_ITS_WAY, wait_until_s=NOW_S + 0.1, **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    ("it has waited", lambda: begun(ON_ITS_WAY, wait_until_s=NOW_S, **WANTS)[2]["revision"], 1),
    ("another is under way", lambda: begun(ON_ITS_WAY, replan=UNSOLVED, **WANTS), ([], {}, {})),
    ("the flight was aborted", lambda: begun(ON_ITS_WAY, recalled=True, **WANTS), ([], {}, {})),
    ("nobody has started", lambda: begun(ON_ITS_WAY, launched_s=None, **WANTS), ([], {}, {})),
    ("nobody is heard", lambda: begun(ON_ITS_WAY, silent_since_s=5.0, **WANTS), ([], {}, {})),
    (
        "a segment was flown without proof",
        lambda: begun(flying(waypoint=4), orphans_since_s=5.0, inspected=dict.fromkeys(range(1, 6), "uav3")),
        (
            [
                Say(
                    Level.INFO,
                    (
                        "re-plan 1: 1 segment without a vehicle (not proven to be inspected: segment 0); "
                        "planning for uav1"
                    ),
                ),
                Solve(
                    revision=1,
                    open_segments=(0,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, 15.4),
                            budget_pct=73.0157,
                            consumption=1.12826,
                            airborne=True,
                            tail=(),
                            kept=4,
                        ),
                    ),
                    trigger="not proven to be inspected: segment 0",
                ),
            ],
            {},
            {"attempts": {0: 1}, "revision": 1, "replan": (NOW_S, False), "considered": frozenset({"uav1"})},
        ),
    ),
    (
        "a segment was flown without proof for the second time",
        lambda: begun(
            flying(waypoint=4), orphans_since_s=5.0, attempts={0: 1}, inspected=dict.fromkeys(range(1, 6), "uav3")
        ),
        (
            [
                Say(
                    Level.INFO,
                    (
                        "re-plan 1: 1 segment without a vehicle (not proven to be inspected: segment 0); "
                        "planning for uav1"
                    ),
                ),
                Solve(
                    revision=1,
                    open_segments=(0,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, 15.4),
                            budget_pct=73.0157,
                            consumption=1.12826,
                            airborne=True,
                            tail=(),
                            kept=4,
                        ),
                    ),
                    trigger="not proven to be inspected: segment 0",
                ),
            ],
            {},
            {"attempts": {0: 2}, "revision": 1, "replan": (NOW_S, False), "considered": frozenset({"uav1"})},
        ),
    ),
    (
        "a segment was flown without proof for the third time",
        lambda: begun(
            flying(waypoint=4), orphans_since_s=5.0, attempts={0: 2}, inspected=dict.fromkeys(range(1, 6), "uav3")
        ),
        (
            [Say(Level.WARNING, "some segments could not be proven to be inspected; left for later")],
            {},
            {"given_up": frozenset({0}), "attempts": {0: 3}},
        ),
    ),
    (
        "of two segments one was flown too often",
        lambda: begun(
            flying(waypoint=4),
            orphans_since_s=5.0,
            attempts={0: 2},
            given_up=frozenset({5}),
            inspected=dict.fromkeys(range(2, 6), "uav3"),
        ),
        (
            [
                Say(
                    Level.INFO,
                    (
                        "re-plan 1: 1 segment without a vehicle (not proven to be inspected: segment 1); "
                        "planning for uav1"
                    ),
                ),
                Solve(
                    revision=1,
                    open_segments=(1,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, 15.4),
                            budget_pct=73.0157,
                            consumption=1.12826,
                            airborne=True,
                            tail=(),
                            kept=4,
                        ),
                    ),
                    trigger="not proven to be inspected: segment 1",
                ),
            ],
            {},
            {
                "given_up": frozenset({0, 5}),
                "attempts": {0: 3, 1: 1},
                "revision": 1,
                "replan": (NOW_S, False),
                "considered": frozenset({"uav1"}),
            },
        ),
    ),
    (
        "nobody is left",
        lambda: begun(
            flying(fault=BATTERY_FAULT),
            with_facts(SECOND, excluded=True),
            replace(SECOND, name="uav3", stage=Stage.LOST),
            **WANTS,
        ),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "nobody is in the air",
        lambda: begun(flying(fault=BATTERY_FAULT), with_facts(SECOND, excluded=True), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "nobody in the air can, and who has landed could",
        lambda: begun(
            with_facts(landed(stage=Stage.LANDED), heard_s=None),
            with_facts(SECOND, excluded=True),
            replace(SECOND, name="uav3", fault=BATTERY_FAULT),
            **WANTS,
        ),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "somebody flies its mission and cannot now",
        lambda: begun(flying(held_s=5.0), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "somebody comes back who may fly again",
        lambda: begun(flying(**HOMEWARD), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "somebody comes back who may not fly again",
        lambda: begun(flying(**HOMEWARD), context=CREW, **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
    (
        "who comes back is at fault",
        lambda: begun(flying(**HOMEWARD, fault=BATTERY_FAULT), **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
    (
        "who comes back is out of the plan",
        lambda: begun(flying(**HOMEWARD, excluded=True), **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
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
                Say(Level.WARNING, "the budgets that are left do not cover segments 3, 4"),
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
                Say(Level.WARNING, "the budgets that are left do not cover segment 3"),
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
                Say(Level.INFO, "uav1: flew on before its new mission came; re-plan 4 is planned again for it"),
                Say(Level.INFO, "re-plan 4 ended; no mission has changed"),
            ],
            {},
            {
                "urgent": True,
                "trigger": "uav1: flew on before its new mission came",
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
            for name, mission in replanning.all_made(
                CONTEXT, flight_of(ON_ITS_WAY), replace(UNMADE, unmade=(*UNMADE.unmade, NewRoute("uav2", (6,))))
            ).missions.items()
        },
        {"uav1": ((0, 4), False)},
    ),
    (
        "all missions at once leave none to make",
        lambda: replanning.all_made(CONTEXT, flight_of(ON_ITS_WAY), UNMADE).unmade,
        (),
    ),
    ("a re-plan that goes on", lambda: closed(pending=frozenset({"uav1"})), ([], {}, {})),
    ("a re-plan that is not solved", lambda: closed(solve_s=None), ([], {}, {})),
    (
        "a re-plan that has ended",
        lambda: closed(uncovered=(3,)),
        (
            [Say(Level.INFO, "re-plan 4 is on board, 5.0 s after it was needed")],
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
            [Say(Level.INFO, "re-plan 4 is on board, 90.0 s after it was needed")],
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
    ("no re-plan", lambda: replanning.ended_if_done(flight_of(replan=None), NOW_S)[1], ()),
    (
        "who is heard again may reach what was left over",
        lambda: again(given_up=frozenset({2, 5, 1})),
        ({}, {"given_up": frozenset({5}), "urgent": True, "trigger": "uav1: link regained", "trigger_s": NOW_S}),
    ),
    ("who is heard again, everybody sent home", lambda: again(recalled=True), ({}, {})),
    ("who is heard again, with nothing left over", lambda: again(given_up=frozenset({5})), ({}, {})),
    ("who is heard again, with no re-plan before", lambda: again(records=()), ({}, {})),
    ("who is heard again was asked already", lambda: again(considered=frozenset({"uav1"})), ({}, {})),
    ("who is heard again is at fault", lambda: again(flying(fault=BATTERY_FAULT)), ({}, {})),
    ("who is heard again returns", lambda: again(flying(**HOMEWARD)), ({}, {})),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


@pytest.mark.parametrize(("ways", "made"), [(6, 1), (7, 2), (12, 2), (13, 3)])
def test_so_many_ways_are_made_in_one_turn(ways: int, made: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replanning, "WAYS_AT_ONCE", ways)
    names = ("uav1", "uav2", "uav3")
    plan = plan_of(
        *(offer_of(name, airborne=False) for name in names),
        unmade=tuple(NewRoute(name, (4,)) for name in names), pending=frozenset(names),
    )  # fmt: skip
    before = flight_of(replan=plan)
    after, commands = replanning.composed(CONTEXT, before, MissionsWanted(4), NOW_S)
    assert after.replanning.replan is not None
    assert [route.vehicle for route in after.replanning.replan.unmade] == list(names[made:])
    assert [one for one in commands if isinstance(one, Compose)] == [Compose(4)] * (made < 3)
