"""What holds for every dialogue machine, under any order of messages, deadlines and a cancellation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from hypothesis import strategies as st

from executor.core.interface.messages import Message, Outgoing
from executor.protocols.machine import DialogueMachine

M = TypeVar("M", bound=DialogueMachine)

ENDLESS = 1000
"""More deadlines in a row than any dialogue may need."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """The machine's own deadline passes."""


@dataclass(frozen=True, slots=True)
class Cancel:
    """Somebody gives the dialogue up."""


Step = Message | Deadline | Cancel


@dataclass(frozen=True, slots=True)
class Told:
    """What happened, and how long after the step before; for a deadline, after the deadline."""

    step: Step
    after_s: float


def stories(messages: st.SearchStrategy[Message], *, cancels: bool = True) -> st.SearchStrategy[list[Told]]:
    """Return any sequence of messages, deadlines and cancellations."""
    kinds: list[st.SearchStrategy[Step]] = [messages, messages, messages, st.just(Deadline())]
    if cancels:
        kinds.append(st.just(Cancel()))
    times = st.sampled_from([0.0, 0.01, 0.05, 0.1, 0.3, 1.0, 3.0])
    return st.lists(st.builds(Told, st.one_of(kinds), times), max_size=60)


def play(machine: M, story: Sequence[Told]) -> tuple[M, list[Outgoing]]:
    """Tell a machine its story, then let deadlines pass until it ends; it keeps what every machine promises.

    It has no outcome before it begins; it ends for certain; a state with an outcome never changes and sends nothing.
    """
    assert machine.outcome is None
    now_s = 100.0
    machine, opening = machine.begin(now_s)
    assert opening, "a dialogue opens with a question"
    sent = list(opening)
    for told in story:
        if isinstance(told.step, Deadline) and machine.outcome is None:
            now_s = max(now_s, machine.deadline_s)
        now_s += told.after_s
        after, said = _told(machine, told.step, now_s)
        if machine.outcome is not None:
            assert after == machine, "an outcome is for good"
            assert said == (), "nothing is sent after the outcome"
        machine = after
        sent.extend(said)
    for _ in range(ENDLESS):
        if machine.outcome is not None:
            break
        assert machine.deadline_s < float("inf"), "whoever waits has a deadline"
        now_s = max(now_s, machine.deadline_s)
        machine, said = machine.on_deadline(now_s)
        sent.extend(said)
    assert machine.outcome is not None, "it never ended"
    return machine, sent


def _told(machine: M, step: Step, now_s: float) -> tuple[M, tuple[Outgoing, ...]]:
    match step:
        case Deadline():
            return machine.on_deadline(now_s)
        case Cancel():
            return machine.cancel()
        case _:
            return machine.on_message(step, now_s)
