"""The command and the parameter machine, under any order, duplication and loss of messages."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from executor.core.interface.messages import (
    CommandAck,
    Message,
    MissionAck,
    Outgoing,
    ParamValue,
    SendCommand,
    SendParamRequest,
    SendParamSet,
)
from executor.protocols import parameter_dialogue, vehicle_commands
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.parameter_dialogue import ParameterDialogue
from executor.protocols.vehicle_commands import IN_PROGRESS_S, RESULT_NAMES, CommandDialogue
from tests.properties.machines import Told, play, stories

ORDER = SendCommand(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
ACKS: st.SearchStrategy[Message] = st.one_of(
    st.builds(CommandAck, st.sampled_from([400, 300]), st.integers(0, 12)), st.just(MissionAck(0))
)
VALUES: st.SearchStrategy[Message] = st.one_of(
    st.builds(
        ParamValue, st.sampled_from(["RTL_ALT", "FS_GCS_ENABLE"]), st.sampled_from([0.0, 1.0, 1500.0]), st.just(9)
    ),
    st.just(MissionAck(0)),
)
SET = SendParamSet("RTL_ALT", 1500.0, 9)


def arm() -> CommandDialogue:
    return CommandDialogue(ORDER, "arm")


@given(story=stories(ACKS))
def test_a_command_ends_exactly_once_whatever_comes(story: list[Told]) -> None:
    _, sent = play(arm(), story)
    assert len(sent) <= vehicle_commands.TRIES
    confirmations = [message.confirmation for message in sent if isinstance(message, SendCommand)]
    assert confirmations == list(range(len(sent)))


@given(story=stories(ACKS, cancels=False))
def test_a_command_is_accepted_only_by_its_own_acknowledgement(story: list[Told]) -> None:
    machine, _ = play(arm(), story)
    if isinstance(machine.outcome, Accepted):
        assert CommandAck(400, 0) in [one.step for one in story]


@given(story=stories(VALUES))
@pytest.mark.parametrize("wanted", [None, SET])
def test_a_parameter_ends_exactly_once_whatever_comes(wanted: SendParamSet | None, story: list[Told]) -> None:
    machine, sent = play(ParameterDialogue("RTL_ALT", wanted), story)
    assert len(sent) <= parameter_dialogue.TRIES
    if isinstance(machine.outcome, Accepted):
        assert machine.value is not None
        assert machine.value.name == "RTL_ALT"
        assert wanted is None or machine.value.value == wanted.value


def told(machine: CommandDialogue, *results: int) -> tuple[CommandDialogue, list[Outgoing]]:
    machine, opening = machine.begin(0.0)
    sent = list(opening)
    for result in results:
        machine, said = machine.on_message(CommandAck(400, result), 0.1)
        sent.extend(said)
    return machine, sent


@pytest.mark.parametrize("result", sorted(mav.enums["MAV_RESULT"])[:-1])
def test_every_result(result: int) -> None:
    machine, sent = told(arm(), result)
    assert sent == [ORDER]
    if result == mav.MAV_RESULT_ACCEPTED:
        assert machine.outcome == Accepted()
    elif result in {mav.MAV_RESULT_TEMPORARILY_REJECTED, mav.MAV_RESULT_IN_PROGRESS}:
        assert machine.outcome is None
    else:
        assert machine.outcome == Rejected(f"arm: {RESULT_NAMES.get(result, f'result {result}')}")


def test_a_temporary_rejection_is_asked_again_and_then_is_the_reason() -> None:
    machine, sent = play(arm(), [Told(CommandAck(400, 1), 0.1)])
    assert len(sent) == vehicle_commands.TRIES
    assert machine.outcome == Rejected("arm: temporarily rejected")


def test_work_in_progress_is_waited_for() -> None:
    machine, _ = told(arm(), 5)
    assert machine.deadline_s == pytest.approx(0.1 + IN_PROGRESS_S)


def test_silence_ends_a_command() -> None:
    machine, _ = play(arm(), [])
    assert machine.outcome == TimedOut("arm: no acknowledgement")


def test_a_cancelled_command_sends_nothing() -> None:
    machine, _ = arm().begin(0.0)
    ended, said = machine.cancel()
    assert (ended.outcome, said) == (Aborted(), ())


def test_a_parameter_that_stays_as_it_is() -> None:
    machine, sent = play(ParameterDialogue("RTL_ALT", SET), [Told(ParamValue("RTL_ALT", 0.0, 9), 0.1)])
    assert sent == [SET] * parameter_dialogue.TRIES_ANSWERED
    assert machine.outcome == Rejected("RTL_ALT stays 0")


def test_a_parameter_request_without_an_answer() -> None:
    machine, sent = play(ParameterDialogue("RTL_ALT"), [Told(ParamValue("OTHER", 0.0, 9), 0.1)])
    assert sent == [SendParamRequest("RTL_ALT")] * parameter_dialogue.TRIES
    assert machine.outcome == TimedOut("RTL_ALT: no answer")


def test_a_set_value_comes_back_as_float32() -> None:
    wanted = SendParamSet("NAV_SPEED", 8.1, 9)
    machine, _ = ParameterDialogue("NAV_SPEED", wanted).begin(0.0)
    machine, _ = machine.on_message(ParamValue("NAV_SPEED", 8.100000381469727, 9), 0.1)
    assert machine.outcome == Accepted()
