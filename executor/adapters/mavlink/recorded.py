"""Telemetry logs (.tlog) to our messages, faster than a codec that decodes them all.

A record is [8 bytes, microseconds since 1970, big-endian][a MAVLink frame]; both directions and any number of vehicles
may share a file. Only the headers of most frames are read, for their sequence numbers. What some watchpoint needs is
unpacked here, field by field; `codec` stays the definition (a test holds the two against each other). The file is read
in pieces, so a log of any length takes the same memory.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from executor.adapters.mavlink.texts import Texts
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
    StatusText,
    SystemStatus,
    Traffic,
)
from executor.core.recording import Record, Skipped

V1, V2 = 0xFE, 0xFD
STAMP = 8
CHUNK = 1 << 20
LONGEST = STAMP + 10 + 255 + 2 + 13
STAMP_TOLERANCE_USEC = 3 * 86400 * 1_000_000
"""Where a log was damaged, a record counts whose time is within three days of the last (as pymavlink does)."""
EVERY_USEC = 190_000
"""Of a kind that vehicles send faster than 5 Hz, no watchpoint needs more."""
GCS_TYPE, NO_AUTOPILOT = 6, 8
DO_SET_MODE = 176
MODE_COMMANDS = frozenset({16, 17, 18, 19, 20, 21, 22, 176, 185, 192, 193, 252, 300, 400})
"""MAV_CMD that a ground station changes a mode with, or what the vehicle does in it."""
PREARM_CHECK = 0x10000000
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_STAMP = struct.Struct(">Q")


def checksum(data: bytes) -> int:
    """Return MAVLink's checksum (CRC-16/MCRF4XX): the standard library's runs the other way round.

    >>> checksum(b"123456789") == 0x6F91
    True
    """
    turned = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[turned >> 8] | _REVERSED[turned & 255] << 8


@dataclass(frozen=True, slots=True)
class Kind:
    """One message that is read."""

    extra: int
    """CRC_EXTRA: part of its checksum."""
    layout: struct.Struct
    """All fields in the order on the wire; what a sender left out at the end is zero."""
    read: Callable[..., FlightMessage | None]


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


def _position(boot: int, lat: int, lon: int, alt: int, rel: int, *rest: int) -> Position | None:
    if lat == 0 and lon == 0:
        return None  # before there is a place both autopilots send zeros
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
        cells_v=tuple(cell / 1e3 for cell in known) if len(known) > 1 and max(known) < 5000 else (),
    )


def _radio(_: int, __: int, rssi: int, remote: int, buffer: int, noise: int, remote_noise: int) -> Radio:
    return Radio(
        rssi=None if rssi == 255 else rssi,
        remote_rssi=None if remote == 255 else remote,
        noise=None if noise == 255 else noise,
        remote_noise=None if remote_noise == 255 else remote_noise,
        free_buffer_pct=buffer if buffer <= 100 else None,
    )


def _mission_current(seq: int, total: int) -> MissionCurrent:
    return MissionCurrent(seq, total or None)


def _landed(_: int, state: int) -> LandedState:
    return LandedState({1: True, 2: False, 3: False, 4: False}.get(state))


def _ordered(command: int) -> OrderSeen | None:
    return OrderSeen(command) if command in MODE_COMMANDS else None


STATUSTEXT, COMMAND_LONG, COMMAND_INT, SET_MODE = 253, 76, 75, 11
_NEVER = lambda *_: None  # noqa: E731
KINDS: dict[int, Kind] = {
    0: Kind(50, struct.Struct("<IBBBBB"), _heartbeat),
    1: Kind(124, struct.Struct("<IIIHHhHHHHHHb"), _system_status),
    33: Kind(104, struct.Struct("<IiiiihhhH"), _position),
    42: Kind(28, struct.Struct("<HH"), _mission_current),
    46: Kind(11, struct.Struct("<H"), MissionReached),
    109: Kind(185, struct.Struct("<HHBBBBB"), _radio),
    147: Kind(154, struct.Struct("<iih10HhBBBbiB4HBI"), _battery),
    245: Kind(130, struct.Struct("<BB"), _landed),
    STATUSTEXT: Kind(83, struct.Struct("<B50sHB"), _NEVER),
    COMMAND_LONG: Kind(152, struct.Struct("<7fHBB"), _NEVER),
    COMMAND_INT: Kind(158, struct.Struct("<4fiifHBB"), _NEVER),
    SET_MODE: Kind(89, struct.Struct("<IBB"), _NEVER),
}
"""By message id: what is read. The numbers are those of common.xml; RADIO_STATUS is also what SiK radios send."""
OFTEN = frozenset({1, 33, 147})


@dataclass(slots=True)
class _Source:
    """One system and component."""

    seq: int
    received: int = 1
    missing: int = 0
    vehicle: bool = False


@dataclass(slots=True)
class TelemetryFile:
    """A .tlog being read once, from its beginning to its end."""

    path: Path
    skipped: Skipped = field(default_factory=Skipped)
    stations: set[int] = field(default_factory=set)
    """Systems that sent a ground station's HEARTBEAT."""
    frames: int = 0
    _texts: Texts = field(default_factory=Texts)
    _sources: dict[int, _Source] = field(default_factory=dict)
    _last: dict[int, int] = field(default_factory=dict)
    """When a message of OFTEN was read last, by its source and id."""
    _stamp: int = 0

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

    def _piece(self, buffer: bytes, *, last: bool) -> Generator[Record, None, int]:
        """Yield what whole records of a piece say; returns where the rest begins."""
        at, size = 0, len(buffer)
        stop = size if last else size - 2 * LONGEST
        sources = self._sources
        idle = self._stamp
        in_garbage = False
        while at < stop:
            end = _end(buffer, at, size)
            if not self._begins(buffer, at, end, size):
                self.skipped.garbage_runs += not (in_garbage or self.skipped.truncated)
                in_garbage = True
                at += 1
                continue
            in_garbage = False
            stamp = int.from_bytes(buffer[at : at + 8], "big")
            if buffer[at + 8] == V2:
                seq, system, component = buffer[at + 12], buffer[at + 13], buffer[at + 14]
                number, payload = buffer[at + 15] | buffer[at + 16] << 8 | buffer[at + 17] << 16, at + 18
            else:
                seq, system, component = buffer[at + 10], buffer[at + 11], buffer[at + 12]
                number, payload = buffer[at + 13], at + 14
            self.frames += 1
            self._stamp = stamp
            key = system << 8 | component
            source = sources.get(key)
            if source is None:
                sources[key] = source = _Source(seq)
            else:
                gap = (seq - source.seq) & 255
                if 0 < gap < 128:
                    source.missing += gap - 1
                    source.received += 1
                    source.seq = seq
            if number in KINDS:
                if number in OFTEN and 0 <= stamp - self._last.get(key << 24 | number, 0) < EVERY_USEC:
                    at = end
                    continue
                self._last[key << 24 | number] = stamp
                yield from self._read(buffer, at, payload, end, (stamp, system, component, number), source)
                idle = stamp
            elif stamp - idle >= EVERY_USEC:
                idle = stamp
                yield stamp, 0, None
            at = end
        return at

    def _begins(self, buffer: bytes, at: int, end: int, size: int) -> bool:
        """Return whether a whole record lies here."""
        if end == 0:
            return False
        if end > size:
            self.skipped.truncated = 1  # only the end of the file can do that, once
            return False
        if end == size or (end + STAMP < size and buffer[end + STAMP] in {V1, V2}) or end + STAMP >= size:
            return self._stamp == 0 or self._near(buffer, at)
        return self._near(buffer, at) and _whole(buffer, at, end)

    def _near(self, buffer: bytes, at: int) -> bool:
        stamp = int.from_bytes(buffer[at : at + 8], "big")
        return self._stamp == 0 or abs(stamp - self._stamp) < STAMP_TOLERANCE_USEC

    def _read(
        self, buffer: bytes, at: int, payload: int, end: int, head: tuple[int, int, int, int], source: _Source
    ) -> Iterator[Record]:
        stamp, system, component, number = head
        if not _whole(buffer, at, end):
            self.skipped.bad_checksums += 1
            return
        kind, length = KINDS[number], buffer[at + 9]
        need = kind.layout.size
        raw = buffer[payload : payload + min(length, need)]
        fields = kind.layout.unpack(raw if len(raw) == need else raw.ljust(need, b"\0"))
        if number == STATUSTEXT:
            for text in self._said((system, component), fields):
                yield stamp, system, text
            return
        if number in {COMMAND_LONG, COMMAND_INT, SET_MODE}:
            command, target = (DO_SET_MODE, fields[1]) if number == SET_MODE else (fields[7], fields[8])
            order = _ordered(command)
            if order is not None:
                yield stamp, target, order
            return
        message = kind.read(*fields)
        if isinstance(message, Heartbeat):
            source.vehicle = True
            yield stamp, system, Traffic(source.received, source.missing)
            source.received = source.missing = 0
        elif number == 0 and fields[1] == GCS_TYPE:
            self.stations.add(system)
        elif message is None and number == 33:
            self.skipped.impossible += 1
        if isinstance(message, Radio):
            yield stamp, 0, message
        elif source.vehicle or message is None:
            yield stamp, system if message is not None else 0, message

    def _said(self, source: tuple[int, int], fields: tuple[int, bytes, int, int]) -> list[StatusText]:
        severity, raw, number, part = fields
        return [*self._texts.passed(source), *self._texts.take(source, severity, raw, number, part)]


def _end(buffer: bytes, at: int, size: int) -> int:
    """Return where a record that begins here ends; 0 if none does."""
    if at + STAMP + 10 > size:
        return 0
    mark = buffer[at + 8]
    if mark == V2:
        flags = buffer[at + 10]
        return 0 if flags & ~1 else at + STAMP + 12 + buffer[at + 9] + 13 * flags
    return at + STAMP + 8 + buffer[at + 9] if mark == V1 else 0


def _whole(buffer: bytes, at: int, end: int) -> bool:
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
