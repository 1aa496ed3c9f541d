"""What one vehicle's flights take: the times and energies of legs and moves, of its take-off and its landing.

There is one description of a flight. The planner's matrices (`pricing`), the checks before the flight, its progress,
re-plans and reports price their legs here, so that a plan says what will be flown. A *move* is what a route consists
of: the transit to a segment's first pylon, which ends with a stop, and the inspection to its last one, which does too.
What a move takes therefore does not depend on what comes before or after it.

Places are east, north and up in metres, the height as it would be in the lowest layer: layers are parallel, so that
what a move takes is the same in each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from missions.geo import BoolArray, FloatArray
from missions.pace import AS_MODELLED, Pace
from missions.performance import Performance
from missions.validation import Figure, Place
from missions.vertical_legs import NEVER
from planner import CLIMB_SHARE_PER_M_S, SteadyWind

SAME_PLACE_M = 0.5
"""An inspection that starts this near to where the last one ended needs no waypoint in between."""
UNKNOWN = np.zeros(3)
"""The direction of who may face anywhere."""
Speed = Annotated[Figure, Field(ge=0.001)]


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
        self, from_m: FloatArray, facing_m: FloatArray, first_m: FloatArray, last_m: FloatArray,
        down: BoolArray = NEVER,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """Return seconds and energies of moves from rest; the four arrays (..., 3) broadcast against each other.

        Args:
            from_m: Where they begin.
            facing_m: Along which the vehicle arrived there; of no length where nobody knows.
            first_m: Where the visits begin.
            last_m: Where they end.
            down: Which visits it comes down to, straight, when it is there.
        """
        there_m, along_m = first_m - from_m, last_m - first_m
        away = np.hypot(there_m[..., 0], there_m[..., 1]) > SAME_PLACE_M
        hold_s = self.performance.hold_s
        transit_s, transit_pct = self._price_transit(facing_m, there_m, hold_s)
        before_m = np.where(away[..., np.newaxis], there_m, facing_m)
        before_m = arrival_vectors_m(down, before_m)
        fast_m_s = np.where(away, self.transit_speed_m_s, self.inspection_speed_m_s)
        inspect_s, inspect_pct = self._price_inspection(before_m, self._arrival_speed_m_s(before_m, fast_m_s), along_m)
        seconds = np.where(away, transit_s, 0.0) + inspect_s
        return np.asarray(seconds), np.asarray(np.where(away, transit_pct, 0.0) + inspect_pct)

    def price_moves_along(
        self, facing_m: FloatArray, ways_m: FloatArray, last_m: FloatArray, down: BoolArray = NEVER
    ) -> tuple[FloatArray, FloatArray]:
        """Return (k,) seconds and energies of moves whose transits lead through (k, w, 3) places."""
        transit_s, transit_pct = self._price_transit_along(facing_m, ways_m, self.performance.hold_s)
        before_m, along_m = ways_m[:, -1] - ways_m[:, -2], last_m - ways_m[:, -1]
        before_m = arrival_vectors_m(down, before_m)
        arrives_m_s = self._arrival_speed_m_s(before_m, self.transit_speed_m_s)
        inspect_s, inspect_pct = self._price_inspection(before_m, arrives_m_s, along_m)
        return transit_s + inspect_s, transit_pct + inspect_pct

    def price_ways_home(self, from_m: FloatArray, facing_m: FloatArray, base: Base) -> tuple[FloatArray, FloatArray]:
        """Return seconds and energies of the ways from rest (..., 3) onto a pad."""
        there_m = np.array(base.place_m) - from_m
        level_s, level_pct = self._price_transit(facing_m, there_m, 0.0)
        land_s, land_pct = self.price_landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def price_ways_home_along(
        self, facing_m: FloatArray, ways_m: FloatArray, base: Base
    ) -> tuple[FloatArray, FloatArray]:
        """Return (k,) the same of ways through (k, w, 3) places."""
        level_s, level_pct = self._price_transit_along(facing_m, ways_m, 0.0)
        land_s, land_pct = self.price_landing(np.array(base.climb_m))
        return level_s + land_s, level_pct + land_pct

    def price_vertical(self, rise_m: float) -> tuple[float, float]:
        """Return seconds and energy of a way straight up, or below zero down, with the stop at its end."""
        seconds, pct = self._price_transit(UNKNOWN, np.array([0.0, 0.0, rise_m]), self.performance.hold_s)
        return float(seconds), float(pct)

    def _price_transit_along(
        self, before_m: FloatArray, ways_m: FloatArray, hold_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return (k,) seconds and energies from stop to stop through (k, w, 3) places; those between are passed."""
        along_m = np.diff(ways_m, axis=1)
        speed_m_s = np.full(along_m.shape[:-1], self.transit_speed_m_s)
        ends = np.zeros(along_m.shape[:-1])
        ends[:, 0] += 1.0
        ends[:, -1] += 1.0
        seconds, pct = self.price_legs(along_m, speed_m_s, ends)
        own = self.performance
        arrives_m_s = self._arrival_speed_m_s(before_m, self.inspection_speed_m_s)
        stays_s = own.settle_s + hold_s + own.turns_s(before_m, along_m[:, 0], arrives_m_s)
        stays_s = stays_s + own.corners_s(along_m[:, :-1], along_m[:, 1:], speed_m_s[:, 1:]).sum(axis=1)
        pace = self.pace.transit
        return pace * (seconds.sum(axis=1) + stays_s), pace * (pct.sum(axis=1) + stays_s * self.hover_pct_per_s)

    def _price_transit(self, before_m: FloatArray, along_m: FloatArray, hold_s: float) -> tuple[FloatArray, FloatArray]:
        arrives_m_s = self._arrival_speed_m_s(before_m, self.inspection_speed_m_s)
        turns_s = self.performance.turns_s(before_m, along_m, arrives_m_s)
        return self._price_stopping_leg(along_m, self.transit_speed_m_s, hold_s + turns_s, self.pace.transit)

    def _price_inspection(
        self, before_m: FloatArray, arrives_m_s: FloatArray, along_m: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        turns_s = self.performance.turns_s(before_m, along_m, arrives_m_s)
        return self._price_stopping_leg(
            along_m, self.inspection_speed_m_s, self.performance.hold_s + turns_s, self.pace.inspect
        )

    def _price_stopping_leg(
        self, along_m: FloatArray, speed_m_s: float, stays_s: FloatArray, pace: float
    ) -> tuple[FloatArray, FloatArray]:
        shape = along_m.shape[:-1]
        seconds, pct = self.price_legs(along_m, np.full(shape, speed_m_s), np.full(shape, 2.0))
        stays_s = self.performance.settle_s + stays_s
        return pace * (seconds + stays_s), pace * (pct + stays_s * self.hover_pct_per_s)

    def _arrival_speed_m_s(self, before_m: FloatArray, speed_m_s: FloatArray | float) -> FloatArray:
        return self.performance.arrival_speed_m_s(np.hypot(before_m[..., 0], before_m[..., 1]), speed_m_s)

    def _rates_pct_per_s(self, velocities_m_s: FloatArray) -> FloatArray:
        return self.power.rates_pct_per_s(velocities_m_s[..., 0], velocities_m_s[..., 1])


def arrival_vectors_m(upright: BoolArray, along_m: FloatArray) -> FloatArray:
    """Return along what vehicles arrive: nobody who comes straight up or down arrives along anything."""
    return np.where(upright[..., np.newaxis], UNKNOWN, along_m) if upright.any() else along_m
