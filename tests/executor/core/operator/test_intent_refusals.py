"""Refusals of intents: each reason on both sides of its limit."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core.interface.intents import Action, Intent
from executor.core.interface.messages import Heartbeat
from executor.core.operator.intent_refusals import build_confirmation_question, find_refusal
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import ModeCause, PositionFix, Takeover
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState
from missions import Phase
from tests.executor.builders import vehicle, with_facts
from tests.executor.core.vehicles import (
    AUTO,
    CONTEXT,
    DISARMED,
    FLEET,
    NOW_S,
    RTL,
    SETUP,
    at,
    flying,
    pack,
)

PAD_E, PAD_N = SETUP.pad_m
LINE_N = float(CONTEXT.setup.network.ends_m[0, 0, 1])
FAULT = Fault(FaultKind.BATTERY, "why", NOW_S, FaultCode.BATTERY_LOW)


def state_of(one: VehicleState, **changes: object) -> FleetState:
    others = {name: vehicle(FLEET, name) for name in ("uav2", "uav3")}
    state = with_facts(FleetState(MappingProxyType({"uav1": one, **others})), launched_s=NOW_S - 100.0)
    return with_facts(state, **changes)


def words(state: FleetState, intent: Intent) -> str:
    why = find_refusal(CONTEXT, state, intent, NOW_S)
    return "" if why is None else why[1]


def refused(action: Action, one: VehicleState, **changes: object) -> str:
    return words(state_of(one, **changes), Intent("wish", action, "uav1", "page", False))


def leg(phase: Phase) -> VehicleState:
    board = flying().assignment.board
    assert board is not None
    return flying(waypoint=next(n for n, point in enumerate(board.path.waypoints) if point.phase is phase))


def placed(east_m: float, north_m: float, age_s: float = 0.0) -> PositionFix:
    return replace(at(age_s=age_s), place_m=(east_m, north_m))


def grounded(**changes: object) -> VehicleState:
    """Return a vehicle that has landed on its pad and was taken out of the plan."""
    fix = placed(PAD_E, PAD_N)
    told: dict[str, object] = {"stage": Stage.LANDED, "heartbeat": DISARMED, "excluded": True, "fix": fix}
    return flying(**(told | changes))


HOLDS = flying(held_s=NOW_S - 9.0)
AWAY = flying(fix=placed(PAD_E, LINE_N - 300.0))
OTHER_PAD = CONTEXT.vehicles["uav2"].pad_m
DOWN = flying(stage=Stage.DOWN)
ROWS: list[tuple[Action, VehicleState, str]] = [
    (Action.HOLD, flying(), ""),
    (Action.HOLD, flying(stage=Stage.PILOT), ""),
    (Action.HOLD, flying(stage=Stage.RETURNING), "it is not on its mission, it is returning"),
    (Action.HOLD, HOLDS, "it holds already"),
    (Action.HOLD, flying(pending=3), "mission upload in progress; try again in a moment"),
    (Action.HOLD, flying(heard_s=NOW_S - 2.9), ""),
    (Action.HOLD, flying(heard_s=NOW_S - 3.0), "no message from it for 3 s"),
    (Action.HOLD, flying(heard_s=None), "no message was ever received from it"),
    (Action.HOLD, leg(Phase.TAKEOFF), "it is climbing from its pad; below its layer it could conflict with others"),
    (Action.HOLD, leg(Phase.LAND), "it is landing"),
    (Action.HOLD, leg(Phase.TRANSIT), ""),
    (Action.RESUME, HOLDS, ""),
    (Action.RESUME, flying(), "it is not on hold, it is flying"),
    (Action.RESUME, flying(stage=Stage.RETURNING, held_s=NOW_S), "it is not on hold, it is returning"),
    (
        Action.RESUME,
        flying(stage=Stage.PILOT, held_s=NOW_S),
        "it is with its pilot: the pilot must set mission mode; then include it",
    ),
    (Action.RESUME, with_facts(HOLDS, heard_s=NOW_S - 3.0), "no message from it for 3 s"),
    (Action.RETURN, flying(), ""),
    (Action.RETURN, flying(stage=Stage.RETURNING), ""),
    (
        Action.RETURN,
        flying(stage=Stage.RETURNING, heartbeat=Heartbeat(3, RTL, True, 4)),
        "it is returning already",
    ),
    (Action.RETURN, grounded(), "it is on the ground"),
    (Action.RETURN, DOWN, "it is on the ground"),
    (Action.RETURN, flying(stage=Stage.LOST), "no link; RTL will be commanded as soon as the link is back"),
    (Action.LAND, AWAY, ""),
    (Action.LAND, replace(AWAY, stage=Stage.LOST), "it is not flying, it is lost"),
    (Action.LAND, with_facts(AWAY, heartbeat=DISARMED), "it is not flying, it is flying"),
    (Action.LAND, with_facts(AWAY, lands=True), "it is landing already"),
    (Action.LAND, with_facts(AWAY, fix=None), "its position is not known"),
    (Action.LAND, flying(fix=placed(PAD_E, LINE_N - 300.0, age_s=3.0)), ""),
    (Action.LAND, flying(fix=placed(PAD_E, LINE_N - 300.0, age_s=3.1)), "its position is not known"),
    (Action.LAND, flying(fix=placed(250.0, LINE_N + 12.1)), ""),
    (
        Action.LAND,
        flying(fix=placed(250.0, LINE_N + 11.9)),
        "it is 12 m from the line, too near to land safely; use return",
    ),
    (
        Action.LAND,
        flying(fix=placed(250.0, LINE_N - 5.0)),
        "it is 5 m from the line, too near to land safely; use return",
    ),
    # The line begins at 100 m and ends at 700 m east of the depot.
    (Action.LAND, flying(fix=placed(87.9, LINE_N)), ""),
    (Action.LAND, flying(fix=placed(88.1, LINE_N)), "it is 12 m from the line, too near to land safely; use return"),
    (Action.LAND, flying(fix=placed(712.1, LINE_N)), ""),
    (Action.LAND, flying(fix=placed(711.9, LINE_N)), "it is 12 m from the line, too near to land safely; use return"),
    (Action.LAND, flying(fix=placed(OTHER_PAD[0], OTHER_PAD[1] - 4.1)), ""),
    (Action.LAND, flying(fix=placed(OTHER_PAD[0], OTHER_PAD[1] - 3.9)), "it would land on the pad of uav2"),
    (Action.LAND, flying(fix=placed(PAD_E, PAD_N)), ""),
    (Action.EXCLUDE, flying(), ""),
    (Action.EXCLUDE, flying(fault=FAULT), "it is out of the plan already: why"),
    (Action.EXCLUDE, flying(excluded=True), "it is out of the plan already"),
    (Action.INCLUDE, grounded(), ""),
    (Action.INCLUDE, grounded(stage=Stage.DOWN), ""),
    (Action.INCLUDE, flying(), "it is not on the ground with its motors off, it is flying"),
    (
        Action.INCLUDE,
        grounded(heartbeat=Heartbeat(3, AUTO, True, 3)),
        "it is not on the ground with its motors off, it is landed",
    ),
    (Action.INCLUDE, grounded(heard_s=NOW_S - 3.0), "no message from it for 3 s"),
    (Action.INCLUDE, grounded(tilted_since_s=NOW_S), "it is tilted, it may have tipped over"),
    (Action.INCLUDE, grounded(cleared_s=NOW_S), "it is cleared for take-off already"),
    (Action.INCLUDE, grounded(fix=placed(PAD_E, PAD_N - 15.0)), ""),
    (
        Action.INCLUDE,
        grounded(fix=placed(PAD_E, PAD_N - 15.1)),
        "it is not on its pad, where its climb and landing are planned",
    ),
    (Action.INCLUDE, grounded(fix=None), "it is not on its pad, where its climb and landing are planned"),
    (Action.INCLUDE, grounded(battery=pack(20.0)), ""),
    (Action.INCLUDE, grounded(battery=pack(19.9)), "its battery is 20 %; expected more than its reserve of 15 %"),
    (Action.INCLUDE, flying(stage=Stage.PILOT), "it is with its pilot: the pilot must set mission mode first"),
    (
        Action.INCLUDE,
        flying(stage=Stage.PILOT, taken=Takeover(NOW_S - 9.0)),
        "it is with its pilot: the pilot must set mission mode first",
    ),
    (Action.INCLUDE, flying(stage=Stage.PILOT, taken=Takeover(NOW_S - 9.0, returned_s=NOW_S)), ""),
    (
        Action.INCLUDE,
        flying(stage=Stage.PILOT, taken=Takeover(NOW_S - 9.0, returned_s=NOW_S), fault=FAULT),
        "it is out of the plan: why",
    ),
    (Action.DISARM, DOWN, ""),
    (Action.DISARM, flying(), "it is not down, it is flying"),
    (Action.DISARM, with_facts(DOWN, heartbeat=DISARMED), "its motors are off already"),
    (Action.DISARM, with_facts(DOWN, heard_s=NOW_S - 3.0), "no message from it for 3 s"),
]


@pytest.mark.parametrize(
    ("action", "one", "why"), ROWS, ids=[f"{n}-{row[0].value}-{row[2] or 'done'}" for n, row in enumerate(ROWS)]
)
def test_what_is_refused_and_why(action: Action, one: VehicleState, why: str) -> None:
    assert refused(action, one) == why


@pytest.mark.parametrize(
    ("action", "one"),
    [
        (Action.RESUME, HOLDS),
        (Action.INCLUDE, grounded()),
        (Action.INCLUDE, flying(stage=Stage.PILOT, taken=Takeover(NOW_S, returned_s=NOW_S))),
        (Action.REPLAN, flying()),
    ],
)
def test_no_vehicle_takes_off_after_an_abort(action: Action, one: VehicleState) -> None:
    intent = Intent("wish", action, None if action is Action.REPLAN else "uav1", "page", False)
    assert words(state_of(one, recalled=True), intent) == "the flight was aborted"


def test_what_fits_no_time_is_refused() -> None:
    assert refused(Action.HOLD, flying(), finished=True) == "the flight is over"
    assert refused(Action.HOLD, flying(), launched_s=None) == "the flight has not begun"
    strange = Intent("wish", Action.HOLD, "uav9", "page", False)
    assert words(state_of(flying()), strange) == "there is no vehicle 'uav9': expected one of uav1, uav2, uav3"
    nobody = Intent("wish", Action.HOLD, None, "page", False)
    assert words(state_of(flying()), nobody) == "hold needs a vehicle: one of uav1, uav2, uav3"
    assert refused(Action.ABORT, flying()) == "abort is for the whole fleet; expected no vehicle"


def test_an_abort_needs_a_vehicle_on_its_mission() -> None:
    abort = Intent("wish", Action.ABORT, None, "page", False)
    for stage in Stage:
        flies = stage in {Stage.STARTING, Stage.FLYING}
        why = words(state_of(flying(stage=stage)), abort)
        assert why == ("" if flies else "no vehicle is on a mission"), stage


ASKED = [
    (Action.DISARM, DOWN, "force its motors off? If it is still flying, it will fall"),
    (Action.INCLUDE, grounded(), "Is its pad clear of people?"),
    (Action.INCLUDE, flying(stage=Stage.PILOT), ""),
    (
        Action.HOLD,
        flying(stage=Stage.PILOT, cause=ModeCause.PERSON),
        "Take control of it? Speak to the pilot first",
    ),
    (
        Action.LAND,
        flying(stage=Stage.PILOT, cause=ModeCause.PERSON),
        "Take control of it? Speak to the pilot first",
    ),
    (Action.EXCLUDE, flying(stage=Stage.PILOT), ""),
    (Action.HOLD, flying(), ""),
]


@pytest.mark.parametrize(("action", "one", "asked"), ASKED)
def test_what_could_hurt_is_asked_again_until_it_is_confirmed(action: Action, one: VehicleState, asked: str) -> None:
    wish = Intent("wish", action, "uav1", "page", False)
    told = build_confirmation_question(CONTEXT, state_of(one), wish)
    assert told.endswith(asked)
    assert bool(told) is bool(asked)
    assert build_confirmation_question(CONTEXT, state_of(one), replace(wish, confirmed=True)) == ""
