"""Telemetry radios: one half-duplex channel that a ground station and its vehicles share, as a pure state machine.

Bytes and the time go in, bytes come out. A radio takes bytes from a serial line into a buffer that cuts what does not
fit, sends packets in its turn on the air, and hands out on the other serial line what has arrived. Figures are those
published of each radio; where a figure follows from others, the row says so.
"""

from __future__ import annotations

import heapq
import random
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from simulator.errors import SimulatorError
from simulator.messages import build_message
from simulator.wire import Codec

GROUND = -1
MAGICS = b"\xfd\xfe"
"""Start bytes of MAVLink 2 and MAVLink 1 frames."""
SIGNED = 1
"""The only incompatibility flag that a parser must know: signed."""
RADIO_SYSTEM, RADIO_COMPONENT = 51, 68
LINE_BYTES = 2048
"""Buffer before the serial line; autopilots and ground stations hold back what does not fit."""
BURST_PACKETS = 4
"""Mean length of a burst of losses."""
OUTAGE_EVERY_S = 120.0
"""Mean time between two outages; assumed, no figure is published."""
STATUS_WAITS_S = 0.15
"""Time after which the stock firmware sends RADIO_STATUS alone; otherwise it is inserted between other bytes."""


@dataclass(frozen=True, slots=True)
class RadioProfile:
    """How one kind of radio behaves."""

    byte_s: float
    """Time of one byte on the air."""
    overhead_s: float
    """Time of an empty packet."""
    packet_bytes: tuple[int, int]
    """Largest packet, up and down."""
    window_s: float = 0.0
    """Transmit window of every node, once a round."""
    round_s: float = 0.0
    """Round time shared equally by all nodes, instead of windows."""
    silence_s: float = 0.0
    """Silence after each window."""
    yields: bool = False
    """Whether an empty packet yields the rest of a window."""
    whole_frames: bool = False
    """Whether a frame that does not fit the buffer is dropped whole instead of cut."""
    splits_frames: bool = False
    """Whether RADIO_STATUS is inserted inside frames, which destroys them."""
    speaks: bool = True
    """Whether it sends RADIO_STATUS."""
    shared: bool = True
    """Whether all vehicles share one channel; otherwise each has its own pair."""
    delay_s: tuple[float, float] = (0.0, 0.0)
    """Additional delay, least and greatest."""
    outage_s: float = 0.0
    serial_bytes_s: float = 5760.0
    fifo_bytes: tuple[int, int] = (1850, 645)
    """Buffers of a radio: from and to its serial line."""


_SIK = RadioProfile(144e-6, 2.1e-3, (250, 250), window_s=0.114, silence_s=4.2e-3, yields=True)
_SIK_ECC = replace(_SIK, byte_s=288e-6, overhead_s=3.2e-3, packet_bytes=(118, 118), window_s=0.112, silence_s=6.5e-3)


def _with_bugs(profile: RadioProfile) -> RadioProfile:
    """Return a radio with stock firmware.

    The losses published of stock firmware, 31 to 65 % above 4 kB/s and 11 to 63 % above 1.2 kB/s, and its 924 ms under
    load, are those of radios that never get more than their own window.
    """
    return replace(profile, splits_frames=True, yields=False)


_LTE = RadioProfile(
    1e-6, 1e-3, (1400, 1400), window_s=5e-3, speaks=False, shared=False, delay_s=(0.056, 0.14),
    serial_bytes_s=1e6, fifo_bytes=(65_536, 65_536), whole_frames=True,
)  # fmt: skip


def _mlrs(rate_hz: float) -> RadioProfile:
    """Return mLRS at a rate; with the bytes of a packet its published rates up and down follow."""
    half_s = 0.5 / rate_hz
    return RadioProfile(0.0, 0.9 * half_s, (64, 82), round_s=2 * half_s, shared=False, whole_frames=True)


PROFILES: Mapping[str, RadioProfile] = {
    "sik": _SIK,
    "sik-stock": _with_bugs(_SIK),
    "sik-ecc": _with_bugs(_SIK_ECC),
    "sik-ecc-mended": _SIK_ECC,
    "mlrs-19": _mlrs(19),
    "mlrs-31": _mlrs(31),
    "mlrs-50": _mlrs(50),
    "mesh": RadioProfile(144e-6, 2.1e-3, (250, 250), round_s=1 / 0.7, delay_s=(0.2, 0.45)),
    "lte": _LTE,
    "lte-2": replace(_LTE, outage_s=2.0),
    "lte-8": replace(_LTE, outage_s=8.0),
    "lte-20": replace(_LTE, outage_s=20.0),
}
"""SiK at 64 kbit/s with its bugs mended, or stock, without and with error correction; mLRS by its packet rate; RFD900x
with several nodes, each heard 0.7 times a second, and so
late that a round trip takes the 1 to 2 s that are published; LTE, also with outages of so many seconds."""


@dataclass(frozen=True, slots=True)
class RadioSetup:
    """A radio as it is ordered."""

    profile: RadioProfile
    loss: float = 0.0
    """Share of packets lost, in bursts."""


def parse_radio(text: str) -> RadioSetup:
    """Read ``PROFILE`` or ``PROFILE:loss=SHARE``.

    Raises:
        SimulatorError: one line that quotes the text and says what was expected.

    >>> parse_radio("sik:loss=0.15").loss
    0.15
    """
    name, colon, rest = text.strip().partition(":")
    profile = PROFILES.get("sik" if name == "sik64" else name)
    if profile is None:
        raise SimulatorError(f"radio {text!r}: unknown profile {name!r}, expected one of {', '.join(PROFILES)}")
    key, _, value = rest.partition("=")
    try:
        loss = float(value) if colon else 0.0
    except ValueError:
        loss = -1.0
    if (colon and key != "loss") or not 0.0 <= loss <= 0.8:
        raise SimulatorError(f"radio {text!r}: expected {name} or {name}:loss=SHARE, a share from 0 to 0.8")
    return RadioSetup(profile, loss)


def measure_frame(data: bytes | bytearray) -> int:
    """Return how many bytes the frame has that these begin with, or what stands before the next one.

    The number is larger than that of the bytes where the frame is not whole. A frame with flags that nobody knows is
    none: every MAVLink parser looks on behind them (mavlink_helpers.h; measured on both autopilots). So a report of a
    radio that falls on a frame's length does not have 278 bytes taken for one frame.
    """
    if data[0] not in MAGICS:
        return _find_magic(data, 1)
    if len(data) < 3:
        return 8
    if data[0] == MAGICS[1]:
        return 8 + data[1]
    return _find_magic(data, 3) if data[2] & ~SIGNED else 12 + data[1] + 13 * data[2]


def _find_magic(data: bytes | bytearray, first: int) -> int:
    return next((place for place in range(first, len(data)) if data[place] in MAGICS), len(data))


def is_heartbeat(frame: bytes) -> bool:
    """Return whether a frame is a HEARTBEAT."""
    number = frame[7:10] if frame[0] == MAGICS[0] else frame[5:6]
    return len(frame) >= 17 and not any(number)


class BurstLoss:
    """Losses that come in bursts: a good state that loses nothing, a bad one that loses everything."""

    def __init__(self, share: float, rng: random.Random) -> None:
        self._rng = rng
        self._begins, self._ends = share / (BURST_PACKETS * (1 - share)), 1 / BURST_PACKETS
        self._bad = False

    def draw_loss(self) -> bool:
        """Return whether the next packet is lost."""
        if self._begins > 0:
            self._bad = self._rng.random() >= self._ends if self._bad else self._rng.random() < self._begins
        return self._bad


class _Way:
    """Between the ground's radio and one vehicle's: its losses, its outages, its delay."""

    def __init__(self, setup: RadioSetup, rng: random.Random) -> None:
        self._profile, self._rng = setup.profile, rng
        self._loss = BurstLoss(setup.loss, rng)
        self._out_s = (0.0, 0.0)
        self._latest_s = {True: 0.0, False: 0.0}

    def carry(self, sent_s: float, took_s: float, *, up: bool) -> float | None:
        """Return when what was sent, and took so long on the air, arrives; None if it is lost."""
        if self._loss.draw_loss() or self._is_out(sent_s):
            return None
        # Nothing overtakes what was sent before, or arrives at the same time.
        self._latest_s[up] = max(self._latest_s[up] + took_s, sent_s + self._rng.uniform(*self._profile.delay_s))
        return self._latest_s[up]

    def _is_out(self, now_s: float) -> bool:
        if not self._profile.outage_s:
            return False
        while now_s >= self._out_s[1]:
            begins_s = self._out_s[1] + self._rng.expovariate(1 / OUTAGE_EVERY_S)
            self._out_s = (begins_s, begins_s + self._profile.outage_s)
        return now_s >= self._out_s[0]


class _Node:
    """One radio, and both directions of its serial line."""

    def __init__(self, profile: RadioProfile, rng: random.Random, *, up: bool) -> None:
        self._profile, self._rng = profile, rng
        self._most_bytes = profile.packet_bytes[not up]
        self._line: deque[tuple[float, bytes, int]] = deque()
        """Frames from its serial line, with start time and vehicle."""
        self._line_free_s = 0.0
        self._inside = 0
        """Bytes of the first frame already in the buffer or cut."""
        self.fifo = bytearray()
        self._out_free_s = 0.0
        self._tails: dict[int, bytearray] = {}
        self._out: dict[int, list[tuple[float, int, bytes]]] = {}
        self._count = 0
        self._codec = Codec(RADIO_SYSTEM, component=RADIO_COMPONENT)
        self.cut_bytes = 0
        """Bytes cut on either side."""
        self._status: tuple[float, int, bytes] | None = None
        """RADIO_STATUS that the stock firmware inserts between the next bytes."""

    def offer(self, vehicle: int, data: bytes, now_s: float) -> None:
        """Take bytes that somebody sends on the serial line."""
        rate_bytes_s = self._profile.serial_bytes_s
        while data:
            frame = data[: measure_frame(data)]
            data = data[len(frame) :]
            begins_s = max(now_s, self._line_free_s)
            if (begins_s - now_s) * rate_bytes_s + len(frame) > max(LINE_BYTES, self._profile.fifo_bytes[0]):
                self.cut_bytes += len(frame)
                continue
            self._line.append((begins_s, frame, vehicle))
            self._line_free_s = begins_s + len(frame) / rate_bytes_s

    def take_out(self, vehicle: int, now_s: float) -> list[bytes]:
        """Take away what has come out on the serial line by now, a frame each or what is left of one."""
        waiting = self._out.get(vehicle, [])
        taken = []
        while waiting and waiting[0][0] <= now_s:
            taken.append(heapq.heappop(waiting)[2])
        return taken

    def fill(self, now_s: float) -> None:
        """Let into the buffer what the serial line has brought by now; what has no room is cut."""
        while self._line and self._line[0][0] < now_s:
            begins_s, frame, vehicle = self._line[0]
            come = min(len(frame), int((now_s - begins_s) * self._profile.serial_bytes_s + 1e-6))
            room = self._profile.fifo_bytes[0] - len(self.fifo)
            if not self._profile.whole_frames:
                self.fifo += frame[self._inside : come][:room]
                self.cut_bytes += max(0, come - self._inside - room)
            elif come == len(frame):
                self.fifo += frame if come <= room else b""
                self.cut_bytes += come if come > room else 0
            self._inside = come
            if come < len(frame):
                break
            self._line.popleft()
            self._inside = 0
            if self._profile.speaks and is_heartbeat(frame):
                self._report(vehicle, now_s)
        if self._status is not None and now_s - self._status[0] > STATUS_WAITS_S:
            _, vehicle, status = self._status
            self._status = None
            self._put_out(vehicle, status, now_s, whole=True)

    def find_ready_s(self, now_s: float) -> float:
        """Return when it has something to send, as far as is known."""
        if self.fifo and self._measure_ready(0) > 0:
            return now_s
        if not self._line:
            return float("inf")
        begins_s, frame, _ = self._line[0]
        return max(now_s, begins_s) + (len(frame) - self._inside + 1) / self._profile.serial_bytes_s

    def take_packet(self, room_bytes: int) -> bytes:
        """Take what goes into a packet for which the window has so much room; empty if nothing fits or is there."""
        room, size = min(room_bytes, self._most_bytes), 0
        while size < min(room, len(self.fifo)) and (frame := self._measure_ready(size)):
            size = min(room, size + frame)
        packet = bytes(self.fifo[:size])
        del self.fifo[:size]
        return packet

    def _measure_ready(self, place: int) -> int:
        """Return how many bytes of the buffer from a place on go together; 0 where the rest is on its way."""
        frame, left = measure_frame(self.fifo[place : place + 280]), len(self.fifo) - place
        if frame <= left or not self._inside:
            return min(frame, left)
        return 0

    def arrive(self, vehicle: int, data: bytes, at_s: float) -> None:
        """Take a packet from the air."""
        if self._status is not None:
            place = self._rng.randrange(len(data) + 1)
            data = data[:place] + self._status[2] + data[place:]
            self._status = None
        self._put_out(vehicle, data, at_s)

    def _put_out(self, vehicle: int, data: bytes, at_s: float, *, whole: bool = False) -> None:
        """Hand out bytes on the serial line; what its buffer has no room for is cut."""
        begins_s, rate_bytes_s = max(at_s, self._out_free_s), self._profile.serial_bytes_s
        room = max(0, int(self._profile.fifo_bytes[1] - (begins_s - at_s) * rate_bytes_s))
        self.cut_bytes += max(0, len(data) - room)
        data = data[:room]
        self._out_free_s = begins_s + len(data) / rate_bytes_s
        tail = bytearray() if whole else self._tails.setdefault(vehicle, bytearray())
        tail += data
        while tail and (size := measure_frame(tail)) <= len(tail):
            self._count += 1
            arrived = (self._out_free_s, self._count, bytes(tail[:size]))
            heapq.heappush(self._out.setdefault(vehicle, []), arrived)
            del tail[:size]

    def _report(self, vehicle: int, now_s: float) -> None:
        """Say RADIO_STATUS on the serial line."""
        size = self._profile.fifo_bytes[0]
        txbuf_pct = 100 * ((size - len(self.fifo)) // 8) // (size // 8)
        status = self._codec.encode(
            build_message(
                "RADIO_STATUS", rssi=200, remrssi=200, txbuf=txbuf_pct, noise=50, remnoise=50, rxerrors=0, fixed=0
            )
        )
        if self._profile.splits_frames:
            self._status = (now_s, vehicle, status)
        else:
            self._put_out(vehicle, status, now_s, whole=True)


class Radio:
    """One channel: its nodes have the air in turn."""

    def __init__(self, setup: RadioSetup, vehicles: Sequence[int], seed: int | str = 0) -> None:
        """Switch it on at 0 s, with the ground station's node and one for each of these vehicles."""
        rng, self._profile = random.Random(f"{seed}:radio"), setup.profile
        self._nodes = {number: _Node(setup.profile, rng, up=number == GROUND) for number in (GROUND, *vehicles)}
        self._ways = {number: _Way(setup, rng) for number in vehicles}
        profile, count = setup.profile, len(self._nodes)
        self._window_s = profile.round_s / count - profile.silence_s if profile.round_s else profile.window_s
        self._turns = deque(self._nodes)
        """Nodes in order of turn; the present one first."""
        self._now_s, self._ends_s = 0.0, self._window_s
        self._yielded = False
        self._spoke_s = dict.fromkeys(self._nodes, 0.0)
        self._lived_s = dict.fromkeys(vehicles, 0.0)

    @property
    def cut_bytes(self) -> int:
        """What had no room anywhere."""
        return sum(node.cut_bytes for node in self._nodes.values())

    def send(self, vehicle: int, data: bytes, now_s: float, *, up: bool) -> None:
        """Take bytes for a vehicle from the ground station, or the other way round."""
        self._nodes[GROUND if up else vehicle].offer(vehicle, data, now_s)

    def take(self, vehicle: int, now_s: float, *, up: bool) -> list[bytes]:
        """Return what has come to a vehicle, or to the ground station from it, by now.

        The channel lives as far as all vehicles have, as they say here.
        """
        self._lived_s[vehicle] = max(self._lived_s[vehicle], now_s)
        self._advance(min(self._lived_s.values()))
        return self._nodes[vehicle if up else GROUND].take_out(vehicle, now_s)

    def _advance(self, until_s: float) -> None:
        while self._now_s < until_s:
            for node in self._nodes.values():
                node.fill(self._now_s)
            if self._now_s >= self._ends_s - 1e-9:
                self._now_s = self._ends_s + self._profile.silence_s
                self._ends_s = self._now_s + self._window_s
                self._turns.rotate(-1)
                self._yielded = False
                continue
            if not self._send_packet():
                self._wait(until_s)

    def _speakers(self) -> list[int]:
        """Return who may have the air now, who has waited longest first."""
        owner, *others = self._turns
        return sorted(others, key=self._spoke_s.__getitem__) if self._yielded else [owner]

    def _send_packet(self) -> bool:
        """Let a node that may send do so; False if none has anything that fits."""
        profile, left_s = self._profile, self._ends_s - self._now_s
        room_s = left_s - profile.overhead_s
        room_bytes = int(room_s / profile.byte_s + 1e-6) if profile.byte_s and room_s > 0 else 10**6 * (room_s > 0)
        for number in self._speakers():
            node = self._nodes[number]
            packet = node.take_packet(room_bytes)
            if packet:
                took_s = profile.overhead_s + len(packet) * profile.byte_s
                self._now_s += took_s
                self._spoke_s[number] = self._now_s
                self._deliver(number, packet, took_s)
                return True
        return False

    def _wait(self, until_s: float) -> None:
        """Give the window to the others, or let the time pass until somebody has something to say."""
        ready_s = min(self._nodes[number].find_ready_s(self._now_s) for number in self._speakers())
        if ready_s <= self._now_s:  # what is there does not fit any more
            self._now_s = self._ends_s
        elif self._profile.yields and not self._yielded:
            self._yielded = True
            self._now_s = min(self._ends_s, self._now_s + self._profile.overhead_s)
        else:
            self._now_s = min(self._ends_s, until_s, ready_s)

    def _deliver(self, number: int, packet: bytes, took_s: float) -> None:
        up = number == GROUND
        for vehicle in self._ways if up else (number,):
            at_s = self._ways[vehicle].carry(self._now_s, took_s, up=up)
            if at_s is not None:
                self._nodes[vehicle if up else GROUND].arrive(vehicle, packet, at_s)


def build_radios(setup: RadioSetup, vehicles: int, seed: int | str = 0) -> list[Radio]:
    """Return the channel of each vehicle: one for all where the radio is shared."""
    if setup.profile.shared:
        return [Radio(setup, range(vehicles), seed)] * vehicles
    return [Radio(setup, (number,), f"{seed}:{number}") for number in range(vehicles)]
