"""Telemetry logs (.tlog) to our messages, faster than a codec that decodes them all.

A record is [8 bytes, microseconds since 1970, big-endian][a MAVLink frame]; both directions and any number of vehicles
may share a file. Only the headers of most frames are read, for their sequence numbers. What some watchpoint needs is
unpacked here, field by field; `codec` stays the definition (a test holds the two against each other). The file is read
in pieces, so a log of any length takes the same memory.
"""

from __future__ import annotations

import math
import struct
from binascii import crc_hqx
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from executor.adapters.mavlink import integers
from executor.adapters.mavlink.texts import Texts
from executor.core import words
from executor.core.hearing.plausible import plausible
from executor.core.hearing.speaker import Speaker, speaker_after
from executor.core.messages import (
    Battery,
    FlightMessage,
    Heartbeat,
    LandedState,
    MissionCurrent,
    MissionReached,
    OrderSeen,
    Position,
    Radio,
    RcChannels,
    Setting,
    StatusText,
    SystemStatus,
    Traffic,
)
from executor.core.recording import MODE_COMMANDS, RcWatch, Record, Skipped, is_wanted_setting
from missions import AUTOPILOTS

V1, V2 = 0xFE, 0xFD
MARKS = frozenset({V1, V2})
STAMP = 8
CHUNK = 1 << 20
LONGEST = STAMP + 10 + 255 + 2 + 13
STAMP_TOLERANCE_USEC = 3 * 86400 * 1_000_000
"""Where a log was damaged, a record counts whose time is within three days of the last (as pymavlink does)."""
EVERY_USEC = 450_000
"""Of a battery's reports no watchpoint needs more than two a second."""
SLOW_USEC = 950_000
"""Of everything else one a second is enough."""
POSITION_USEC = 1_900_000
"""Of positions one in two seconds: without a plan they say how fast it flies and how far from home."""
STEADY_USEC = 2_900_000
"""Of what is repeated until it changes, one in three seconds."""
RC_USEC = 190_000
GAP_USEC = 900_000
"""Where nothing came of a system for so long, it is said that time passed before its next message."""
ENOUGH_FRAMES = 80
"""Counts of frames are handed on with a HEARTBEAT once there are as many."""
HALF = 128
MOST_NAMED = 8
"""A sequence number that is ahead by more is one that was overtaken on the way."""
GCS_TYPE, NO_AUTOPILOT = 6, 8
ROUND_TWICE = frozenset(dialect.number for dialect in AUTOPILOTS if dialect.rounds_twice)
"""MAV_AUTOPILOT."""
DO_SET_MODE = 176
PX4 = 12
ACCEPTED = frozenset({0, 5})
"""MAV_RESULT: accepted, in progress."""
PREARM_CHECK = 0x10000000
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_HEAD = struct.Struct(">Q10B")
HEAD_SIZE = _HEAD.size


def checksum(data: bytes) -> int:
    """Return MAVLink's checksum (CRC-16/MCRF4XX): the standard library's runs the other way round.

    >>> checksum(b"123456789") == 0x6F91
    True
    """
    turned = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[turned >> 8] | _REVERSED[turned & 255] << 8


@dataclass(frozen=True, slots=True)
class MessageKind:
    """One message that is read."""

    extra: int
    """CRC_EXTRA: part of its checksum."""
    layout: struct.Struct
    """All fields in the order on the wire; what a sender left out at the end is zero."""
    read: Callable[..., FlightMessage | None]
    every_usec: int = 0
    """One that follows another sooner than this is passed over."""
    special: bool = False
    """Whether it is not simply a vehicle's word about itself."""

    def fields(self, buffer: bytes, payload: int, length: int) -> tuple[Any, ...]:
        """Return all fields of a message; what its sender left out at the end is zero."""
        need = self.layout.size
        raw = buffer[payload : payload + min(need, length)]
        return self.layout.unpack(raw if len(raw) == need else raw.ljust(need, b"\0"))


def _heartbeat(mode: int, kind: int, autopilot: int, base: int, status: int, _: int) -> Heartbeat | None:
    if kind == GCS_TYPE or autopilot == NO_AUTOPILOT:
        return None
    return Heartbeat(autopilot, mode, bool(base & 128), status, kind)


def _percent(value: int) -> float | None:
    return float(value) if 0 <= value <= 100 else None


def _system_status(*fields: int) -> SystemStatus:
    present, enabled, healthy, _, voltage = fields[:5]
    return SystemStatus(
        remaining_pct=_percent(fields[12]),
        voltage_v=None if voltage in {0, 65535} else voltage / 1e3,
        unhealthy=enabled & ~healthy,
        prearm_ok=bool(healthy & PREARM_CHECK) if present & PREARM_CHECK else None,
    )


def _position(boot: int, lat: int, lon: int, alt: int, rel: int, *rest: int) -> Position:
    north, east, down, heading = rest
    return Position(
        boot / 1e3, lat / 1e7, lon / 1e7, alt / 1e3, rel / 1e3, north / 100, east / 100, down / 100,
        None if heading == 65535 else heading / 100,
    )  # fmt: skip


def _battery(*fields: int) -> Battery:
    consumed, cells, current = fields[0], fields[3:13], fields[13]
    number, remaining, charge_state, extra, faults = fields[14], fields[17], fields[19], fields[20:24], fields[25]
    known = [cell for cell in cells if cell != 65535]
    known += [cell for cell in extra if cell not in {0, 65535}]
    return Battery(
        battery=number,
        remaining_pct=_percent(remaining),
        voltage_v=sum(known) / 1e3 if known else None,
        current_a=None if current < 0 else current / 100,
        consumed_ah=None if consumed < 0 else consumed / 1e3,
        charge_state=charge_state,
        faults=faults,
        cells_v=tuple(cell / 1e3 for cell in known) if len(known) > 1 else (),
    )


def _radio(_: int, __: int, rssi: int, remote: int, buffer: int, noise: int, remote_noise: int) -> Radio:
    return Radio(
        rssi=None if rssi == 255 else rssi,
        remote_rssi=None if remote == 255 else remote,
        noise=None if noise == 255 else noise,
        remote_noise=None if remote_noise == 255 else remote_noise,
        free_buffer_pct=buffer if buffer <= 100 else None,
    )


def _mission_current(seq: int, total: int, _: int, __: int, number: int) -> MissionCurrent:
    return MissionCurrent(seq, total or None, number or None)


def _landed(_: int, state: int) -> LandedState:
    return LandedState({1: True, 2: False, 3: False, 4: False}.get(state))


NO_CHANNEL = 65535
"""Of RC_CHANNELS and RC_CHANNELS_RAW."""


def _channels_raw(_: int, *fields: int) -> RcChannels:
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in fields[:8]))


def _channels(_: int, *fields: int) -> RcChannels:
    return RcChannels(tuple(0 if value == NO_CHANNEL else value for value in fields[: min(18, fields[18])]))


STAND_IN_USEC = 4_000_000
"""SYS_STATUS stands in for BATTERY_STATUS; beside it one in five seconds is enough."""


def _never(*_: object) -> None:
    """Say nothing: it is not the message alone that tells."""


HEARTBEAT, SYSTEM, POSITION, BATTERY, STATUSTEXT, COMMAND_LONG, COMMAND_INT, SET_MODE = 0, 1, 33, 147, 253, 76, 75, 11
COMMAND_ACK, PARAM_VALUE, RC_CHANNELS_RAW, RC_CHANNELS = 77, 22, 35, 65
KINDS: dict[int, MessageKind] = {
    HEARTBEAT: MessageKind(50, struct.Struct("<IBBBBB"), _heartbeat, special=True),
    SYSTEM: MessageKind(124, struct.Struct("<IIIHHhHHHHHHb"), _system_status, SLOW_USEC),
    POSITION: MessageKind(104, struct.Struct("<IiiiihhhH"), _position, POSITION_USEC),
    42: MessageKind(28, struct.Struct("<HHBBI"), _mission_current, STEADY_USEC),
    46: MessageKind(11, struct.Struct("<H"), MissionReached),
    109: MessageKind(185, struct.Struct("<HHBBBBB"), _radio, POSITION_USEC, special=True),
    BATTERY: MessageKind(154, struct.Struct("<iih10HhBBBbiB4HBI"), _battery, EVERY_USEC),
    245: MessageKind(130, struct.Struct("<BB"), _landed, STEADY_USEC),
    STATUSTEXT: MessageKind(83, struct.Struct("<B50sHB"), _never, special=True),
    COMMAND_LONG: MessageKind(152, struct.Struct("<7fHBB"), _never, special=True),
    COMMAND_INT: MessageKind(158, struct.Struct("<4fiifHBB"), _never, special=True),
    SET_MODE: MessageKind(89, struct.Struct("<IBB"), _never, special=True),
    COMMAND_ACK: MessageKind(143, struct.Struct("<HB"), _never, special=True),
    PARAM_VALUE: MessageKind(220, struct.Struct("<fHH16sB"), _never, special=True),
    RC_CHANNELS_RAW: MessageKind(244, struct.Struct("<I8HBB"), _channels_raw, RC_USEC, special=True),
    RC_CHANNELS: MessageKind(118, struct.Struct("<I18HBB"), _channels, RC_USEC, special=True),
}
"""By message id: what is read. The numbers are those of common.xml; RADIO_STATUS is also what SiK radios send."""
ORDERS = frozenset({COMMAND_LONG, COMMAND_INT, SET_MODE})
TOLD_BY_VEHICLES = frozenset({COMMAND_ACK, PARAM_VALUE, RC_CHANNELS_RAW, RC_CHANNELS})


@dataclass(slots=True)
class _Source:
    """One system and component."""

    seq: int
    received: int = 1
    missing: int = 0
    vehicle: bool = False
    rounds_twice: bool = False
    """Whether SYS_STATUS says more than BATTERY_STATUS, as PX4's does."""


@dataclass(slots=True)
class TelemetryFile:
    """A .tlog being read once, from its beginning to its end."""

    path: Path
    skipped: Skipped = field(default_factory=Skipped)
    stations: set[int] = field(default_factory=set)
    """Systems that sent a ground station's HEARTBEAT."""
    heard: dict[int, int] = field(default_factory=dict)
    """When any frame of a vehicle's autopilot came last, whether or not it was handed on."""
    frames: int = 0
    notes: list[str] = field(default_factory=list)
    _texts: Texts = field(default_factory=Texts)
    _sources: dict[int, _Source] = field(default_factory=dict)
    _speakers: dict[int, Speaker] = field(default_factory=dict)
    """By system."""
    _newest: dict[int, int] = field(default_factory=dict)
    """When a message was read last, by its source and id."""
    _stamp: int = 0
    _rc: dict[int, RcWatch] = field(default_factory=dict)
    _autopilots: dict[int, int] = field(default_factory=dict)

    def records(self) -> Iterator[Record]:
        """Yield (t_usec, system, message) in the order of the file; a message of None is time passing.

        System 0 stands for what is about the link as a whole.
        """
        with self.path.open("rb") as file:
            buffer, base = b"", 0
            while True:
                more = file.read(CHUNK)
                buffer = buffer[base:] + more
                base = yield from self._piece(buffer, last=not more)
                if not more:
                    break
        self._explain()

    def _explain(self) -> None:
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

    def _piece(self, buffer: bytes, *, last: bool) -> Generator[Record, None, int]:  # noqa: C901, PLR0912, PLR0915
        """Yield what whole records of a piece say; returns where the rest begins. Calls would take most of the time."""
        at, size, known, in_garbage, frames = 0, len(buffer), self._stamp, False, 0
        stop = size if last else size - 2 * LONGEST
        sources, kinds, newest, heard, head = self._sources, KINDS, self._newest, self.heard, _HEAD.unpack_from
        while at < stop:
            if at + HEAD_SIZE > size:
                self.skipped.truncated = 1  # only the end of the file can do that, once
                break
            stamp, mark, length, flags, _, seq, system, component, low, middle, high = head(buffer, at)
            if mark == V2:
                number, payload = low | middle << 8 | high << 16, at + 18
                end = payload + length + (15 if flags & 1 else 2)
            else:  # the fields of the older version stand elsewhere
                seq, system, component, number = buffer[at + 10 : at + 14]
                payload, end = at + 14, at + 16 + length
            if not (
                end + STAMP < size
                and buffer[end + STAMP] in MARKS
                and mark in MARKS
                and -STAMP_TOLERANCE_USEC < stamp - (known or stamp) < STAMP_TOLERANCE_USEC
                and (mark == V1 or flags < 2)
            ) and not self._begins(buffer, at, end, known):
                self.skipped.garbage_runs += not (in_garbage or self.skipped.truncated)
                in_garbage = True
                at += 1
                continue
            in_garbage = False
            frames += 1
            known = stamp
            key = system << 8 | component
            source = sources.get(key)
            if source is None:
                sources[key] = source = _Source(seq)
            elif 0 < (ahead := (seq - source.seq) & 255) < HALF:
                source.missing += ahead - 1  # that its sequence number says are lost
                source.received += 1
                source.seq = seq
            if source.vehicle:
                if not 0 <= stamp - heard.get(system, 0) < GAP_USEC:
                    yield stamp, 0, None
                heard[system] = stamp
            kind = kinds.get(number)
            if kind is not None:
                key = key << 24 | number
                every = kind.every_usec if number != SYSTEM else self._stands_in_usec(key, stamp, source)
                if every == 0 or not 0 <= stamp - newest.get(key, -STAND_IN_USEC) < every:
                    newest[key] = stamp
                    if not _whole(buffer, at):
                        self.skipped.bad_checksums += 1
                    else:
                        fields = kind.fields(buffer, payload, length)
                        message = kind.read(*fields)
                        message = None if message is None else plausible(message)
                        if message is not None and source.vehicle and not kind.special:
                            yield stamp, system, message
                        else:
                            yield from self._special((stamp, system, component, number), fields, message, source)
            at = end
        self._stamp = known
        self.frames += frames
        return at

    def _stands_in_usec(self, key: int, stamp: int, source: _Source) -> int:
        """Return how often SYS_STATUS is wanted: seldom beside BATTERY_STATUS, if that says the same."""
        if source.rounds_twice:
            return SLOW_USEC
        beside = 0 <= stamp - self._newest.get(key - SYSTEM + BATTERY, -STAND_IN_USEC) < STAND_IN_USEC
        return STAND_IN_USEC if beside else SLOW_USEC

    def _begins(self, buffer: bytes, at: int, end: int, known: int) -> bool:
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
            return _whole(buffer, at) and abs(following - stamp) < STAMP_TOLERANCE_USEC
        return end == size or _whole(buffer, at)

    def _special(
        self, head: tuple[int, int, int, int], fields: tuple[Any, ...], message: FlightMessage | None, source: _Source
    ) -> Iterator[Record]:
        """Yield what is about the link, about orders to others, or begins a vehicle."""
        stamp, system, component, number = head
        if number == STATUSTEXT:
            yield from self._texted(stamp, system, component, fields)
        elif number in ORDERS:
            yield from self._ordered(stamp, system, number, fields)
        elif isinstance(message, Heartbeat) and self._speaks(system, component, message):
            self._autopilots[system] = message.autopilot
            source.vehicle, source.rounds_twice = True, message.autopilot in ROUND_TWICE
            if source.received + source.missing >= ENOUGH_FRAMES:
                yield stamp, system, Traffic(source.received, source.missing)
                source.received = source.missing = 0
            yield stamp, system, message
        elif isinstance(message, Radio):
            yield stamp, 0, message
        elif number in TOLD_BY_VEHICLES:
            told = self._of_vehicle(stamp, system, number, fields, message) if source.vehicle else None
            if told is not None:
                yield stamp, system, told
        else:
            if number == HEARTBEAT and fields[1] == GCS_TYPE:
                self.stations.add(system)
            self.skipped.impossible += number == POSITION and message is None
            yield stamp, 0, None

    def _ordered(self, stamp: int, by: int, number: int, fields: tuple[Any, ...]) -> Iterator[Record]:
        """Yield an order to change the mode, as of whom it is for."""
        command, target = (DO_SET_MODE, fields[1]) if number == SET_MODE else (fields[7], fields[8])
        if command in MODE_COMMANDS:
            yield stamp, target, OrderSeen(command, self._ordered_mode(number, fields, target), by)

    def _ordered_mode(self, number: int, fields: tuple[Any, ...], target: int) -> int | None:
        if number == SET_MODE:
            return int(fields[0])
        if fields[7] != DO_SET_MODE or not all(0 <= value < HALF for value in fields[1:3]):
            return None
        main, sub = int(fields[1]), int(fields[2])
        return main << 16 | sub << 24 if self._autopilots.get(target) == PX4 else main

    def _of_vehicle(
        self, stamp: int, system: int, number: int, fields: tuple[Any, ...], message: FlightMessage | None
    ) -> FlightMessage | None:
        """Return what a vehicle says of an order, of its settings and of its pilot's transmitter."""
        if number == COMMAND_ACK:
            command = DO_SET_MODE if fields[0] == SET_MODE else fields[0]  # ArduPilot 3 names the message
            return OrderSeen(command) if command in MODE_COMMANDS and fields[1] in ACCEPTED else None
        if number == PARAM_VALUE:
            name = words.shown(fields[3].split(b"\0", 1)[0].decode(errors="replace"))
            value = integers.from_wire(fields[0], fields[4], self._autopilots.get(system))
            return Setting(name, value) if is_wanted_setting(name) and math.isfinite(value) else None
        if not isinstance(message, RcChannels):
            return None
        watch = self._rc.setdefault(system, RcWatch())
        if len(message.values_us) < len(watch.told):
            return None  # ArduPilot sends the first eight channels once more
        return watch.news(stamp, message.values_us)

    def _speaks(self, system: int, component: int, beat: Heartbeat) -> bool:
        """Return whether a component with an autopilot's HEARTBEAT is the one that speaks for its system."""
        known = self._speakers.get(system, Speaker())
        speaker = self._speakers[system] = speaker_after(known, component, beat)
        if speaker.component != known.component and (before := self._sources.get(system << 8 | known.component)):
            before.vehicle = False
        return speaker.component == component

    def _texted(self, stamp: int, system: int, component: int, fields: tuple[Any, ...]) -> Iterator[Record]:
        """Yield what a vehicle's autopilot says in words."""
        if component == self._speakers.get(system, Speaker()).component:
            for text in self._said((system, component), fields):
                yield stamp, system, text

    def _said(self, source: tuple[int, int], fields: tuple[Any, ...]) -> list[StatusText]:
        severity, raw, number, part = fields
        return [*self._texts.passed(source), *self._texts.take(source, severity, raw, number, part)]


def _whole(buffer: bytes, at: int) -> bool:
    """Return whether a frame that is known here has its checksum."""
    if buffer[at + 8] == V2:
        number = buffer[at + 15] | buffer[at + 16] << 8 | buffer[at + 17] << 16
        stop = at + 18 + buffer[at + 9]
    else:
        number, stop = buffer[at + 13], at + 14 + buffer[at + 9]
    kind = KINDS.get(number)
    if kind is None or stop + 2 > len(buffer):
        return False
    return checksum(buffer[at + 9 : stop] + bytes((kind.extra,))) == buffer[stop] | buffer[stop + 1] << 8
