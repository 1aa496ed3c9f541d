"""Decide which frames of other ground stations reach the vehicles: a MAVLink router's rules, and a radio's share.

Nothing of theirs takes precedence over this flight's own frames, and nothing that would fill a radio is forwarded.
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
"""PARAM_REQUEST_LIST, REQUEST_DATA_STREAM, FILE_TRANSFER_PROTOCOL, LOG_REQUEST_LIST, LOG_REQUEST_DATA: small requests
whose answers occupy a radio for minutes."""
TRANSFERS = frozenset({37, 38, 39, 40, 43, 44, 45, 47, 51, 73, 110})
"""Messages of a mission or file transfer, and MISSION_CLEAR_ALL; a vehicle handles one such transfer at a time."""
CORRECTIONS = frozenset({123, 233, *range(12900, 12921)})
"""GPS_INJECT_DATA, GPS_RTCM_DATA and OPEN_DRONE_ID_*."""
LINK_REPORTS = frozenset({109, 166})
"""RADIO_STATUS: autopilots thin their streams by their own link's report."""
CORRECTIONS_BYTES_S = 5000.0
"""Largest rate of corrections without a radio."""
SMALLEST_BURST_BYTES, BURST_S = 1000.0, 3.0
"""Burst allowance: a dozen commands."""
HEARTBEAT_HZ, HEARTBEAT_BURST = 1.0, 1.5
"""HEARTBEAT rate with a margin for irregular timing."""
MAX_SENDERS = 32


@dataclass(frozen=True, slots=True)
class StationFrame:
    """A frame of another ground station, reduced to the fields the rules use."""

    system: int
    component: int
    number: int
    """Message id."""
    size: int
    """Size of the whole frame in bytes."""
    target: int = 0
    """The addressed system; 0 for all."""
    command: int | None = None
    """MAV_CMD of a command."""
    does: str = ""
    """Its change on board, in words; empty if it changes nothing."""

    @property
    def sender(self) -> Sender:
        """The sender."""
        return self.system, self.component

    @property
    def is_flood(self) -> bool:
        """Whether its answer would fill a radio."""
        return self.number in FLOODS or self.command == SET_MESSAGE_INTERVAL


@dataclass(frozen=True, slots=True)
class ForwardRules:
    """Rules for senders and targets."""

    ours: int
    """Our own system id."""
    vehicles: frozenset[int]
    """System ids of the fleet."""
    allow_orders: bool = False

    def find_refusal(self, frame: StationFrame, *, signed: bool = True) -> str:
        """Return in words why a frame is not forwarded to any vehicle; empty if it may be.

        Args:
            frame: The station's frame.
            signed: Whether it has the signature that the vehicles require, if they do.
        """
        if not self.allow_orders:
            return link.ORDERS_NOT_ALLOWED
        if frame.system == self.ours:
            return link.HAS_OUR_SYSTEM.format(ours=self.ours)
        if frame.system in self.vehicles:
            return link.HAS_VEHICLES_SYSTEM
        return "" if signed else link.NOT_SIGNED

    def select_targets(self, frame: StationFrame) -> frozenset[int]:
        """Return the vehicles a frame is for; never another station, nor its origin."""
        return self.vehicles if frame.target == 0 else self.vehicles & {frame.target}

    def is_for_station(self, target: int, stations: Collection[int]) -> bool:
        """Return whether a vehicle's frame is forwarded to a port.

        Args:
            target: The addressed system; 0 for all.
            stations: The systems that send from that port.
        """
        return target == 0 or (target in stations and target != self.ours)


@dataclass(frozen=True, slots=True)
class Bucket:
    """A token bucket: a long-term rate, and a burst."""

    per_s: float
    most: float
    left: float = math.inf
    """Full at first."""
    at_s: float = -math.inf

    def take(self, amount: float, now_s: float, kept: float = 0.0) -> Bucket | None:
        """Return the bucket after an amount is taken; None if too little is left beside the part `kept` for others."""
        gained = self.per_s * max(0.0, now_s - self.at_s) if self.at_s > -math.inf else 0.0
        left = min(self.most, self.left + gained)
        if left - amount < kept:
            return None
        return Bucket(self.per_s, self.most, left - amount, max(self.at_s, now_s))


@dataclass(frozen=True, slots=True)
class Allowance:
    """The rest of other stations' share of one channel."""

    bytes_: Bucket
    is_radio: bool
    beats: tuple[tuple[Sender, Bucket], ...] = field(default=())
    """For each sender's HEARTBEATs."""

    def admit(self, frame: StationFrame, now_s: float, *, busy: bool) -> tuple[Allowance, str | None]:
        """Return the allowance after a frame, and why it is dropped: None if forwarded, empty if dropped silently.

        Args:
            frame: A frame that may go to a vehicle on this channel.
            now_s: The time.
            busy: Whether our own transfer uses the channel.
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
        # Half is reserved for commands, whatever else is sent.
        taken = self.bytes_.take(frame.size, now_s, self.bytes_.most / 2 if waits else 0.0)
        return (self, link.MORE_THAN_SHARE) if taken is None else (replace(self, bytes_=taken), None)

    def _admit_heartbeat(self, frame: StationFrame, now_s: float) -> tuple[Allowance, str | None]:
        known = dict(self.beats)
        bucket = known.get(frame.sender)
        if bucket is None and len(known) >= MAX_SENDERS:
            return self, ""
        taken = (bucket or Bucket(HEARTBEAT_HZ, HEARTBEAT_BURST)).take(1.0, now_s)
        if taken is None:
            return self, ""
        return replace(self, beats=tuple({**known, frame.sender: taken}.items())), None


def make_allowance(share_bytes_s: float | None) -> Allowance:
    """Return the allowance of other stations on one channel.

    Args:
        share_bytes_s: Their share of a radio; None where there is none.
    """
    if share_bytes_s is None:
        return Allowance(Bucket(CORRECTIONS_BYTES_S, BURST_S * CORRECTIONS_BYTES_S), is_radio=False)
    burst = max(SMALLEST_BURST_BYTES, BURST_S * share_bytes_s)
    return Allowance(Bucket(share_bytes_s, burst), is_radio=True)
