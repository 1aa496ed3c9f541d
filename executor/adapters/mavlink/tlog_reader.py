"""Telemetry logs (.tlog) to our messages, faster than a codec that decodes them all.

A record is [8 bytes, microseconds since 1970, big-endian][a MAVLink frame]; both directions and any number of vehicles
may share a file. Only the headers of most frames are read, for their sequence numbers. What is wanted of the others is
unpacked by pymavlink's own definitions and read by `message_readers`, as on a link; only the classes of pymavlink are
passed by, whose making takes most of the time of a long log. The file is read in pieces, so a log of any length takes
the same memory.

A log is stamped by the computer that wrote it, whose clock is set in flight: by satellites, by a network, by hand, from
1970 to today, or an hour back. What the vehicles send has their own time since their boot. After a leap both go on
alike, apart by as much as the clock was set; after a silence of the link they agree as before, at the latest when what
was held back has come.
"""

from __future__ import annotations

import math
import struct
from collections import namedtuple
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.chunks import read_in_chunks
from executor.adapters.mavlink import frame_layout, message_readers
from executor.adapters.mavlink.frame_layout import HEADS, V2, has_valid_checksum, message_id_of, payload_of
from executor.adapters.mavlink.message_readers import Frame, StatusTextAssembler
from executor.core import formatting
from executor.core.interface.messages import (
    Attitude,
    DoubleHeard,
    FlightMessage,
    Heartbeat,
    HeightTarget,
    ListedItem,
    OrderSeen,
    Radio,
    RcChannels,
    Traffic,
    VehicleSetting,
)
from executor.core.interface.recorded_log import (
    RcChangeFilter,
    Record,
    RecordedFile,
    TiltFilter,
    is_wanted_setting,
)
from executor.core.state.link_quality import DuplicateIdWatch, ReportedPosition, add_reported_position
from executor.core.telemetry.plausibility import filter_implausible
from executor.core.telemetry.vehicle_identity import AutopilotComponent, update_autopilot_component
from missions import AUTOPILOTS, PX4

BACK_USEC = 1_000_000
"""Frames of several links are out of order by less."""
AHEAD_USEC = 2_000_000
"""A shorter pause is one of any link, and costs nothing."""
SET_USEC = 1_500_000
"""A clock that is off by less was not set."""
ALIKE_USEC = 500_000
"""By so much both may differ after it was set; frames that were held back catch up by more."""
SEEN_USEC, LOOKS_USEC = 2_500_000, 10_000_000
"""For so long both must go on alike where the leap itself is short, and for so long is looked ahead."""
SHORT_USEC = 60_000_000
LONGEST_PAUSE_USEC = 86_400_000_000
"""Where no vehicle's clock says anything a longer pause of a recorder is a clock that was set."""
EVERY_USEC = 450_000
"""Of a battery's reports no watchpoint needs more than two a second."""
SLOW_USEC = 950_000
"""Of everything else one a second is enough."""
POSITION_USEC = 1_400_000
"""Of positions two in three seconds: of one in two each would be called late."""
STEADY_USEC = 2_900_000
"""Of what is repeated until it changes, one in three seconds."""
RC_USEC = 190_000
"""A switch is seen at once."""
STAND_IN_USEC = 4_000_000
"""SYS_STATUS stands in for BATTERY_STATUS; beside it one in five seconds is enough."""
MARKS = frozenset(HEADS)
STAMP = 8
LONGEST = STAMP + 10 + 255 + 2 + 13
STAMP_TOLERANCE_USEC = 3 * 86400 * 1_000_000
"""Where a log was damaged, a record counts whose time is within three days of the last (as pymavlink does)."""
GAP_USEC = 900_000
"""Where nothing came of a system for so long, it is said that time passed before its next message."""
BEAT_FRAMES = 25
"""Not every frame is looked at: one HEARTBEAT stands for so many, for texts whose other parts are waited for."""
ENOUGH_FRAMES = 80
"""Counts of frames are handed on with a HEARTBEAT once there are as many."""
HALF = 128
"""A sequence number that is ahead by more is one that was overtaken on the way."""
POSITION, BATTERY, SYSTEM = "GLOBAL_POSITION_INT", "BATTERY_STATUS", "SYS_STATUS"
LOCAL_POSITION = "LOCAL_POSITION_NED"
MOST_NAMED = 8
ROUND_TWICE = frozenset(dialect.number for dialect in AUTOPILOTS if dialect.rounds_twice)
"""MAV_AUTOPILOT."""
BOOT_TIMED = frozenset({POSITION, "ATTITUDE"})
_HEAD = struct.Struct(">Q5B")
LOOKAHEAD = 1 << 16
"""Bytes of a piece that are left to the next one, so that what follows a leap of the clock is there to look at."""
LEAST = 18
"""Bytes of the shortest records: a time, and a frame of the older version without a field."""


@dataclass(frozen=True, slots=True)
class BootTime:
    """A vehicle's own time, and the log's beside it, in microseconds."""

    boot_usec: int
    stamp_usec: int


def was_set_by_usec(pairs: Sequence[tuple[BootTime, BootTime]], stamp_usec: int, before_usec: int) -> int:
    """Return by how much a clock was set between two stamps; 0 where it was not.

    Args:
        pairs: Of each report after the leap, in their order: its vehicle's last report before it, and itself.
        stamp_usec: Of the first record after it.
        before_usec: Of the last record before it.
    """
    leap_usec = stamp_usec - before_usec
    off = [
        (after.stamp_usec - before.stamp_usec) - (after.boot_usec - before.boot_usec)
        for before, after in pairs
        if after.boot_usec >= before.boot_usec  # else it rebooted, and says nothing of the time between
    ]
    if not off:
        return leap_usec if not -BACK_USEC <= leap_usec < LONGEST_PAUSE_USEC else 0
    seen_usec = pairs[-1][1].stamp_usec - stamp_usec
    alike = max(off) - min(off) <= ALIKE_USEC and (seen_usec >= SEEN_USEC or abs(leap_usec) >= SHORT_USEC)
    if alike and abs(off[-1]) >= SET_USEC:
        return off[-1]
    return leap_usec if leap_usec < -BACK_USEC else 0


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One message that is read."""

    name: str
    extra: int
    """CRC_EXTRA: part of its checksum."""
    layout: struct.Struct
    """All fields in the order on the wire; what a sender left out at the end is zero."""
    name_fields: Callable[[tuple[Any, ...]], Any]
    """Makes of their values an object that has them by MAVLink's names."""
    read: Callable[[Any], FlightMessage | None]
    every_usec: int
    """One that follows another sooner than this is passed over."""
    special: bool
    """Whether it is not simply a vehicle's word about itself."""
    arrays: tuple[tuple[int, int], ...] = ()
    """Where each field begins and ends among the values, if any has more than one."""

    def unpack_fields(self, frame: bytes) -> Frame:
        """Return all fields of a frame by their names."""
        values = self.layout.unpack(payload_of(frame, self.layout.size))
        if self.arrays:
            values = tuple(values[first] if end == first + 1 else values[first:end] for first, end in self.arrays)
        return self.name_fields(values)


def _ignore_message(_: object) -> None:
    """Say nothing: it is not the message alone that tells."""


def _make_kind(name: str, every_usec: int, *, special: bool) -> MessageKind:
    """Return a kind as pymavlink defines it."""
    known, read = _DEFINED[name], message_readers.READERS.get(name, _ignore_message)
    read = message_readers.read_channels if name == "RC_CHANNELS_RAW" else read
    more_format, more_fields = _MORE.get(name, ("", ()))
    layout = struct.Struct(known.unpacker.format + more_format)
    name_fields = _named_tuple(name, (*known.ordered_fieldnames, *more_fields))._make
    ends = list(accumulate(known.lengths))
    arrays = tuple(zip([0, *ends], ends, strict=False)) if max(known.lengths) > 1 else ()
    return MessageKind(name, known.crc_extra, layout, name_fields, read, every_usec, special, arrays)


_named_tuple: Any = namedtuple
_DEFINED: Mapping[str, Any] = {one.msgname: one for one in mav.mavlink_map.values()}
_MORE = {"MISSION_CURRENT": ("I", ("mission_id",))}
"""Fields at the end that pymavlink's definition does not have yet."""
ORDERS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
ITEMS = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})
_PLAIN = {
    **dict.fromkeys(("SYS_STATUS", "GPS_RAW_INT", "GPS2_RAW", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"), SLOW_USEC),
    **dict.fromkeys(("MISSION_CURRENT", "EXTENDED_SYS_STATE"), STEADY_USEC),
    "NAV_CONTROLLER_OUTPUT": SLOW_USEC,
    "GLOBAL_POSITION_INT": POSITION_USEC,
    "MISSION_ITEM_REACHED": 0,
    "BATTERY_STATUS": EVERY_USEC,
}
"""A vehicle's words about itself, and how often one is wanted."""
_SPECIAL = {
    **dict.fromkeys(("HEARTBEAT", "STATUSTEXT", "COMMAND_ACK", "PARAM_VALUE", *ORDERS, *ITEMS), 0),
    **dict.fromkeys(("LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED"), SLOW_USEC),
    **dict.fromkeys(("RC_CHANNELS_RAW", "RC_CHANNELS"), RC_USEC),
    "ATTITUDE": EVERY_USEC,
    "RADIO_STATUS": POSITION_USEC,
}
"""What is not simply that."""
_EVENT = MessageKind(
    message_readers.EVENT_NAME,
    message_readers.EVENT_EXTRA,
    message_readers.EVENT_LAYOUT,
    _named_tuple(message_readers.EVENT_NAME, message_readers.EVENT_FIELDS)._make,
    _ignore_message,
    every_usec=0,
    special=True,
)
KINDS: Mapping[int, MessageKind] = (
    {_DEFINED[name].id: _make_kind(name, every_usec, special=False) for name, every_usec in _PLAIN.items()}
    | {_DEFINED[name].id: _make_kind(name, every_usec, special=True) for name, every_usec in _SPECIAL.items()}
    | {message_readers.EVENT: _EVENT}
)
"""By message id: what is read; RADIO_STATUS is also what SiK radios send."""
TOLD_BY_VEHICLES = frozenset({
    message_readers.EVENT_NAME, "COMMAND_ACK", "PARAM_VALUE", "RC_CHANNELS_RAW", "RC_CHANNELS", "ATTITUDE",
    "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED",
})  # fmt: skip


@dataclass(slots=True)
class _Source:
    """One system and component."""

    seq: int
    received: int = 1
    missing: int = 0
    vehicle: bool = False
    rounds_twice: bool = False
    """Whether SYS_STATUS says more than BATTERY_STATUS, as PX4's does."""
    battery_usec: int = -STAND_IN_USEC
    """When its BATTERY_STATUS came last."""
    boot: BootTime | None = None
    """Its own time when it said it last."""
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)


@dataclass(slots=True)
class _MessageStream:
    """One source's messages of one kind."""

    source: _Source
    kind: MessageKind | None
    """None if they are not read."""
    system: int
    component: int
    every_usec: int
    newest_usec: int = -STAND_IN_USEC
    """When one was read last."""
    told_usec: int = -STAND_IN_USEC
    """When one was handed on last, of those that are all read."""


@dataclass(slots=True)
class TelemetryFile(RecordedFile):
    """A .tlog being read once, from its beginning to its end."""

    on_board = False
    frames: int = 0
    _texts: StatusTextAssembler = field(default_factory=StatusTextAssembler)
    _sources: dict[int, _Source] = field(default_factory=dict)
    _speakers: dict[int, AutopilotComponent] = field(default_factory=dict)
    """By system."""
    _lanes: dict[bytes, _MessageStream] = field(default_factory=dict)
    """By system, component and id as the frame has them."""
    _stamp: int = 0
    """Of the last record, as it stands there."""
    _shift: int = 0
    """What the recorder's clock was set by since the first record, taken back."""
    _began: int = 0
    _sets: int = 0
    _rc: dict[int, RcChangeFilter] = field(default_factory=dict)
    _tilts: dict[int, TiltFilter] = field(default_factory=dict)
    _autopilots: dict[int, int] = field(default_factory=dict)
    _events: dict[int, message_readers.Px4EventDecoder] = field(default_factory=dict)
    _downs_m: dict[int, float] = field(default_factory=dict)
    """How far below where its filter began each system is."""

    def read_records(self) -> Iterator[Record]:
        """Yield (t_usec, system, message) in the order of the file; a message of None is time passing.

        System 0 stands for what is about the link as a whole.
        """
        yield from read_in_chunks(self.path, self._read_piece)
        for (system, _), text in self._texts.list_unfinished_texts():
            yield self._stamp, system, text
        self._explain_no_vehicle()

    def _explain_no_vehicle(self) -> None:
        """Note why there is nobody to follow, if nobody is."""
        if any(source.vehicle for source in self._sources.values()):
            return
        systems = sorted({key >> 8 for key in self._sources} - self.stations)
        if not self.path.stat().st_size:
            self.notes.append("it is empty")
        elif not self.frames:
            self.notes.append("there is no MAVLink frame in it")
        elif not systems:
            self.notes.append("only ground stations were recorded")
        else:
            named = ", ".join(str(one) for one in systems[:MOST_NAMED])
            self.notes.append(f"no HEARTBEAT of an autopilot in it; heard were the systems {named}")

    def _read_piece(self, buffer: bytes, last: bool) -> Generator[Record, None, int]:
        """Yield what whole records of a piece say; returns where the rest begins. Calls would take most of the time."""
        at, size, known, in_garbage, frames, shift = 0, len(buffer), self._stamp, False, 0, self._shift
        stop = size if last else size - LOOKAHEAD
        lanes, heard, head = self._lanes, self.heard, _HEAD.unpack_from
        while at < stop:
            if at + LEAST > size:
                self.skipped.truncated = 1  # only the end of the file can do that, once
                break
            stamp, mark, length, flags, _, seq = head(buffer, at)
            if mark == V2:
                key, end = buffer[at + 13 : at + 18], at + 18 + length + (15 if flags & 1 else 2)
            else:  # the fields of the older version stand elsewhere
                key, end, seq, flags = buffer[at + 11 : at + 14], at + 16 + length, flags, 0
            if not (
                end + STAMP < size
                and buffer[end + STAMP] in MARKS
                and mark in MARKS
                and -STAMP_TOLERANCE_USEC < stamp - (known or stamp) < STAMP_TOLERANCE_USEC
                and flags < 2
            ) and not self._is_record_at(buffer, at, end, known):
                self.skipped.garbage_runs += not (in_garbage or self.skipped.truncated)
                in_garbage = True
                at += 1
                continue
            if not -BACK_USEC <= stamp - known < AHEAD_USEC:
                shift = self._shift_from(buffer, at, known)
            in_garbage, known = False, stamp
            stamp += shift
            frames += 1
            lane = lanes.get(key) or self._open_stream(key, seq)
            source = lane.source
            if 0 < (ahead := (seq - source.seq) & 255) < HALF:
                source.missing += ahead - 1  # that its sequence number says are lost
                source.received += 1
                source.seq = seq
            if source.vehicle:
                if not 0 <= stamp - heard.get(lane.system, 0) < GAP_USEC:
                    yield stamp, 0, None
                heard[lane.system] = stamp
            if lane.kind is not None and not 0 <= stamp - lane.newest_usec < lane.every_usec:
                yield from self._read_frame(buffer[at + STAMP : end], stamp, lane)
            at = end
        self._stamp = known
        self.frames += frames
        return at

    def _shift_from(self, buffer: bytes, at: int, known: int) -> int:
        """Return what stamps are shifted by from a record on, whose stamp is far from that of the last one."""
        stamp = int.from_bytes(buffer[at : at + STAMP], "big")
        if not known:
            self._began = stamp
            return self._shift
        by_usec = was_set_by_usec(self._boots_after(buffer, at), stamp + self._shift, known + self._shift)
        if not by_usec:
            return self._shift
        self._sets += 1
        self.skipped.time_back += by_usec < 0
        if self._sets <= MOST_NAMED:
            at_s = (known + self._shift - self._began) / 1e6
            own = f"by {by_usec / 1e6:+.1f} s at {at_s:.1f} s: times go on by the vehicles' own"
            self.notes.append(f"the recorder's clock was set {own}")
        self._shift -= by_usec
        return self._shift

    def _boots_after(self, buffer: bytes, at: int) -> list[tuple[BootTime, BootTime]]:
        """Return what vehicles say of their own time after a leap."""
        found, first = list[tuple[BootTime, BootTime]](), int.from_bytes(buffer[at : at + STAMP], "big")
        while at + LONGEST <= len(buffer) and buffer[at + STAMP] in MARKS:
            stamp, mark, length, flags, *_ = _HEAD.unpack_from(buffer, at)
            if not -LOOKS_USEC < stamp - first < LOOKS_USEC:
                break  # it leaps again
            if mark == V2:
                key, end = buffer[at + 13 : at + 18], at + 18 + length + (15 if flags & 1 else 2)
            else:
                key, end = buffer[at + 11 : at + 14], at + 16 + length
            lane, frame = self._lanes.get(key), buffer[at + STAMP : end]
            if (
                lane is not None and lane.source.boot is not None
                and lane.kind is not None and lane.kind.name in BOOT_TIMED
                and has_valid_checksum(frame, lane.kind.extra)
            ):  # fmt: skip
                found.append((lane.source.boot, BootTime(_boot_usec(frame), stamp + self._shift)))
            at = end
        return found

    def _open_stream(self, key: bytes, seq: int) -> _MessageStream:
        """Return what is known of a source's messages of one kind, from now on."""
        system, component, number = key[0], key[1], int.from_bytes(key[2:], "little")
        source = self._sources.setdefault(system << 8 | component, _Source(seq))
        kind = KINDS.get(number)
        every_usec = 0 if kind is None or kind.name == POSITION or self.every_record else kind.every_usec
        lane = self._lanes[key] = _MessageStream(source, kind, system, component, every_usec)
        return lane

    def _read_frame(self, frame: bytes, stamp: int, lane: _MessageStream) -> Iterator[Record]:
        """Yield what a frame says that is wanted now."""
        kind, source = lane.kind, lane.source
        lane.newest_usec = stamp
        if kind is None or not has_valid_checksum(frame, kind.extra):
            self.skipped.bad_checksums += 1
            return
        if kind.name == BATTERY:
            source.battery_usec = stamp
        elif kind.name in BOOT_TIMED:
            source.boot = BootTime(_boot_usec(frame), stamp)
        elif kind.name == SYSTEM and not self.every_record:
            # Beside BATTERY_STATUS it is wanted seldom, if it says the same.
            beside = not source.rounds_twice and 0 <= stamp - source.battery_usec < STAND_IN_USEC
            lane.every_usec = STAND_IN_USEC if beside else SLOW_USEC
        fields = kind.unpack_fields(frame)
        if kind.name == POSITION and source.vehicle:
            # Every one of them: of one in seconds all may be of the same of two vehicles.
            yield from _twins_heard(source, stamp, lane.system, fields)
            if 0 <= stamp - lane.told_usec < kind.every_usec and not self.every_record:
                return
            lane.told_usec = stamp
        message = kind.read(fields)
        message = None if message is None else filter_implausible(message)
        if message is not None and source.vehicle and not kind.special:
            yield stamp, lane.system, message
        else:
            yield from self._read_special(stamp, lane, fields, message)

    def _is_record_at(self, buffer: bytes, at: int, end: int, known: int) -> bool:
        """Return whether a whole record lies here, where what follows it does not show that."""
        size = len(buffer)
        if buffer[at + 8] not in MARKS or (buffer[at + 8] == V2 and buffer[at + 10] & ~1):
            return False
        if end > size:
            self.skipped.truncated = 1
            return False
        stamp = int.from_bytes(buffer[at : at + 8], "big")
        far = known and abs(stamp - known) >= STAMP_TOLERANCE_USEC
        if far:
            # A clock that is set in flight may leap by years: then the next record must agree.
            following = int.from_bytes(buffer[end : end + 8], "big")
            return _is_known(buffer, at, end) and abs(following - stamp) < STAMP_TOLERANCE_USEC
        return end == size or _is_known(buffer, at, end)

    def _read_special(
        self, stamp: int, lane: _MessageStream, frame: Frame, message: FlightMessage | None
    ) -> Iterator[Record]:
        """Yield what is about the link, about orders to others, or begins a vehicle."""
        name = "" if lane.kind is None else lane.kind.name
        source, system, component = lane.source, lane.system, lane.component
        if name == "STATUSTEXT":
            yield from self._read_statustext(stamp, system, component, frame)
        elif name in ORDERS | ITEMS:
            sent = self._read_mode_order if name in ORDERS else self._read_mission_item
            yield from sent(stamp, system, frame)
        elif isinstance(message, Heartbeat) and self._is_speaker(system, component, message):
            self._autopilots[system] = message.autopilot
            source.vehicle, source.rounds_twice = True, message.autopilot in ROUND_TWICE
            if source.received + source.missing >= ENOUGH_FRAMES:
                yield stamp, system, Traffic(source.received, source.missing)
                source.received = source.missing = 0
            yield stamp, system, message
            for text in self._texts.count_frame((system, component), BEAT_FRAMES):
                yield stamp, system, text
        elif isinstance(message, Radio):
            yield stamp, 0, message
        elif name in TOLD_BY_VEHICLES:
            told = self._read_vehicle_message(stamp, system, name, frame, message) if source.vehicle else None
            if told is not None:
                yield stamp, system, told
        else:
            if name == "HEARTBEAT" and frame.type == message_readers.GCS_TYPE:
                self.stations.add(system)
            self.skipped.impossible += name == POSITION and message is None
            yield stamp, 0, None

    def _read_mode_order(self, stamp: int, by: int, frame: Frame) -> Iterator[Record]:
        """Yield an order to change the mode, as of whom it is for."""
        target = frame.target_system
        ordered = message_readers.read_mode_order(frame, self._autopilots.get(target))
        if ordered is not None:
            yield stamp, target, OrderSeen(*ordered, by)

    def _read_mission_item(self, stamp: int, by: int, frame: Frame) -> Iterator[Record]:
        """Yield an item of a vehicle's mission, on its way to it or from it.

        One of a fence, of rally points, or a place to be flown to at once is none.
        """
        of = by if by in self._autopilots else frame.target_system
        whole = not frame.mission_type and frame.current <= 1 and all(map(math.isfinite, (frame.x, frame.y, frame.z)))
        if whole and of in self._autopilots:
            yield stamp, of, ListedItem(message_readers.read_mission_item(frame))

    def _read_vehicle_message(
        self, stamp: int, system: int, name: str, frame: Frame, message: FlightMessage | None
    ) -> FlightMessage | None:
        """Return what a vehicle says of an order, of its settings and of its pilot's transmitter."""
        if name == "COMMAND_ACK":
            command = message_readers.read_accepted_order(frame)
            return None if command is None else OrderSeen(command)
        if name == message_readers.EVENT_NAME:
            told = self._events.setdefault(system, message_readers.Px4EventDecoder())
            px4s = self._autopilots.get(system) == PX4.number
            return told.decode(frame.id, frame.event_time_boot_ms, frame.sequence, frame.arguments) if px4s else None
        if name == "PARAM_VALUE":
            setting = formatting.escape_controls(frame.param_id.split(b"\0", 1)[0].decode(errors="replace"))
            value = frame_layout.from_wire(frame.param_value, frame.param_type, self._autopilots.get(system))
            return VehicleSetting(setting, value) if is_wanted_setting(setting) and math.isfinite(value) else None
        if name in {LOCAL_POSITION, "POSITION_TARGET_LOCAL_NED"}:
            return self._read_height_target(system, name, frame.z)
        if isinstance(message, Attitude):
            return self._tilts.setdefault(system, TiltFilter()).filter_attitude(stamp, message)
        if not isinstance(message, RcChannels):
            return None
        watch = self._rc.setdefault(system, RcChangeFilter())
        if len(message.values_us) < len(watch.told):
            return None  # ArduPilot sends the first eight channels once more
        return watch.filter_channels(stamp, message.values_us)

    def _read_height_target(self, system: int, name: str, down_m: float) -> HeightTarget | None:
        """Return how far PX4 is below what it wants, where it says both; ArduPilot says the difference."""
        if name == LOCAL_POSITION:
            self._downs_m[system] = down_m
            return None
        is_px4 = self._autopilots.get(system) == PX4.number
        return filter_implausible(HeightTarget(self._downs_m.get(system, math.nan) - down_m)) if is_px4 else None

    def _is_speaker(self, system: int, component: int, beat: Heartbeat) -> bool:
        """Return whether a component with an autopilot's HEARTBEAT is the one that speaks for its system."""
        known = self._speakers.get(system, AutopilotComponent())
        speaker = self._speakers[system] = update_autopilot_component(known, component, beat)
        if speaker.component != known.component and (before := self._sources.get(system << 8 | known.component)):
            before.vehicle = False
        return speaker.component == component

    def _read_statustext(self, stamp: int, system: int, component: int, frame: Frame) -> Iterator[Record]:
        """Yield what a vehicle's autopilot says in words."""
        if component == self._speakers.get(system, AutopilotComponent()).component:
            source = (system, component)
            for text in self._texts.add_part(source, frame.severity, frame.text, frame.id, frame.chunk_seq):
                yield stamp, system, text


def _twins_heard(source: _Source, stamp: int, system: int, frame: Frame) -> Iterator[Record]:
    """Follow where a vehicle is, and yield once that it is two."""
    known, place = source.twins, (frame.lat / 1e7, frame.lon / 1e7)
    source.twins = add_reported_position(known, ReportedPosition(stamp / 1e6, frame.time_boot_ms / 1e3, *place))
    if source.twins.are_two and not known.are_two:
        yield stamp, system, DoubleHeard(system, ())


def _boot_usec(frame: bytes) -> int:
    """Return the time since its vehicle's boot that a frame begins with."""
    return 1000 * int.from_bytes(payload_of(frame, 4), "little")


def _is_known(buffer: bytes, at: int, end: int) -> bool:
    """Return whether a frame of a kind that is read here begins behind a time, whole."""
    frame = buffer[at + STAMP : end]
    kind = KINDS.get(message_id_of(frame))
    return kind is not None and has_valid_checksum(frame, kind.extra)
