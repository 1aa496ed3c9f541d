"""One parameter: asked for six times, and a set is believed when the value comes back; or many, at the link's pace."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import ParamValue, SendParamRequest, SendParamSet
from executor.protocols.machine import Aborted, Accepted, Rejected, TimedOut
from executor.protocols.parameter_dialogue import ParameterDialogue

ASK = SendParamRequest("RTL_ALT")
SET = SendParamSet("RTL_ALT", 3000.0, 9)


def test_a_question_is_asked_more_and_more_seldom() -> None:
    state, sent = ParameterDialogue("RTL_ALT").begin(10.0)
    asked = list(sent)
    times_s = [state.deadline_s]
    while state.outcome is None:
        state, sent = state.on_deadline(state.deadline_s)
        asked += sent
        times_s += [state.deadline_s]
    assert asked == [ASK] * 6
    assert times_s == [11.0, 13.0, 17.0, 21.0, 25.0, 29.0, float("inf")]
    assert state.outcome == TimedOut("RTL_ALT: no answer")
    assert state.on_deadline(99.0) == (state, ())
    assert state.cancel() == (state, ())


def test_the_answer_ends_it_and_another_parameters_does_not() -> None:
    state, _ = ParameterDialogue("RTL_ALT").begin(0.0)
    assert state.on_message(ParamValue("RTL_SPEED", 3.0, 9), 0.1) == (state, ())
    answer = ParamValue("RTL_ALT", 1500.0, 9)
    ended, sent = state.on_message(answer, 0.2)
    assert (ended.outcome, ended.value, ended.deadline_s, sent) == (Accepted(), answer, float("inf"), ())
    assert ended.on_message(ParamValue("RTL_ALT", 7.0, 9), 0.3) == (ended, ())


@pytest.mark.parametrize(
    ("wanted", "value", "same"),
    [
        (3000.0, 3000.0, True),
        (3000.0, 3000.02, True),
        (3000.0, 3000.05, False),
        (3000.0, 1500.0, False),
        (0.0, 1e-7, True),
        (0.0, 1e-5, False),
    ],
)
def test_a_set_is_believed_when_its_value_comes_back_as_float32(wanted: float, value: float, *, same: bool) -> None:
    state, sent = ParameterDialogue("RTL_ALT", SendParamSet("RTL_ALT", wanted, 9)).begin(0.0)
    assert sent == (SendParamSet("RTL_ALT", wanted, 9),)
    state, _ = state.on_message(ParamValue("RTL_ALT", value, 9), 0.1)
    assert (state.outcome == Accepted()) is same
    assert state.value == ParamValue("RTL_ALT", value, 9)


def test_a_value_that_stays_is_a_refusal_and_no_answer_is_none() -> None:
    state, _ = ParameterDialogue("RTL_ALT", SET).begin(0.0)
    state, _ = state.on_message(ParamValue("RTL_ALT", 1500.0, 9), 0.1)
    for second in range(1, 5):
        assert state.outcome is None
        state, _ = state.on_deadline(float(second))
    assert state.outcome == Rejected("RTL_ALT stays 1500")
    silent, _ = ParameterDialogue("RTL_ALT", SET).begin(0.0)
    while silent.outcome is None:
        silent, _ = silent.on_deadline(silent.deadline_s)
    assert silent.outcome == TimedOut("RTL_ALT: no answer")


def test_a_question_can_be_given_up() -> None:
    state, _ = ParameterDialogue("RTL_ALT").begin(0.0)
    ended, sent = state.cancel()
    assert (ended.outcome, ended.deadline_s, sent) == (Aborted(), float("inf"), ())
