"""The planning problem and its solution as frozen data, built from segment end points and a fleet.

A *visit* is one segment in one direction. Visits are numbered ``2 * segment + reversed``, so the two visits of a
segment are ``v`` and ``v ^ 1``: the 'set' of the Set TSP of which a plan takes exactly one.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError, PlanError
from planner.moves import FloatArray, MoveGeometry, Moves, Travel, compute_moves, compute_transits

TABLES_UP_TO = 1000
"""Maximum number of segments for tables of all moves: 2000 x 2000 times and energies are 64 MB."""
BARRED_PCT = 1e5
"""Additional cost, in percent of a full battery, of a visit that a vehicle must not make; it exceeds any budget."""
BY_VISIT = ("start_s", "home_s", "depot_s", "start_pct", "home_pct", "depot_pct")
"""Tables of an instance with a row for each vehicle and a column for each visit."""


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
    """Return visits with each segment replaced by its ``number``."""
    return tuple(visit_of(number[segment_of(visit)], is_reversed(visit)) for visit in visits)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle as used by the planner."""

    name: str
    start_m: tuple[float, float]
    """Start of its route, local east and north in metres."""
    budget_pct: float
    """Energy limit from its start until it has landed, in percent of a full battery."""
    consumption: float = 1.0
    """Consumption relative to the energy model; 1.1 is a worn pack or a head wind."""
    airborne: bool = False
    """Whether it starts in the air: then it pays for its return even without a visit."""
    start_up_m: float = 0.0
    """Height of its start, if moves include heights."""
    facing_m: tuple[float, float] = (0.0, 0.0)
    """Direction in which it arrived at its start, east and north; zero length if unknown."""


@dataclass(frozen=True, slots=True)
class Instance:
    """``n`` segments and ``k`` vehicles of ``p`` profiles, with the time and energy of every move."""

    vehicles: tuple[Vehicle, ...]
    profile: tuple[int, ...]
    """For each vehicle, the index of its profile in ``moves``."""
    moves: Moves
    """Moves from the end of one visit to the end of another, for a consumption of 1."""
    start_s: FloatArray
    """(k, 2n) float64: seconds from vehicle k's start to the end of visit j."""
    home_s: FloatArray
    """(k, 2n) float64: seconds from the end of visit i to vehicle k's landing place."""
    idle_s: FloatArray
    """(k,) float64: seconds of a route without a visit: 0 on the ground, the return in the air."""
    start_pct: FloatArray
    """(k, 2n) float64: energy in percent of a full battery with vehicle k's own consumption, as the next two."""
    home_pct: FloatArray
    """(k, 2n) float64."""
    idle_pct: FloatArray
    """(k,) float64."""
    depot_s: FloatArray
    """(k, 2n) float64: seconds from the ground to the end of visit j, for vehicle k's next flight after a landing."""
    depot_pct: FloatArray
    """(k, 2n) float64: energy of the same moves for a consumption of 1."""
    value: FloatArray
    """(n,) float64: value of a segment if not all can be inspected: its length in metres."""
    end_m: FloatArray
    """(2n, 3) float64: end of each visit, local east and north in metres, and up if moves include heights."""
    landing_m: tuple[float, float]
    """End of every route, local east and north in metres."""
    answer_s: float = 0.0
    """Seconds that all vehicles continue after a loss until it is detected and a re-plan is computed and uploaded."""
    locked: Mapping[int, int] = field(default_factory=dict)
    """Segments locked to one vehicle, with its number: they cost every other vehicle BARRED_PCT more."""

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
        shapes: dict[str, tuple[int, ...]] = {
            **dict.fromkeys(BY_VISIT, (fleet, visits)),
            "idle_s": (fleet,), "idle_pct": (fleet,), "value": (visits // 2,), "end_m": (visits, 3),
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
    """One sortie of one vehicle: its ordered visits, from its start to its landing.

    In a single flight each vehicle has one, from its start to the depot.
    """

    vehicle: int
    visits: tuple[int, ...]
    base: int = 0
    """For days of sorties: the base where it begins."""
    lands: int = 0
    """For days of sorties: the base where it ends."""
    start_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Plan:
    """Routes in the order of the instance's vehicles and then of time, and the uncovered segments."""

    routes: tuple[Route, ...]
    uncovered: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check that routes are in order and no segment occurs twice.

        Raises:
            PlanError: routes are not in the vehicles' order, or a segment is visited twice or both visited and left.
        """
        numbers = [route.vehicle for route in self.routes]
        if numbers != sorted(numbers):
            raise PlanError("routes must be in the order of the vehicles")
        seen = [segment_of(visit) for route in self.routes for visit in route.visits] + list(self.uncovered)
        if len(seen) != len(set(seen)):
            raise PlanError("a segment occurs twice in the plan")

    def routes_of(self, vehicle: int) -> tuple[Route, ...]:
        """Return the routes of one vehicle."""
        return tuple(route for route in self.routes if route.vehicle == vehicle)


def build_instance(
    ends_m: npt.ArrayLike,
    landing_m: npt.ArrayLike,
    vehicles: Sequence[Vehicle],
    travel: Travel | Sequence[Travel],
    *,
    tables_up_to: int = TABLES_UP_TO,
) -> Instance:
    """Return the instance of ``n`` segments and a fleet with one landing place.

    Args:
        ends_m: (n, 2, 2) float64, the end points a and b of each segment, local east and north in metres.
        landing_m: (2,) float64, end of every route.
        vehicles: the fleet; each starts at its own ``start_m``, in the air if ``airborne``.
        travel: speeds and energy rates of all vehicles, or of each.
        tables_up_to: maximum number of segments for tables; with more, moves are computed on demand.

    Raises:
        InstanceError: a shape does not fit, or a coordinate is not a number.
    """
    ends, landing = np.asarray(ends_m, dtype=np.float64), np.asarray(landing_m, dtype=np.float64)
    if ends.size == 0:
        ends = np.zeros((0, 2, 2))
    if ends.ndim != 3 or ends.shape[1:] != (2, 2):
        raise InstanceError(f"ends_m has shape {ends.shape}, expected (n, 2, 2)")
    if landing.shape != (2,):
        raise InstanceError(f"landing_m has shape {landing.shape}, expected (2,)")
    if not (np.all(np.isfinite(ends)) and np.all(np.isfinite(landing))):
        raise InstanceError("ends_m or landing_m holds a number that is infinite or NaN")
    first = ends.reshape(-1, 2)  # row 2s is a, row 2s + 1 is b: visit 2s starts at a, visit 2s + 1 at b
    last = np.array(ends[:, ::-1].reshape(-1, 2))
    starts = np.array([vehicle.start_m for vehicle in vehicles], dtype=np.float64).reshape(-1, 2)
    if not np.all(np.isfinite(starts)):
        raise InstanceError("a vehicle's start_m holds a number that is infinite or NaN")
    travels = [travel] * len(vehicles) if isinstance(travel, Travel) else list(travel)
    if len(travels) != len(vehicles):
        raise InstanceError(f"{len(travels)} travels for {len(vehicles)} vehicles, expected one each")
    profiles = tuple(dict.fromkeys(travels))
    profile = tuple(profiles.index(own) for own in travels)
    consumption = np.array([vehicle.consumption for vehicle in vehicles], dtype=np.float64)[:, np.newaxis]
    in_the_air = np.array([vehicle.airborne for vehicle in vehicles], dtype=np.float64)

    east = np.array([1.0, 0.0])  # the authors' vehicles leave the depot facing east
    begin = [compute_moves(start, east, first, last, own) for start, own in zip(starts, travels, strict=True)]
    depot = [compute_moves(landing, east, first, last, own) for own in profiles]
    home = [compute_transits(last, last - first, landing, own) for own in profiles]
    idle = [compute_transits(start, east, landing, own) for start, own in zip(starts, travels, strict=True)]
    home_s, home_pct = _stack_rows([home[own] for own in profile], len(first))
    start_s, start_pct = _stack_rows(begin, len(first))
    depot_s, depot_pct = _stack_rows([depot[own] for own in profile], len(first))
    geometry = MoveGeometry(first, last, profiles)
    moves: Moves = geometry.tabulate() if profiles and len(ends) <= tables_up_to else geometry
    return Instance(
        vehicles=tuple(vehicles),
        profile=profile,
        moves=moves,
        start_s=start_s,
        home_s=home_s,
        idle_s=np.array([float(way[0]) for way in idle]) * in_the_air,
        start_pct=start_pct * consumption,
        home_pct=home_pct * consumption,
        idle_pct=np.array([float(way[1]) for way in idle]) * in_the_air * consumption[:, 0],
        depot_s=depot_s,
        depot_pct=depot_pct,
        value=np.hypot(*(last - first)[::2].T),
        end_m=np.column_stack((last, np.zeros(len(last)))),
        landing_m=(float(landing[0]), float(landing[1])),
    )


def _stack_rows(rows: Sequence[tuple[FloatArray, FloatArray]], visits: int) -> tuple[FloatArray, FloatArray]:
    """Return seconds and energies, (rows, visits) float64 each."""
    shape = (len(rows), visits)
    return np.array([row[0] for row in rows]).reshape(shape), np.array([row[1] for row in rows]).reshape(shape)


def build_part_instance(instance: Instance, vehicles: Sequence[int], segments: Sequence[int]) -> Instance:
    """Return some vehicles and segments of an instance as an instance, renumbered in the given order."""
    visits = [visit_of(segment, reverse) for segment in segments for reverse in (False, True)]
    rows, fleet = np.ix_(vehicles, visits), list(vehicles)
    return replace(
        instance,
        vehicles=tuple(instance.vehicles[vehicle] for vehicle in vehicles),
        profile=tuple(instance.profile[vehicle] for vehicle in vehicles),
        moves=instance.moves.select_visits(visits),
        idle_s=instance.idle_s[fleet],
        idle_pct=instance.idle_pct[fleet],
        value=instance.value[list(segments)],
        end_m=instance.end_m[visits],
        locked={
            number: fleet.index(instance.locked[segment])
            for number, segment in enumerate(segments)
            if instance.locked.get(segment) in fleet
        },
        **{name: getattr(instance, name)[rows] for name in BY_VISIT},
    )


def lift_locks(instance: Instance, lost: Collection[int]) -> Instance:
    """Return the instance without the locks of the ``lost`` vehicles: any vehicle may inspect those segments."""
    lifted = {segment: vehicle for segment, vehicle in instance.locked.items() if vehicle in lost}
    if not lifted:
        return instance
    more_pct = np.zeros((instance.moves.profiles, 2 * instance.segments))
    start_pct, depot_pct = instance.start_pct.copy(), instance.depot_pct.copy()
    for segment, keeper in lifted.items():
        own = slice(2 * segment, 2 * segment + 2)
        more_pct[[one for one in range(len(more_pct)) if one != instance.profile[keeper]], own] = -BARRED_PCT
        for number, vehicle in enumerate(instance.vehicles):
            if number != keeper:
                start_pct[number, own] -= BARRED_PCT * vehicle.consumption
                depot_pct[number, own] -= BARRED_PCT
    locked = {segment: vehicle for segment, vehicle in instance.locked.items() if segment not in lifted}
    moves = instance.moves.add_pct(more_pct)
    return replace(instance, moves=moves, locked=locked, start_pct=start_pct, depot_pct=depot_pct)
