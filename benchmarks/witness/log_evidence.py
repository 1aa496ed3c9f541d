"""A log's evidence on one vehicle, unprocessed; times are microseconds on the log's own clock."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

SECOND = 1_000_000


class Controller(Enum):
    """Source of a mode change, from the log around it."""

    PILOT = "its pilot"
    STATION = "a ground station"
    FAILSAFE = "its own failsafe"
    MISSION = "its mission"
    NOBODY = "nobody that the log names"


@dataclass(frozen=True, slots=True)
class LogLine:
    """A log entry for or against a declaration."""

    t_usec: int
    words: str
    severity: int = 6
    """MAV_SEVERITY of a text."""


@dataclass(frozen=True, slots=True)
class TransmitterMove:
    """Movement of a switch on the pilot's transmitter."""

    t_usec: int
    words: str
    channel: int | None = None


@dataclass(frozen=True, slots=True)
class FailsafeEntry:
    """The autopilot's own record of a failsafe."""

    t_usec: int
    kind: str
    """battery, crash, ekf, gps, rc, ground station, fence, ... or other."""
    words: str


@dataclass(frozen=True, slots=True)
class ModeSet:
    """A change of mode, with its reason if logged."""

    t_usec: int
    mode: int
    by: Controller | None = None
    words: str = ""


@dataclass(frozen=True, slots=True)
class MotionSample:
    """Position and motion."""

    t_usec: int
    lat_deg: float
    lon_deg: float
    height_m: float | None
    """Height above its home."""
    speed_m_s: float
    climb_m_s: float


@dataclass(frozen=True, slots=True)
class PowerReport:
    """Report of its battery monitor."""

    t_usec: int
    volts: float | None
    amperes: float | None
    consumed_mah: float | None
    percent: float | None


@dataclass(frozen=True, slots=True)
class Silence:
    """Interval without messages of the vehicle."""

    from_usec: int
    to_usec: int
    others: bool | None
    """Whether other senders were heard meanwhile; None if the log has none."""

    @property
    def lasted_s(self) -> float:
        """Duration."""
        return (self.to_usec - self.from_usec) / 1e6


@dataclass(slots=True)
class LogEvidence:
    """All of a log's evidence on one vehicle."""

    system: int
    on_board: bool = False
    """Written by the vehicle: contains nothing about its link."""
    ardupilot: bool = True
    began_usec: int = 0
    ended_usec: int = 0
    armed: list[tuple[int, bool]] = field(default_factory=list)
    """Changes of the armed state."""
    modes: list[ModeSet] = field(default_factory=list)
    statuses: list[tuple[int, int]] = field(default_factory=list)
    """Changes of HEARTBEAT.system_status."""
    texts: list[LogLine] = field(default_factory=list)
    orders: list[LogLine] = field(default_factory=list)
    """Commands accepted by the vehicle, or sent to it."""
    switches: list[TransmitterMove] = field(default_factory=list)
    """Switches of the pilot's transmitter."""
    failings: list[FailsafeEntry] = field(default_factory=list)
    tilts: list[tuple[int, float]] = field(default_factory=list)
    """Tilt in degrees from upright."""
    moments: list[MotionSample] = field(default_factory=list)
    heights: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    """Heights by instrument: metres above any fixed reference."""
    powers: list[PowerReport] = field(default_factory=list)
    items: list[tuple[int, int]] = field(default_factory=list)
    """Changes of the current mission item."""
    silences: list[Silence] = field(default_factory=list)
    streams: dict[str, list[int]] = field(default_factory=dict)
    """Arrival times of messages, by kind."""
    settings: dict[str, float] = field(default_factory=dict)
    frames: dict[int, list[int]] = field(default_factory=dict)
    """Frames received and missing, by minute of the log."""

    def note_height(self, instrument: str, t_usec: int, height_m: float) -> None:
        """Add an instrument's height."""
        rows = self.heights.setdefault(instrument, [])
        if math.isfinite(height_m) and (not rows or t_usec > rows[-1][0]):
            rows.append((t_usec, height_m))

    def is_armed(self, at_usec: int) -> bool:
        """Return whether it was armed then."""
        known = find_last_before(self.armed, at_usec)
        return known is not None and known[1]

    def find_arming_usec(self, at_usec: int) -> int | None:
        """Return the arming time of the flight that contains a moment."""
        known = find_last_before(self.armed, at_usec)
        return known[0] if known is not None and known[1] else None

    def find_disarm_usec(self, at_usec: int) -> int:
        """Return the next disarming, or the log's end."""
        return next((t_usec for t_usec, armed in self.armed if t_usec > at_usec and not armed), self.ended_usec)

    def find_motion(self, at_usec: int, *, within_s: float = 4.0) -> MotionSample | None:
        """Return its position then, if reported shortly before."""
        index = bisect_right(self.moments, at_usec, key=_time_of) - 1
        if index < 0 or at_usec - self.moments[index].t_usec > within_s * SECOND:
            return None
        return self.moments[index]


def _time_of(one: Any) -> int:  # noqa: ANN401 - anything with a time
    return int(one.t_usec)


def _first_of(pair: tuple[int, Any]) -> int:
    return pair[0]


def select_between(rows: Sequence[Any], from_usec: int, to_usec: int) -> Sequence[Any]:
    """Return the rows in an interval, of rows sorted by `t_usec`."""
    return rows[bisect_left(rows, from_usec, key=_time_of) : bisect_right(rows, to_usec, key=_time_of)]


def select_pairs_between(rows: Sequence[tuple[int, Any]], from_usec: int, to_usec: int) -> Sequence[tuple[int, Any]]:
    """Return the pairs in an interval, of pairs that begin with the time."""
    return rows[bisect_left(rows, from_usec, key=_first_of) : bisect_right(rows, to_usec, key=_first_of)]


def find_last_before(rows: Sequence[tuple[int, Any]], at_usec: int) -> tuple[int, Any] | None:
    """Return the last pair that is not later."""
    index = bisect_right(rows, at_usec, key=_first_of) - 1
    return rows[index] if index >= 0 else None


def note_change(rows: list[tuple[int, Any]], t_usec: int, value: Any) -> None:  # noqa: ANN401 - of any kind
    """Add a value from now on, unless it is unchanged."""
    if not rows or rows[-1][1] != value:
        rows.append((t_usec, value))


def select_near(rows: Sequence[Any], at_usec: int, before_s: float, after_s: float) -> Sequence[Any]:
    """Return the rows around a moment."""
    return select_between(rows, at_usec - round(before_s * SECOND), at_usec + round(after_s * SECOND))
