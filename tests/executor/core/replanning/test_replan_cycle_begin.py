"""When a re-plan begins, and for which vehicles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from executor.core.context import Context
from executor.core.interface.commands import Level, Say, Solve, Survivor
from executor.core.replanning import replan_cycle
from executor.core.state.fleet_state import Replan, ReplanRecord
from executor.core.state.radio_channel import ChannelState
from executor.core.state.vehicle_state import Stage, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    CREW,
    HOMEWARD,
    ITS_OFFER,
    SECOND,
    Changes,
    Stepped,
    differences,
    flight_of,
    landed,
    outcome,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, at, flying

CONTEXT = FLEET.context
WANTS: Changes = {"urgent": True, "trigger": "uav3: gone", "trigger_s": NOW_S - 2.0}
ON_ITS_WAY = flying()
PROVEN = dict.fromkeys(range(6), "uav3")
UNSOLVED = plan_of(solve_s=None, solved_s=0.0)


def begun(*vehicles: VehicleState, context: Context = CONTEXT, **given: Any) -> Stepped:
    """Return what comes of the need; of the re-plan beside its question, since when it is needed and who asked."""
    before = flight_of(*vehicles, **given)
    commands, ones, flight = outcome(before, replan_cycle.begin_replan(context, before, NOW_S))
    plan = flight.get("replan")
    if isinstance(plan, Replan):
        assert plan.solve == commands[-1]
        flight["replan"] = (plan.begun_s, plan.ordered)
    return commands, ones, flight


def again(one: VehicleState = ON_ITS_WAY, **given: Any) -> tuple[Changes, Changes]:
    left = ReplanRecord(3, "why", False, (1, 2), 0.5, 5.0, 9.0, 1.0)
    before = flight_of(one, **{"given_up": frozenset({2, 5}), "records": (left,), **given})
    return differences(before, replan_cycle.replan_for_regained_link(before, one, NOW_S))


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
                    ("re-plan 1: 4 open segments (assigned to no vehicle: segments 2, 3, 4, 5); planning for uav1"),
                ),
                Solve(
                    revision=1,
                    open_segments=(1, 2, 3, 4, 5),
                    survivors=(ITS_OFFER,),
                    trigger="assigned to no vehicle: segments 2, 3, 4, 5",
                ),
            ],
            {},
            {
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
                Say(Level.INFO, "re-plan 1: 4 open segments (uav3: gone); planning for uav1"),
                Solve(
                    revision=1,
                    open_segments=(1, 2, 3, 4, 5),
                    survivors=(ITS_OFFER,),
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
        lambda: begun(ON_ITS_WAY, inspected=PROVEN, ordered=True, trigger="requested by page", trigger_s=NOW_S - 1.0),
        (
            [
                Say(Level.INFO, "re-plan 1: 0 open segments (requested by page); planning for uav1"),
                Solve(
                    revision=1,
                    open_segments=(),
                    survivors=(ITS_OFFER,),
                    trigger="requested by page",
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
    ("no vehicle started", lambda: begun(ON_ITS_WAY, launched_s=None, **WANTS), ([], {}, {})),
    ("no vehicle received", lambda: begun(ON_ITS_WAY, silent_since_s=5.0, **WANTS), ([], {}, {})),
    (
        "a segment was flown without proof",
        lambda: begun(
            flying(waypoint=4, fix=at(north_m=-18.0)), orphans_since_s=5.0, inspected=dict.fromkeys(range(1, 6), "uav3")
        ),
        (
            [
                Say(
                    Level.INFO,
                    ("re-plan 1: 1 open segment (inspection not proven: segment 0); planning for uav1"),
                ),
                Solve(
                    revision=1,
                    open_segments=(0,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, -2.6),
                            budget_pct=73.7572,
                            consumption=0.999998,
                            airborne=True,
                            tail=(),
                            kept=4,
                            most_pct=74.7572,
                            start_up_m=20.0,
                            facing_m=(100.0, 0.0),
                        ),
                    ),
                    trigger="inspection not proven: segment 0",
                ),
            ],
            {},
            {"attempts": {0: 1}, "revision": 1, "replan": (NOW_S, False), "considered": frozenset({"uav1"})},
        ),
    ),
    (
        "a segment was flown without proof for the second time",
        lambda: begun(
            flying(waypoint=4, fix=at(north_m=-18.0)),
            orphans_since_s=5.0,
            attempts={0: 1},
            inspected=dict.fromkeys(range(1, 6), "uav3"),
        ),
        (
            [
                Say(
                    Level.INFO,
                    ("re-plan 1: 1 open segment (inspection not proven: segment 0); planning for uav1"),
                ),
                Solve(
                    revision=1,
                    open_segments=(0,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, -2.6),
                            budget_pct=73.7572,
                            consumption=0.999998,
                            airborne=True,
                            tail=(),
                            kept=4,
                            most_pct=74.7572,
                            start_up_m=20.0,
                            facing_m=(100.0, 0.0),
                        ),
                    ),
                    trigger="inspection not proven: segment 0",
                ),
            ],
            {},
            {"attempts": {0: 2}, "revision": 1, "replan": (NOW_S, False), "considered": frozenset({"uav1"})},
        ),
    ),
    (
        "a segment was flown without proof for the third time",
        lambda: begun(
            flying(waypoint=4, fix=at(north_m=-18.0)),
            orphans_since_s=5.0,
            attempts={0: 2},
            inspected=dict.fromkeys(range(1, 6), "uav3"),
        ),
        (
            [Say(Level.WARNING, "inspection of some segments not proven; left for later")],
            {},
            {"given_up": frozenset({0}), "attempts": {0: 3}},
        ),
    ),
    (
        "of two segments one was flown too often",
        lambda: begun(
            flying(waypoint=4, fix=at(north_m=-18.0)),
            orphans_since_s=5.0,
            attempts={0: 2},
            given_up=frozenset({5}),
            inspected=dict.fromkeys(range(2, 6), "uav3"),
        ),
        (
            [
                Say(
                    Level.INFO,
                    ("re-plan 1: 1 open segment (inspection not proven: segment 1); planning for uav1"),
                ),
                Solve(
                    revision=1,
                    open_segments=(1,),
                    survivors=(
                        Survivor(
                            vehicle="uav1",
                            start_m=(261.5, -2.6),
                            budget_pct=73.7572,
                            consumption=0.999998,
                            airborne=True,
                            tail=(),
                            kept=4,
                            most_pct=74.7572,
                            start_up_m=20.0,
                            facing_m=(100.0, 0.0),
                        ),
                    ),
                    trigger="inspection not proven: segment 1",
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
        "no vehicle left",
        lambda: begun(
            flying(fault=BATTERY_FAULT),
            with_facts(SECOND, excluded=True),
            replace(SECOND, name="uav3", stage=Stage.LOST),
            **WANTS,
        ),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "no vehicle airborne",
        lambda: begun(flying(fault=BATTERY_FAULT), with_facts(SECOND, excluded=True), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "no airborne vehicle can, a landed one could",
        lambda: begun(
            with_facts(landed(stage=Stage.LANDED), heard_s=None),
            with_facts(SECOND, excluded=True),
            replace(SECOND, name="uav3", fault=BATTERY_FAULT),
            **WANTS,
        ),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "a vehicle on its mission that cannot now",
        lambda: begun(flying(held_s=5.0), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "a returning vehicle that may fly again",
        lambda: begun(flying(**HOMEWARD), **WANTS),
        ([], {}, {"orphans_since_s": NOW_S}),
    ),
    (
        "a returning vehicle that may not fly again",
        lambda: begun(flying(**HOMEWARD), context=CREW, **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
    (
        "the returning vehicle is at fault",
        lambda: begun(flying(**HOMEWARD, fault=BATTERY_FAULT), **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
    (
        "the returning vehicle is excluded",
        lambda: begun(flying(**HOMEWARD, excluded=True), **WANTS),
        (
            [Say(Level.WARNING, "no vehicle in the air can take over segments 0, 1, 2, 3, 4, 5")],
            {},
            {"given_up": frozenset({0, 1, 2, 3, 4, 5}), "orphans_since_s": NOW_S, "urgent": False},
        ),
    ),
    (
        "link regained, segments left over within reach",
        lambda: again(given_up=frozenset({2, 5, 1})),
        ({}, {"given_up": frozenset({5}), "urgent": True, "trigger": "uav1: link regained", "trigger_s": NOW_S}),
    ),
    ("link regained, flight recalled", lambda: again(recalled=True), ({}, {})),
    ("link regained, nothing left over", lambda: again(given_up=frozenset({5})), ({}, {})),
    ("link regained, no re-plan before", lambda: again(records=()), ({}, {})),
    ("link regained, vehicle considered already", lambda: again(considered=frozenset({"uav1"})), ({}, {})),
    ("link regained, vehicle at fault", lambda: again(flying(fault=BATTERY_FAULT)), ({}, {})),
    ("link regained, vehicle returning", lambda: again(flying(**HOMEWARD)), ({}, {})),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected


@pytest.mark.parametrize(
    ("ended_s", "upload_s", "radio", "begins"),
    [
        (NOW_S - 6.0, 2.0, False, True), (NOW_S - 6.0, 2.0, True, False), (NOW_S - 8.1, 2.0, True, True),
        (NOW_S - 6.0, 60.0, True, True), (NOW_S - 6.0, 0.1, True, True),
    ],
)  # fmt: skip
def test_over_a_radio_segments_without_proof_wait_for_more_of_their_kind_unless_the_flight_ends_before(
    ended_s: float, upload_s: float, radio: bool, begins: bool
) -> None:
    one = flying(waypoint=4, fix=at(north_m=-18.0))
    last = ReplanRecord(1, "why", True, (), 0.5, 5.0, ended_s, upload_s)
    channels = {"uav1": ChannelState()} if radio else {}
    open_since: Changes = {"orphans_since_s": NOW_S - 6.0, "inspected": dict.fromkeys(range(1, 6), "uav3")}
    assert bool(begun(one, records=(last,), channels=channels, **open_since)[0]) == begins
    asked = begun(one, records=(last,), channels=channels, **(open_since | WANTS))
    assert asked[0], "a fault does not wait"
