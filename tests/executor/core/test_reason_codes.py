"""Reasons have codes that a program can branch on: each is reached, and documents and schemas list them all."""

from __future__ import annotations

import ast
import json
import re
from enum import StrEnum

import pytest

from executor.adapters.eventlog import from_plain, to_plain
from executor.core.context import Context
from executor.core.inflight.faults.watchpoints import TABLE
from executor.core.interface.codes import Ending
from executor.core.interface.events import UploadEnded
from executor.core.interface.intents import Action, Intent, IntentReason
from executor.core.interface.messages import CommandAck
from executor.core.operator.intent_refusals import find_refusal
from executor.core.state.fleet_state import Briefing, FleetState, Question
from executor.core.state.vehicle_state import FaultCode, Stage
from executor.protocols import mission_transfer
from executor.protocols.machine import Rejected
from executor.protocols.vehicle_commands import CommandDialogue, arm
from scripts.pages.reference import DOMAINS
from tests.executor.core.operator.test_intent_refusals import ROWS, grounded, state_of
from tests.executor.core.steps import plan_of
from tests.executor.core.vehicles import CONTEXT, NOW_S, flying
from tests.test_architecture import ROOT, modules

R = IntentReason


def code_of(action: Action, state: FleetState, vehicle: str | None = "uav1", context: Context = CONTEXT) -> R | None:
    why = find_refusal(context, state, Intent("wish", action, vehicle, "page", False), NOW_S)
    return None if why is None else why[0]


INSPECTED = dict.fromkeys(range(CONTEXT.segments), "uav2")
ASKED: list[tuple[R, Action, FleetState, str | None]] = [
    (R.OVER, Action.HOLD, state_of(flying(), finished=True), "uav1"),
    (R.NOT_BEGUN, Action.HOLD, state_of(flying(), launched_s=None), "uav1"),
    (R.BEGUN, Action.PREPARE, state_of(flying()), None),
    (R.VEHICLE_UNEXPECTED, Action.ABORT, state_of(flying()), "uav1"),
    (R.VEHICLE_MISSING, Action.HOLD, state_of(flying()), None),
    (R.VEHICLE_UNKNOWN, Action.HOLD, state_of(flying()), "uav9"),
    (R.ABORTED, Action.REPLAN, state_of(flying(), recalled=True), None),
    (R.REPLANNING, Action.REPLAN, state_of(flying(), replan=plan_of()), None),
    (R.NO_VEHICLE, Action.ABORT, state_of(flying(stage=Stage.RETURNING)), None),
    (R.IN_PLAN, Action.INCLUDE, state_of(grounded(excluded=False), inspected=INSPECTED), "uav1"),
    (
        R.NOT_ASKED,
        Action.TAKE_OFF,
        state_of(flying(), launched_s=None, briefing=Briefing(question=Question("prepare", "go?", ()))),
        None,
    ),
]
OF_ONE = {
    R.NOT_ON_MISSION, R.ON_HOLD, R.UPLOADING, R.LINK_STALE, R.NEVER_HEARD, R.CLIMBING, R.LANDING, R.NOT_ON_HOLD,
    R.WITH_PILOT, R.RETURNING, R.ON_GROUND, R.LINK_LOST, R.NOT_FLYING, R.POSITION_UNKNOWN, R.NEAR_LINE, R.OTHER_PAD,
    R.OUT_OF_PLAN, R.NOT_AT_REST, R.TILTED, R.CLEARED, R.OFF_PAD, R.BATTERY_LOW, R.NOT_DOWN, R.DISARMED,
}  # fmt: skip
"""Refusals that hang on the vehicle that is named."""


@pytest.mark.parametrize(("code", "action", "state", "vehicle"), ASKED, ids=[row[0].value for row in ASKED])
def test_a_refusal_has_its_code(code: R, action: Action, state: FleetState, vehicle: str | None) -> None:
    assert code_of(action, state, vehicle) is code


def test_so_has_every_refusal_of_one_vehicle() -> None:
    found = {code_of(action, state_of(one)) for action, one, why in ROWS if why}
    assert found == OF_ONE


def test_a_plain_yes_has_none() -> None:
    assert {code_of(action, state_of(one)) for action, one, why in ROWS if not why} == {None}


@pytest.mark.parametrize(
    ("result", "code"),
    [
        (2, Ending.DENIED),
        (3, Ending.UNSUPPORTED),
        (4, Ending.FAILED),
        (6, Ending.CANCELLED),
        (9, Ending.UNKNOWN_RESULT),
    ],
)
def test_a_command_that_is_refused_has_the_code_of_its_result(result: int, code: Ending) -> None:
    asked, _ = CommandDialogue(arm(), "arm").begin(0.0)
    ended, _ = asked.on_message(CommandAck(asked.command.command, result), 0.1)
    assert isinstance(ended.outcome, Rejected)
    assert ended.outcome.code is code


def test_a_mission_that_is_refused_has_the_code_of_its_result() -> None:
    codes = {
        result: mission_transfer.build_rejection("mission", result).code
        for result in (*mission_transfer.RESULT_NAMES, 99)
    }
    assert [codes[result] for result in (1, 4, 13, 14, 15, 99)] == [
        Ending.ERROR, Ending.NO_SPACE, Ending.INVALID_SEQUENCE, Ending.OTHER_STATION, Ending.CANCELLED,
        Ending.UNKNOWN_RESULT,
    ]  # fmt: skip
    assert Ending.UNKNOWN_RESULT not in [codes[result] for result in mission_transfer.RESULT_NAMES]


def test_each_watchpoint_has_a_code_of_its_own() -> None:
    codes = [point.code for point in TABLE]
    assert len(set(codes)) == len(codes)
    assert set(FaultCode) - set(codes) == {
        FaultCode.NOT_STARTED, FaultCode.MISSION_FOREIGN, FaultCode.MISSION_MIXED,
        FaultCode.OPERATOR_LAND, FaultCode.OPERATOR_EXCLUDE, FaultCode.CAMERA_SILENT, FaultCode.CAMERA_MUTE,
        FaultCode.CARD_FULL, FaultCode.GIMBAL_STUCK,
    }  # fmt: skip


def test_a_log_keeps_the_code_and_an_older_one_lacks_it() -> None:
    ended = UploadEnded("uav1", 2, accepted=False, mixed=False, reason="no", code=Ending.NO_SPACE)
    plain = json.loads(json.dumps(to_plain(ended)))
    assert plain["code"] == "no_space"
    assert from_plain(plain) == ended
    assert from_plain({key: value for key, value in plain.items() if key != "code"}).code is None
    assert from_plain(plain | {"code": None}).code is None


def used() -> set[str]:
    """Return every member of a reason that the program names, as `Ending.DENIED`."""
    return {
        f"{node.value.id}.{node.attr}"
        for path in modules("executor")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    }


def test_every_code_is_snake_case_and_produced_somewhere() -> None:
    codes = [(kind.__name__, one) for _, kind in DOMAINS for one in kind]
    assert [one for _, one in codes if not re.fullmatch(r"[a-z]+(_[a-z]+)*", one.value)] == []
    assert {f"{name}.{one.name}" for name, one in codes} <= used()


@pytest.mark.parametrize("kind", [kind for _, kind in DOMAINS], ids=lambda kind: kind.__name__)
def test_the_schemas_list_the_same_codes(kind: type[StrEnum]) -> None:
    files = [path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "mqtt").glob("*.schema.json")]
    listed = [
        parts[kind.__name__]["enum"] for text in files if kind.__name__ in (parts := json.loads(text).get("$defs", {}))
    ]
    assert listed
    assert all(codes == [one.value for one in kind] for codes in listed)
