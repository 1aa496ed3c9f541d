"""Download of what is on board, a mission, a fence or rally points.

Here the ground station drives: it asks for one item at a time, and repeats its question, at the pace of the link, until
it is answered. What comes twice, or late, is passed over.

An error is no end: it may be the late answer to a doubled item of the upload before, or another station's transfer that
will be over soon. It is the reason if the question stays without an answer. PX4 ends a transfer with one where a
repeated question comes two items late, and without a word after 5 s: then the list is asked for anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self, TypeVar

from executor.core.interface.messages import (
    Message,
    MissionAck,
    MissionCount,
    MissionItemReceived,
    Outgoing,
    SendMissionAck,
    SendMissionRequest,
    SendMissionRequestList,
)
from executor.protocols.machine import SAME_S, Aborted, Accepted, DialogueMachine, TimedOut
from executor.protocols.round_trip import RoundTrip
from executor.protocols.upload import build_rejection
from missions.items import MissionItem, MissionKind

D = TypeVar("D", bound="DownloadDialogue")

MOST_PERIOD_S = 2.0
"""PX4 ends the transfer after 5 s without a question: two in a row may get lost."""
LEFT_S = 5.0
"""After so long without an answer PX4 has ended it."""
SILENT_S = 8.0
ANEW = 3
"""How often the list is asked for anew where the vehicle answers again and again."""
FIRST_READ_TRIP = RoundTrip(waits_s=1.0, most_s=MOST_PERIOD_S)


@dataclass(frozen=True, slots=True)
class DownloadDialogue(DialogueMachine):
    """The state of one download."""

    kind: MissionKind = MissionKind.MISSION
    """Which of the vehicle's lists: what is said of another is another dialogue's."""
    count: int | None = None
    items: tuple[MissionItem, ...] = ()
    tries: int = 0
    """How often the question that is open was asked."""
    refusal: int | None = None
    """The error that came since it was asked first."""
    round_trip: RoundTrip = FIRST_READ_TRIP
    asked_s: float = 0.0
    heard_s: float = 0.0
    """When the last answer came."""
    begun: int = 0
    """How often the list was asked for after it had been answered before."""
    broke_off_at: str = ""
    """What was asked for in vain before that."""

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask how many items there are."""
        return _request_open_items(replace(self, heard_s=now_s), now_s)

    def on_message(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the count, then the items in their order."""
        if self.outcome is not None:
            return self, ()
        match message:
            case MissionCount(count, kind) if kind is self.kind and self.count is None:
                return self._request_next(now_s, count, ())
            case MissionItemReceived(item, kind) if kind is self.kind and self._is_next(item):
                return self._request_next(now_s, self.count, (*self.items, item))
            case MissionAck(result, kind) if kind is self.kind and result != 0:
                return replace(self, refusal=result), ()
            case _:
                return self, ()

    def on_deadline(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask again, for the list where the vehicle has ended the transfer; or give up."""
        if self.outcome is not None:
            return self, ()
        if now_s >= self.heard_s + SILENT_S - SAME_S:
            if self.refusal is not None:
                return self._finish(build_rejection("download", self.refusal)), ()
            return self._finish(TimedOut(f"no answer when asked for {self._open}")), ()
        state = replace(self, round_trip=self.round_trip.record_timeout() if self.tries > 1 else self.round_trip)
        ended = self.refusal is not None or now_s - self.heard_s >= LEFT_S
        if self.count is not None and ended and self.begun < ANEW:
            state = replace(
                state, count=None, items=(), tries=0, refusal=None, begun=self.begun + 1, broke_off_at=self._open
            )
        return _request_open_items(state, now_s)

    def cancel(self) -> tuple[Self, tuple[Outgoing, ...]]:
        """Give up."""
        if self.outcome is not None:
            return self, ()
        return self._finish(Aborted()), (SendMissionAck(15, self.kind),)

    @property
    def _open(self) -> str:
        """What is asked for, in words."""
        return self.broke_off_at or (
            f"item {len(self.items)} of {self.count}" if self.count is not None else "the count"
        )

    def _is_next(self, item: MissionItem) -> bool:
        return self.count is not None and item.seq == len(self.items)

    def _request_next(
        self, now_s: float, count: int | None, items: tuple[MissionItem, ...]
    ) -> tuple[Self, tuple[Outgoing, ...]]:
        """Ask for what comes after an answer, or say that all has come."""
        trip = self.round_trip.record_round_trip(now_s - self.asked_s) if self.tries == 1 else self.round_trip
        state = replace(
            self, count=count, items=items, round_trip=trip, heard_s=now_s, tries=0, refusal=None, broke_off_at=""
        )
        if len(items) == count:
            done = replace(state, outcome=Accepted(), deadline_s=float("inf"))
            return done, (SendMissionAck(0, self.kind),)
        return _request_open_items(state, now_s)


def _request_open_items(state: D, now_s: float) -> tuple[D, tuple[Outgoing, ...]]:
    """Ask what is open."""
    deadline_s = min(now_s + state.round_trip.waits_s, state.heard_s + SILENT_S)
    state = replace(state, tries=state.tries + 1, asked_s=now_s, deadline_s=deadline_s)
    if state.count is None:
        return state, (SendMissionRequestList(state.kind),)
    return state, (SendMissionRequest(len(state.items), state.kind),)
