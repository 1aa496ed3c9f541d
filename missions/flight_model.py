"""What one vehicle's flights take: the times and energies of legs and moves, of its take-off and its landing.

There is one description of a flight. The planner's matrices (`pricing`), the checks before the flight, its progress,
re-plans and reports price their legs here, so that a plan says what will be flown. A *move* is what a route consists
of: the transit to a segment's first pylon, which ends with a stop, and the inspection to its last one, which does too.
What a move takes therefore does not depend on what comes before or after it.

Places are east, north and up in metres, the height as it would be in the lowest layer: layers are parallel, so that
what a move takes is the same in each. How long a whole flight takes, leg by leg, follows from the same model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from missions.geo import BoolArray, FloatArray, LocalFrame
from missions.performance import Performance
from missions.validation import Figure, Place
from missions.waypoints import FlightPath, Phase, legs_m
from planner import CLIMB_SHARE_PER_M_S, SteadyWind

SAME_PLACE_M = 0.5
"""An inspection that starts this near to where the last one ended needs no waypoint in between."""
UNKNOWN = np.zeros(3)
"""The direction of who may face anywhere."""
Speed = Annotated[Figure, Field(ge=0.001)]
Factor = Annotated[Figure, Field(ge=0.1, le=10)]
NEVER: BoolArray = np.array(False)
"""As every move is where vehicles inspect in their layers; it broadcasts against any others."""
UPRIGHT_M = 1e-6
"""A leg that goes less far over the ground goes straight up or down."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Factors on the times of legs: 1 is as the model has it, more is slower.

    A vehicle that takes longer for a leg draws its power for longer: energies of these legs have the same factor.
    """

    inspect: Factor = 1.0
    transit: Factor = 1.0

    def factor_of(self, phase: Phase) -> float:
        """Return the factor of legs of a phase; take-offs and landings are as the model has them.

        >>> Pace(1.2, 1.1).factor_of(Phase.RETURN)
        1.1
        """
        if phase is Phase.INSPECT:
            return self.inspect
        return self.transit if phase in (Phase.TRANSIT, Phase.RETURN) else 1.0

    def combine(self, other: Pace) -> Pace:
        """Return what both together make of a time."""
        return Pace(self.inspect * other.inspect, self.transit * other.transit)


AS_MODELLED = Pace()


@dataclass(frozen=True, slots=True, eq=False)
class VerticalLegs:
    """Of some moves: which begin with a way up, and which come down before their inspection."""

    up: BoolArray
    down: BoolArray

    @classmethod
    def find_between(
        cls, from_m: FloatArray, first_m: FloatArray, from_low: BoolArray, to_low: BoolArray, near_m: float
    ) -> VerticalLegs:
        """Return those of moves between (..., 3) places; arrays broadcast against each other.

        Args:
            from_m: Where moves begin.
            first_m: Where their visits begin.
            from_low: Which of the former are below the layer.
            to_low: Which of the latter are.
            near_m: A visit that begins this near to there follows on without a way between.
        """
        if not (from_low.any() or to_low.any()):
            return cls(NEVER, NEVER)
        there_m = first_m - from_m
        away = np.hypot(there_m[..., 0], there_m[..., 1]) > near_m
        return cls(from_low & (away | ~to_low), to_low & (away | ~from_low))


@dataclass(frozen=True, slots=True)
class Base:
    """Where a vehicle takes off and lands."""

    place_m: Place
    """Over its pad, where its climb ends and its landing begins."""
    climb_m: Annotated[Figure, Field(ge=0)]
    """From the pad's ground to there, in the vehicle's own layer."""


@dataclass(frozen=True, slots=True)
class FlightModel:
    """What one vehicle's flights take."""

    performance: Performance
    power: SteadyWind
    """What it uses at an air speed, and the wind."""
    transit_speed_m_s: Speed
    inspection_speed_m_s: Speed
    pace: Pace = AS_MODELLED
    """What is known of this very vehicle: on its moves as a whole."""

    def price_legs(self, along_m: FloatArray, speed_m_s: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (...) float64 seconds and energies in percent of a full battery of straight legs.

        Args:
            along_m: (..., 3) float64, east, north and up.
            speed_m_s: (...) float64 over the ground, at most.
            ends: (...) float64, how many of the two ends are at rest.
        """
        length_m, rise_m = np.hypot(along_m[..., 0], along_m[..., 1]), along_m[..., 2]
        seconds = self.performance.legs_s(length_m, rise_m, speed_m_s, ends)
        speed = self.performance.leg_speed_m_s(length_m, rise_m, speed_m_s)
        # A leg too short for its speed is two ramps, whose mean speed is half of the peak's.
        peak = np.minimum(speed, 2.0 * length_m / np.maximum(seconds, 1e-9))
        ramps_s = np.minimum(seconds, ends * self.performance.level.ramp_s(peak))
        toward = along_m[..., :2] / np.maximum(length_m, 1e-9)[..., np.newaxis] * peak[..., np.newaxis]
        cruise, half, rest = (self._rates_pct_per_s(share * toward) for share in (1.0, 0.5, 0.0))
        ramp_pct = ramps_s * (cruise + 4.0 * half + rest) / 6.0  # Simpson's rule over speeds from 0 to the peak
        climb_pct = CLIMB_SHARE_PER_M_S * np.maximum(rise_m, 0.0) * cruise
        return seconds, np.asarray((seconds - ramps_s) * cruise + ramp_pct + climb_pct)

    @property
    def hover_pct_per_s(self) -> float:
        """What a second at rest over a place uses."""
        return float(self._rates_pct_per_s(np.zeros(2)))

    def price_take_off(self, climb_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of climbs from the pad."""
        seconds = self.performance.take_off_s(climb_m)
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
            facing_m: (..., 3) along which the vehicle arrived where they begin; of no length where nobody knows.
            legs_m: (..., w, 3) the legs of their transits to where the visits begin.
            along_m: (..., 3) from there to where the visits end.
            down: (...) which visits it comes down to, straight, when it is there.
        """
        away = np.hypot(legs_m[..., 0], legs_m[..., 1]).sum(axis=-1) > SAME_PLACE_M
        transit_s, transit_pct = self._price_transit(facing_m, legs_m, self.performance.hold_s)
        before_m = arrival_vectors_m(down, np.where(away[..., np.newaxis], legs_m[..., -1, :], facing_m))
        fast_m_s = np.where(away, self.transit_speed_m_s, self.inspection_speed_m_s)
        inspect_s, inspect_pct = self._price_inspection(before_m, self._arrival_speed_m_s(before_m, fast_m_s), along_m)
        seconds = np.where(away, transit_s, 0.0) + inspect_s
        return np.asarray(seconds), np.asarray(np.where(away, transit_pct, 0.0) + inspect_pct)

    def price_ways_home(self, facing_m: FloatArray, legs_m: FloatArray, base: Base) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of ways from rest onto a pad, whose legs over the ground are (..., w, 3)."""
        level_s, level_pct = self._price_transit(facing_m, legs_m, 0.0)
        land_s, land_pct = self.price_landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def price_vertical(self, rise_m: float) -> tuple[float, float]:
        """Return seconds and energy of a way straight up, or below zero down, with the stop at its end."""
        seconds, pct = self._price_transit(UNKNOWN, np.array([[0.0, 0.0, rise_m]]), self.performance.hold_s)
        return float(seconds), float(pct)

    def _price_transit(self, before_m: FloatArray, legs_m: FloatArray, hold_s: float) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies from stop to stop along (..., w, 3) legs; the places between them are passed."""
        speed_m_s, ends = np.full(legs_m.shape[:-1], self.transit_speed_m_s), np.zeros(legs_m.shape[:-1])
        ends[..., 0] += 1.0
        ends[..., -1] += 1.0
        seconds, pct = self.price_legs(legs_m, speed_m_s, ends)
        own, pace = self.performance, self.pace.transit
        arrives_m_s = self._arrival_speed_m_s(before_m, self.inspection_speed_m_s)
        stays_s = own.settle_s + (hold_s + own.turns_s(before_m, legs_m[..., 0, :], arrives_m_s))
        stays_s = stays_s + own.corners_s(legs_m[..., :-1, :], legs_m[..., 1:, :], speed_m_s[..., 1:]).sum(axis=-1)
        return pace * (seconds.sum(axis=-1) + stays_s), pace * (pct.sum(axis=-1) + stays_s * self.hover_pct_per_s)

    def _price_inspection(
        self, before_m: FloatArray, arrives_m_s: FloatArray, along_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        shape, own, pace = along_m.shape[:-1], self.performance, self.pace.inspect
        seconds, pct = self.price_legs(along_m, np.full(shape, self.inspection_speed_m_s), np.full(shape, 2.0))
        stays_s = own.settle_s + (own.hold_s + own.turns_s(before_m, along_m, arrives_m_s))
        return pace * (seconds + stays_s), pace * (pct + stays_s * self.hover_pct_per_s)

    def _arrival_speed_m_s(self, before_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        return self.performance.arrival_speed_m_s(np.hypot(before_m[..., 0], before_m[..., 1]), speed_m_s)

    def _rates_pct_per_s(self, velocities_m_s: FloatArray) -> FloatArray:
        return self.power.rates_pct_per_s(velocities_m_s[..., 0], velocities_m_s[..., 1])


def arrival_vectors_m(upright: BoolArray, along_m: FloatArray) -> FloatArray:
    """Return along what vehicles arrive: nobody who comes straight up or down arrives along anything."""
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
    """One for each waypoint: the leg that ends there."""


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
