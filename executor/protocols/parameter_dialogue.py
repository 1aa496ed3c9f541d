"""A vehicle's parameters: many are read at the pace of the link; one is set, and confirmed by what comes back.

Neither autopilot answers a question for a parameter that it does not have (measured), or with the newer PARAM_ERROR.
On a link that loses, a silence says nothing: it counts only where a question that was asked later is answered, and only
so often in a row that the link, by what it loses of questions that are answered, cannot be the reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self, TypeVar

from executor.core.interface.codes import Ending
from executor.core.interface.messages import Message, Outgoing, ParamRefused, ParamValue, SendParamRequest, SendParamSet
from executor.protocols.machine import SAME_S, Accepted, DialogueMachine, Rejected, RoundTrip, TimedOut

R = TypeVar("R", bound="ParameterReading")

AT_ONCE, MOST_AT_ONCE = 4, 16
"""Questions under way in the beginning, and where nothing gets lost: ArduPilot drops what is beyond 20
(GCS_Param.cpp), and the queue of a radio holds some 50 answers for everybody behind it."""
SILENT_S = 20.0
"""After so long without any answer the rest is not read: four times what a radio's full queue holds a frame back."""
LONGEST_S = 180.0
BY_CHANCE = 1e-6
"""How likely at most the link alone may have swallowed all questions for a parameter that is said not to be there."""
PERIOD_S, LONGEST_PERIOD_S = 1.0, 4.0
TRIES, TRIES_ANSWERED = 6, 4
"""Of setting a parameter; fewer where it is answered, and another value stays."""


@dataclass(frozen=True, slots=True)
class _Question:
    """One parameter that is asked for."""

    name: str
    asked_s: float = 0.0
    number: int = 0
    """Of its latest question, in the order in which they are sent."""
    first: int = 0
    """Of its first."""
    tries: int = 0
    outlived: bool = False
    """Whether a question that was asked after its latest is answered."""
    in_vain: int = 0
    """How many of its questions were outlived and not answered."""


@dataclass(frozen=True, slots=True)
class ParameterReading(DialogueMachine):
    """The state of reading parameters: of each there is a value in the end, or it is not there, or it was not read."""

    is_transfer = True
    waiting: tuple[_Question, ...]
    """Those to be asked next, in turn."""
    asked: tuple[_Question, ...] = ()
    """Those under way."""
    control: _Question | None = None
    """A parameter that is there and is asked for again, behind those that do not answer."""
    values: tuple[ParamValue, ...] = ()
    absent: frozenset[str] = frozenset()
    """What the vehicle does not have."""
    refused: frozenset[str] = frozenset()
    """What it answers without a value."""
    round_trip: RoundTrip = field(default=RoundTrip(waits_s=1.5, most_s=4.0), kw_only=True)
    room: int = AT_ONCE
    """How many may be under way."""
    sent: int = 0
    lost: int = 0
    """Of the questions for parameters that are there."""
    answered: int = 0
    began_s: float = 0.0
    heard_s: float = 0.0

    @classmethod
    def start(cls, names: tuple[str, ...]) -> Self:
        """Return the reading of some parameters before it begins."""
        return cls(tuple(_Question(name) for name in dict.fromkeys(names)))

    @property
    def unread(self) -> frozenset[str]:
        """What is not known, as nothing usable was answered and the link may be the reason."""
        return self.refused | {question.name for question in (*self.waiting, *self.asked)}

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask for the first few."""
        return _fill_pipeline(replace(self, began_s=now_s, heard_s=now_s), now_s)

    def _take(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        if not isinstance(message, ParamValue | ParamRefused):
            return self, ()
        control, name = self.control, message.name
        question = next((one for one in (*self.asked, *self.waiting) if one.name == name and one.tries), None)
        if question is None and control is not None and control.name == name:
            return _fill_pipeline(_record_answer(replace(self, control=None), control, now_s), now_s)
        if question is None:
            return self, ()
        state = _drop_question(self, question)
        match message:
            case ParamValue(value=value) if math.isfinite(value):
                state = replace(state, values=(*state.values, message))
            case ParamRefused(absent=True):
                state = replace(state, absent=state.absent | {name})
            case _:
                state = replace(state, refused=state.refused | {name})
        return _fill_pipeline(_record_answer(state, question, now_s), now_s)

    def _expire(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask again what was not answered in time; or give up."""
        if now_s >= min(self.heard_s + SILENT_S, self.began_s + LONGEST_S) - SAME_S:
            return self._finish(TimedOut(f"{', '.join(sorted(self.unread))}: no answer")), ()
        latest_s = now_s - self.round_trip.waits_s + SAME_S
        late = [one for one in self.asked if one.asked_s <= latest_s]
        state = self
        for question in late:
            state = _postpone_question(state, question)
        if self.control is not None and self.control.asked_s <= latest_s:
            state = replace(state, control=None, lost=state.lost + 1)
        if any(not one.outlived for one in late):  # a jam is not to be fed: fewer at a time, and then more seldom
            trip = self.round_trip.record_timeout() if self.room == 1 else self.round_trip
            state = replace(state, round_trip=trip, room=max(1, self.room // 2))
        return _fill_pipeline(state, now_s)


def _drop_question(state: R, question: _Question) -> R:
    asked = tuple(one for one in state.asked if one is not question)
    return replace(state, asked=asked, waiting=tuple(one for one in state.waiting if one is not question))


def _record_answer(state: R, question: _Question, now_s: float) -> R:
    """Note what an answer says of the link, and of what was asked before."""
    asked = tuple(one if one.number > question.first else replace(one, outlived=True) for one in state.asked)
    trip = state.round_trip.record_round_trip(now_s - question.asked_s) if question.tries == 1 else state.round_trip
    return replace(
        state, asked=asked, round_trip=trip, heard_s=now_s, room=min(state.room + 1, MOST_AT_ONCE),
        lost=state.lost + question.tries - 1, answered=state.answered + 1,
    )  # fmt: skip


def _postpone_question(state: R, question: _Question) -> R:
    """Put a question that was not answered in time behind the others; or believe that nobody ever will."""
    in_vain = question.in_vain + question.outlived
    state = _drop_question(state, question)
    share = (state.lost + 1.0) / (state.lost + state.answered + 2.0)
    if share**in_vain <= BY_CHANCE:
        return replace(state, absent=state.absent | {question.name})
    return replace(state, waiting=(*state.waiting, replace(question, in_vain=in_vain)))


def _fill_pipeline(state: R, now_s: float) -> tuple[R, tuple[Outgoing, ...]]:
    """Ask as many as may be under way, and one that is there behind them where none of them may be."""
    said: list[str] = []
    while state.waiting and len(state.asked) < state.room:
        question = _mark_sent(state, state.waiting[0], now_s)
        said.append(question.name)
        state = replace(state, waiting=state.waiting[1:], asked=(*state.asked, question), sent=question.number)
    silent = all(one.tries > 1 for one in state.asked) or now_s >= state.heard_s + state.round_trip.waits_s
    if said and silent and state.values and state.control is None:
        control = _mark_sent(state, _Question(state.values[state.sent % len(state.values)].name), now_s)
        said.append(control.name)
        state = replace(state, control=control, sent=control.number)
    if not state.asked and not state.waiting:
        return replace(state, outcome=Accepted(), deadline_s=math.inf), ()
    under_way = state.asked if state.control is None else (*state.asked, state.control)
    deadline_s = min(one.asked_s for one in under_way) + state.round_trip.waits_s
    patience_s = min(state.heard_s + SILENT_S, state.began_s + LONGEST_S)
    return replace(state, deadline_s=min(deadline_s, patience_s)), tuple(SendParamRequest(name) for name in said)


def _mark_sent(state: ParameterReading, question: _Question, now_s: float) -> _Question:
    number = state.sent + 1
    first = question.first or number
    return replace(question, asked_s=now_s, number=number, first=first, tries=question.tries + 1, outlived=False)


@dataclass(frozen=True, slots=True)
class ParameterDialogue(DialogueMachine):
    """The state of one question, or of one change if `wanted` is given."""

    name: str
    wanted: SendParamSet | None = None
    tries: int = 0
    value: ParamValue | None = None

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask, or set."""
        return replace(self, tries=1, deadline_s=now_s + self.period_s), (self._build_request(),)

    @property
    def period_s(self) -> float:
        """How long an answer is waited for at first."""
        return max(PERIOD_S, self.round_trip.waits_s)

    def _take(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the value if it is the one asked for, and the one wanted."""
        match message:
            case ParamValue(name, value) if name == self.name:
                if self.wanted is None or math.isclose(value, self.wanted.value, rel_tol=1e-5, abs_tol=1e-6):
                    return replace(self._finish(Accepted()), value=message), ()
                return replace(self, value=message, deadline_s=min(self.deadline_s, now_s + self.period_s)), ()
            case ParamRefused(name, absent) if name == self.name:
                why = "is not there" if absent else "is refused"
                return self._finish(Rejected(f"{self.name} {why}", Ending.VALUE_STAYS)), ()
            case _:
                return self, ()

    def _expire(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask again, more and more seldom while nobody answers; or give up."""
        if self.wanted is not None and self.value is not None and self.tries >= TRIES_ANSWERED:
            return self._finish(Rejected(f"{self.name} stays {self.value.value:g}", Ending.VALUE_STAYS)), ()
        if self.tries >= TRIES:
            return self._finish(TimedOut(f"{self.name}: no answer")), ()
        period_s = self.period_s
        if self.value is None:
            period_s = max(period_s, min(PERIOD_S * 2.0**self.tries, LONGEST_PERIOD_S))
        return replace(self, tries=self.tries + 1, deadline_s=now_s + period_s), (self._build_request(),)

    def _build_request(self) -> Outgoing:
        return self.wanted if self.wanted is not None else SendParamRequest(self.name)
