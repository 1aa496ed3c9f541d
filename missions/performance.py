"""How a multicopter flies the legs of a mission: the one description from which every flight's time is made.

A leg is flown from rest, or from the leg before it in passing, along a straight line. The autopilots build up speed
with a bounded acceleration, and the acceleration with a bounded jerk: the ramp from rest to a speed ``v`` then takes
``v / a + a / j``, or ``2 sqrt(v / j)`` where the acceleration is not reached, and covers half of ``v`` times that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from missions.geo import FloatArray
from missions.validation import Figure

Above0 = Annotated[Figure, Field(gt=0)]
From0 = Annotated[Figure, Field(ge=0)]
SHORT_M = 1e-6


@dataclass(frozen=True, slots=True)
class Ramp:
    """How fast a speed is built up and taken away along one axis."""

    acceleration_m_s2: Above0
    jerk_m_s3: Above0

    def ramp_s(self, speed_m_s: FloatArray) -> FloatArray:
        """Return the time from rest to a speed, or from it to rest."""
        full = self.acceleration_m_s2**2 / self.jerk_m_s3
        reached = speed_m_s / self.acceleration_m_s2 + self.acceleration_m_s2 / self.jerk_m_s3
        return np.asarray(np.where(speed_m_s >= full, reached, 2.0 * np.sqrt(speed_m_s / self.jerk_m_s3)))

    def peak_m_s(self, length_m: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the speed that is reached on lengths too short for more, with 1 or 2 ends at rest."""
        area = 2.0 * length_m / np.maximum(ends, 1)  # speed times ramp
        lag_s, full = self.acceleration_m_s2 / self.jerk_m_s3, self.acceleration_m_s2**2 / self.jerk_m_s3
        reached = 0.5 * self.acceleration_m_s2 * (np.sqrt(lag_s**2 + 4.0 * area / self.acceleration_m_s2) - lag_s)
        return np.asarray(np.where(reached >= full, reached, np.cbrt(area**2 * self.jerk_m_s3 / 4.0)))

    def leg_s(self, length_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the time of lengths at a speed, with 0, 1 or 2 of their ends at rest."""
        ramp_s = self.ramp_s(speed_m_s)
        whole = length_m / speed_m_s + 0.5 * ends * ramp_s
        short = (ends > 0) & (length_m < 0.5 * ends * speed_m_s * ramp_s)
        if not np.any(short):
            return np.asarray(whole)
        return np.asarray(np.where(short, ends * self.ramp_s(self.peak_m_s(length_m, ends)), whole))


@dataclass(frozen=True, slots=True)
class Performance:
    """How a multicopter moves under its autopilot, on missions as they are encoded here."""

    level: Ramp
    """Over the ground."""
    upright: Ramp
    """Up and down."""
    climb_m_s: Above0
    """At most, on a leg."""
    descent_m_s: Above0
    settle_s: From0
    """What a stop takes beyond its ramp, until its hold begins."""
    hold_s: From0
    """What a hold of the mission takes then."""
    take_off_m_s: Above0
    """Climb from the pad."""
    spool_s: From0
    """From the order to take off until it climbs, and what the climb's end takes beyond its ramp."""
    land_fast_m_s: Above0
    """Descent onto the pad."""
    land_m_s: Above0
    """Its last part's speed."""
    land_below_m: From0
    """Height of its last part."""
    touch_s: From0
    """What a landing takes beyond its descents."""

    def legs_s(self, length_m: FloatArray, rise_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the times of straight legs; all arrays broadcast against each other.

        Args:
            length_m: Over the ground.
            rise_m: Up, or below zero down.
            speed_m_s: Over the ground, at most: a steep leg is flown as fast as its height allows.
            ends: How many of the two ends are at rest: 0, 1 or 2.
        """
        speed_m_s = self.leg_speed_m_s(length_m, rise_m, speed_m_s)
        level_s = self.level.leg_s(length_m, speed_m_s, ends)
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        return np.asarray(np.maximum(level_s, self.upright.leg_s(np.abs(rise_m), steepest, ends)))

    def leg_speed_m_s(self, length_m: FloatArray, rise_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the speeds over the ground of legs that may be too steep for the one asked."""
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        able = steepest * length_m / np.maximum(np.abs(rise_m), SHORT_M)
        return np.asarray(np.minimum(speed_m_s, np.maximum(able, SHORT_M)))

    def take_off_s(self, climb_m: FloatArray) -> FloatArray:
        """Return the times from the order to take off until it stands over its pad."""
        two = np.full_like(climb_m, 2.0)
        return np.asarray(self.spool_s + self.upright.leg_s(climb_m, np.full_like(climb_m, self.take_off_m_s), two))

    def landing_s(self, drop_m: FloatArray) -> FloatArray:
        """Return the times from standing over its pad to the ground."""
        slow_m = np.minimum(drop_m, self.land_below_m)
        fast_m = drop_m - slow_m
        one = np.full_like(drop_m, 1.0)
        fast_s = self.upright.leg_s(fast_m, np.full_like(drop_m, self.land_fast_m_s), one)
        return np.asarray(fast_s + slow_m / self.land_m_s + self.touch_s)
