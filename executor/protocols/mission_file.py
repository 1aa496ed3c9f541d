"""A new mission for a flying ArduPilot as a file, over MAVFTP: it takes effect as a whole.

Sent item by item, old and new are flown as a mixture until the last item is there, and each item restarts the leg, so
that a vehicle crawls. Of the file `@MISSION/mission.dat` ArduPilot takes the last part alone, from an item on, and puts
it in place in one go when the file is closed (AP_Filesystem_Mission.cpp; measured on Copter 4.7-dev).

A list is not shortened by that. MISSION_COUNT does it at once (MissionItemProtocol.cpp), so it waits until the checksum
says that the new mission is there, with the rest of the old one behind its landing: the old one without its landing
must not be flown. The upload that it announces ends with its first item, which no autopilot takes.

A file without its header is dropped when it is closed, by us or, after the link was lost, by the next station that
opens one. So the header goes last, when everything else is acknowledged, and zeros stand in its place until then: the
memory of the file may still hold the header of an earlier one.

That the close is acknowledged does not say that the file was taken. The checksum of what is on board then does, and the
home position, which is the vehicle's own, is asked for beside it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import ClassVar, Self, TypeVar

from executor.core.interface import messages
from executor.core.interface.codes import Ending
from executor.protocols.machine import SAME_S, Accepted, DialogueMachine, Rejected, RoundTrip, TimedOut
from missions.items import MissionItem, MissionKind
from missions.stored_items import predict_stored_item

NAME = b"@MISSION/mission.dat"
SESSION = 190
"""Our MAVFTP session, the same as our component id; other stations count from 0."""
HEADER = struct.Struct("<HHHHH")
"""Magic, kind of list, options, first item, number of items."""
MAGIC, KEEP_THE_REST = 0x763D, 1
ITEM = struct.Struct("<4fiifHHBBBBBB")
"""MISSION_ITEM_INT as it is on the wire."""
CHECKSUM = struct.Struct("<I")
ITEMS_IN_ONE, FEW_IN_ONE = 5, 2
"""Items per frame: five fit a radio's packet of 250 bytes. Two fit one of 118 bytes; a radio with error correction has
that, and a frame in several packets is destroyed more often."""
FEW_AHEAD = 8
"""Items in flight below which a frame has few."""
MOST_AT_ONCE = 4
"""Most requests in flight; ArduPilot queues five and drops more (GCS_FTP.cpp)."""
OPEN_REPEATS = 4
MOST_RESTARTS = 3
SILENT_S = 8.0
MOST_WAIT_S = 2.0
FAILED = 1
"""MAVFTP error of an autopilot that already has a file open."""


class FileOperation(IntEnum):
    """MAVFTP's opcodes."""

    CLOSE = 1
    WRITE = 7
    OPEN_TO_WRITE = 11
    CHECKSUM = 14


F = TypeVar("F", bound="MissionFileUpload")
Sent = tuple[messages.Outgoing, ...]
Request = messages.FileRequest | messages.MissionRequest | messages.MissionCount | messages.MissionItemInt
Step = tuple[Request, ...]
"""Independent requests; all must be answered before the next step."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """A request that is under way."""

    request: Request
    at_s: float
    again: bool = False


@dataclass(frozen=True, slots=True)
class MissionFileUpload(DialogueMachine):
    """The state of one upload of the last part of a mission."""

    is_transfer = True
    kind: ClassVar[MissionKind] = MissionKind.MISSION
    items: tuple[MissionItem, ...]
    """The whole mission."""
    first: int
    """First item that differs from the mission on board; the length of the mission to only ask for its checksum."""
    number: int
    """Number of the next request. A vehicle repeats its last answer if it receives the same number again, so two
    uploads must not start with the same number."""
    rest: tuple[MissionItem, ...] = ()
    """Items on board beyond the new mission, to be cut off."""
    is_cut: bool = False
    """Whether the cut has begun."""
    steps: tuple[Step, ...] = ()
    """Remaining steps, the present one first."""
    under_way: tuple[_Asked, ...] = ()
    is_open: bool = False
    """Whether the vehicle has opened the file."""
    is_begun: bool = False
    """Whether the complete file was closed, so that the new mission may be on board."""
    is_doubtful: bool = False
    """Whether the header may have arrived after a time-out; only the checksum decides."""
    restarts: int = 0
    """Number of times the file was reopened."""
    checksum: int | None = None
    """Checksum of the mission on board, as reported."""
    home: MissionItem | None = None
    """Item 0 on board."""
    tries: int = 0
    """Number of requests since the last answer."""
    heard_s: float = 0.0
    round_trip: RoundTrip = field(default=RoundTrip(most_s=MOST_WAIT_S), kw_only=True)

    @property
    def is_all_sent(self) -> bool:
        """Whether the last acknowledgement alone may have got lost."""
        return self.is_begun

    def begin(self, now_s: float) -> tuple[Self, Sent]:
        """Open the file."""
        return _ask(replace(self, heard_s=now_s, steps=_list_steps(self)), now_s)

    def move(self, now_s: float) -> tuple[Self, Sent]:
        """Ask again over another link for all that is under way: to ArduPilot the session is the same."""
        again = tuple(replace(one, at_s=now_s, again=True) for one in self.under_way)
        return _wait(replace(self, under_way=again, heard_s=now_s)), tuple(one.request for one in again)

    @property
    def items_in_one(self) -> int:
        """Return how many items a frame has."""
        return ITEMS_IN_ONE if self.most_ahead >= FEW_AHEAD else FEW_IN_ONE

    @property
    def is_proven(self) -> bool:
        """Whether the vehicle has said the checksum of the new mission."""
        return self.has_checksum_of(self.items)

    def has_checksum_of(self, items: tuple[MissionItem, ...]) -> bool:
        """Return whether it was that of these items."""
        if self.checksum is None or self.home is None:
            return False
        stored = (self.home, *map(predict_stored_item, items[1:]))
        return self.checksum in set(_list_checksums(stored))

    def _take(self, message: messages.Message, now_s: float) -> tuple[Self, Sent]:
        asked = next((one for one in self.under_way if _is_answer(message, one.request)), None)
        if asked is None:
            return self, ()
        opens, error = _is_opening(asked), message.error if isinstance(message, messages.FileReply) else None
        closes = len(self.steps) == 1
        if error is not None and not closes:
            if opens or self.is_open:
                if opens and error == FAILED and self.restarts < MOST_RESTARTS:
                    # It may be a file of ours: opened just now, or left open when the link was lost.
                    return _restart(self, now_s, _DROP)
                refusal = f"mission file refused: MAVFTP error {error}"
                return self._finish(Rejected(refusal, Ending.ERROR)), self._build_farewell()
            if any(map(_is_opening, self.under_way)):
                return self, ()  # what was to open the file got lost
        trip = self.round_trip if asked.again else self.round_trip.record_round_trip(now_s - asked.at_s)
        left = tuple(one for one in self.under_way if one is not asked)
        state = replace(
            self, under_way=left, round_trip=trip, is_open=self.is_open or opens, heard_s=now_s, tries=0,
            is_doubtful=self.is_doubtful or (closes and self.is_open and error is not None),
        )  # fmt: skip
        if isinstance(message, messages.MissionItemInt):
            state = replace(state, home=message.item)
        elif asked.again and closes and _give_number(asked.request, 0) == _CLOSE:
            state = replace(state, steps=((*self.steps[0], _CHECK),))  # the first may have been answered before it
        elif isinstance(message, messages.FileReply) and len(message.data) == CHECKSUM.size:
            state = replace(state, checksum=CHECKSUM.unpack(message.data)[0])
        return _ask(state, now_s)

    def _expire(self, now_s: float) -> tuple[Self, Sent]:
        if now_s >= self.heard_s + SILENT_S - SAME_S or (not self.is_open and self.tries >= OPEN_REPEATS):
            return self._finish(TimedOut("no answer over MAVFTP")), ()
        due_s = now_s - self.round_trip.waits_s + SAME_S
        again = tuple(replace(one, at_s=now_s, again=True) if one.at_s <= due_s else one for one in self.under_way)
        trip = self.round_trip.record_timeout()
        state = replace(self, under_way=again, round_trip=trip, tries=self.tries + 1)
        return _wait(state), tuple(one.request for one in again if one.at_s == now_s)

    def _build_farewell(self) -> Sent:
        """Drop what was written, unless the vehicle may have taken it."""
        if not self.is_open or self.is_begun:
            return ()
        return tuple(_give_number(step[0], self.number + n) for n, step in enumerate(_DROP))


def _write(offset: int, data: bytes) -> messages.FileRequest:
    return messages.FileRequest(SESSION, FileOperation.WRITE, offset, data)


_CLOSE = messages.FileRequest(SESSION, FileOperation.CLOSE)
_CHECK = messages.FileRequest(SESSION, FileOperation.CHECKSUM, data=NAME)
_NO_HEADER = bytes(HEADER.size)
_REFUSED = messages.MissionItemInt(MissionItem(0, 0, 0))
"""An item with an unknown command, whose refusal ends an upload (AP_Mission::mavlink_int_to_mission_cmd)."""
_DROP: tuple[Step, ...] = ((_write(0, _NO_HEADER),), (_CLOSE,))
"""Closes a file without a header, so that it is dropped."""


def pack_items(items: Iterable[MissionItem]) -> bytes:
    """Return items as the file holds them."""
    return b"".join(
        ITEM.pack(
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, item.seq, item.command, 0, 0,
            item.frame, item.current, item.autocontinue, MissionKind.MISSION,
        )
        for item in items
    )  # fmt: skip


def _list_steps(state: MissionFileUpload) -> tuple[Step, ...]:
    items, first = state.items, state.first
    if first == len(items):
        return ((_CHECK, messages.MissionRequest(0)),)
    data, size = pack_items(items[first:]), state.items_in_one * ITEM.size
    parts = (_write(HEADER.size + at, data[at : at + size]) for at in range(0, len(data), size))
    header = HEADER.pack(MAGIC, MissionKind.MISSION, KEEP_THE_REST, first, len(items) - first)
    return (
        (messages.FileRequest(SESSION, FileOperation.OPEN_TO_WRITE, data=NAME), _write(0, _NO_HEADER), *parts),
        (_write(0, header), _CLOSE, _CHECK, messages.MissionRequest(0)),
    )


def _restart(state: F, now_s: float, before: tuple[Step, ...] = ()) -> tuple[F, Sent]:
    """Open the file anew, after what has to come before that."""
    state = replace(
        state, steps=(*before, *_list_steps(state)), restarts=state.restarts + 1, under_way=(),
        is_open=False, is_doubtful=False, heard_s=now_s, tries=0,
    )  # fmt: skip
    return _ask(state, now_s)


def _is_opening(asked: _Asked) -> bool:
    return isinstance(asked.request, messages.FileRequest) and asked.request.operation == FileOperation.OPEN_TO_WRITE


def _is_answer(message: messages.Message, request: Request) -> bool:
    match message, request:
        case messages.FileReply(number, session), messages.FileRequest():
            return (number, session) == (request.number, request.session)
        case messages.MissionItemInt(item, kind), messages.MissionRequest(seq, asked):
            return (item.seq, kind) == (seq, asked)
        case messages.MissionRequest(seq, kind), messages.MissionCount():
            return (seq, kind) == (0, request.kind)
        case messages.MissionAck(result, kind), messages.MissionItemInt():
            return result != 0 and kind is request.kind
        case _:
            return False


def _list_checksums(stored: Sequence[MissionItem]) -> Iterator[int]:
    """Yield what the checksum of these items may be.

    The file marks as current every item whose command has the number of the index that is flown (AP_Mission::get_item).
    """
    head = HEADER.pack(MAGIC, MissionKind.MISSION, 0, 0, len(stored))
    for marked in (None, *{item.command for item in stored}):
        data = head + pack_items(replace(item, current=item.command == marked) for item in stored)
        yield ~zlib.crc32(data, 0xFFFFFFFF) & 0xFFFFFFFF


def _ask(state: F, now_s: float) -> tuple[F, Sent]:
    """Ask what there is room for; finish where all is answered."""
    steps = state.steps
    if not steps[0] and not state.under_way:
        steps = steps[1:]
    if not steps and state.rest and not state.is_cut and state.has_checksum_of(state.items + state.rest):
        steps = ((messages.MissionCount(len(state.items)),), (_REFUSED,), (_CHECK,))
        state = replace(state, is_cut=True)
    if not steps and state.is_doubtful and state.restarts < MOST_RESTARTS and not state.is_proven:
        return _restart(state, now_s)
    if not steps:
        return replace(state, outcome=Accepted(), deadline_s=float("inf")), ()
    room = min(MOST_AT_ONCE, max(1, state.most_ahead // state.items_in_one)) - len(state.under_way)
    sent = tuple(_give_number(request, state.number + n) for n, request in enumerate(steps[0][:room]))
    state = replace(
        state,
        steps=(steps[0][len(sent) :], *steps[1:]),
        number=state.number + len(sent) & 0xFFFF,
        under_way=(*state.under_way, *(_Asked(request, now_s) for request in sent)),
        is_begun=state.is_begun or (state.is_open and _CLOSE in steps[0]),
    )
    return _wait(state), sent


def _give_number(request: Request, number: int) -> Request:
    return replace(request, number=number & 0xFFFF) if isinstance(request, messages.FileRequest) else request


def _wait(state: F) -> F:
    deadline_s = min(one.at_s for one in state.under_way) + state.round_trip.waits_s
    return replace(state, deadline_s=min(deadline_s, state.heard_s + SILENT_S))
