"""The planning problem and its answer as frozen data.

A *visit* is one segment in one direction. Visits are numbered ``2 * segment + reversed``, so the two visits of a
segment are ``v`` and ``v ^ 1``: the 'set' of the Set TSP of which a plan takes exactly one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import InstanceError, PlanError
from planner.moves import FloatArray, Moves


def visit_of(segment: int, reverse: bool) -> int:
    """Return the visit that inspects ``segment``, flown from b to a if ``reverse``."""
    return 2 * segment + int(reverse)


def segment_of(visit: int) -> int:
    """Return the segment that ``visit`` inspects."""
    return visit >> 1


def is_reversed(visit: int) -> bool:
    """Return whether ``visit`` is flown from the segment's b to its a."""
    return bool(visit & 1)


def renumber_visits(visits: Iterable[int], number: Mapping[int, int] | Sequence[int]) -> tuple[int, ...]:
    """Return visits with the ``number`` of each of their segments instead of it."""
    return tuple(visit_of(number[segment_of(visit)], is_reversed(visit)) for visit in visits)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle as the planner sees it."""

    name: str
    start_m: tuple[float, float]
    """Where its route starts, local east and north in metres."""
    budget_pct: float
    """What it may spend from its start until it is home, in percent of a full battery."""
    consumption: float = 1.0
    """What it uses relative to the energy model; 1.1 is a worn pack or a head wind."""
    airborne: bool = False
    """An airborne vehicle pays its way home even when it is given no visit."""
    start_up_m: float = 0.0
    """Height of its start, where moves count heights."""
    facing_m: tuple[float, float] = (0.0, 0.0)
    """Along which it arrived there, east and north; of no length where nobody knows."""


@dataclass(frozen=True, slots=True)
class Instance:
    """``n`` segments and ``k`` vehicles of ``p`` profiles, with the time and the energy of every move."""

    vehicles: tuple[Vehicle, ...]
    profile: tuple[int, ...]
    """For each vehicle, whose ``moves`` are its own."""
    moves: Moves
    """From the end of one visit to the end of another, for a consumption of 1."""
    start_s: FloatArray
    """(k, 2n) float64: seconds from vehicle k's start to the end of visit j."""
    home_s: FloatArray
    """(k, 2n) float64: seconds from the end of visit i to vehicle k's landing place."""
    idle_s: FloatArray
    """(k,) float64: seconds of a route without a visit: 0 on the ground, the way home in the air."""
    start_pct: FloatArray
    """(k, 2n) float64: energy in percent of a full battery with vehicle k's own consumption, as the next two."""
    home_pct: FloatArray
    """(k, 2n) float64."""
    idle_pct: FloatArray
    """(k,) float64."""
    depot_s: FloatArray
    """(k, 2n) float64: seconds from the ground to the end of visit j: what vehicle k flies again once it has landed."""
    depot_pct: FloatArray
    """(k, 2n) float64: energy of the same moves for a consumption of 1."""
    value: FloatArray
    """(n,) float64: what inspecting a segment is worth when not all can be: its length in metres."""
    end_m: FloatArray
    """(2n, 3) float64: where each visit ends, local east and north in metres, and up where moves count heights."""
    landing_m: tuple[float, float]
    """Where every route ends, local east and north in metres."""
    answer_s: float = 0.0
    """How long after a loss everybody flies on as planned: until it is known, a re-plan is found and is on board."""

    def __post_init__(self) -> None:
        """Check shapes and numbers.

        Raises:
            InstanceError: a shape does not fit, or a number is NaN, infinite or negative.
        """
        visits, fleet, profiles = 2 * len(self.value), len(self.vehicles), self.moves.profiles
        if fleet == 0:
            raise InstanceError("an instance needs at least one vehicle")
        if self.moves.visits != visits:
            raise InstanceError(f"moves are between {self.moves.visits} visits, expected {visits}")
        if len(self.profile) != fleet or not all(0 <= own < profiles for own in self.profile):
            raise InstanceError(f"profile is {self.profile}, expected one of {profiles} for each vehicle")
        shapes = {
            "start_s": (fleet, visits), "home_s": (fleet, visits), "idle_s": (fleet,),
            "start_pct": (fleet, visits), "home_pct": (fleet, visits), "idle_pct": (fleet,),
            "depot_s": (fleet, visits), "depot_pct": (fleet, visits), "value": (visits // 2,),
            "end_m": (visits, 3),
        }  # fmt: skip
        for name, shape in shapes.items():
            array: FloatArray = getattr(self, name)
            if array.shape != shape:
                raise InstanceError(f"{name} has shape {array.shape}, expected {shape}")
            if not np.all(np.isfinite(array)) or (name != "end_m" and np.any(array < 0)):
                raise InstanceError(f"{name} holds a negative, infinite or NaN entry")
        if not (math.isfinite(self.answer_s) and self.answer_s >= 0):
            raise InstanceError(f"answer_s is {self.answer_s}, expected zero or more")
        self._check_vehicles()

    def _check_vehicles(self) -> None:
        for vehicle in self.vehicles:
            if not (math.isfinite(vehicle.budget_pct) and math.isfinite(vehicle.consumption)):
                raise InstanceError(f"vehicle {vehicle.name!r} has a budget or consumption that is not a number")
            if vehicle.consumption <= 0:
                raise InstanceError(f"vehicle {vehicle.name!r}: consumption is {vehicle.consumption}, expected > 0")

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.value)


@dataclass(frozen=True, slots=True)
class Route:
    """One vehicle's ordered visits, from where it starts to the depot."""

    vehicle: int
    visits: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Plan:
    """A route for every vehicle, in the order of the instance's vehicles, and the segments that nobody inspects."""

    routes: tuple[Route, ...]
    uncovered: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check that routes are numbered and no segment occurs twice.

        Raises:
            PlanError: routes are not in the vehicles' order, or a segment is visited twice or both visited and left.
        """
        if [route.vehicle for route in self.routes] != list(range(len(self.routes))):
            raise PlanError("routes must be in the order of the vehicles, one each")
        seen = [segment_of(visit) for route in self.routes for visit in route.visits] + list(self.uncovered)
        if len(seen) != len(set(seen)):
            raise PlanError("a segment occurs twice in the plan")
