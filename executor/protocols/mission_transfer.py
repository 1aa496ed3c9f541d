"""Upload and download of a mission, a fence or rally points.

In an upload the vehicle drives: it asks for each item, and asks again for what got lost. We repeat only MISSION_COUNT,
and only until the first request, because PX4 answers a later one with ERROR "Busy" (mavlink_mission.cpp). The last item
is repeated when the final acknowledgement stays away: PX4 acknowledges it again, and ArduPilot ignores it.

PX4 asks again every 0.25 s, whatever the link. What it asked before our answer can have reached it is not answered
twice: over a radio that is slower than that, every item would go out many times over, and feed the jam that it is in.

In a download the ground station drives: it asks for one item at a time, and repeats its question, at the pace of the
link, until it is answered. What comes twice, or late, is passed over.

An error is no end of a download: it may be the late answer to a doubled item of the upload before, or another station's
transfer that will be over soon. It is the reason if the question stays without an answer. PX4 ends a transfer with one
where a repeated question comes two items late, and without a word after 5 s: then the list is asked for anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self, TypeVar

from executor.core.interface import messages
from executor.core.interface.codes import Ending
from executor.protocols.machine import SAME_S, Accepted, DialogueMachine, Rejected, RoundTrip, TimedOut
from missions.items import MissionItem, MissionKind

COUNT_PERIOD_S = 1.5
COUNT_TRIES = 5
"""QGroundControl's figures (PlanManager.h), recommended by the mission protocol page of mavlink.io."""
REPEAT_S = 0.1
"""A request repeated sooner than this, or than a round trip, crossed our answer on the way and is not answered twice
(PX4 issue 11078)."""
FIRST_TRIP = RoundTrip(least_s=REPEAT_S, most_s=1.25)
"""PX4 gives up after 5 s without an item: it gets four copies in that time, however slow the link is."""
LAST_ITEM_PERIOD_S = 1.0

RESULT_ACCEPTED = 0
RESULT_ERROR = 1
RESULT_CANCELLED = 15
RESULT_NAMES = {
    1: "error, or busy with another transfer", 2: "unsupported frame", 3: "unsupported command", 4: "no space",
    5: "invalid item", 6: "invalid param1", 7: "invalid param2", 8: "invalid param3", 9: "invalid param4",
    10: "invalid latitude", 11: "invalid longitude", 12: "invalid height", 13: "invalid sequence",
    14: "denied: another ground station is uploading", 15: "cancelled by the vehicle",
}  # fmt: skip
"""MAV_MISSION_RESULT in words."""
_CODES = {
    1: Ending.ERROR, 2: Ending.UNSUPPORTED, 3: Ending.UNSUPPORTED, 4: Ending.NO_SPACE,
    **dict.fromkeys(range(5, 13), Ending.INVALID_ITEM), 13: Ending.INVALID_SEQUENCE, 14: Ending.OTHER_STATION,
    15: Ending.CANCELLED,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class UploadDialogue(DialogueMachine):
    """The state of one upload."""

    items: tuple[MissionItem, ...]
    silence_s: float
    """How long the vehicle may stay silent after its first request: longer than its own time-out."""
    warnings: frozenset[int]
    """MAV_MISSION_RESULTs that this autopilot sends while it goes on (ArduPilot: 13)."""
    kind: MissionKind = MissionKind.MISSION
    """Which of the vehicle's lists: what is said of another is another dialogue's."""
    counts_sent: int = 0
    furthest: int = -1
    """The highest item asked for so far."""
    answered: int = -1
    """The item answered last, at `answered_s`."""
    answered_s: float = float("-inf")
    first_s: float = float("-inf")
    """When that item was sent first."""
    round_trip: RoundTrip = FIRST_TRIP
    heard_s: float = 0.0
    """When the vehicle last asked for an item."""
    refusal: int | None = None
    """The error that it sent since its last request."""

    @property
    def is_begun(self) -> bool:
        """Whether the vehicle has asked for an item: from then on ArduPilot's old mission is no longer whole."""
        return self.furthest >= 0

    def begin(self, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Announce the number of items."""
        state = replace(self, counts_sent=1, answered_s=now_s, first_s=now_s, deadline_s=now_s + COUNT_PERIOD_S)
        return state, (messages.MissionCount(len(self.items), self.kind),)

    def _take(self, message: messages.Message, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Answer requests; end on an acknowledgement that is final."""
        match message:
            case messages.MissionRequest(seq, kind) if kind is self.kind and 0 <= seq < len(self.items):
                return self._answer(seq, now_s)
            case messages.MissionAck(result, kind) if kind is self.kind:
                return self._handle_acknowledgement(result), ()
            case _:
                return self, ()

    def _expire(self, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Repeat what may be repeated, or give up."""
        if not self.is_begun:
            if self.counts_sent >= COUNT_TRIES:
                return self._finish(TimedOut("the vehicle did not ask for the first item")), ()
            state = replace(self, counts_sent=self.counts_sent + 1, deadline_s=now_s + COUNT_PERIOD_S)
            return state, (messages.MissionCount(len(self.items), self.kind),)
        if now_s - self.heard_s >= self.silence_s:
            if self.refusal is not None:
                return self._finish(build_rejection(list_name_of(self.kind), self.refusal)), ()
            return self._finish(TimedOut(f"no answer after item {self.furthest} of {len(self.items)}")), ()
        state = replace(self, deadline_s=now_s + max(LAST_ITEM_PERIOD_S, self.round_trip.waits_s))
        if self.furthest == len(self.items) - 1:
            return state, (messages.MissionItemInt(self.items[-1], self.kind),)
        return state, ()

    def _build_farewell(self) -> tuple[messages.Outgoing, ...]:
        """PX4 takes the cancellation, ArduPilot notices the silence."""
        return (messages.MissionAck(RESULT_CANCELLED, self.kind),)

    def _answer(self, seq: int, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        trip = self._update_round_trip(now_s) if seq == self.answered + 1 else self.round_trip
        deadline_s = now_s + min(max(LAST_ITEM_PERIOD_S, trip.waits_s), self.silence_s)
        state = replace(
            self, furthest=max(self.furthest, seq), heard_s=now_s, refusal=None, round_trip=trip, deadline_s=deadline_s
        )
        again = seq <= self.answered  # one before the last is a late double, or a vehicle that has begun anew
        if again and now_s - self.answered_s < min(trip.usual_s, trip.most_s):
            return state, ()
        first_s = self.first_s if seq == self.answered else now_s
        state = replace(state, answered=seq, answered_s=now_s, first_s=first_s)
        return state, (messages.MissionItemInt(self.items[seq], self.kind),)

    def _update_round_trip(self, now_s: float) -> RoundTrip:
        """Return what is known of the link once the next item is asked for.

        Which of two copies arrived tells the time since the last: one that cannot have come and gone since was in vain.
        """
        since_s = now_s - self.answered_s
        vain = self.round_trip.mean_s is not None and since_s < self.round_trip.mean_s / 2
        return self.round_trip.record_round_trip(now_s - self.first_s if vain else since_s)

    def _handle_acknowledgement(self, result: int) -> Self:
        all_asked = self.furthest == len(self.items) - 1
        if result == RESULT_ACCEPTED:
            # Before the last item was asked for it can only be a late duplicate of an earlier transfer's.
            return self._finish(Accepted()) if all_asked else self
        if result in self.warnings or (result == RESULT_CANCELLED and not self.is_begun):
            return self  # what has not begun cannot be given up: that was an earlier transfer
        if result == RESULT_ERROR and self.is_begun and not all_asked:
            # PX4 says so of a doubled COUNT and goes on. Whether it does, its next request shows.
            return replace(self, refusal=result)
        return self._finish(build_rejection(list_name_of(self.kind), result))


def list_name_of(kind: MissionKind) -> str:
    """Return one of a vehicle's lists in words."""
    return {MissionKind.MISSION: "mission", MissionKind.FENCE: "fence", MissionKind.RALLY: "rally points"}[kind]


def build_rejection(what: str, result: int) -> Rejected:
    """Return the outcome that a MAV_MISSION_RESULT means."""
    words = RESULT_NAMES.get(result, f"result {result}")
    return Rejected(f"{what} refused: {words}", _CODES.get(result, Ending.UNKNOWN_RESULT))


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

    def begin(self, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Ask how many items there are."""
        return _request_open_items(replace(self, heard_s=now_s), now_s)

    def _take(self, message: messages.Message, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Take the count, then the items in their order."""
        match message:
            case messages.MissionCount(count, kind) if kind is self.kind and self.count is None:
                return self._request_next(now_s, count, ())
            case messages.MissionItemInt(item, kind) if kind is self.kind and self._is_next(item):
                return self._request_next(now_s, self.count, (*self.items, item))
            case messages.MissionAck(result, kind) if kind is self.kind and result != 0:
                return replace(self, refusal=result), ()
            case _:
                return self, ()

    def _expire(self, now_s: float) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Ask again, for the list where the vehicle has ended the transfer; or give up."""
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

    def _build_farewell(self) -> tuple[messages.Outgoing, ...]:
        return (messages.MissionAck(RESULT_CANCELLED, self.kind),)

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
    ) -> tuple[Self, tuple[messages.Outgoing, ...]]:
        """Ask for what comes after an answer, or say that all has come."""
        trip = self.round_trip.record_round_trip(now_s - self.asked_s) if self.tries == 1 else self.round_trip
        state = replace(
            self, count=count, items=items, round_trip=trip, heard_s=now_s, tries=0, refusal=None, broke_off_at=""
        )
        if len(items) == count:
            done = replace(state, outcome=Accepted(), deadline_s=float("inf"))
            return done, (messages.MissionAck(0, self.kind),)
        return _request_open_items(state, now_s)


def _request_open_items(state: D, now_s: float) -> tuple[D, tuple[messages.Outgoing, ...]]:
    """Ask what is open."""
    deadline_s = min(now_s + state.round_trip.waits_s, state.heard_s + SILENT_S)
    state = replace(state, tries=state.tries + 1, asked_s=now_s, deadline_s=deadline_s)
    if state.count is None:
        return state, (messages.MissionRequestList(state.kind),)
    return state, (messages.MissionRequest(len(state.items), state.kind),)
