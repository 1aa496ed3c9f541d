"""Read a vehicle's parameters at the pace of the link; set one, and confirm it by the value that comes back.

Neither autopilot answers a request for an absent parameter (measured), except by the newer PARAM_ERROR. On a lossy link
a silence proves nothing: it counts only where a later request is answered, and the parameter is absent only after so
many such silences in a row that packet loss, as measured on answered requests, cannot be the reason.
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
"""Requests in flight at first, and at most on a link without loss: ArduPilot drops what is beyond 20 (GCS_Param.cpp),
and a radio queue holds some 50 answers for all vehicles behind it."""
SILENT_S = 20.0
"""Seconds without any answer after which reading stops: four times the delay of a radio's full queue."""
LONGEST_S = 180.0
BY_CHANCE = 1e-6
"""Greatest probability that packet loss alone explains the silence of a parameter reported as absent."""
PERIOD_S, LONGEST_PERIOD_S = 1.0, 4.0
TRIES, TRIES_ANSWERED = 6, 4
"""Attempts to set a parameter; fewer where it is answered with another value."""


@dataclass(frozen=True, slots=True)
class _Question:
    """One requested parameter."""

    name: str
    asked_s: float = 0.0
    number: int = 0
    """Sequence number of its latest request."""
    first: int = 0
    """Sequence number of its first request."""
    tries: int = 0
    outlived: bool = False
    """Whether a request sent after its latest one was answered."""
    in_vain: int = 0
    """Number of its requests that were outlived and not answered."""


@dataclass(frozen=True, slots=True)
class ParameterReading(DialogueMachine):
    """State of reading parameters: each ends with a value, as absent, or as unread."""

    is_transfer = True
    waiting: tuple[_Question, ...]
    """Parameters to request next, in order."""
    asked: tuple[_Question, ...] = ()
    """Requests in flight."""
    control: _Question | None = None
    """A present parameter, requested again behind silent ones."""
    values: tuple[ParamValue, ...] = ()
    absent: frozenset[str] = frozenset()
    """Parameters that the vehicle does not have."""
    refused: frozenset[str] = frozenset()
    """Parameters that it answers without a value."""
    round_trip: RoundTrip = field(default=RoundTrip(waits_s=1.5, most_s=4.0), kw_only=True)
    room: int = AT_ONCE
    """Most requests in flight."""
    sent: int = 0
    lost: int = 0
    """Lost requests for present parameters."""
    answered: int = 0
    began_s: float = 0.0
    heard_s: float = 0.0

    @classmethod
    def start(cls, names: tuple[str, ...]) -> Self:
        """Return the reading of some parameters before its start."""
        return cls(tuple(_Question(name) for name in dict.fromkeys(names)))

    @property
    def unread(self) -> frozenset[str]:
        """Parameters without a usable answer, where the link may be the reason."""
        return self.refused | {question.name for question in (*self.waiting, *self.asked)}

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send the first requests."""
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
        """Repeat requests that timed out; or give up."""
        if now_s >= min(self.heard_s + SILENT_S, self.began_s + LONGEST_S) - SAME_S:
            return self._finish(TimedOut(f"{', '.join(sorted(self.unread))}: no answer")), ()
        latest_s = now_s - self.round_trip.waits_s + SAME_S
        late = [one for one in self.asked if one.asked_s <= latest_s]
        state = self
        for question in late:
            state = _postpone_question(state, question)
        if self.control is not None and self.control.asked_s <= latest_s:
            state = replace(state, control=None, lost=state.lost + 1)
        if any(not one.outlived for one in late):  # do not feed a jam: fewer at a time, then less often
            trip = self.round_trip.record_timeout() if self.room == 1 else self.round_trip
            state = replace(state, round_trip=trip, room=max(1, self.room // 2))
        return _fill_pipeline(state, now_s)


def _drop_question(state: R, question: _Question) -> R:
    asked = tuple(one for one in state.asked if one is not question)
    return replace(state, asked=asked, waiting=tuple(one for one in state.waiting if one is not question))


def _record_answer(state: R, question: _Question, now_s: float) -> R:
    """Note what an answer shows about the link and about earlier requests."""
    asked = tuple(one if one.number > question.first else replace(one, outlived=True) for one in state.asked)
    trip = state.round_trip.record_round_trip(now_s - question.asked_s) if question.tries == 1 else state.round_trip
    return replace(
        state, asked=asked, round_trip=trip, heard_s=now_s, room=min(state.room + 1, MOST_AT_ONCE),
        lost=state.lost + question.tries - 1, answered=state.answered + 1,
    )  # fmt: skip


def _postpone_question(state: R, question: _Question) -> R:
    """Put a timed-out request behind the others; or declare the parameter absent."""
    in_vain = question.in_vain + question.outlived
    state = _drop_question(state, question)
    share = (state.lost + 1.0) / (state.lost + state.answered + 2.0)
    if share**in_vain <= BY_CHANCE:
        return replace(state, absent=state.absent | {question.name})
    return replace(state, waiting=(*state.waiting, replace(question, in_vain=in_vain)))


def _fill_pipeline(state: R, now_s: float) -> tuple[R, tuple[Outgoing, ...]]:
    """Send as many requests as may be in flight, plus one for a present parameter where none of them is present."""
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
    """State of one read, or of one change if `wanted` is given."""

    name: str
    wanted: SendParamSet | None = None
    tries: int = 0
    value: ParamValue | None = None

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send the read or the change."""
        return replace(self, tries=1, deadline_s=now_s + self.period_s), (self._build_request(),)

    @property
    def period_s(self) -> float:
        """First time-out for an answer."""
        return max(PERIOD_S, self.round_trip.waits_s)

    def _take(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the value if it is the requested parameter and the wanted value."""
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
        """Repeat at growing intervals without an answer; or give up."""
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
