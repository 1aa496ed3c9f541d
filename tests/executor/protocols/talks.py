"""A dialogue, as what is sent when."""

from __future__ import annotations

from executor.core.interface.messages import (
    Message,
    MissionCount,
    MissionItemInt,
    Outgoing,
)
from executor.protocols.machine import DialogueMachine

LATE = None


def words(sent: Outgoing) -> object:
    """Return a message in a few words."""
    match sent:
        case MissionItemInt(item):
            return f"item {item.seq}"
        case MissionCount(count):
            return f"count {count}"
        case _:
            return sent


def talk(machine: DialogueMachine, *heard: tuple[float, Message | str | None]) -> list[object]:
    """Return what is sent, and until when an answer is waited for, after each thing heard; how it ended at last."""
    machine, sent = machine.begin(100.0)
    found: list[object] = [(*map(words, sent), machine.deadline_s)]
    for now_s, message in heard:
        if message is LATE:
            machine, sent = machine.on_deadline(now_s)
        elif isinstance(message, str):
            machine, sent = machine.cancel()
        else:
            machine, sent = machine.on_message(message, now_s)
        found.append((*map(words, sent), machine.deadline_s))
    return [*found, machine.outcome]


def late(*at_s: float) -> list[tuple[float, None]]:
    return [(one_s, LATE) for one_s in at_s]
