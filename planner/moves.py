"""Time and energy of moves: speeds, energy rates, wind; as tables of all moves or computed on demand.

A *move* ends where a visit ends: the transit to the visit's first pylon and the inspection itself. The default is the
paper's model: distance over speed, no other dynamics. With ``Dynamics`` it is the matrix of the authors' public solver,
which adds acceleration from and to rest and turns on the spot.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.energy import Drone, pct_per_s
from planner.errors import InstanceError

FloatArray = npt.NDArray[np.float64]
Visits = int | Sequence[int] | npt.NDArray[np.int64]
"""Visit numbers; two arguments broadcast against each other like numpy indices."""
CURVE_STEP_M_S = 0.25
"""Step of the energy-rate curve over air speed: linear interpolation is within 0.01 % of it."""


@dataclass(frozen=True, slots=True)
class Dynamics:
    """Dynamics that the authors' public solver adds to the paper's model."""

    acceleration_m_s2: float = 2.5
    yaw_rate_rad_s: float = 1.0

    def __post_init__(self) -> None:
        """Check both rates.

        Raises:
            InstanceError: a rate is not a positive number.
        """
        _check_positive("acceleration_m_s2", self.acceleration_m_s2)
        _check_positive("yaw_rate_rad_s", self.yaw_rate_rad_s)


@dataclass(frozen=True, slots=True)
class SteadyWind:
    """Steady wind, and the energy rate over air speed.

    Vehicles hold their ground speed, as multicopter autopilots do in missions: wind changes the energy of a move, not
    its time, and the reverse direction uses a different energy.
    """

    east_m_s: float
    """Velocity of the air towards the east."""
    north_m_s: float
    airspeed_m_s: tuple[float, ...]
    """Air speeds, ascending from 0."""
    pct_per_s: tuple[float, ...]
    """Energy rate at each of those air speeds, for a consumption of 1; linear in between."""

    def __post_init__(self) -> None:
        """Check that the rates form a curve.

        Raises:
            InstanceError: a figure is not a number, or the curve is invalid.
        """
        if not (math.isfinite(self.east_m_s) and math.isfinite(self.north_m_s)):
            raise InstanceError("wind: expected two numbers, east and north in m/s")
        if len(self.airspeed_m_s) != len(self.pct_per_s) or len(self.airspeed_m_s) < 2:
            raise InstanceError("wind: expected as many rates as air speeds, two at least")
        if not (np.all(np.diff(self.airspeed_m_s) > 0) and min(self.pct_per_s) > 0):
            raise InstanceError("wind: expected ascending air speeds and positive rates")

    def rates_pct_per_s(self, east_m_s: FloatArray, north_m_s: FloatArray) -> FloatArray:
        """Return the energy rates at given ground velocities."""
        airspeed = np.hypot(east_m_s - self.east_m_s, north_m_s - self.north_m_s)
        rates: FloatArray = np.interp(airspeed, self.airspeed_m_s, self.pct_per_s)
        return rates


@dataclass(frozen=True, slots=True)
class Travel:
    """Speeds of a vehicle, and its energy rates at a consumption of 1."""

    transit_speed_m_s: float
    inspection_speed_m_s: float
    transit_pct_per_s: float
    """Energy rate in still air."""
    inspection_pct_per_s: float
    dynamics: Dynamics | None = None
    wind: SteadyWind | None = None

    def __post_init__(self) -> None:
        """Check that all figures are positive.

        Raises:
            InstanceError: a figure is not a positive number.
        """
        for name in ("transit_speed_m_s", "inspection_speed_m_s", "transit_pct_per_s", "inspection_pct_per_s"):
            _check_positive(name, getattr(self, name))

    def rates_pct_per_s(self, vectors_m: FloatArray, speed_m_s: float, calm_pct_per_s: float) -> FloatArray:
        """Return (...) float64, energy rates along ``vectors_m`` (..., 2) at a speed, given the rate in still air."""
        if self.wind is None:
            return np.full(vectors_m.shape[:-1], calm_pct_per_s)
        length_m = np.hypot(vectors_m[..., 0], vectors_m[..., 1])
        # A move of zero length takes no time, whatever its rate.
        speed = np.divide(speed_m_s, length_m, out=np.zeros_like(length_m), where=length_m > 0)
        return self.wind.rates_pct_per_s(vectors_m[..., 0] * speed, vectors_m[..., 1] * speed)


def travel_for(
    drone: Drone,
    transit_speed_m_s: float,
    inspection_speed_m_s: float,
    wind_m_s: tuple[float, float] = (0.0, 0.0),
) -> Travel:
    """Return the travel of a drone at two speeds, with energy from the pen-and-paper model.

    Args:
        drone: The drone whose power is modelled.
        transit_speed_m_s: Ground speed.
        inspection_speed_m_s: Ground speed.
        wind_m_s: Velocity of the air, towards east and north.

    Raises:
        InstanceError: a speed is not a positive number, or needs more power than the drone's battery can deliver.
    """
    return Travel(
        transit_speed_m_s,
        inspection_speed_m_s,
        pct_per_s(drone, transit_speed_m_s),
        pct_per_s(drone, inspection_speed_m_s),
        wind=build_steady_wind(drone, max(transit_speed_m_s, inspection_speed_m_s), wind_m_s)
        if any(wind_m_s)
        else None,
    )


def build_steady_wind(drone: Drone, fastest_m_s: float, wind_m_s: tuple[float, float]) -> SteadyWind:
    """Return a wind, or still air, with a drone's energy rates up to a ground speed.

    Raises:
        InstanceError: that speed against the wind needs more power than the battery can deliver.
    """
    points = math.ceil((fastest_m_s + math.hypot(*wind_m_s)) / CURVE_STEP_M_S) + 2
    airspeed = tuple(CURVE_STEP_M_S * point for point in range(points))
    return SteadyWind(wind_m_s[0], wind_m_s[1], airspeed, tuple(pct_per_s(drone, speed) for speed in airspeed))


class Moves(ABC):
    """The moves between an instance's visits. Vehicles of equal travel share a *profile*.

    Moves computed on demand use memory that grows with the segments, not with their square.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def profiles(self) -> int:
        """Number of profiles."""

    @property
    @abstractmethod
    def visits(self) -> int:
        """Number of visits, two for each segment."""

    @abstractmethod
    def compute(self, profile: int, before: Visits, after: Visits) -> tuple[FloatArray, FloatArray]:
        """Return the seconds from the end of visits ``before`` to the end of visits ``after``, and the energy.

        Energies are for a consumption of 1, in percent of a full battery.
        """

    def seconds(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the seconds of moves."""
        return self.compute(profile, before, after)[0]

    def pct(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the energy of moves."""
        return self.compute(profile, before, after)[1]

    def tabulate(self) -> MoveTables:
        """Return all moves as tables."""
        every = np.arange(self.visits)
        blocks = [self.compute(profile, every[:, np.newaxis], every) for profile in range(self.profiles)]
        shape = (self.profiles, self.visits, self.visits)
        seconds, pct = (np.array([block[of] for block in blocks]).reshape(shape) for of in (0, 1))
        return MoveTables(seconds, pct)

    def add_pct(self, more_pct: FloatArray) -> Moves:
        """Return moves with additional energy (p, 2n), by the visit at their end."""
        return self.tabulate().add_pct(more_pct)

    @abstractmethod
    def select_visits(self, visits: Sequence[int]) -> MoveTables:
        """Return the moves between some of the visits as tables, renumbered in the given order."""


@dataclass(frozen=True, slots=True)
class MoveTables(Moves):
    """Tables of all moves, for networks of up to some hundred segments."""

    table_s: FloatArray
    """(p, 2n, 2n) float64: for each profile, seconds from the end of visit i to the end of visit j."""
    table_pct: FloatArray
    """(p, 2n, 2n) float64."""

    def __post_init__(self) -> None:
        """Check shapes and numbers.

        Raises:
            InstanceError: a table does not have the shape for a number of visits, or holds an invalid time or energy.
        """
        shape = self.table_s.shape
        if len(shape) != 3 or shape[0] == 0 or shape[1] != shape[2] or self.table_pct.shape != shape:
            raise InstanceError(f"moves have shapes {shape} and {self.table_pct.shape}, expected (p, 2n, 2n) twice")
        for table in (self.table_s, self.table_pct):
            if not np.all(np.isfinite(table)) or np.any(table < 0):
                raise InstanceError("moves hold a negative, infinite or NaN entry")

    @property
    def profiles(self) -> int:
        """Number of profiles."""
        return len(self.table_s)

    @property
    def visits(self) -> int:
        """Number of visits."""
        return int(self.table_s.shape[1])

    def tabulate(self) -> MoveTables:
        """Return these tables."""
        return self

    def add_pct(self, more_pct: FloatArray) -> MoveTables:
        """Return moves with additional energy."""
        return MoveTables(self.table_s, self.table_pct + more_pct[:, np.newaxis])

    def compute(self, profile: int, before: Visits, after: Visits) -> tuple[FloatArray, FloatArray]:
        """Return the seconds and the energy of moves."""
        return self.seconds(profile, before, after), self.pct(profile, before, after)

    def seconds(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the seconds of moves."""
        return np.asarray(self.table_s[profile][before, after])

    def pct(self, profile: int, before: Visits, after: Visits) -> FloatArray:
        """Return the energy of moves."""
        return np.asarray(self.table_pct[profile][before, after])

    def select_visits(self, visits: Sequence[int]) -> MoveTables:
        """Return the moves between some of the visits."""
        block = np.ix_(range(self.profiles), visits, visits)
        return MoveTables(self.table_s[block], self.table_pct[block])


@dataclass(frozen=True, slots=True)
class MoveGeometry(Moves):
    """Moves between places, computed on demand."""

    first_m: FloatArray
    """(2n, 2) float64: start of each visit, local east and north in metres."""
    last_m: FloatArray
    """(2n, 2) float64: end of each visit."""
    travels: tuple[Travel, ...]
    """One travel for each profile."""

    @property
    def profiles(self) -> int:
        """Number of profiles."""
        return len(self.travels)

    @property
    def visits(self) -> int:
        """Number of visits."""
        return len(self.first_m)

    def select_visits(self, visits: Sequence[int]) -> MoveTables:
        """Return the moves between some of the visits, as tables."""
        return MoveGeometry(self.first_m[list(visits)], self.last_m[list(visits)], self.travels).tabulate()

    def compute(self, profile: int, before: Visits, after: Visits) -> tuple[FloatArray, FloatArray]:
        """Return the seconds and the energy of moves."""
        places, headings = self.last_m[before], self.last_m[before] - self.first_m[before]
        return compute_moves(places, headings, self.first_m[after], self.last_m[after], self.travels[profile])


def compute_moves(
    places_m: FloatArray, headings_m: FloatArray, first_m: FloatArray, last_m: FloatArray, travel: Travel
) -> tuple[FloatArray, FloatArray]:
    """Return seconds and energies of moves; the four arrays (..., 2) broadcast against each other.

    Args:
        places_m: Start of each move.
        headings_m: Direction in which the vehicle arrived there.
        first_m: Start of each visit.
        last_m: End of each visit.
        travel: Speeds and rates.
    """
    transit_s, transit_pct = compute_transits(places_m, headings_m, first_m, travel)
    along = last_m - first_m
    inspection_s = np.hypot(along[..., 0], along[..., 1]) / travel.inspection_speed_m_s
    if travel.dynamics is not None:
        ramps_s = travel.inspection_speed_m_s / travel.dynamics.acceleration_m_s2
        inspection_s = inspection_s + ramps_s + _turn_s(first_m - places_m, along, travel.dynamics)
    rates = travel.rates_pct_per_s(along, travel.inspection_speed_m_s, travel.inspection_pct_per_s)
    return transit_s + inspection_s, transit_pct + inspection_s * rates


def compute_transits(
    places_m: FloatArray, headings_m: FloatArray, targets_m: FloatArray, travel: Travel
) -> tuple[FloatArray, FloatArray]:
    """Return seconds and energies of transits; the three arrays (..., 2) broadcast against each other.

    With dynamics: the turn from the heading, then d / v + v / a, which is the authors' (d - v^2/a)/v + 2 v/a. They also
    charge it to a transit of zero length.
    """
    vector = targets_m - places_m
    seconds: FloatArray = np.hypot(vector[..., 0], vector[..., 1]) / travel.transit_speed_m_s
    if travel.dynamics is not None:
        ramps_s = travel.transit_speed_m_s / travel.dynamics.acceleration_m_s2
        seconds = seconds + ramps_s + _turn_s(headings_m, vector, travel.dynamics)
    return seconds, seconds * travel.rates_pct_per_s(vector, travel.transit_speed_m_s, travel.transit_pct_per_s)


def _turn_s(before: FloatArray, after: FloatArray, dynamics: Dynamics) -> FloatArray:
    """Return the seconds of the turns between vectors; a vector of zero length faces east, as in atan2(0, 0)."""
    turn = np.arctan2(before[..., 1], before[..., 0]) - np.arctan2(after[..., 1], after[..., 0])
    wrapped: FloatArray = np.abs((turn + math.pi) % (2 * math.pi) - math.pi)
    return wrapped / dynamics.yaw_rate_rad_s


def _check_positive(name: str, number: float) -> None:
    if not (math.isfinite(number) and number > 0):
        raise InstanceError(f"{name} is {number}, expected a positive number")
