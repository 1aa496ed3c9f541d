"""Download of what is on board, a mission, a fence or rally points.

Here the ground station drives, and repeats its question until it is answered.

An error is no end: it may be the late answer to a doubled item of the upload before, or another station's transfer that
will be over soon. It is the reason if the question stays without an answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from executor.core.messages import (
    Message,
    MissionAck,
    MissionCount,
    MissionItemReceived,
    Outgoing,
    SendMissionAck,
    SendMissionRequest,
    SendMissionRequestList,
)
from executor.protocols.machine import Accepted, BrokenOff, Machine, TimedOut
from executor.protocols.upload import rejected
from missions.items import MissionItem, MissionKind

PERIOD_S = 1.0
TRIES = 8


@dataclass(frozen=True, slots=True)
class DownloadDialogue(Machine):
    """The state of one download."""

    kind: MissionKind = MissionKind.MISSION
    """Which of the vehicle's lists: what is said of another is another dialogue's."""
    count: int | None = None
    items: tuple[MissionItem, ...] = ()
    tries: int = 0
    """How often the question that is open was asked."""
    refusal: int | None = None
    """The error that came since it was asked first."""

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask how many items there are."""
        return replace(self, tries=1, deadline_s=now_s + PERIOD_S), (SendMissionRequestList(self.kind),)

    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the count, then the items in their order."""
        if self.outcome is not None:
            return self, ()
        match message:
            case MissionCount(count, kind) if kind is self.kind and self.count is None:
                return self._ask(count, self.items, now_s)
            case MissionItemReceived(item, kind) if kind is self.kind and self._is_next(item):
                return self._ask(self.count, (*self.items, item), now_s)
            case MissionAck(result, kind) if kind is self.kind and result != 0:
                return replace(self, refusal=result), ()
            case _:
                return self, ()

    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask again, or give up."""
        if self.outcome is not None:
            return self, ()
        if self.tries >= TRIES:
            if self.refusal is not None:
                return self._ended(rejected("download", self.refusal)), ()
            what = "the count" if self.count is None else f"item {len(self.items)} of {self.count}"
            return self._ended(TimedOut(f"no answer when asked for {what}")), ()
        state = replace(self, tries=self.tries + 1, deadline_s=now_s + PERIOD_S)
        if self.count is None:
            return state, (SendMissionRequestList(self.kind),)
        return state, (SendMissionRequest(len(self.items), self.kind),)

    def cancel(self) -> tuple[Self, tuple[Outgoing, ...]]:
        """Give up."""
        if self.outcome is not None:
            return self, ()
        return self._ended(BrokenOff()), (SendMissionAck(15, self.kind),)

    def _is_next(self, item: MissionItem) -> bool:
        return self.count is not None and item.seq == len(self.items)

    def _ask(
        self, count: int | None, items: tuple[MissionItem, ...], now_s: float
    ) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask for the next item, or say that all have come."""
        if len(items) == count:
            return replace(self._ended(Accepted()), count=count, items=items), (SendMissionAck(0, self.kind),)
        asked = replace(self, count=count, items=items, tries=1, refusal=None, deadline_s=now_s + PERIOD_S)
        return asked, (SendMissionRequest(len(items), self.kind),)
