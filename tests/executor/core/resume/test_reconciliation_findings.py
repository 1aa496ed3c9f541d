"""A resumed flight: the action for each vehicle, by its mission on board."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.voltage import VoltageState
from executor.core.interface.commands import Level, Say, Start
from executor.core.interface.events import Found, Match, Reopened, StartEnded
from executor.core.resume import reconciliation
from executor.core.state import inspection_proof
from executor.core.state.fleet_state import GroundStationAbsence, Replan
from executor.core.state.inspection_proof import InspectionRun, PositionSample, _RunStatistics
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_parts import HomingOrder, LastKnown
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import FlightPath, MissionItem, encode
from tests.executor.builders import with_facts
from tests.executor.core.resume.resumed_flight import CONTEXT, found, taken_up
from tests.executor.core.steps import (
    CREW,
    HOLD,
    HOMEWARD,
    LOW,
    SECOND,
    STILL,
    Changes,
    Stepped,
    beat,
    flight_of,
    landed,
    new_mission,
    outcome,
    over_pad,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import DISARMED, NOW_S, at, flying, mission

OUR_BOARD = mission()
NEW = new_mission(4, 6)
GOING = plan_of(missions={"uav1": NEW}, pending=frozenset({"uav1"}))
GETS = flying(pending=4)
STARTS = flying(stage=Stage.STARTING, waypoint=0, fix=LOW, took_off=False, began_pct=93.0)
WAS = LastKnown(at(age_s=60.0), 2, None, None, 95.0, -math.inf)
RUN = inspection_proof.join_run(OUR_BOARD.tracks[0], PositionSample(5.0, (150.0, -5.0), 3.0), 3.0)
LEFT: Changes = {
    "errand": HomingOrder(5.0, land=True, told=True), "run": RUN, "stale": True,
    "watches": (("mode", 5.0),), "heard_s": NOW_S - 99.0,
    "quality": LinkQuality(lost=0.1), "volts": VoltageState(highest_v=16.0, voltage_v=15.0),
}  # fmt: skip
OURS = Match(0, 10, whole=True)
THEIRS = Match(0, 4, whole=False)
HALF = Match(4, 6, whole=False)


def reopened(*vehicles: VehicleState, notes: tuple[str, ...] = (), **given: Any) -> Stepped:
    before = flight_of(*vehicles, **given)
    return outcome(before, reconciliation.apply_reopening(before, Reopened(1.7e9, 12.3, notes), NOW_S))


def on_board(path: FlightPath) -> tuple[MissionItem, ...]:
    return encode(path, CONTEXT.vehicles["uav1"].dialect).items


ITEMS = on_board(OUR_BOARD.path)


def compared(items: Sequence[MissionItem] | None, plan: Replan | None = None, one: VehicleState = GETS) -> Found:
    return reconciliation.compare_onboard_mission(CONTEXT, flight_of(one, replan=plan), "uav1", items, 5)


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "everything that a pause leaves is begun anew",
        lambda: reopened(
            with_facts(flying(), **LEFT),
            with_facts(SECOND, heard_s=None, before=WAS),
            notes=("the log ends in the midst",),
            tick_s=5.0,
            silent_since_s=5.0,
        ),
        (
            [
                Say(Level.WARNING, "the ground station runs again, after 12 s"),
                Say(Level.WARNING, "the log ends in the midst"),
            ],
            {
                "uav1": {
                    "heard_s": NOW_S,
                    "anchor": None,
                    "run": None,
                    "stale": False,
                    "heartbeat_s": None,
                    "quality": LinkQuality(),
                    "volts": VoltageState(highest_v=16.0),
                    "excused_s": NOW_S,
                    "reopened": True,
                    "before": replace(
                        WAS,
                        fix=replace(STILL, alt_rel_m=20.0, alt_msl_m=470.0, velocity_m_s=(3.0, 0.0, 0.0)),
                        run=InspectionRun(
                            furthest_m=50.0,
                            recent=((5.0, 50.0),),
                            pace=_RunStatistics(began_s=-11.6667, began_m=0.0, fastest_m_s=3.0, samples=1),
                        ),
                        remaining_pct=90.0,
                        factor=0.999998,
                    ),
                    "errand": HomingOrder(5.0, land=True),
                },
                "uav2": {
                    "anchor": None,
                    "heartbeat_s": None,
                    "volts": VoltageState(highest_v=16.8),
                    "excused_s": NOW_S,
                    "reopened": True,
                },
                "uav3": {"excused_s": NOW_S, "reopened": True},
            },
            {"silent_since_s": None, "absences": (GroundStationAbsence(until_s=NOW_S, pause_s=12.3, restarted=True),)},
        ),
    ),
    (
        "a pause of a flight on the ground",
        lambda: reopened(landed(stage=Stage.LANDED)),
        (
            [Say(Level.WARNING, "the ground station runs again, after 12 s")],
            {
                "uav1": {
                    "heartbeat_s": None,
                    "volts": VoltageState(highest_v=16.8),
                    "excused_s": NOW_S,
                    "reopened": True,
                },
                "uav2": {"excused_s": NOW_S, "reopened": True},
                "uav3": {"excused_s": NOW_S, "reopened": True},
            },
            {"absences": (GroundStationAbsence(until_s=NOW_S, pause_s=12.3, restarted=True),)},
        ),
    ),
    (
        "our mission on board",
        lambda: compared(ITEMS),
        Found(vehicle="uav1", heard=True, seq=5, items=10, matches=(OURS,)),
    ),
    (
        "our mission on board, cut short",
        lambda: compared(ITEMS[:6]),
        Found(vehicle="uav1", heard=True, seq=5, items=6, matches=(Match(revision=0, alike=6, whole=False),)),
    ),
    (
        "our mission on board, with more items",
        lambda: compared((*ITEMS, ITEMS[-1])),
        Found(vehicle="uav1", heard=True, seq=5, items=11, matches=(Match(revision=0, alike=10, whole=False),)),
    ),
    (
        "mission on board unreadable",
        lambda: compared(None, GOING),
        Found(vehicle="uav1", heard=True, seq=5, items=None, matches=()),
    ),
    (
        "the new mission on board",
        lambda: compared(on_board(NEW.path), GOING),
        Found(
            vehicle="uav1",
            heard=True,
            seq=5,
            items=14,
            matches=(Match(revision=0, alike=6, whole=False), Match(revision=4, alike=14, whole=True)),
        ),
    ),
    (
        "a mix of two missions on board",
        lambda: compared((*on_board(NEW.path)[:7], *ITEMS[7:]), GOING),
        Found(
            vehicle="uav1",
            heard=True,
            seq=5,
            items=10,
            matches=(Match(revision=0, alike=6, whole=False), Match(revision=4, alike=7, whole=False)),
        ),
    ),
    (
        "a mission on board where none was uploaded",
        lambda: compared(ITEMS, GOING, with_facts(GETS, board=None)),
        Found(vehicle="uav1", heard=True, seq=5, items=10, matches=(HALF,)),
    ),
    (
        "a new mission is of others",
        lambda: compared(ITEMS, replace(GOING, missions={})),
        Found(vehicle="uav1", heard=True, seq=5, items=10, matches=(OURS,)),
    ),
    (
        "it does not answer",
        lambda: taken_up(flying(before=WAS), found(OURS, heard=False)),
        ([Say(Level.WARNING, "uav1: does not answer yet")], (), (), {"uav1": {"before": None}}, {}),
    ),
    (
        "it returns",
        lambda: taken_up(flying(**HOMEWARD, before=WAS), found(OURS)),
        ([], (), (), {"uav1": {"before": None}}, {}),
    ),
    (
        "it has no mission",
        lambda: taken_up(flying(board=None, before=WAS), found()),
        ([], (), (), {"uav1": {"before": None}}, {}),
    ),
    ("it flies its mission", lambda: taken_up(flying(), found(OURS)), ([], (), (), {}, {})),
    (
        "it flies its mission and is further",
        lambda: taken_up(flying(), found(OURS, seq=7)),
        ([], (), (), {"uav1": {"waypoint": 4}}, {}),
    ),
    (
        "it flies its mission and was on its way",
        lambda: taken_up(
            flying(
                before=replace(WAS, fix=replace(at(age_s=36.0), place_m=(150.0, -5.0)), run=LEFT["run"], run_visit=0),
                waypoint=3,
                fix=replace(at(), place_m=(250.0, -5.0)),
            ),
            found(OURS, seq=6),
            absences=(GroundStationAbsence(5.0, 10.0, restarted=True),),
        ),
        (
            [Say(Level.INFO, "uav1: flew segment 0 during the outage, inferred from its clock and position")],
            (),
            (),
            {
                "uav1": {
                    "run": InspectionRun(
                        furthest_m=50.0,
                        recent=((NOW_S, 50.0),),
                        pace=_RunStatistics(began_s=NOW_S - 16.667, began_m=0.0, fastest_m_s=3.0, samples=1),
                    ),
                    "run_visit": 1,
                    "before": None,
                }
            },
            {
                "inspected": {0: "uav1"},
                "absences": (GroundStationAbsence(until_s=5.0, pause_s=36.0, restarted=True),),
                "inferred": frozenset({0, 1}),
            },
        ),
    ),
    ("it says an item that its mission has not", lambda: taken_up(flying(), found(OURS, seq=10)), ([], (), (), {}, {})),
    ("it says no item", lambda: taken_up(flying(), found(OURS, seq=None)), ([], (), (), {}, {})),
    (
        "it carries another mission",
        lambda: taken_up(flying(before=WAS), found(THEIRS)),
        (
            [],
            (),
            (("uav1", "mission on board differs from the uploaded one from item 4 on"),),
            {"uav1": {"before": None}},
            {},
        ),
    ),
    (
        "it carries another mission on the ground",
        lambda: taken_up(flying(heartbeat=DISARMED), found(THEIRS)),
        ([], (), (), {}, {}),
    ),
    ("mission on board unknown", lambda: taken_up(flying(), found(items=None)), ([], (), (), {}, {})),
    (
        "length of the absence by the vehicle's clock",
        lambda: taken_up(
            flying(before=WAS),
            found(OURS),
            absences=(
                GroundStationAbsence(5.0, 10.0, restarted=False),
                GroundStationAbsence(NOW_S, 10.0, restarted=True),
            ),
        ),
        (
            [],
            (),
            (),
            {"uav1": {"before": None}},
            {
                "absences": (
                    GroundStationAbsence(until_s=5.0, pause_s=10.0, restarted=False),
                    GroundStationAbsence(until_s=NOW_S, pause_s=60.0, restarted=True),
                )
            },
        ),
    ),
    (
        "length of the absence by our own clock",
        lambda: taken_up(
            flying(before=WAS), found(OURS), absences=(GroundStationAbsence(NOW_S, 61.0, restarted=True),)
        ),
        (
            [],
            (),
            (),
            {"uav1": {"before": None}},
            {},
        ),
    ),
    (
        "length of the absence without any clock",
        lambda: taken_up(
            flying(before=WAS), found(OURS, heard=False), absences=(GroundStationAbsence(NOW_S, 10.0, restarted=True),)
        ),
        ([Say(Level.WARNING, "uav1: does not answer yet")], (), (), {"uav1": {"before": None}}, {}),
    ),
    (
        "a start has become a flight",
        lambda: taken_up(with_facts(STARTS, before=WAS), found(OURS)),
        ([], (StartEnded(vehicle="uav1", accepted=True, reason=""),), (), {"uav1": {"before": None}}, {}),
    ),
    (
        "a start has become a flight in another mode",
        lambda: taken_up(with_facts(STARTS, heartbeat=beat(HOLD), fix=over_pad(2.1)), found(OURS)),
        ([], (StartEnded(vehicle="uav1", accepted=True, reason=""),), (), {}, {}),
    ),
    (
        "a start has not become a flight",
        lambda: taken_up(with_facts(STARTS, heartbeat=beat(HOLD), fix=over_pad(2.0)), found(OURS)),
        (
            [Say(Level.INFO, "uav1: had not started yet; trying again"), Start("uav1")],
            (),
            (),
            {"uav1": {"ordered_mode_s": NOW_S}},
            {},
        ),
    ),
    (
        "a start has become a flight, which nobody can say where",
        lambda: taken_up(with_facts(STARTS, fix=None), found(OURS)),
        (
            [Say(Level.INFO, "uav1: had not started yet; trying again"), Start("uav1")],
            (),
            (),
            {"uav1": {"ordered_mode_s": NOW_S}},
            {},
        ),
    ),
    (
        "a start waits for the crew",
        lambda: taken_up(with_facts(STARTS, heartbeat=beat(HOLD)), found(OURS), context=CREW),
        ([], (), (("uav1", "was armed and had not taken off when the ground station went offline"),), {}, {}),
    ),
    (
        "a start has not armed",
        lambda: taken_up(with_facts(STARTS, heartbeat=DISARMED), found(OURS)),
        (
            [Say(Level.INFO, "uav1: had not started yet; trying again"), Start("uav1")],
            (),
            (),
            {"uav1": {"ordered_mode_s": NOW_S}},
            {},
        ),
    ),
    (
        "a start has not armed, and waits for the crew",
        lambda: taken_up(with_facts(STARTS, heartbeat=DISARMED), found(OURS), context=CREW),
        (
            [Say(Level.WARNING, "uav1: had not started yet; it stays on the ground")],
            (),
            (),
            {"uav1": {"stage": Stage.GROUND}},
            {},
        ),
    ),
    (
        "a start has not armed, and the crew's yes to it is from before",
        lambda: taken_up(with_facts(STARTS, heartbeat=DISARMED, cleared_s=NOW_S - 30.0), found(OURS), context=CREW),
        (
            [Say(Level.WARNING, "uav1: had not started yet; it stays on the ground")],
            (),
            (),
            {"uav1": {"stage": Stage.GROUND, "cleared_s": None}},
            {},
        ),
    ),
    (
        "a start has not armed, and carries another mission",
        lambda: taken_up(with_facts(STARTS, heartbeat=DISARMED), found(THEIRS)),
        (
            [Say(Level.WARNING, "uav1: had not started yet; it stays on the ground")],
            (),
            (),
            {"uav1": {"stage": Stage.GROUND}},
            {},
        ),
    ),
    (
        "a start has become a landing",
        lambda: taken_up(with_facts(STARTS, heartbeat=DISARMED, began_pct=93.1), found(OURS)),
        (
            [Say(Level.INFO, "uav1: its battery has lost 3 % since then: assumed to have flown and landed")],
            (),
            (),
            {"uav1": {"stage": Stage.LANDED}},
            {},
        ),
    ),
    (
        "a start of an unknown battery",
        lambda: [
            taken_up(with_facts(STARTS, **given, heartbeat=DISARMED), found(OURS))[0]
            for given in ({"began_pct": None}, {"battery": BatteryState()})
        ],
        [
            [Say(Level.INFO, "uav1: had not started yet; trying again"), Start("uav1")],
            [Say(Level.INFO, "uav1: had not started yet; trying again"), Start("uav1")],
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
