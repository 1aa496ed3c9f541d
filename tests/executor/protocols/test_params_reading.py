"""Many parameters are read at the pace of the link: in the end each has a value, is not there, or was not read."""

from __future__ import annotations

import heapq
import random
from collections.abc import Collection
from dataclasses import dataclass, field

import pytest

from executor.core.interface.messages import Message, Outgoing, ParamRefused, ParamValue, SendParamRequest
from executor.protocols.machine import Accepted, TimedOut
from executor.protocols.parameter_dialogue import MOST_AT_ONCE, ParameterReading

NAMES = tuple(f"P{number}" for number in range(26))


@dataclass
class Wire:
    """A link of its own to a vehicle that answers at once what it has."""

    has: Collection[str] = NAMES
    loss: float = 0.0
    delay_s: float = 0.1
    """Each way."""
    seed: int = 0
    dead_from_s: float = float("inf")
    refuses: dict[str, bool] = field(default_factory=dict)
    """What it answers without a value, and whether that says that it is not there."""
    asked: list[str] = field(default_factory=list)
    most_open: int = 0

    def read(self, names: tuple[str, ...] = NAMES) -> tuple[ParameterReading, float]:
        """Return how a reading ends, and after how long."""
        rng, coming, count, now_s = random.Random(self.seed), list[tuple[float, int, Message]](), 0, 0.0
        machine, sent = ParameterReading.start(names).begin(now_s)
        while True:
            for question in sent:
                assert isinstance(question, SendParamRequest)
                self.asked.append(question.name)
                answer = self._answer(question)
                if answer is None or now_s >= self.dead_from_s or rng.random() < 1 - (1 - self.loss) ** 2:
                    continue
                count += 1
                heapq.heappush(coming, (now_s + 2 * self.delay_s, count, answer))
            self.most_open = max(self.most_open, len(machine.asked))
            if machine.outcome is not None:
                return machine, now_s
            if coming and coming[0][0] <= machine.deadline_s:
                now_s, _, message = heapq.heappop(coming)
                machine, sent = machine.on_message(message, now_s)
            else:
                now_s = machine.deadline_s
                machine, sent = machine.on_deadline(now_s)

    def _answer(self, question: Outgoing) -> Message | None:
        assert isinstance(question, SendParamRequest)
        name = question.name
        if name in self.refuses:
            return ParamRefused(name, absent=self.refuses[name])
        return ParamValue(name, float(NAMES.index(name)), 9) if name in self.has else None


def test_every_parameter_is_asked_for_once_and_few_at_a_time() -> None:
    wire = Wire()
    ended, took_s = wire.read()
    assert (ended.outcome, ended.absent, ended.unread) == (Accepted(), frozenset(), frozenset())
    assert {value.name for value in ended.values} == {*NAMES}
    assert sorted(wire.asked) == sorted(NAMES)
    assert wire.most_open <= MOST_AT_ONCE
    assert took_s < 1.5


def test_a_link_that_answers_late_is_not_asked_twice_for_long() -> None:
    """The first few are asked again, as nobody knows the link yet; of the others each is asked for once."""
    wire = Wire(delay_s=1.1)
    ended, _ = wire.read()
    assert ended.outcome == Accepted()
    assert len(wire.asked) <= len(NAMES) + 8


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("loss", [0.05, 0.2, 0.4])
def test_what_gets_lost_is_asked_for_again_until_it_is_known(loss: float, seed: int) -> None:
    ended, _ = Wire(has=NAMES[:-2], loss=loss, delay_s=0.3, seed=seed).read()
    assert not ended.absent & {*NAMES[:-2]}, "the link is no reason to say that it is not there"
    if ended.outcome == Accepted():
        assert {value.name for value in ended.values} == {*NAMES[:-2]}
        assert ended.absent == {*NAMES[-2:]}
    else:
        assert loss > 0.2, "nobody gives up for a fifth that is lost each way"


def test_what_is_never_answered_is_not_there() -> None:
    wire = Wire(has=NAMES[3:])
    ended, took_s = wire.read()
    assert (ended.outcome, ended.absent) == (Accepted(), frozenset(NAMES[:3]))
    assert took_s < 4.0
    assert all(wire.asked.count(name) >= 4 for name in NAMES[:3])


def test_one_beside_one_that_is_there_can_be_told_to_be_not_there() -> None:
    ended, _ = Wire(has=NAMES[:1]).read(NAMES[:2])
    assert (ended.outcome, ended.absent) == (Accepted(), frozenset(NAMES[1:2]))


def test_the_silence_of_a_link_says_nothing() -> None:
    ended, took_s = Wire(has=()).read(("P0", "P1"))
    assert ended.outcome == TimedOut("P0, P1: no answer")
    assert (ended.absent, ended.unread) == (frozenset[str](), frozenset({"P0", "P1"}))
    assert took_s == 20.0


def test_a_link_that_dies_leaves_the_rest_unread() -> None:
    ended, _ = Wire(dead_from_s=0.3).read()
    assert isinstance(ended.outcome, TimedOut)
    known = {value.name for value in ended.values}
    assert known
    assert (ended.absent, ended.unread) == (frozenset[str](), frozenset(NAMES) - known)


def test_a_vehicle_that_says_that_it_has_no_such_parameter_is_believed_at_once() -> None:
    wire = Wire(refuses={"P1": True, "P2": False})
    ended, took_s = wire.read()
    assert (ended.outcome, ended.absent, ended.unread) == (Accepted(), frozenset({"P1"}), frozenset({"P2"}))
    assert (wire.asked.count("P1"), took_s < 1.5) == (1, True)


def test_an_answer_without_a_request_changes_nothing() -> None:
    state, _ = ParameterReading.start(NAMES).begin(0.0)
    assert state.on_message(ParamValue("P25", 1.0, 9), 0.1) == (state, ()), "it is not asked for yet"
    assert state.on_message(ParamValue("OTHER", 1.0, 9), 0.1) == (state, ())
    ended, _ = Wire().read()
    assert ended.on_message(ParamValue("P0", 9.0, 9), 99.0) == (ended, ())
    assert ended.on_deadline(99.0) == (ended, ())


def test_a_timer_that_ends_a_hair_early_is_the_end_of_the_silence_all_the_same() -> None:
    """Else it would be asked, and asked again, in no time."""
    state, _ = ParameterReading.start(NAMES).begin(100.0)
    for _ in range(60):
        state, _ = state.on_deadline(state.deadline_s - 1e-9)
    assert isinstance(state.outcome, TimedOut)
