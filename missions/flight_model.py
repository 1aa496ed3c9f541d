"""Compute the times and energies of one vehicle's legs and moves, its take-off and its landing.

This is the only description of a flight. The planner's matrices (`pricing`), pre-flight checks, progress, re-plans and
reports all price their legs here, so that a plan matches what will be flown. A route consists of *moves*: the transit
to a segment's first pylon, which ends with a stop, and the inspection to its last one, which also ends with a stop. The
price of a move therefore does not depend on the moves before or after it.

Places are east, north and up in metres, the height as in the lowest layer: layers are parallel, so a move has the same
price in each. The same model gives the duration of a whole flight, leg by leg.

A leg is flown along a straight line, from rest or passing from the leg before it. Autopilots build up speed with a
bounded acceleration ``a``, the acceleration with a bounded jerk ``j``, and ArduPilot the jerk over a time ``s``. The
ramp from rest to a speed ``v`` takes ``v / a + s + a / j`` where the acceleration is reached, and else
``2 (s + p / j)`` with the peak ``p = j / 2 (sqrt(s^2 + 4 v / j) - s)`` of the acceleration; it covers half of ``v``
times that. A leg of length ``d`` from rest to rest takes ``d / v`` and one ramp (ArduPilot: SCurve.cpp; flights of both
autopilots in simulation match it, see docs/results).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from missions.geo import BoolArray, FloatArray, LocalFrame
from missions.validation import Above0, Figure, From0, Place
from missions.waypoints import FlightPath, Phase, legs_m
from planner import CLIMB_SHARE_PER_M_S, SteadyWind

SAME_PLACE_M = 0.5
"""Distance within which an inspection starts where the last one ended, without a waypoint between them."""
UNKNOWN = np.zeros(3)
"""Unknown direction."""
Speed = Annotated[Figure, Field(ge=0.001)]
Factor = Annotated[Figure, Field(ge=0.1, le=10)]
NEVER: BoolArray = np.array(False)
"""No inspection below the layer; broadcasts against any shape."""
UPRIGHT_M = 1e-6
"""Horizontal length below which a leg is vertical."""
SHORT_M = 1e-6
LEAST_M_S = 0.1
CORNER_M_S = 8.0
TINY_S = 1e-12
STEPS = 8
"""Steps of Newton's method for legs too short to reach their speed."""


def half_turn_sines(before_m: FloatArray, after_m: FloatArray) -> FloatArray:
    """Return the sine of half the turn from ``before_m`` to ``after_m`` (..., 2): 0 straight on, 1 back.

    A vector of zero length is an unknown direction: it counts as a right angle.
    """
    lengths = np.hypot(before_m[..., 0], before_m[..., 1]) * np.hypot(after_m[..., 0], after_m[..., 1])
    along = before_m[..., 0] * after_m[..., 0] + before_m[..., 1] * after_m[..., 1]
    return np.asarray(np.sqrt(np.clip(0.5 * (1.0 - along / np.maximum(lengths, SHORT_M)), 0.0, 1.0)))


@dataclass(frozen=True, slots=True)
class Ramp:
    """How speed is built up and reduced along one axis."""

    acceleration_m_s2: Above0
    jerk_m_s3: Above0
    smooth_s: From0 = 0.0
    """Time in which the jerk builds up."""

    def ramp_s(self, speed_m_s: FloatArray) -> FloatArray:
        """Return the time from rest to a speed, or back to rest."""
        acceleration, jerk, smooth = self.acceleration_m_s2, self.jerk_m_s3, self.smooth_s
        peak = 0.5 * jerk * (np.sqrt(smooth**2 + 4.0 * speed_m_s / jerk) - smooth)
        reached = speed_m_s / acceleration + smooth + acceleration / jerk
        return np.asarray(np.where(peak >= acceleration, reached, 2.0 * (smooth + peak / jerk)))

    def rest_s(self, length_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the time of lengths at a speed from rest to rest; zero length takes no time."""
        ramp_s = self.ramp_s(speed_m_s)
        short = length_m < speed_m_s * ramp_s
        whole = length_m / speed_m_s + ramp_s
        if np.any(short):
            whole = np.where(short, 2.0 * self._short_ramp_s(length_m), whole)
        return np.asarray(np.where(length_m > SHORT_M, whole, 0.0))

    def leg_s(self, length_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the time of lengths at a speed with 0, 1 or 2 of their ends at rest.

        Each passed end saves half a ramp, and on lengths too short for the speed half of that: autopilots fly no faster
        than they can stop by the end of the leg.
        """
        rest_s = self.rest_s(length_m, speed_m_s)
        return np.asarray(rest_s - 0.5 * (2.0 - ends) * np.minimum(self.ramp_s(speed_m_s), 0.5 * rest_s))

    def _short_ramp_s(self, length_m: FloatArray) -> FloatArray:
        """Return the ramps of lengths too short to hold a speed: two of them cover the length."""
        acceleration, jerk, smooth = self.acceleration_m_s2, self.jerk_m_s3, self.smooth_s
        lag_s = smooth + acceleration / jerk
        fast_m_s = 0.5 * acceleration * (np.sqrt(lag_s**2 + 4.0 * length_m / acceleration) - lag_s)
        # If the acceleration is not reached: length = 2 j q (s + q)^2, where q is its peak divided by the jerk.
        q = np.cbrt(length_m / (2.0 * jerk)) + TINY_S
        for _ in range(STEPS):
            value = 2.0 * jerk * q * (smooth + q) ** 2 - length_m
            q = np.maximum(q - value / (2.0 * jerk * (smooth + q) * (smooth + 3.0 * q)), TINY_S)
        return np.asarray(np.where(jerk * q >= acceleration, fast_m_s / acceleration + lag_s, smooth + q + smooth + q))


@dataclass(frozen=True, slots=True)
class Performance:
    """How a multicopter flies missions as encoded here under its autopilot."""

    level: Ramp
    """Ramp of horizontal flight."""
    upright: Ramp
    """Ramp of vertical flight."""
    climb_m_s: Above0
    """Greatest climb rate on a leg."""
    descent_m_s: Above0
    turn_s: From0
    """Time to turn around after a stop before a leg in the opposite direction."""
    turn_power: From0
    """Exponent on the sine of half the turn angle; 2 makes small turns cheap."""
    corner_s: From0
    """Time of an about-turn in passing at `CORNER_M_S`, proportional to the speed."""
    corner_power: From0
    """The same exponent for corners flown in passing."""
    settle_s: From0
    """Time of a stop beyond its ramp, until its hold begins."""
    accept_m: From0
    """Distance before its end at which a leg with a stop is complete and its hold begins."""
    hold_s: From0
    """Duration of a hold."""
    spool_s: From0
    """Time of a take-off beyond its climb: motors, lift-off, end of climb."""
    take_off_m_s: Above0
    """Climb from the pad."""
    take_off_below_m: From0
    """Height up to which that rate holds; above it, a leg's."""
    land_m_s: Above0
    """Descent onto the pad."""
    land_below_m: From0
    """Height below which that rate holds; above it, ``land_fast_m_s``."""
    land_fast_m_s: Above0
    touch_s: From0
    """Time of a landing beyond its descent: start, touch-down, motors."""
    home_m_s: Above0
    """Ground speed of RTL, which the mission's speed does not affect."""
    home_wait_s: From0
    """Waiting time above its pad during RTL, before the descent."""
    pass_s: From0 = 0.0
    """Time to pass a waypoint even without a turn, until it heads for the next one."""
    waits: From0 = 0.0
    """Additional share of a horizontal leg's time in which the trajectory waits for the vehicle."""
    turn_speed_power: From0 = 0.0
    """Exponent on the arrival speed over `CORNER_M_S`: a moving vehicle must first stop."""

    def legs_s(self, length_m: FloatArray, rise_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the times of straight legs; all arrays broadcast against each other.

        Args:
            length_m: Horizontal length.
            rise_m: Climb; negative for a descent.
            speed_m_s: Greatest horizontal speed; a steep leg is flown as fast as its climb rate allows.
            ends: Number of ends at rest: 0, 1 or 2.
        """
        speed_m_s = self.leg_speed_m_s(length_m, rise_m, speed_m_s)
        level_s = self.level.leg_s(length_m, speed_m_s, ends)
        # The last metres of a path from stop to stop are saved once, for any number of legs.
        level_s = (1.0 + self.waits) * np.maximum(0.0, level_s - 0.5 * ends * self._braking_gain_s(speed_m_s))
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        return np.asarray(np.maximum(level_s, self.upright.leg_s(np.abs(rise_m), steepest, ends)))

    def _braking_gain_s(self, speed_m_s: FloatArray) -> FloatArray:
        """Return the time saved at a stop: its last metres overlap with the braking."""
        braking_m_s2, speed_m_s = self.level.acceleration_m_s2, np.maximum(speed_m_s, LEAST_M_S)
        braked_m = np.minimum(self.accept_m, 0.5 * speed_m_s**2 / braking_m_s2)
        return np.asarray(np.sqrt(2.0 * braked_m / braking_m_s2) + (self.accept_m - braked_m) / speed_m_s)

    def leg_speed_m_s(self, length_m: FloatArray, rise_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the horizontal speeds of legs that may be too steep for the requested speed."""
        steepest = np.where(rise_m > 0, self.climb_m_s, self.descent_m_s)
        able = steepest * length_m / np.maximum(np.abs(rise_m), SHORT_M)
        return np.asarray(np.minimum(speed_m_s, np.maximum(able, SHORT_M)))

    def arrival_speed_m_s(self, length_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        """Return the mid-path speed of a path from rest to rest, from which it brakes at the end."""
        return np.asarray(np.minimum(speed_m_s, np.sqrt(self.level.acceleration_m_s2 * length_m)))

    def turns_s(self, before_m: FloatArray, after_m: FloatArray, arrives_m_s: FloatArray) -> FloatArray:
        """Return the time to begin legs along ``after_m`` (..., 2) after a stop at the end of others.

        Args:
            before_m: (..., 2) direction of arrival.
            after_m: (..., 2) direction of departure.
            arrives_m_s: (...) speed from which it braked.
        """
        sines = half_turn_sines(before_m, after_m) ** self.turn_power
        return np.asarray(self.turn_s * sines * (arrives_m_s / CORNER_M_S) ** self.turn_speed_power)

    def corners_s(self, before_m: FloatArray, after_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return the extra time to continue along ``after_m`` (..., 2) when passing the end of other legs."""
        sines = half_turn_sines(before_m, after_m) ** self.corner_power
        return np.asarray(self.pass_s + self.corner_s * sines * speed_m_s / CORNER_M_S)

    def landing_s(self, drop_m: FloatArray) -> FloatArray:
        """Return the times from hovering over its pad until its motors have stopped."""
        slow_m = np.minimum(drop_m, self.land_below_m)
        return np.asarray(self.touch_s + slow_m / self.land_m_s + (drop_m - slow_m) / self.land_fast_m_s)

    def return_s(self, length_m: float, rise_m: float, drop_m: float) -> tuple[float, float, float]:
        """Return the times of the climb, the level flight and the landing of an RTL from hover.

        Args:
            length_m: Horizontal length; 0 if already over the pad.
            rise_m: Climb to the RTL height.
            drop_m: Descent from there onto the pad.
        """
        level_s = wait_s = 0.0
        if length_m > SHORT_M:
            level_s, wait_s = _level_s(self.level, length_m, self.home_m_s), self.home_wait_s
        return rise_m / self.climb_m_s, level_s, wait_s + _landing_s(self, drop_m)


@lru_cache(maxsize=512)
def _level_s(level: Ramp, length_m: float, speed_m_s: float) -> float:
    """Return the time of one length from rest to rest; cached, as it is used several times per position update."""
    return float(level.rest_s(np.array(length_m), np.array(speed_m_s)))


@lru_cache(maxsize=512)
def _landing_s(performance: Performance, drop_m: float) -> float:
    return float(performance.landing_s(np.array(drop_m)))


@dataclass(frozen=True, slots=True)
class Tuning:
    """An autopilot parameter that affects flight, and the performance figures proportional to it."""

    parameter: str
    default: float
    shapes: tuple[str, ...]
    """Keys of the performance, e.g. `climb_m_s` and `level.acceleration_m_s2`."""
    alone: bool = False
    """Whether it replaces the effect of earlier parameters."""


def apply_tunings(performance: Performance, tunings: Iterable[Tuning], parameters: Mapping[str, float]) -> Performance:
    """Return a vehicle's performance by its own parameters; missing or implausible ones take the default."""
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


@dataclass(frozen=True, slots=True)
class Pace:
    """Factors on the times of legs: 1 is as modelled, more is slower.

    A vehicle that takes longer for a leg draws power for longer: energies of these legs have the same factor.
    """

    inspect: Factor = 1.0
    transit: Factor = 1.0

    def factor_of(self, phase: Phase) -> float:
        """Return the factor of legs of a phase; take-offs and landings are as modelled.

        >>> Pace(1.2, 1.1).factor_of(Phase.RETURN)
        1.1
        """
        if phase is Phase.INSPECT:
            return self.inspect
        return self.transit if phase in (Phase.TRANSIT, Phase.RETURN) else 1.0

    def combine(self, other: Pace) -> Pace:
        """Return the combined factors."""
        return Pace(self.inspect * other.inspect, self.transit * other.transit)


AS_MODELLED = Pace()


def find_vertical_legs(
    from_m: FloatArray, first_m: FloatArray, from_low: BoolArray, to_low: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Return which moves between (..., 3) places begin with a climb, and which descend before their inspection.

    Arrays broadcast against each other. A visit that begins within `SAME_PLACE_M` follows without a transit.

    Args:
        from_m: Starts of moves.
        first_m: Starts of their visits.
        from_low: Which moves start below the layer.
        to_low: Which visits start below the layer.
    """
    if not (from_low.any() or to_low.any()):
        return NEVER, NEVER
    there_m = first_m - from_m
    away = np.hypot(there_m[..., 0], there_m[..., 1]) > SAME_PLACE_M
    return from_low & (away | ~to_low), to_low & (away | ~from_low)


@dataclass(frozen=True, slots=True)
class Base:
    """Take-off and landing place of a vehicle."""

    place_m: Place
    """Place above its pad where its climb ends and its landing begins."""
    climb_m: Annotated[Figure, Field(ge=0)]
    """Climb from the pad to its own layer."""


@dataclass(frozen=True, slots=True)
class FlightModel:
    """Times and energies of one vehicle's flights."""

    performance: Performance
    power: SteadyWind
    """Power by air speed, and wind."""
    transit_speed_m_s: Speed
    inspection_speed_m_s: Speed
    pace: Pace = AS_MODELLED
    """Learned factors of this vehicle."""

    def price_legs(self, along_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (...) float64 seconds and energies in percent of a full battery of straight legs.

        Args:
            along_m: (..., 3) float64, east, north and up.
            speed_m_s: (...) float64, greatest horizontal speed.
            ends: (...) float64, number of ends at rest.
        """
        length_m, rise_m = np.hypot(along_m[..., 0], along_m[..., 1]), along_m[..., 2]
        seconds = self.performance.legs_s(length_m, rise_m, speed_m_s, ends)
        speed = self.performance.leg_speed_m_s(length_m, rise_m, speed_m_s)
        # A leg too short for its speed is two ramps, whose mean speed is half the peak speed.
        peak = np.minimum(speed, 2.0 * length_m / np.maximum(seconds, 1e-9))
        ramps_s = np.minimum(seconds, ends * self.performance.level.ramp_s(peak))
        toward = along_m[..., :2] / np.maximum(length_m, 1e-9)[..., np.newaxis] * peak[..., np.newaxis]
        cruise, half, rest = (self._rates_pct_per_s(share * toward) for share in (1.0, 0.5, 0.0))
        ramp_pct = ramps_s * (cruise + 4.0 * half + rest) / 6.0  # Simpson's rule over speeds from 0 to the peak
        climb_pct = CLIMB_SHARE_PER_M_S * np.maximum(rise_m, 0.0) * cruise
        return seconds, np.asarray((seconds - ramps_s) * cruise + ramp_pct + climb_pct)

    @property
    def hover_pct_per_s(self) -> float:
        """Energy per second at rest over a place."""
        return float(self._rates_pct_per_s(np.zeros(2)))

    def price_take_off(self, climb_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of climbs from the pad, from the take-off command until hover above it."""
        own, slow_m = self.performance, np.minimum(climb_m, self.performance.take_off_below_m)
        seconds = np.asarray(own.spool_s + slow_m / own.take_off_m_s + (climb_m - slow_m) / own.climb_m_s)
        return seconds, np.asarray((seconds + CLIMB_SHARE_PER_M_S * climb_m) * self.hover_pct_per_s)

    def price_landing(self, drop_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of landings from over the pad."""
        seconds = self.performance.landing_s(drop_m)
        return seconds, np.asarray(seconds * self.hover_pct_per_s)

    def price_moves(
        self, facing_m: FloatArray, legs_m: FloatArray, along_m: FloatArray, down: BoolArray = NEVER
    ) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of moves from rest; arrays broadcast against each other.

        Args:
            facing_m: (..., 3) direction of arrival at their start; of zero length if unknown.
            legs_m: (..., w, 3) legs of their transits to where the visits begin.
            along_m: (..., 3) vector from there to where the visits end.
            down: (...) visits before which it descends vertically on arrival.
        """
        away = np.hypot(legs_m[..., 0], legs_m[..., 1]).sum(axis=-1) > SAME_PLACE_M
        transit_s, transit_pct = self._price_transit(facing_m, legs_m, self.performance.hold_s)
        before_m = arrival_vectors_m(down, np.where(away[..., np.newaxis], legs_m[..., -1, :], facing_m))
        fast_m_s = np.where(away, self.transit_speed_m_s, self.inspection_speed_m_s)
        shape, own, pace = along_m.shape[:-1], self.performance, self.pace.inspect
        inspect_s, inspect_pct = self.price_legs(
            along_m, np.full(shape, self.inspection_speed_m_s), np.full(shape, 2.0)
        )
        turns_s = own.turns_s(before_m, along_m, self._arrival_speed_m_s(before_m, fast_m_s))
        stays_s = own.settle_s + (own.hold_s + turns_s)
        inspect_s, inspect_pct = pace * (inspect_s + stays_s), pace * (inspect_pct + stays_s * self.hover_pct_per_s)
        seconds = np.where(away, transit_s, 0.0) + inspect_s
        return np.asarray(seconds), np.asarray(np.where(away, transit_pct, 0.0) + inspect_pct)

    def price_ways_home(self, facing_m: FloatArray, legs_m: FloatArray, base: Base) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of returns from rest onto a pad along (..., w, 3) legs."""
        level_s, level_pct = self._price_transit(facing_m, legs_m, 0.0)
        land_s, land_pct = self.price_landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def price_vertical(self, rise_m: float) -> tuple[float, float]:
        """Return seconds and energy of a vertical climb, or a descent if negative, with the stop at its end."""
        seconds, pct = self._price_transit(UNKNOWN, np.array([[0.0, 0.0, rise_m]]), self.performance.hold_s)
        return float(seconds), float(pct)

    def _price_transit(self, before_m: FloatArray, legs_m: FloatArray, hold_s: float) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies from stop to stop along (..., w, 3) legs; places between them are passed."""
        speed_m_s, ends = np.full(legs_m.shape[:-1], self.transit_speed_m_s), np.zeros(legs_m.shape[:-1])
        ends[..., 0] += 1.0
        ends[..., -1] += 1.0
        seconds, pct = self.price_legs(legs_m, speed_m_s, ends)
        own, pace = self.performance, self.pace.transit
        arrives_m_s = self._arrival_speed_m_s(before_m, self.inspection_speed_m_s)
        stays_s = own.settle_s + (hold_s + own.turns_s(before_m, legs_m[..., 0, :], arrives_m_s))
        stays_s = stays_s + own.corners_s(legs_m[..., :-1, :], legs_m[..., 1:, :], speed_m_s[..., 1:]).sum(axis=-1)
        return pace * (seconds.sum(axis=-1) + stays_s), pace * (pct.sum(axis=-1) + stays_s * self.hover_pct_per_s)

    def _arrival_speed_m_s(self, before_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        return self.performance.arrival_speed_m_s(np.hypot(before_m[..., 0], before_m[..., 1]), speed_m_s)

    def _rates_pct_per_s(self, velocities_m_s: FloatArray) -> FloatArray:
        return self.power.rates_pct_per_s(velocities_m_s[..., 0], velocities_m_s[..., 1])


def arrival_vectors_m(upright: BoolArray, along_m: FloatArray) -> FloatArray:
    """Return the directions of arrival; after a vertical leg there is none."""
    return np.where(upright[..., np.newaxis], UNKNOWN, along_m) if upright.any() else along_m


@dataclass(frozen=True, slots=True)
class LegEstimate:
    """One leg, with the hold at its end."""

    duration_s: float
    energy_pct: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """A whole flight."""

    duration_s: float
    energy_pct: float
    legs: tuple[LegEstimate, ...]
    """Estimates by waypoint: the leg that ends there."""


def estimate(path: FlightPath, model: FlightModel, *, consumption: float = 1.0) -> Estimate:
    """Return the duration in seconds and the energy in percent of a full battery of a flight.

    Args:
        path: The flight; a path without waypoints takes nothing.
        model: What the vehicle's flights take.
        consumption: The vehicle's own, relative to the energy model.
    """
    if not path.waypoints:
        return Estimate(0.0, 0.0, ())
    first = path.waypoints[0]
    ends_m = legs_m(path, LocalFrame(first.lat_deg, first.lon_deg))
    along_m = ends_m[:, 1] - ends_m[:, 0]
    stops = np.array([_is_stop_at_end(path, along_m, index) for index in range(len(path.waypoints))], dtype=np.float64)
    at_rest = np.concatenate(([1.0], stops[:-1])) + stops
    speeds = np.array([point.speed_m_s for point in path.waypoints])
    seconds, pct = model.price_legs(along_m, speeds, at_rest)
    performance = model.performance
    for index, point in enumerate(path.waypoints):
        if point.phase in (Phase.TAKEOFF, Phase.LAND):
            upright = model.price_take_off if point.phase is Phase.TAKEOFF else model.price_landing
            seconds[index], pct[index] = upright(np.abs(along_m[index, 2]))
            continue
        more_s = performance.settle_s * stops[index] + max(performance.hold_s, point.hover_s) * point.hold
        before_m = along_m[index - 1] if index and path.waypoints[index - 1].phase is not Phase.TAKEOFF else UNKNOWN
        if index and stops[index - 1]:
            stays_there = math.hypot(along_m[index, 0], along_m[index, 1]) < UPRIGHT_M
            came_m = 0.0 if stays_there else math.hypot(before_m[0], before_m[1])  # it comes to rest going up
            arrives_m_s = performance.arrival_speed_m_s(np.array(came_m), speeds[index - 1])
            more_s += float(performance.turns_s(before_m, along_m[index], arrives_m_s))
        elif index:
            more_s += float(performance.corners_s(before_m, along_m[index], speeds[index]))
        seconds[index] += more_s
        pct[index] += more_s * model.hover_pct_per_s
    paces = np.array([model.pace.factor_of(point.phase) for point in path.waypoints])
    seconds, pct = paces * seconds, consumption * paces * pct
    legs = tuple(LegEstimate(*leg) for leg in zip(seconds.tolist(), pct.tolist(), strict=True))
    return Estimate(float(seconds.sum()), float(pct.sum()), legs)


def _is_stop_at_end(path: FlightPath, along_m: FloatArray, index: int) -> bool:
    point = path.waypoints[index]
    if point.hold or point.phase in (Phase.TAKEOFF, Phase.LAND) or index + 1 == len(path.waypoints):
        return True
    before, after = along_m[index, :2], along_m[index + 1, :2]
    # Straight up or down: the vehicle stands first.
    return math.hypot(*before) * math.hypot(*after) < 1e-6
