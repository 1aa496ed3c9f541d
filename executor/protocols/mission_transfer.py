"""Upload and download of a mission, a fence or rally points.

In an upload the vehicle drives: it asks for each item, and asks again for what got lost. Before its first request we
repeat only MISSION_COUNT, and never after it, because PX4 answers a later one with ERROR "Busy" (mavlink_mission.cpp).
From then on items go out ahead of the requests, as many as the link takes: both autopilots take an item that comes in
its turn, asked for or not (MissionItemProtocol.cpp, mavlink_mission.cpp), so that a mission costs a few round trips and
not one for each item. What comes out of turn ArduPilot answers with a warning, and PX4 passes over. The last item is
repeated when the final acknowledgement stays away: PX4 acknowledges it again, and ArduPilot calls it an error.

PX4 asks again every 0.25 s, whatever the link. What it asked before our answer can have reached it is not answered
twice: over a radio that is slower than that, every item would go out many times over, and feed the jam that it is in.

In a download the ground station drives: it asks for items, and repeats each question, at the pace of the link, until it
is answered. What comes twice, or late, is passed over. ArduPilot answers questions in any order, so that several are
under way; PX4 ends a transfer with an error where a question comes out of turn.

An error is no end of a download: it may be the late answer to a doubled item of the upload before, or another station's
transfer that will be over soon. It is the reason if the question stays without an answer. PX4 ends a transfer with one
where a repeated question comes two items late, and without a word after 5 s: then the list is asked for anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import islice
from math import inf, isinf
from typing import Self, TypeVar

from executor.core.interface import messages
from executor.core.interface.codes import Ending
from executor.protocols.machine import (
    MOST_AHEAD,
    SAME_S,
    Accepted,
    DialogueMachine,
    Rejected,
    RoundTrip,
    TimedOut,
)
from executor.protocols.turns import FAR_S
from missions import compute_list_checksum
from missions.items import MissionItem, MissionKind

COUNT_PERIOD_S = 1.5
COUNT_TRIES = 5
"""QGroundControl's figures (PlanManager.h), recommended by the mission protocol page of mavlink.io."""
MOVED_PERIOD_S = 0.5
REPEAT_S = 0.1
"""A request repeated sooner than this, or than a round trip, crossed our answer and is not answered twice (PX4 issue
11078)."""
FIRST_TRIP = RoundTrip(least_s=REPEAT_S, most_s=2.4)
"""Initial round trip. PX4 gives up after 5 s without an item, so it gets two copies within that time on any link."""
U = TypeVar("U", bound="UploadDialogue")
D = TypeVar("D", bound="DownloadDialogue")
Sent = tuple[messages.Outgoing, ...]

LEAST_PERIOD_S = 0.25
"""Least interval of unrequested repeats of an item; the vehicle or this computer may be busy."""
LAST_ITEM_PERIOD_S = 1.0
GRACE_S = 0.2
"""Longest wait for what may have come in one packet with a repeated request."""
ASKS_EVERY_S = 0.25
"""No autopilot repeats a request sooner; PX4 does after MAVLINK_MISSION_RETRY_TIMEOUT_DEFAULT."""
COPIES_LEFT = 2
"""Copies of an item for which the time is left until the vehicle gives up, whatever the link."""
FIRST_AHEAD = 8
AGAIN_AHEAD = 4
"""Items to resend from a lost one on; if one is lost, others may be, and all behind them must be resent."""
AHEAD_TRIP_S = 0.03
"""Round trip below which items need not be sent ahead."""

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
class _UnderWay:
    """An item that was sent, or asked for, and not answered yet."""

    seq: int
    at_s: float
    first_s: float | None = None
    """Time it was first sent, if it was repeated, as the answer may be to either. Minus infinity if forgotten."""


@dataclass(frozen=True, slots=True)
class UploadDialogue(DialogueMachine):
    """The state of one upload."""

    is_transfer = True
    items: tuple[MissionItem, ...]
    silence_s: float
    """Longest silence of the vehicle after its first request; longer than its own time-out."""
    warnings: frozenset[int]
    """MAV_MISSION_RESULTs with which this autopilot continues (ArduPilot: 13)."""
    kind: MissionKind = MissionKind.MISSION
    """Kind of list; messages about another kind belong to another dialogue."""
    counts_sent: int = 0
    counted_s: float = 0.0
    """Time of the first announcement."""
    furthest: int = -1
    """Highest item requested so far."""
    under_way: tuple[_UnderWay, ...] = ()
    """Items in flight, in order."""
    room: int = FIRST_AHEAD
    """Items that may be in flight now."""
    highest: int = -1
    """Highest item sent so far."""
    repeats: int = 0
    """Number of repeats since the vehicle's last request."""
    round_trip: RoundTrip = field(default=FIRST_TRIP, kw_only=True)
    heard_s: float = 0.0
    """Time of the vehicle's last request."""
    asked_s: float = 0.0
    """Time of its first request for the item that it waits for."""
    asks: int = 0
    """Times that it repeated that request."""
    doubts: bool = False
    """Whether that item seems to be lost, and goes out again at the deadline."""
    refusal: int | None = None
    """Error received since its last request."""
    early: bool = False
    """Whether it has accepted the list since then without requesting all of it."""
    checksum: int | None = None
    """Checksum that the vehicle reports on acceptance; None if it reports none."""

    moved: bool = False
    """Whether it was announced over another link before."""
    is_touched: bool = False
    """Whether the vehicle had requested an item there."""

    @property
    def is_begun(self) -> bool:
        """Whether the vehicle has asked for an item: from then on ArduPilot's old mission is no longer whole."""
        return self._is_asked or self.is_touched

    @property
    def _is_asked(self) -> bool:
        return self.furthest >= 0

    @property
    def is_all_sent(self) -> bool:
        """Whether every item was sent: perhaps the acknowledgement alone got lost."""
        return self._is_asked and self.highest == len(self.items) - 1

    def move(self, now_s: float) -> tuple[Self, Sent]:
        """Announce the list anew over another link.

        ArduPilot takes items from any link and asks for them where they were announced, so there it goes on at once.
        PX4 lets nobody begin elsewhere until it has given up the transfer over the link that was left.
        """
        fresh = replace(
            self, moved=True, is_touched=self.is_begun, counts_sent=0, counted_s=now_s, heard_s=now_s, furthest=-1,
            under_way=(), room=self.most_ahead, highest=-1, repeats=0, refusal=None, early=False, doubts=False,
        )  # fmt: skip
        return _announce_items(fresh, now_s)

    def begin(self, now_s: float) -> tuple[Self, Sent]:
        """Announce the number of items."""
        return _announce_items(replace(self, counted_s=now_s, heard_s=now_s), now_s)

    def _take(self, message: messages.Message, now_s: float) -> tuple[Self, Sent]:
        match message:
            case messages.MissionRequest(seq, kind) if kind is self.kind and 0 <= seq < len(self.items):
                return self._answer(seq, now_s)
            case messages.MissionAck(result, kind) if kind is self.kind and result in self.warnings and self._is_asked:
                # Once for each item: the warning may be about a copy of one that it has, and would bring the next.
                again = bool(self.under_way) and self.under_way[0].first_s is not None
                return (self, ()) if again else _repeat_if_lost(self, now_s)
            case messages.MissionAck(result, kind, checksum) if kind is self.kind:
                return self._handle_acknowledgement(result, checksum), ()
            case _:
                return self, ()

    def _expire(self, now_s: float) -> tuple[Self, Sent]:
        if not self._is_asked:
            left = self.moved and now_s - self.heard_s < self.silence_s - SAME_S
            if self.counts_sent >= COUNT_TRIES and not left:
                return self._finish(TimedOut("the vehicle did not ask for the first item")), ()
            return _announce_items(self, now_s)
        if self.early:
            return self._finish(Accepted()), ()
        if self.doubts:
            return _send_again(self, now_s)
        silent = now_s - self.heard_s >= self.silence_s - SAME_S
        if self.refusal is not None and (silent or self.is_all_sent):
            return self._finish(build_rejection(list_name_of(self.kind), self.refusal)), ()
        if silent:
            return self._finish(TimedOut(f"no answer after item {self.furthest} of {len(self.items)}")), ()
        trip, repeats = self.round_trip.record_timeout(), self.repeats + 1
        state = replace(self, round_trip=trip, room=max(1, self.room // 2), repeats=repeats)
        # Who has everything asks for nothing more: the last item brings its acknowledgement again. Who has not, and is
        # not heard, waits for what it asked for: the two by turns.
        last = self.is_all_sent and repeats % 2 == 1
        # Its request for the next item may have got lost: that one goes out, too.
        return _send_items(state, (), len(self.items) - 1 if last else self.furthest, now_s, min(self.most_ahead, 2))

    def _build_farewell(self) -> Sent:
        """PX4 takes the cancellation, ArduPilot notices the silence."""
        return (messages.MissionAck(RESULT_CANCELLED, self.kind),)

    def _answer(self, seq: int, now_s: float) -> tuple[Self, Sent]:
        state = replace(self, heard_s=now_s, refusal=None, early=False, repeats=0)
        if seq == self.furthest:
            return _repeat_if_lost(state, now_s)
        state = replace(state, doubts=False)
        if seq < self.furthest:  # a late double, or a vehicle that has begun anew
            if self.under_way and now_s - self.under_way[0].at_s < self.find_repeat_s(now_s):
                return _wait_for_answer(state, now_s), ()
            return _send_items(replace(state, furthest=seq, asked_s=now_s, asks=0), (), seq, now_s, self.room)
        come = [one for one in self.under_way if one.seq < seq]  # it has all that stands before what it asks for
        left = tuple(one for one in self.under_way if one.seq >= seq)
        trip = self.round_trip
        if come:
            trip = _record_answer(trip, come[-1], now_s)
        elif not self._is_asked and self.counts_sent == 1:
            took_s = now_s - self.counted_s
            # What took far longer than all before it was known of another link, or without a queue.
            other = trip.mean_s is not None and took_s > 2 * trip.mean_s
            trip = (replace(trip, mean_s=None) if other else trip).record_round_trip(took_s)
        room = min(self.most_ahead, self.room + len(come))
        if not self._is_asked and (trip.mean_s or 0.0) >= FAR_S:
            room = self.most_ahead  # growing to it would take some long round trips
        state = replace(state, furthest=seq, asked_s=now_s, asks=0, round_trip=trip, room=room)
        return _send_items(state, left, left[-1].seq + 1 if left else seq, now_s, room - len(left))

    def find_wait_s(self, now_s: float) -> float:
        """Return how long the vehicle has waited for an item; its repeated requests tell when this computer stalled."""
        return max(now_s - self.asked_s, self.asks * ASKS_EVERY_S)

    def find_grace_s(self, now_s: float) -> float:
        """Return the time to wait for the requests behind one that was repeated: a radio sends several in one packet.

        None once the vehicle has waited for a good part of its patience, as when this computer stalls.
        """
        mean_s = self.round_trip.mean_s or 0.0
        is_urgent = self.find_wait_s(now_s) > self.silence_s / 4
        return 0.0 if mean_s < AHEAD_TRIP_S or is_urgent else min(GRACE_S, mean_s / 4)

    def find_repeat_s(self, now_s: float) -> float:
        """Return after how long an item that the vehicle still asks for is sent again.

        That is by when most of what was sent is answered, and sooner as the vehicle's patience ends: another copy costs
        less than the whole list.
        """
        left_s = self.silence_s - self.find_wait_s(now_s)
        return min(self.round_trip.usual_s, self.round_trip.most_s, max(REPEAT_S, left_s / COPIES_LEFT))

    def _handle_acknowledgement(self, result: int, checksum: int | None) -> Self:
        all_asked = self.furthest == len(self.items) - 1
        if result == RESULT_ACCEPTED:
            proven = checksum is not None and checksum == compute_list_checksum(self.items)
            if all_asked or (self.is_all_sent and proven):
                return replace(self._finish(Accepted()), checksum=checksum)
            # Before the last item was asked for it may be a late duplicate of an earlier transfer's.
            return replace(self, early=True, checksum=checksum) if self.is_all_sent else self
        if result in self.warnings or (result == RESULT_CANCELLED and not self._is_asked):
            return self  # what has not begun cannot be given up: that was an earlier transfer
        if result == RESULT_ERROR and (self.moved if not self._is_asked else not all_asked):
            # PX4 says so of a doubled COUNT and goes on, and while it waits over the link that was left.
            return replace(self, refusal=result)
        return self._finish(build_rejection(list_name_of(self.kind), result))


def _announce_items(state: U, now_s: float) -> tuple[U, Sent]:
    period_s = MOVED_PERIOD_S if state.moved else max(COUNT_PERIOD_S, state.round_trip.waits_s)
    state = replace(state, counts_sent=state.counts_sent + 1, deadline_s=now_s + period_s)
    return state, (messages.MissionCount(len(state.items), state.kind),)


def _repeat_if_lost(state: U, now_s: float) -> tuple[U, Sent]:
    """Send what the vehicle waits for again, unless that may still be on its way; what is behind it is lost too."""
    state = replace(state, asks=state.asks + 1)
    if state.doubts:
        return state, ()
    first, grace_s = state.under_way[0] if state.under_way else None, state.find_grace_s(now_s)
    if first is not None and first.seq == state.furthest:
        # What was sent with an item that has just arrived is on its way, however long the radio took for it.
        waits_s = state.find_repeat_s(now_s)
        if now_s - first.at_s < waits_s or state.find_wait_s(now_s) < waits_s / 2:
            return _wait_for_answer(state, now_s), ()
    return (replace(state, doubts=True, deadline_s=now_s + grace_s), ()) if grace_s else _send_again(state, now_s)


def _send_again(state: U, now_s: float) -> tuple[U, Sent]:
    state = replace(state, room=min(state.room, AGAIN_AHEAD), doubts=False)
    return _send_items(state, (), state.furthest, now_s, state.room)


def _send_items(state: U, kept: tuple[_UnderWay, ...], seq: int, now_s: float, most: int) -> tuple[U, Sent]:
    """Send the items from one on, as many as there is room for beside those that stay under way."""
    fast = state.round_trip.mean_s is not None and state.round_trip.mean_s < AHEAD_TRIP_S
    room = max(0, min(most, 1 - len(kept) if fast else most))
    sent, before_s = state.items[seq : seq + room], {one.seq: one.first_s or one.at_s for one in state.under_way}
    fresh = (
        _UnderWay(one.seq, now_s, before_s.get(one.seq, -inf) if one.seq <= state.highest else None) for one in sent
    )
    highest = max([state.highest, *(one.seq for one in sent)])
    state = replace(state, under_way=(*kept, *fresh), highest=highest)
    return _wait_for_answer(state, now_s), tuple(messages.MissionItemInt(one, state.kind) for one in sent)


def _record_answer(trip: RoundTrip, asked: _UnderWay, now_s: float) -> RoundTrip:
    """Return what is known of the link after an answer.

    Of two copies nobody knows which was answered, unless the last cannot have come and gone since.
    """
    since_s = now_s - asked.at_s
    if asked.first_s is None:
        return trip.record_round_trip(since_s)
    vain = since_s < trip.shortest_s / 2
    return trip.record_round_trip(now_s - asked.first_s) if vain and not isinf(asked.first_s) else trip


def _wait_for_answer(state: U, now_s: float) -> U:
    """Return the state with the time until which the vehicle may take to answer what is under way."""
    waits_s = max(state.round_trip.waits_s, LEAST_PERIOD_S)
    if len(state.under_way) > 1:  # the last of many waits for the others, and a vehicle says soon what it misses
        waits_s = max(waits_s, 2 * (state.round_trip.mean_s or 0.0))
    if state.is_all_sent:
        waits_s = max(waits_s, LAST_ITEM_PERIOD_S)  # it asks by itself for what it has not
    return replace(state, deadline_s=min(now_s + waits_s, state.heard_s + state.silence_s))


def list_name_of(kind: MissionKind) -> str:
    """Return one of a vehicle's lists in words."""
    return {MissionKind.MISSION: "mission", MissionKind.FENCE: "fence", MissionKind.RALLY: "rally points"}[kind]


def build_rejection(what: str, result: int) -> Rejected:
    """Return the outcome that a MAV_MISSION_RESULT means."""
    words = RESULT_NAMES.get(result, f"result {result}")
    return Rejected(f"{what} refused: {words}", _CODES.get(result, Ending.UNKNOWN_RESULT))


MOST_PERIOD_S = 2.0
"""Longest interval between questions. PX4 ends a transfer after 5 s without one, and two in a row may get lost."""
LEFT_S = 5.0
"""Silence after which PX4 has ended the transfer."""
SILENT_S = 8.0
ANEW = 3
"""Number of times the list is requested anew from a vehicle that keeps answering."""
FIRST_READ_TRIP = RoundTrip(waits_s=1.0, most_s=MOST_PERIOD_S)


@dataclass(frozen=True, slots=True)
class DownloadDialogue(DialogueMachine):
    """The state of one download."""

    is_transfer = True
    kind: MissionKind = MissionKind.MISSION
    """Kind of list; messages about another kind belong to another dialogue."""
    first: int = 0
    """First item to read."""
    ahead: int = 1
    """Most questions in flight; 1 if they must be in order."""
    checksum: int | None = None
    """Expected checksum; if it is on board nothing needs to be read."""
    count: int | None = None
    items: tuple[MissionItem, ...] = ()
    """Items read, from the first on, without a gap."""
    later: tuple[MissionItem, ...] = ()
    """Items that arrived out of order."""
    proven: bool = False
    """Whether the vehicle reports that checksum."""
    room: int = FIRST_AHEAD
    """Questions that may be in flight now."""
    under_way: tuple[_UnderWay, ...] = ()
    """Questions in flight, oldest first."""
    tries: int = 0
    """How often was asked since the last answer."""
    refusal: int | None = None
    """Error received since the last answer."""
    round_trip: RoundTrip = field(default=FIRST_READ_TRIP, kw_only=True)
    asked_s: float = 0.0
    heard_s: float = 0.0
    """Time of the last answer."""
    begun: int = 0
    """Number of times the list was requested again after an answer."""
    broke_off_at: str = ""
    """Request that failed before that."""

    def begin(self, now_s: float) -> tuple[Self, Sent]:
        """Ask how many items there are."""
        return _ask_count(replace(self, heard_s=now_s), now_s)

    def move(self, now_s: float) -> tuple[Self, Sent]:
        """Ask for the list anew over another link: PX4 reads it out to each by itself."""
        fresh = replace(self, count=None, items=(), later=(), under_way=(), tries=0, refusal=None, heard_s=now_s)
        return _ask_count(fresh, now_s)

    def _take(self, message: messages.Message, now_s: float) -> tuple[Self, Sent]:
        """Take the count, then the items."""
        match message:
            case messages.MissionCount(count, kind, checksum) if kind is self.kind and self.count is None:
                proven = checksum is not None and checksum == self.checksum
                trip = self.round_trip.record_round_trip(now_s - self.asked_s) if self.tries == 1 else self.round_trip
                return _go_on(replace(self, count=count, proven=proven, round_trip=trip), now_s)
            case messages.MissionItemInt(item, kind) if kind is self.kind:
                asked = next((one for one in self.under_way if one.seq == item.seq), None)
                return (self, ()) if asked is None else self._take_item(item, asked, now_s)
            case messages.MissionAck(result, kind) if kind is self.kind and result != 0:
                return replace(self, refusal=result), ()
            case _:
                return self, ()

    def _take_item(self, item: MissionItem, asked: _UnderWay, now_s: float) -> tuple[Self, Sent]:
        again = asked.first_s is not None
        trip = self.round_trip if again else self.round_trip.record_round_trip(now_s - asked.at_s)
        items, later = list(self.items), {one.seq: one for one in (*self.later, item)}
        while (seq := self.first + len(items)) in later:
            items.append(later.pop(seq))
        # Answers come in the order of the questions: what was asked before this one got lost.
        at = self.under_way.index(asked)
        passed, left = (() if again else self.under_way[:at]), self.under_way[0 if again else at :]
        state = replace(
            self, items=tuple(items), later=tuple(later.values()), round_trip=trip,
            under_way=tuple(one for one in left if one is not asked), room=min(self.room + 1, MOST_AHEAD),
        )  # fmt: skip
        return _go_on(state, now_s, passed)

    def _expire(self, now_s: float) -> tuple[Self, Sent]:
        """Ask again, for the list where the vehicle has ended the transfer; or give up."""
        if now_s >= self.heard_s + SILENT_S - SAME_S:
            if self.refusal is not None:
                return self._finish(build_rejection("download", self.refusal)), ()
            return self._finish(TimedOut(f"no answer when asked for {self._open}")), ()
        waited_s = self.round_trip.waits_s
        state = replace(self, round_trip=self.round_trip.record_timeout() if self.tries > 1 else self.round_trip)
        ended = self.refusal is not None or now_s - self.heard_s >= LEFT_S
        if self.count is not None and ended and self.begun < ANEW:
            state = replace(
                state, count=None, items=(), later=(), under_way=(), tries=0, refusal=None, begun=self.begun + 1,
                broke_off_at=self._open,
            )  # fmt: skip
        if state.count is None:
            return _ask_count(state, now_s)
        late = tuple(one for one in state.under_way if one.at_s <= now_s - waited_s + SAME_S) or state.under_way[:1]
        kept = tuple(one for one in state.under_way if one not in late)
        return _ask_items(replace(state, under_way=kept, room=max(1, state.room // 2)), now_s, late)

    def _build_farewell(self) -> Sent:
        return (messages.MissionAck(RESULT_CANCELLED, self.kind),)

    @property
    def _open(self) -> str:
        if self.broke_off_at or self.count is None:
            return self.broke_off_at or "the count"
        return f"item {self.first + len(self.items)} of {self.count}"


def _go_on(state: D, now_s: float, lost: tuple[_UnderWay, ...] = ()) -> tuple[D, Sent]:
    """Ask for what comes after an answer, or say that all has come."""
    state = replace(state, heard_s=now_s, tries=0, refusal=None, broke_off_at="")
    if state.proven or state.first + len(state.items) >= (state.count or 0):
        done = replace(state, outcome=Accepted(), deadline_s=float("inf"))
        return done, (messages.MissionAck(0, state.kind),)
    return _ask_items(state, now_s, lost)


def _ask_count(state: D, now_s: float) -> tuple[D, Sent]:
    deadline_s = min(now_s + state.round_trip.waits_s, state.heard_s + SILENT_S)
    state = replace(state, tries=state.tries + 1, asked_s=now_s, deadline_s=deadline_s)
    return state, (messages.MissionRequestList(state.kind),)


def _ask_items(state: D, now_s: float, lost: tuple[_UnderWay, ...] = ()) -> tuple[D, Sent]:
    """Ask again for what got lost, and for as many more items as there is room for."""
    again = tuple(_UnderWay(one.seq, now_s, one.at_s) for one in lost)
    state = replace(state, under_way=(*state.under_way, *again))
    have = {one.seq for one in state.under_way} | {item.seq for item in state.later}
    fresh = (
        _UnderWay(seq, now_s) for seq in range(state.first + len(state.items), state.count or 0) if seq not in have
    )
    room = max(0, min(state.room, state.ahead) - len(state.under_way))
    asks: tuple[_UnderWay, ...] = (*again, *islice(fresh, room))
    under_way = (*state.under_way, *asks[len(again) :])
    asked_s = min(one.at_s for one in under_way)
    if len(under_way) > 1:  # they come one after the other: none is late as long as any comes
        asked_s = max(asked_s, state.heard_s)
    deadline_s = asked_s + state.round_trip.waits_s
    state = replace(
        state, under_way=under_way, tries=state.tries + bool(asks), deadline_s=min(deadline_s, state.heard_s + SILENT_S)
    )
    return state, tuple(messages.MissionRequest(one.seq, state.kind) for one in asks)
