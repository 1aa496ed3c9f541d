"""How ArduPilot flies a leg: a target that moves along it by the clock, and cuts pass-through corners by time.

Every leg is planned from rest to rest (AC_WPNav.cpp, SCurve.cpp): its target speeds up in ``ramp_s``, cruises, and
slows down again. At a corner that is flown through, the next leg's target begins while this one's slows down; the
vehicle follows the sum of both. Measured on Copter 4.7-dev: legs of 3 to 300 m last as computed, within 0.1 s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from simulator.physics import Place, Vector, Velocity

JERK_M_S3 = 1.0
"""WPNAV_JERK."""
SNAP_S = 0.3
"""How long the jerk takes to build up: twice ATC_INPUT_TC, for the planned snap is half of what the vehicle can."""
ACCELERATE_Z_M_S2 = 1.0
"""WPNAV_ACCEL_Z."""
TURN_S = 0.45
"""Measured: a leg that begins with a turn on the spot by an angle lasts longer by this, times (1 - its cosine)."""
SEARCH_S = 0.05


class TargetState(NamedTuple):
    """Where the target is on its line, and how it moves."""

    done_m: float
    speed_m_s: float
    accelerates_m_s2: float


@dataclass(frozen=True, slots=True)
class LegLimits:
    """What a vehicle is asked for at most."""

    level_m_s: float
    up_m_s: float
    down_m_s: float
    accelerate_m_s2: float
    corner_m: float
    """WPNAV_RADIUS: how far a corner may be cut."""

    def speed_m_s(self, way: Vector) -> float:
        """Return the greatest speed along a line (kinematic_limit in control.cpp)."""
        return _combine_limits(way, self.level_m_s, self.up_m_s if way.up_m > 0 else self.down_m_s)

    def acceleration_m_s2(self, way: Vector) -> float:
        """Return the greatest acceleration along a line."""
        return _combine_limits(way, self.accelerate_m_s2, ACCELERATE_Z_M_S2)


@dataclass(frozen=True, slots=True)
class SCurve:
    """A straight line from rest to rest, by the clock."""

    way: Vector
    top_m_s: float
    ramp_s: float

    @classmethod
    def build(cls, way: Vector, pace: LegLimits) -> SCurve:
        """Return the way that is flown as fast as the pace allows."""
        top, most, length = pace.speed_m_s(way), pace.acceleration_m_s2(way), way.length_m
        if top * ramp_s(top, most) > length:
            low = 0.0
            for _ in range(40):
                middle = (low + top) / 2
                low, top = (middle, top) if middle * ramp_s(middle, most) < length else (low, middle)
        return cls(way, top, ramp_s(top, most))

    @property
    def duration_s(self) -> float:
        """From rest to rest."""
        return self.way.length_m / self.top_m_s + self.ramp_s

    def state_at(self, age_s: float) -> TargetState:
        """Return where its target is."""
        age_s = min(max(age_s, 0.0), self.duration_s)
        left_s = self.duration_s - age_s
        if left_s < self.ramp_s:
            done, speed, accelerates = self._ramp_state(left_s)
            return TargetState(self.way.length_m - done, speed, -accelerates)
        return self._ramp_state(age_s)

    def _ramp_state(self, age_s: float) -> TargetState:
        if age_s >= self.ramp_s:
            return TargetState(self.top_m_s * (age_s - self.ramp_s / 2), self.top_m_s, 0.0)
        turn = math.pi / self.ramp_s
        half = self.top_m_s / 2
        sine, cosine = math.sin(turn * age_s), math.cos(turn * age_s)
        return TargetState(half * (age_s - sine / turn), half * (1 - cosine), half * turn * sine)


@dataclass(frozen=True, slots=True)
class DelayedCurve:
    """A curve that begins so long after the leg; before it for one that has begun already."""

    curve: SCurve
    begins_s: float


def ramp_s(speed_m_s: float, most_m_s2: float) -> float:
    """Return how long it takes from rest to a speed."""
    peak = JERK_M_S3 / 2 * (math.sqrt(SNAP_S**2 + 4 * speed_m_s / JERK_M_S3) - SNAP_S)
    if peak < most_m_s2:
        return 2 * (SNAP_S + peak / JERK_M_S3)
    return speed_m_s / most_m_s2 + SNAP_S + most_m_s2 / JERK_M_S3


def overlap_s(one: SCurve, two: SCurve, pace: LegLimits) -> float:
    """Return by how much the second of two legs begins before the first one ends (advance_target_along_track).

    Half-way through the turn the target must be near enough to the corner, slower than on either leg, and not too
    curved.
    """
    lasts_s = min(one.ramp_s, two.ramp_s)
    ahead, after = one.way.scale(1 / one.way.length_m), two.way.scale(1 / two.way.length_m)
    slowest = min(pace.speed_m_s(one.way), pace.speed_m_s(two.way))
    while lasts_s > 0:
        before, behind = one.state_at(one.duration_s - lasts_s / 2), two.state_at(lasts_s / 2)
        cut = ahead.scale(before.done_m - one.way.length_m).add(after.scale(behind.done_m))
        speed = ahead.scale(before.speed_m_s).add(after.scale(behind.speed_m_s))
        curved = ahead.scale(before.accelerates_m_s2).add(after.scale(behind.accelerates_m_s2))
        if (
            cut.length_m < pace.corner_m
            and speed.length_m < slowest
            and math.hypot(curved.east_m, curved.north_m) < 2 * pace.accelerate_m_s2
            and abs(curved.up_m) < ACCELERATE_Z_M_S2
        ):
            return lasts_s
        lasts_s -= SEARCH_S
    return 0.0


def turn_s(turn_rad: float) -> float:
    """Return what a turn on the spot costs the leg after it."""
    return TURN_S * (1 - math.cos(turn_rad))


def compute_target(base: Place, strands: tuple[DelayedCurve, ...], age_s: float) -> tuple[Place, Velocity]:
    """Return where the target of several strands is and how it moves, ``base`` being where the first one begins."""
    place, velocity = base, Vector(0.0, 0.0, 0.0)
    for strand in strands:
        moment, way = strand.curve.state_at(age_s - strand.begins_s), strand.curve.way
        place = place.add(way.scale(moment.done_m / way.length_m))
        velocity = velocity.add(way.scale(moment.speed_m_s / way.length_m))
    return place, Velocity(*velocity)


def _combine_limits(way: Vector, level: float, upright: float) -> float:
    flat = math.hypot(way.east_m, way.north_m)
    if flat * upright >= abs(way.up_m) * level:
        return level * way.length_m / flat
    return upright * way.length_m / abs(way.up_m)
