"""How a multicopter flies the legs of a mission: the one description from which every flight's time is made.

A leg is flown from rest, or from the leg before it in passing, along a straight line. Autopilots build up speed with a
bounded acceleration ``a``, the acceleration with a bounded jerk ``j``, and ArduPilot the jerk over a time ``s``. The
ramp from rest to a speed ``v`` takes ``v / a + s + a / j`` where the acceleration is reached, and else
``2 (s + p / j)`` with the peak ``p = j / 2 (sqrt(s^2 + 4 v / j) - s)`` of the acceleration; it covers half of ``v``
times that. A leg of length ``d`` from rest to rest takes ``d / v`` and one ramp (ArduPilot: SCurve.cpp; flights of both
autopilots in simulation follow it, see docs/results).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from missions.geo import FloatArray
from missions.validation import Above0, From0

SHORT_M = 1e-6
LEAST_M_S = 0.1
CORNER_M_S = 8.0
TINY_S = 1e-12
STEPS = 8
"""Of Newton's method for legs too short for their speed."""


def half_turn_sines(before_m: FloatArray, after_m: FloatArray) -> FloatArray:
    """Return the sine of half the turn from ``before_m`` to ``after_m`` (..., 2): 0 straight on, 1 back.

    A vector of no length is a direction that nobody knows: it counts as a right angle.
    """
    lengths = np.hypot(before_m[..., 0], before_m[..., 1]) * np.hypot(after_m[..., 0], after_m[..., 1])
    along = before_m[..., 0] * after_m[..., 0] + before_m[..., 1] * after_m[..., 1]
    return np.asarray(np.sqrt(np.clip(0.5 * (1.0 - along / np.maximum(lengths, SHORT_M)), 0.0, 1.0)))


@dataclass(frozen=True, slots=True)
class Ramp:
    """How fast a speed is built up and taken away along one axis."""

    acceleration_m_s2: Above0
    jerk_m_s3: Above0
    smooth_s: From0 = 0.0
    """In which the jerk is built up."""

    def ramp_s(self, speed_m_s: FloatArray) -> FloatArray:
        """Return the time from rest to a speed, or from it to rest."""
        acceleration, jerk, smooth = self.acceleration_m_s2, self.jerk_m_s3, self.smooth_s
        peak = 0.5 * jerk * (np.sqrt(smooth**2 + 4.0 * speed_m_s / jerk) - smooth)
        reached = speed_m_s / acceleration + smooth + acceleration / jerk
        return np.asarray(np.where(peak >= acceleration, reached, 2.0 * (smooth + peak / jerk)))

    def rest_s(self, length_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the time of lengths at a speed from rest to rest; none takes no time."""
        ramp_s = self.ramp_s(speed_m_s)
        short = length_m < speed_m_s * ramp_s
        whole = length_m / speed_m_s + ramp_s
        if np.any(short):
            whole = np.where(short, 2.0 * self._short_ramp_s(length_m), whole)
        return np.asarray(np.where(length_m > SHORT_M, whole, 0.0))

    def leg_s(self, length_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the time of lengths at a speed with 0, 1 or 2 of their ends at rest.

        Where an end is passed half a ramp is spared, and on lengths too short for the speed half of that: autopilots
        fly no faster than they can stop by the end of the leg.
        """
        rest_s = self.rest_s(length_m, speed_m_s)
        return np.asarray(rest_s - 0.5 * (2.0 - ends) * np.minimum(self.ramp_s(speed_m_s), 0.5 * rest_s))

    def _short_ramp_s(self, length_m: FloatArray) -> FloatArray:
        """Return the ramps of lengths on which no speed is held: two of them cover the length."""
        acceleration, jerk, smooth = self.acceleration_m_s2, self.jerk_m_s3, self.smooth_s
        lag_s = smooth + acceleration / jerk
        fast_m_s = 0.5 * acceleration * (np.sqrt(lag_s**2 + 4.0 * length_m / acceleration) - lag_s)
        # Where the acceleration is not reached: length = 2 j q (s + q)^2, with q its peak over the jerk.
        q = np.cbrt(length_m / (2.0 * jerk)) + TINY_S
        for _ in range(STEPS):
            value = 2.0 * jerk * q * (smooth + q) ** 2 - length_m
            q = np.maximum(q - value / (2.0 * jerk * (smooth + q) * (smooth + 3.0 * q)), TINY_S)
        return np.asarray(np.where(jerk * q >= acceleration, fast_m_s / acceleration + lag_s, smooth + q + smooth + q))


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
    turn_s: From0
    """What beginning a leg against the direction of the one before it takes after a stop."""
    turn_power: From0
    """A turn by an angle takes this power of the sine of its half: 2 is gentle to small turns."""
    corner_s: From0
    """What an about-turn would take in passing at `CORNER_M_S`, in proportion to the speed."""
    corner_power: From0
    """As for turns."""
    settle_s: From0
    """What a stop takes beyond its ramp, until its hold begins."""
    accept_m: From0
    """So far before its end a leg with a stop is over, and its hold begins."""
    hold_s: From0
    """What a hold of the mission takes."""
    spool_s: From0
    """Of a take-off, beyond its climb: the motors, the lift-off, the climb's end."""
    take_off_m_s: Above0
    """Climb from the pad."""
    take_off_below_m: From0
    """Up to this height; then it is that of a leg."""
    land_m_s: Above0
    """Descent onto the pad."""
    land_below_m: From0
    """Below this height; above it is that of ``land_fast_m_s``."""
    land_fast_m_s: Above0
    touch_s: From0
    """Of a landing, beyond its descent: its beginning, the touch-down, the motors."""
    home_m_s: Above0
    """Over the ground on a return of its own, which no mission's speed is for."""
    home_wait_s: From0
    """Over its pad on such a return, before it comes down."""
    pass_s: From0 = 0.0
    """What passing a waypoint takes however straight the way leads on: until it goes for the next one."""
    waits: From0 = 0.0
    """Of the time of a leg over the ground, what its trajectory waits for it besides."""
    turn_speed_power: From0 = 0.0
    """A turn takes this power of the speed of arrival over `CORNER_M_S`: who still moves must first come to rest."""

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
        # A way from stop to stop is spared its last metres once, whatever number of legs it has.
        level_s = (1.0 + self.waits) * np.maximum(0.0, level_s - 0.5 * ends * self._braking_gain_s(speed_m_s))
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        return np.asarray(np.maximum(level_s, self.upright.leg_s(np.abs(rise_m), steepest, ends)))

    def _braking_gain_s(self, speed_m_s: FloatArray) -> FloatArray:
        """Return what the last metres before a stop would take: they are flown while it brakes."""
        braking_m_s2, speed_m_s = self.level.acceleration_m_s2, np.maximum(speed_m_s, LEAST_M_S)
        braked_m = np.minimum(self.accept_m, 0.5 * speed_m_s**2 / braking_m_s2)
        return np.asarray(np.sqrt(2.0 * braked_m / braking_m_s2) + (self.accept_m - braked_m) / speed_m_s)

    def leg_speed_m_s(self, length_m: FloatArray, rise_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the speeds over the ground of legs that may be too steep for the one asked."""
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        able = steepest * length_m / np.maximum(np.abs(rise_m), SHORT_M)
        return np.asarray(np.minimum(speed_m_s, np.maximum(able, SHORT_M)))

    def arrival_speed_m_s(self, length_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        """Return how fast the middle of a way from rest to rest is flown: it is braked from that at its end."""
        return np.asarray(np.minimum(speed_m_s, np.sqrt(self.level.acceleration_m_s2 * length_m)))

    def turns_s(self, before_m: FloatArray, after_m: FloatArray, arrives_m_s: FloatArray) -> FloatArray:
        """Return what beginning legs along ``after_m`` (..., 2) takes after a stop at the end of others.

        Args:
            before_m: (..., 2) along which it arrived.
            after_m: (..., 2) along which it goes on.
            arrives_m_s: (...) from which speed it has braked.
        """
        sines = half_turn_sines(before_m, after_m) ** self.turn_power
        return np.asarray(self.turn_s * sines * (arrives_m_s / CORNER_M_S) ** self.turn_speed_power)

    def corners_s(self, before_m: FloatArray, after_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return what going on along ``after_m`` (..., 2) takes more at the end of other legs that is passed."""
        sines = half_turn_sines(before_m, after_m) ** self.corner_power
        return np.asarray(self.pass_s + self.corner_s * sines * speed_m_s / CORNER_M_S)

    def take_off_s(self, climb_m: FloatArray) -> FloatArray:
        """Return the times from the order to take off until it stands over its pad."""
        slow_m = np.minimum(climb_m, self.take_off_below_m)
        return np.asarray(self.spool_s + slow_m / self.take_off_m_s + (climb_m - slow_m) / self.climb_m_s)

    def landing_s(self, drop_m: FloatArray) -> FloatArray:
        """Return the times from standing over its pad until its motors have stopped."""
        slow_m = np.minimum(drop_m, self.land_below_m)
        return np.asarray(self.touch_s + slow_m / self.land_m_s + (drop_m - slow_m) / self.land_fast_m_s)

    def return_s(self, length_m: float, rise_m: float, drop_m: float) -> tuple[float, float, float]:
        """Return the times of the climb, the level way and the landing of a return of its own, from a stand.

        Args:
            length_m: Over the ground; none is over the pad already.
            rise_m: Up to the height of the return.
            drop_m: From there onto the pad.
        """
        level_s = wait_s = 0.0
        if length_m > SHORT_M:
            level_s, wait_s = _level_s(self.level, length_m, self.home_m_s), self.home_wait_s
        return rise_m / self.climb_m_s, level_s, wait_s + _landing_s(self, drop_m)


@lru_cache(maxsize=512)
def _level_s(level: Ramp, length_m: float, speed_m_s: float) -> float:
    """Return the time of one length from rest to rest; between two positions it is asked for several times."""
    return float(level.rest_s(np.array(length_m), np.array(speed_m_s)))


@lru_cache(maxsize=512)
def _landing_s(performance: Performance, drop_m: float) -> float:
    return float(performance.landing_s(np.array(drop_m)))


@dataclass(frozen=True, slots=True)
class Tuning:
    """A parameter of an autopilot that shapes its flight, and what of its performance is in proportion to it."""

    parameter: str
    default: float
    shapes: tuple[str, ...]
    """Keys of the performance, such as `climb_m_s` and `level.acceleration_m_s2`."""
    alone: bool = False
    """Whether it replaces what parameters before it made of these."""


def apply_tunings(performance: Performance, tunings: Iterable[Tuning], parameters: Mapping[str, float]) -> Performance:
    """Return how a vehicle flies by its own parameters; what it did not say, or what makes no sense, is the default."""
    usual = performance
    for tuning in tunings:
        value = parameters.get(tuning.parameter)
        if value is None or not (math.isfinite(value) and value > 0):
            continue
        for key in tuning.shapes:
            axis, _, part = key.rpartition(".")
            factor = value / tuning.default
            if not axis:
                base = usual if tuning.alone else performance
                performance = replace(performance, **{part: factor * getattr(base, part)})
                continue
            ramp: Ramp = getattr(usual if tuning.alone else performance, axis)
            changes: dict[str, Any] = {axis: replace(ramp, **{part: factor * getattr(ramp, part)})}
            performance = replace(performance, **changes)
    return performance
