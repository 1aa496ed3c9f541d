"""Telemetry radios: one half-duplex channel that a ground station and its vehicles share, as a pure state machine.

Bytes and the time go in, bytes come out. A radio buffers bytes from a serial line and cuts what does not fit, sends
packets in its turn on the air, and delivers received bytes on the other serial line. Figures are those published for
each radio; where a figure is derived from others, the row says so.
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
"""Mean time between two outages; assumed, as no figure is published."""
STATUS_WAITS_S = 0.15
"""Time after which the stock firmware sends RADIO_STATUS alone; before that it inserts it between other bytes."""


@dataclass(frozen=True, slots=True)
class RadioProfile:
    """Behaviour of one kind of radio."""

    byte_s: float
    """Air time of one byte."""
    overhead_s: float
    """Air time of an empty packet."""
    packet_bytes: tuple[int, int]
    """Largest packet, up and down."""
    window_s: float = 0.0
    """Transmit window of every node, once per round."""
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
    """Whether all vehicles share one channel; otherwise each has its own radio pair."""
    delay_s: tuple[float, float] = (0.0, 0.0)
    """Additional delay, minimum and maximum."""
    outage_s: float = 0.0
    serial_bytes_s: float = 5760.0
    fifo_bytes: tuple[int, int] = (1850, 645)
    """Buffers of a radio: from and to its serial line."""


_SIK = RadioProfile(144e-6, 2.1e-3, (250, 250), window_s=0.114, silence_s=4.2e-3, yields=True)
_SIK_ECC = replace(_SIK, byte_s=288e-6, overhead_s=3.2e-3, packet_bytes=(118, 118), window_s=0.112, silence_s=6.5e-3)


def _with_bugs(profile: RadioProfile) -> RadioProfile:
    """Return a radio with stock firmware.

    The losses published for stock firmware (31 to 65 % above 4 kB/s, 11 to 63 % above 1.2 kB/s) and its 924 ms under
    load are those of radios that never get more than their own window.
    """
    return replace(profile, splits_frames=True, yields=False)


_LTE = RadioProfile(
    1e-6, 1e-3, (1400, 1400), window_s=5e-3, speaks=False, shared=False, delay_s=(0.056, 0.14),
    serial_bytes_s=1e6, fifo_bytes=(65_536, 65_536), whole_frames=True,
)  # fmt: skip


def _mlrs(rate_hz: float) -> RadioProfile:
    """Return mLRS at a packet rate; with its bytes per packet this gives the published rates up and down."""
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
"""Radios by name: SiK at 64 kbit/s with its bugs fixed, or stock, without and with error correction; mLRS by packet
rate; RFD900x with several nodes, each heard 0.7 times a second and late enough for the published round trip of 1 to 2
s; LTE, also with outages of the given seconds."""


@dataclass(frozen=True, slots=True)
class RadioSetup:
    """Selected radio profile and its loss."""

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
    """Return the length of the frame at the start of these bytes, or of the bytes before the next frame.

    The length exceeds that of the bytes if the frame is incomplete. A frame with unknown flags does not count: every
    MAVLink parser searches on after its flags (mavlink_helpers.h; measured on both autopilots). So a radio report that
    overwrites a frame's length does not turn 278 bytes into one frame.
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
    """Burst losses: a good state that loses nothing, and a bad one that loses everything."""

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
    """Path between the ground's radio and one vehicle's: losses, outages, delay."""

    def __init__(self, setup: RadioSetup, rng: random.Random) -> None:
        self._profile, self._rng = setup.profile, rng
        self._loss = BurstLoss(setup.loss, rng)
        self._out_s = (0.0, 0.0)
        self._latest_s = {True: 0.0, False: 0.0}

    def carry(self, sent_s: float, took_s: float, *, up: bool) -> float | None:
        """Return the arrival time of a packet that spent ``took_s`` on the air; None if it is lost."""
        if self._loss.draw_loss() or self._is_out(sent_s):
            return None
        # No packet overtakes an earlier one, or arrives at the same time.
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
        """Take bytes sent on the serial line."""
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
        """Remove and return bytes output on the serial line so far: one frame, or its remains, per item."""
        waiting = self._out.get(vehicle, [])
        taken = []
        while waiting and waiting[0][0] <= now_s:
            taken.append(heapq.heappop(waiting)[2])
        return taken

    def fill(self, now_s: float) -> None:
        """Move bytes that the serial line has delivered so far into the buffer; what does not fit is cut."""
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
        """Return when it next has something to send, as far as known."""
        if self.fifo and self._measure_ready(0) > 0:
            return now_s
        if not self._line:
            return float("inf")
        begins_s, frame, _ = self._line[0]
        return max(now_s, begins_s) + (len(frame) - self._inside + 1) / self._profile.serial_bytes_s

    def take_packet(self, room_bytes: int) -> bytes:
        """Remove and return a packet of at most ``room_bytes``; empty if there is nothing, or nothing fits."""
        room, size = min(room_bytes, self._most_bytes), 0
        while size < min(room, len(self.fifo)) and (frame := self._measure_ready(size)):
            size = min(room, size + frame)
        packet = bytes(self.fifo[:size])
        del self.fifo[:size]
        return packet

    def _measure_ready(self, place: int) -> int:
        """Return how many buffered bytes from ``place`` on form one unit; 0 if the rest has not arrived yet."""
        frame, left = measure_frame(self.fifo[place : place + 280]), len(self.fifo) - place
        if frame <= left or not self._inside:
            return min(frame, left)
        return 0

    def arrive(self, vehicle: int, data: bytes, at_s: float) -> None:
        """Receive a packet from the air."""
        if self._status is not None:
            place = self._rng.randrange(len(data) + 1)
            data = data[:place] + self._status[2] + data[place:]
            self._status = None
        self._put_out(vehicle, data, at_s)

    def _put_out(self, vehicle: int, data: bytes, at_s: float, *, whole: bool = False) -> None:
        """Output bytes on the serial line; what its buffer cannot hold is cut."""
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
        """Output RADIO_STATUS on the serial line."""
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
    """One channel: its nodes transmit in turn."""

    def __init__(self, setup: RadioSetup, vehicles: Sequence[int], seed: int | str = 0) -> None:
        """Switch it on at 0 s, with one node for the ground station and one for each vehicle."""
        rng, self._profile = random.Random(f"{seed}:radio"), setup.profile
        self._nodes = {number: _Node(setup.profile, rng, up=number == GROUND) for number in (GROUND, *vehicles)}
        self._ways = {number: _Way(setup, rng) for number in vehicles}
        profile, count = setup.profile, len(self._nodes)
        self._window_s = profile.round_s / count - profile.silence_s if profile.round_s else profile.window_s
        self._turns = deque(self._nodes)
        """Nodes in transmit order; the current one first."""
        self._now_s, self._ends_s = 0.0, self._window_s
        self._yielded = False
        self._spoke_s = dict.fromkeys(self._nodes, 0.0)
        self._lived_s = dict.fromkeys(vehicles, 0.0)

    @property
    def cut_bytes(self) -> int:
        """Bytes cut in all buffers."""
        return sum(node.cut_bytes for node in self._nodes.values())

    def send(self, vehicle: int, data: bytes, now_s: float, *, up: bool) -> None:
        """Take bytes from the ground station for a vehicle, or the reverse."""
        self._nodes[GROUND if up else vehicle].offer(vehicle, data, now_s)

    def take(self, vehicle: int, now_s: float, *, up: bool) -> list[bytes]:
        """Return bytes that have reached a vehicle, or the ground station from it, by now.

        The channel advances as far as all vehicles have, as reported by these calls.
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
        """Return the nodes that may transmit now, longest waiting first."""
        owner, *others = self._turns
        return sorted(others, key=self._spoke_s.__getitem__) if self._yielded else [owner]

    def _send_packet(self) -> bool:
        """Let a permitted node send a packet; False if none has one that fits."""
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
                self.deliver_packet(number, packet, self._now_s, took_s)
                return True
        return False

    def _wait(self, until_s: float) -> None:
        """Pass the window to the others, or advance to when a node has something to send."""
        ready_s = min(self._nodes[number].find_ready_s(self._now_s) for number in self._speakers())
        if ready_s <= self._now_s:  # the buffered data no longer fits
            self._now_s = self._ends_s
        elif self._profile.yields and not self._yielded:
            self._yielded = True
            self._now_s = min(self._ends_s, self._now_s + self._profile.overhead_s)
        else:
            self._now_s = min(self._ends_s, until_s, ready_s)

    def deliver_packet(self, number: int, packet: bytes, sent_s: float, took_s: float) -> None:
        """Deliver a packet that a node has sent to those that hear it."""
        up = number == GROUND
        for vehicle in self._ways if up else (number,):
            at_s = self._ways[vehicle].carry(sent_s, took_s, up=up)
            if at_s is not None:
                self._nodes[vehicle if up else GROUND].arrive(vehicle, packet, at_s)


def build_radios(setup: RadioSetup, vehicles: int, seed: int | str = 0) -> list[Radio]:
    """Return the channel of each vehicle: the same for all if the radio is shared."""
    if setup.profile.shared:
        return [Radio(setup, range(vehicles), seed)] * vehicles
    return [Radio(setup, (number,), f"{seed}:{number}") for number in range(vehicles)]
