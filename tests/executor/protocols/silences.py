"""A dialogue without answers."""

from __future__ import annotations

import math

from executor.protocols.machine import DialogueMachine


def unanswered(machine: DialogueMachine, now_s: float = 100.0) -> tuple[list[float], DialogueMachine]:
    """Return when a dialogue speaks that nobody answers, and how it ends."""
    state, sent = machine.begin(now_s)
    spoken_s = [now_s] * len(sent)
    while state.outcome is None:
        now_s = state.deadline_s
        state, sent = state.on_deadline(now_s)
        spoken_s += [now_s] * len(sent)
    assert math.isinf(state.deadline_s)
    return spoken_s, state
