"""Read telemetry logs (.tlog) as our messages, decoded by a link's codec.

A record is [8 bytes, microseconds since 1970, big-endian][a MAVLink frame]; a file may hold both directions and any
number of vehicles. For most frames only the header is read, for its sequence number; frames that may hold new data go
to the codec, which takes most of the time of a long log. The file is read in pieces, so memory does not grow with its
length.

The recording computer stamps the log, and its clock may be set in flight: by satellites, by a network, by hand, from
1970 to today, or an hour back. The vehicles' messages hold their own time since boot. After a clock step both continue
alike, apart by that step; after a silent link they agree as before, at the latest when delayed frames have arrived.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.chunks import read_in_chunks
from executor.adapters.mavlink import message_readers
from executor.adapters.mavlink.codec import FrameParser, MavlinkCodec
from executor.adapters.mavlink.frame_layout import HEADS, V1, V2, has_valid_checksum, message_id_of, payload_of
from executor.adapters.mavlink.message_readers import Frame
from executor.core.interface import messages
from executor.core.interface.messages import DoubleHeard, FlightMessage, HeightTarget, ListedItem, Message, Traffic
from executor.core.interface.recorded_log import Record, RecordedFile, is_wanted_setting
from executor.core.state.link_quality import DuplicateIdWatch, ReportedPosition, add_reported_position
from executor.core.telemetry.plausibility import filter_implausible
from missions import PX4

BACK_USEC = 1_000_000
"""Most time by which frames of several links are out of order."""
AHEAD_USEC = 2_000_000
"""Pauses shorter than this are normal for a link."""
SET_USEC = 1_500_000
"""Least step of the recorder's clock that counts as set."""
ALIKE_USEC = 500_000
"""Tolerance between both clocks after a step; delayed frames catch up by more."""
SEEN_USEC, LOOKS_USEC = 2_500_000, 10_000_000
"""Time for which both clocks must agree after a short step, and look-ahead for it."""
SHORT_USEC = 60_000_000
LONGEST_PAUSE_USEC = 86_400_000_000
"""Without a vehicle clock, a longer pause counts as a clock step."""
EVERY_USEC = 450_000
"""Interval of battery reports; watchpoints need two a second."""
SLOW_USEC = 950_000
"""Interval of all other messages; one a second suffices."""
POSITION_USEC = 1_400_000
"""Interval of positions; at two seconds each would count as late."""
STEADY_USEC = 2_900_000
"""Interval of messages that repeat until they change."""
RC_USEC = 190_000
"""Interval of RC channels, so that a switch is seen at once."""
MARKS = frozenset(HEADS)
STAMP = 8
LONGEST = STAMP + 10 + 255 + 2 + 13
STAMP_TOLERANCE_USEC = 3 * 86400 * 1_000_000
"""In a damaged log, the next record must be within three days of the last one (as in pymavlink)."""
GAP_USEC = 900_000
"""Silence of a system after which passing time is reported before its next message."""
BEAT_FRAMES = 20
"""Frames that one HEARTBEAT stands for, as not every frame is read; texts wait that long for further parts."""
ENOUGH_FRAMES = 80
"""Number of frames after which counts are reported with a HEARTBEAT."""
HALF = 128
"""Sequence numbers ahead by more than this arrived out of order."""
POSITION = "GLOBAL_POSITION_INT"
LOCAL_POSITION, TARGET_POSITION = "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED"
MOST_NAMED = 8
BOOT_TIMED = frozenset({POSITION, "ATTITUDE"})
_HEAD = struct.Struct(">Q5B")
LOOKAHEAD = 1 << 16
"""Bytes of a piece held back for the next one, as look-ahead after a clock step."""
LEAST = 18
"""Bytes of the shortest record: a time, and a MAVLink 1 frame without payload."""


@dataclass(frozen=True, slots=True)
class BootTime:
    """A vehicle's time since boot, and the log's time, in microseconds."""

    boot_usec: int
    stamp_usec: int


def was_set_by_usec(pairs: Sequence[tuple[BootTime, BootTime]], stamp_usec: int, before_usec: int) -> int:
    """Return by how much a clock was set between two stamps; 0 if it was not.

    Args:
        pairs: For each report after the step, in order: its vehicle's last report before, and the report.
        stamp_usec: Stamp of the first record after it.
        before_usec: Stamp of the last record before it.
    """
    leap_usec = stamp_usec - before_usec
    off = [
        (after.stamp_usec - before.stamp_usec) - (after.boot_usec - before.boot_usec)
        for before, after in pairs
        if after.boot_usec >= before.boot_usec  # else it rebooted, and tells nothing about the time between
    ]
    if not off:
        return leap_usec if not -BACK_USEC <= leap_usec < LONGEST_PAUSE_USEC else 0
    seen_usec = pairs[-1][1].stamp_usec - stamp_usec
    alike = max(off) - min(off) <= ALIKE_USEC and (seen_usec >= SEEN_USEC or abs(leap_usec) >= SHORT_USEC)
    if alike and abs(off[-1]) >= SET_USEC:
        return off[-1]
    return leap_usec if leap_usec < -BACK_USEC else 0


ORDERS = frozenset({"COMMAND_LONG", "COMMAND_INT", "SET_MODE"})
ITEMS = frozenset({"MISSION_ITEM", "MISSION_ITEM_INT"})
_EVERY_USEC = {
    **dict.fromkeys(("SYS_STATUS", "GPS_RAW_INT", "GPS2_RAW", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"), SLOW_USEC),
    **dict.fromkeys(("NAV_CONTROLLER_OUTPUT", LOCAL_POSITION, TARGET_POSITION), SLOW_USEC),
    **dict.fromkeys(("MISSION_CURRENT", "EXTENDED_SYS_STATE"), STEADY_USEC),
    **dict.fromkeys(("GLOBAL_POSITION_INT", "RADIO_STATUS"), POSITION_USEC),
    **dict.fromkeys(("BATTERY_STATUS", "ATTITUDE"), EVERY_USEC),
    **dict.fromkeys(("RC_CHANNELS_RAW", "RC_CHANNELS"), RC_USEC),
    **dict.fromkeys(("HEARTBEAT", "STATUSTEXT", "COMMAND_ACK", "PARAM_VALUE", "MISSION_ITEM_REACHED"), 0),
    **dict.fromkeys(ORDERS | ITEMS, 0),
}
"""Wanted interval by message; SiK radios send RADIO_STATUS too."""
NO_BEATS = ORDERS | ITEMS | {
    "STATUSTEXT", message_readers.EVENT_NAME, "COMMAND_ACK", "PARAM_VALUE", "RC_CHANNELS_RAW", "RC_CHANNELS",
    "ATTITUDE", LOCAL_POSITION, TARGET_POSITION,
}  # fmt: skip
"""Messages that do not mark passing time when they are not from a vehicle."""


class WantedKind(NamedTuple):
    """A message that is read."""

    name: str
    every_usec: int
    """Shortest interval; more frequent messages are skipped."""
    extra: int
    """CRC_EXTRA, part of its checksum."""


KINDS: Mapping[int, WantedKind] = {
    kind.id: WantedKind(kind.msgname, _EVERY_USEC[kind.msgname], kind.crc_extra)
    for kind in mav.mavlink_map.values()
    if kind.msgname in _EVERY_USEC
} | {message_readers.EVENT: WantedKind(message_readers.EVENT_NAME, 0, message_readers.EVENT_EXTRA)}
"""Wanted messages by id."""


@dataclass(slots=True)
class _Source:
    """One system and component."""

    seq: int
    received: int = 1
    missing: int = 0
    vehicle: bool = False
    boot: BootTime | None = None
    """Last reported time since boot."""
    twins: DuplicateIdWatch = field(default_factory=DuplicateIdWatch)


@dataclass(slots=True)
class _MessageStream:
    """One source's messages of one kind."""

    source: _Source
    kind: WantedKind | None
    """None if these messages are not read."""
    system: int
    component: int
    every_usec: int
    newest_usec: int = -STEADY_USEC
    """Time of the last one read."""
    told_usec: int = -STEADY_USEC
    """Time of the last one passed on, for messages that are all read."""


@dataclass(slots=True)
class TelemetryFile(RecordedFile):
    """A .tlog, read once from beginning to end."""

    on_board = False
    frames: int = 0
    _parser: FrameParser = field(default_factory=lambda: FrameParser(in_datagrams=True))
    _codec: MavlinkCodec = field(default_factory=lambda: MavlinkCodec(overhears=True))
    _sources: dict[int, _Source] = field(default_factory=dict)
    _vehicles: dict[int, _Source] = field(default_factory=dict)
    """Autopilot of each system, once its HEARTBEAT has been received."""
    _lanes: dict[bytes, _MessageStream] = field(default_factory=dict)
    """Streams by system, component and message id, as in the frame."""
    _stamp: int = 0
    """Recorded time of the last record."""
    _shift: int = 0
    """Correction for steps of the recorder's clock since the first record."""
    _began: int = 0
    _sets: int = 0
    _channels: dict[int, int] = field(default_factory=dict)
    """Channels reported by each system; ArduPilot repeats the first eight."""
    _downs_m: dict[int, float] = field(default_factory=dict)
    """Local down position of each system."""

    def read_records(self) -> Iterator[Record]:
        """Yield (t_usec, system, message) in the order of the file; a message of None is passing time.

        System 0 stands for messages about the link as a whole.
        """
        yield from read_in_chunks(self.path, self._read_piece)
        for (system, _), text in self._codec.texts.list_unfinished_texts():
            yield self._stamp, system, text
        self._explain_no_vehicle()

    def _explain_no_vehicle(self) -> None:
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
        """Yield the records in a piece's complete frames; return where the rest begins."""
        at, size, in_garbage = 0, len(buffer), False
        stop = size if last else size - LOOKAHEAD
        while at < stop:
            if at + LEAST > size:
                self.skipped.truncated = 1  # only the end of the file can do that, once
                break
            stamp, key, seq, end = _read_head(buffer, at)
            if not key or not self._is_record_at(buffer, at, end):
                self.skipped.garbage_runs += not (in_garbage or self.skipped.truncated)
                in_garbage = True
                at += 1
                continue
            if not -BACK_USEC <= stamp - self._stamp < AHEAD_USEC:
                self._follow_clock(buffer, at)
            in_garbage, self._stamp = False, stamp
            stamp += self._shift
            self.frames += 1
            lane = self._lanes.get(key) or self._open_stream(key, seq)
            source = lane.source
            if 0 < (ahead := (seq - source.seq) & 255) < HALF:
                source.missing += ahead - 1  # lost, by its sequence number
                source.received += 1
                source.seq = seq
            if source.vehicle:
                if not 0 <= stamp - self.heard.get(lane.system, 0) < GAP_USEC:
                    yield stamp, 0, None
                self.heard[lane.system] = stamp
            if lane.kind is not None and not 0 <= stamp - lane.newest_usec < lane.every_usec:
                yield from self._read_frame(lane.kind, buffer[at + STAMP : end], stamp, lane)
            at = end
        return at

    def _follow_clock(self, buffer: bytes, at: int) -> None:
        """Shift stamps from a record on if its stamp is far from the last one and the clock was set there."""
        stamp, known = int.from_bytes(buffer[at : at + STAMP], "big"), self._stamp
        if not known:
            self._began = stamp
            return
        by_usec = was_set_by_usec(self._boots_after(buffer, at), stamp + self._shift, known + self._shift)
        if not by_usec:
            return
        self._sets += 1
        self.skipped.time_back += by_usec < 0
        if self._sets <= MOST_NAMED:
            at_s = (known + self._shift - self._began) / 1e6
            own = f"by {by_usec / 1e6:+.1f} s at {at_s:.1f} s: times go on by the vehicles' own"
            self.notes.append(f"the recorder's clock was set {own}")
        self._shift -= by_usec

    def _boots_after(self, buffer: bytes, at: int) -> list[tuple[BootTime, BootTime]]:
        """Return the vehicles' own times after a step."""
        found, first = list[tuple[BootTime, BootTime]](), int.from_bytes(buffer[at : at + STAMP], "big")
        while at + LONGEST <= len(buffer):
            stamp, key, _, end = _read_head(buffer, at)
            if not key or not -LOOKS_USEC < stamp - first < LOOKS_USEC:
                break  # another step
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
        """Return a new stream of a source's messages of one kind."""
        system, component, number = key[0], key[1], int.from_bytes(key[2:], "little")
        source = self._sources.setdefault(system << 8 | component, _Source(seq))
        kind = KINDS.get(number)
        every_usec = 0 if kind is None or kind.name == POSITION or self.every_record else kind.every_usec
        lane = self._lanes[key] = _MessageStream(source, kind, system, component, every_usec)
        return lane

    def _read_frame(self, kind: WantedKind, frame: bytes, stamp: int, lane: _MessageStream) -> Iterator[Record]:
        source, lane.newest_usec = lane.source, stamp
        frames = self._parser.feed(frame)
        if not frames:
            self.skipped.bad_checksums += 1
            return
        if kind.name in BOOT_TIMED:
            source.boot = BootTime(_boot_usec(frame), stamp)
        yield from self._interpret(kind.name, frames[0], stamp, lane)
        if not source.vehicle and kind.name not in NO_BEATS:
            yield stamp, 0, None

    def _interpret(self, name: str, frame: Frame, stamp: int, lane: _MessageStream) -> Iterator[Record]:
        """Yield a frame's messages, as a link's codec reads it, and those that no link requests."""
        heard: tuple[Message | None, ...] = ()
        if name in ITEMS:
            yield from self._read_mission_item(stamp, lane.system, frame)
        elif name in {LOCAL_POSITION, TARGET_POSITION}:
            heard = (self._read_height_target(lane.system, name, frame.z),)
        elif name == "RC_CHANNELS_RAW":
            heard = (message_readers.read_channels(frame),)
        else:
            [decoded] = self._codec.read([frame])
            heard = (decoded.message, *decoded.more)
            if name == POSITION and decoded.own:
                yield from self._follow_position(stamp, lane, decoded.message)
        for message in heard:
            if lane.source.vehicle or name != "COMMAND_ACK":  # before that it is unknown which system follows it
                yield from self._tell(stamp, lane, message)

    def _tell(self, stamp: int, lane: _MessageStream, message: Message | None) -> Iterator[Record]:
        """Yield the records of a message; a system not yet known as a vehicle yields only texts."""
        system, source = lane.system, lane.source
        match message:
            case messages.StationHeard():
                self.stations.add(system)
            case messages.OrderSeen(to=target):
                yield stamp, target, replace(message, to=0)
            case messages.Radio():
                yield stamp, 0, message
            case messages.StatusText():
                yield stamp, system, message
            case messages.Heartbeat():
                yield from self._follow_heartbeat(stamp, lane, message)
            case messages.ParamValue(name, value) if source.vehicle and is_wanted_setting(name):
                yield stamp, system, messages.VehicleSetting(name, value)
            case messages.RcChannels(values) if source.vehicle:
                most = self._channels[system] = max(len(values), self._channels.get(system, 0))
                if len(values) == most:
                    yield stamp, system, message
            case _ if (
                source.vehicle and isinstance(message, FlightMessage) and not isinstance(message, messages.Position)
            ):
                yield stamp, system, message

    def _follow_heartbeat(self, stamp: int, lane: _MessageStream, beat: messages.Heartbeat) -> Iterator[Record]:
        """Yield a system's HEARTBEAT, and the reports due with it."""
        system, source = lane.system, lane.source
        if (before := self._vehicles.get(system)) is not None:
            before.vehicle = False
        self._vehicles[system] = source
        source.vehicle = True
        if source.received + source.missing >= ENOUGH_FRAMES:
            yield stamp, system, Traffic(source.received, source.missing)
            source.received = source.missing = 0
        yield stamp, system, beat
        for text in self._codec.texts.count_frame((system, lane.component), BEAT_FRAMES):
            yield stamp, system, text

    def _follow_position(self, stamp: int, lane: _MessageStream, place: Message | None) -> Iterator[Record]:
        """Yield positions at intervals, and one when a system proves to be two vehicles, which intervals may hide."""
        source = lane.source
        is_due = self.every_record or not 0 <= stamp - lane.told_usec < POSITION_USEC
        self.skipped.impossible += is_due and place is None
        if not source.vehicle:
            return
        lane.told_usec = stamp if is_due else lane.told_usec
        if isinstance(place, messages.Position):
            known, told = source.twins, ReportedPosition(stamp / 1e6, place.boot_s, place.lat_deg, place.lon_deg)
            source.twins = add_reported_position(known, told)
            if source.twins.are_two and not known.are_two:
                yield stamp, lane.system, DoubleHeard(lane.system, ())
            if is_due:
                yield stamp, lane.system, place

    def _read_mission_item(self, stamp: int, by: int, frame: Frame) -> Iterator[Record]:
        """Yield an item of a vehicle's mission, uploaded or downloaded.

        Items of a fence, of rally points, or to fly to at once are skipped.
        """
        known = self._codec.autopilots
        of = by if by in known else frame.target_system
        whole = not frame.mission_type and frame.current <= 1 and all(map(math.isfinite, (frame.x, frame.y, frame.z)))
        if whole and of in known:
            yield stamp, of, ListedItem(message_readers.read_mission_item(frame))

    def _read_height_target(self, system: int, name: str, down_m: float) -> HeightTarget | None:
        """Return PX4's height below its target if it reports both; ArduPilot reports the difference."""
        if name == LOCAL_POSITION:
            self._downs_m[system] = down_m
            return None
        is_px4 = self._codec.autopilots.get(system) == PX4.number
        return filter_implausible(HeightTarget(self._downs_m.get(system, math.nan) - down_m)) if is_px4 else None

    def _is_record_at(self, buffer: bytes, at: int, end: int) -> bool:
        size = len(buffer)
        if end > size:
            self.skipped.truncated = 1
            return False
        stamp = int.from_bytes(buffer[at : at + 8], "big")
        if self._stamp and abs(stamp - self._stamp) >= STAMP_TOLERANCE_USEC:
            # A clock that is set in flight may jump by years: then the next record must agree.
            following = int.from_bytes(buffer[end : end + 8], "big")
            return _is_known(buffer, at, end) and abs(following - stamp) < STAMP_TOLERANCE_USEC
        is_followed = end == size or (end + STAMP < size and buffer[end + STAMP] in MARKS)
        return is_followed or _is_known(buffer, at, end)


def _read_head(buffer: bytes, at: int) -> tuple[int, bytes, int, int]:
    """Return a record's stamp, sender and kind, sequence number, and end; no sender if none begins here."""
    stamp, mark, length, flags, _, seq = _HEAD.unpack_from(buffer, at)
    if mark == V2 and flags <= 1:
        return stamp, buffer[at + 13 : at + 18], seq, at + 18 + length + (15 if flags else 2)
    # In MAVLink 1 the fields have other offsets.
    return stamp, buffer[at + 11 : at + 14] if mark == V1 else b"", flags, at + 16 + length


def _boot_usec(frame: bytes) -> int:
    """Return the time since boot with which a frame begins."""
    return 1000 * int.from_bytes(payload_of(frame, 4), "little")


def _is_known(buffer: bytes, at: int, end: int) -> bool:
    """Return whether a complete frame of a known kind follows a time here."""
    frame = buffer[at + STAMP : end]
    kind = KINDS.get(message_id_of(frame))
    return kind is not None and has_valid_checksum(frame, kind.extra)
