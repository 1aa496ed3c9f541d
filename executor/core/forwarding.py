"""What other ground stations may send to the vehicles through us: the rules of a MAVLink router, and a radio's share.

Nothing of theirs comes ahead of what this flight sends itself, and nothing that would fill a radio is passed on.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace

from executor.core.lines import link

Sender = tuple[int, int]
"""System and component."""
HEARTBEAT, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 0, 512, 511
FLOODS = frozenset({21, 66, 110, 117, 119})
"""PARAM_REQUEST_LIST, REQUEST_DATA_STREAM, FILE_TRANSFER_PROTOCOL, LOG_REQUEST_LIST, LOG_REQUEST_DATA: a small question
with an answer that a radio carries for minutes."""
TRANSFERS = frozenset({37, 38, 39, 40, 43, 44, 45, 47, 51, 73, 110})
"""What is said in a transfer of a mission, or of a file, and MISSION_CLEAR_ALL: a vehicle has one such transfer at a
time."""
CORRECTIONS = frozenset({123, 233, *range(12900, 12921)})
"""GPS_INJECT_DATA, GPS_RTCM_DATA and OPEN_DRONE_ID_*."""
LINK_REPORTS = frozenset({109, 166})
"""RADIO_STATUS: autopilots thin their streams by what it says of their own link."""
CORRECTIONS_BYTES_S = 5000.0
"""Of them at most, where there is no radio."""
LEAST_BURST_BYTES, BURST_S = 1000.0, 3.0
"""What may come at once: a dozen orders."""
BEAT_HZ, BEAT_BURST = 1.0, 1.5
"""A HEARTBEAT is never quite in time."""
MOST_SENDERS = 32


@dataclass(frozen=True, slots=True)
class StationFrame:
    """A frame of another ground station, as far as the rules go by it."""

    system: int
    component: int
    number: int
    """Message id."""
    size: int
    """Bytes of the whole frame."""
    target: int = 0
    """The system that it is for; 0 for everybody."""
    command: int | None = None
    """MAV_CMD, if it is one."""
    does: str = ""
    """What it changes on board, in words; empty where it changes nothing."""

    @property
    def sender(self) -> Sender:
        """Who sends it."""
        return self.system, self.component

    @property
    def is_flood(self) -> bool:
        """Whether its answer would fill a radio."""
        return self.number in FLOODS or self.command == SET_MESSAGE_INTERVAL


@dataclass(frozen=True, slots=True)
class ForwardRules:
    """Who may send what to whom."""

    ours: int
    """Our own system."""
    vehicles: frozenset[int]
    """Systems of the fleet."""
    allow_orders: bool = False

    def find_refusal(self, frame: StationFrame, *, signed: bool = True) -> str:
        """Return why a frame goes to no vehicle, in words; empty if it may go.

        Args:
            frame: What came from a station.
            signed: Whether it has the signature that the vehicles want, where they want one.
        """
        if not self.allow_orders:
            return link.ORDERS_NOT_ALLOWED
        if frame.system == self.ours:
            return link.HAS_OUR_SYSTEM.format(ours=self.ours)
        if frame.system in self.vehicles:
            return link.HAS_VEHICLES_SYSTEM
        return "" if signed else link.NOT_SIGNED

    def select_targets(self, frame: StationFrame) -> frozenset[int]:
        """Return the vehicles that a frame is for; it never goes to another station, nor back to where it came from."""
        return self.vehicles if frame.target == 0 else self.vehicles & {frame.target}

    def is_for_station(self, target: int, stations: Collection[int]) -> bool:
        """Return whether a vehicle's frame goes to a port.

        Args:
            target: The system that the frame is for; 0 for everybody.
            stations: The systems that speak from that port.
        """
        return target == 0 or (target in stations and target != self.ours)


@dataclass(frozen=True, slots=True)
class Bucket:
    """A token bucket: so much passes in the long run, and some of it at once."""

    per_s: float
    most: float
    left: float = math.inf
    """It begins full."""
    at_s: float = -math.inf

    def take(self, amount: float, now_s: float, kept: float = 0.0) -> Bucket | None:
        """Return the bucket without an amount; None if that is not in it beside what is `kept` for others."""
        gained = self.per_s * max(0.0, now_s - self.at_s) if self.at_s > -math.inf else 0.0
        left = min(self.most, self.left + gained)
        if left - amount < kept:
            return None
        return Bucket(self.per_s, self.most, left - amount, max(self.at_s, now_s))


@dataclass(frozen=True, slots=True)
class Allowance:
    """What other stations have left of one channel."""

    bytes_: Bucket
    is_radio: bool
    beats: tuple[tuple[Sender, Bucket], ...] = field(default=())
    """Of each sender's HEARTBEATs."""

    def admit(self, frame: StationFrame, now_s: float, *, busy: bool) -> tuple[Allowance, str | None]:
        """Return what is left after a frame, and why it is not passed on: None if it is, empty if nobody is told.

        Args:
            frame: One that may go to a vehicle on this channel.
            now_s: The time.
            busy: Whether a transfer of ours is under way there.
        """
        if frame.number == HEARTBEAT:
            return self._admit_heartbeat(frame, now_s)
        if frame.number in LINK_REPORTS:
            return self, ""
        if self.is_radio and frame.is_flood:
            return self, link.WOULD_FILL_RADIO
        if busy and frame.number in TRANSFERS:
            return self, link.TRANSFER_UNDER_WAY
        is_correction = frame.number in CORRECTIONS
        waits = is_correction or frame.command == REQUEST_MESSAGE
        if not self.is_radio and not is_correction:
            return self, None
        if self.is_radio and waits and busy:
            return self, ""
        # Orders find half of it whatever else is sent.
        taken = self.bytes_.take(frame.size, now_s, self.bytes_.most / 2 if waits else 0.0)
        return (self, link.MORE_THAN_SHARE) if taken is None else (replace(self, bytes_=taken), None)

    def _admit_heartbeat(self, frame: StationFrame, now_s: float) -> tuple[Allowance, str | None]:
        known = dict(self.beats)
        bucket = known.get(frame.sender)
        if bucket is None and len(known) >= MOST_SENDERS:
            return self, ""
        taken = (bucket or Bucket(BEAT_HZ, BEAT_BURST)).take(1.0, now_s)
        if taken is None:
            return self, ""
        return replace(self, beats=tuple({**known, frame.sender: taken}.items())), None


def make_allowance(share_bytes_s: float | None) -> Allowance:
    """Return what stations may send over one channel.

    Args:
        share_bytes_s: Their share of a radio; None where there is none.
    """
    if share_bytes_s is None:
        return Allowance(Bucket(CORRECTIONS_BYTES_S, BURST_S * CORRECTIONS_BYTES_S), is_radio=False)
    burst = max(LEAST_BURST_BYTES, BURST_S * share_bytes_s)
    return Allowance(Bucket(share_bytes_s, burst), is_radio=True)
