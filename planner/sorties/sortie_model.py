"""Days of many sorties as frozen data, and the reference definition of their figures, which the kernels must match.

Times are seconds from the first midnight, energies percent of a full pack.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError, PlanError
from planner.model import Plan, Route
from planner.moves import FloatArray, Moves

Window = tuple[float, float]
"""Start and end of a time window."""


class Objective(Enum):
    """The objective of a plan; the others break ties."""

    FINISH = "finish"
    """Landing time of the last sortie."""
    FLIGHT = "flight"
    """Total flight time of all sorties."""
    SWAPS = "swaps"
    """Number of sorties, each of which uses a pack."""


@dataclass(frozen=True, slots=True)
class SortieBase:
    """A base where sorties begin and end."""

    name: str
    turnaround_s: float
    """Seconds from a landing here to the vehicle's next take-off: the pack is swapped, or charged in the vehicle."""
    packs: int | None = None
    """Packs charged at the beginning of each day; None if unlimited."""
    recharge_s: float | None = None
    """Seconds from a landing here until the pack can fly again; None if packs are only charged overnight."""
    charged_s: tuple[float, ...] | None = None
    """When each pack is charged on the first day, once that day has begun; None if all ``packs`` are at its start."""
    taken_off_s: float = -math.inf
    """Time of the last take-off here."""

    def list_packs(self, day: int, opens_s: float) -> list[float]:
        """Return the charge completion time of each pack at the beginning of a day; empty if packs are unlimited."""
        if self.packs is not None and day == 0 and self.charged_s is not None:
            return list(self.charged_s)
        return [opens_s] * (self.packs or 0)


@dataclass(frozen=True, slots=True)
class SortieVehicle:
    """A vehicle and its current state."""

    name: str
    base: int
    """Current base."""
    budget_pct: float
    """Energy limit of a sortie."""
    windows: tuple[Window, ...]
    """Flight windows, ascending: each sortie lies in one of them. Empty for a vehicle that no longer flies."""
    lands: tuple[int, ...]
    """Bases where it may land and take off."""
    profile: int = 0
    """Index of its profile in the moves."""
    consumption: float = 1.0
    """Factor on the energy of moves."""
    ready_s: float = 0.0
    """Earliest start of its next sortie."""


@dataclass(frozen=True, slots=True, eq=False)
class SortieInstance:
    """``n`` segments, ``d`` bases, ``k`` vehicles. Visit ``2 * segment + reversed`` is a segment in one direction."""

    moves: Moves
    """Moves from the end of one visit to the end of another."""
    bases: tuple[SortieBase, ...]
    vehicles: tuple[SortieVehicle, ...]
    days: tuple[Window, ...]
    """Working days; between them all packs are charged and returned to their bases."""
    out_s: FloatArray
    """(k, d, 2n) float64: seconds from the pad of a base to the end of a visit, the climb included."""
    out_pct: FloatArray
    """(k, d, 2n) float64: energy of the same moves, the vehicle's consumption included."""
    home_s: FloatArray
    """(k, 2n, d) float64: seconds from the end of a visit to the pad of a base."""
    home_pct: FloatArray
    """(k, 2n, d) float64: energy of the same moves."""
    transfer_s: FloatArray
    """(d, d) float64: seconds to move a vehicle on the ground; infinite if impossible."""
    able: npt.NDArray[np.bool_]
    """(k, n): whether a vehicle may inspect a segment: its camera is suitable."""
    wanted: npt.NDArray[np.bool_]
    """(n,): segments to inspect."""
    stagger_s: float = 0.0
    """Minimum time between two take-offs from a base."""
    locked: Mapping[int, int] = field(default_factory=dict)
    """Segments locked to one vehicle, with the vehicle's number."""

    def __post_init__(self) -> None:
        """Check shapes and numbers.

        Raises:
            InstanceError: a shape or a number is invalid.
        """
        if not self.bases or not self.vehicles or not self.days:
            raise InstanceError("bases, vehicles, days: expected one at least of each")
        if not self.stagger_s >= 0:
            raise InstanceError("stagger_s: expected 0 or more")
        visits, d, k = self.moves.visits, len(self.bases), len(self.vehicles)
        shapes: dict[str, tuple[int, ...]] = {
            "out_s": (k, d, visits), "out_pct": (k, d, visits), "home_s": (k, visits, d), "home_pct": (k, visits, d),
            "transfer_s": (d, d), "able": (k, visits // 2), "wanted": (visits // 2,),
        }  # fmt: skip
        for name, shape in shapes.items():
            table: npt.NDArray[np.generic] = getattr(self, name)
            if table.shape != shape:
                raise InstanceError(f"{name} has shape {table.shape}, expected {shape}")
            if not bool((np.asarray(table, dtype=np.float64) >= 0).all()):
                raise InstanceError(f"{name}: expected numbers, 0 or more")
        _check_windows("days", self.days)
        for base in self.bases:
            _check_base(base)
        for own in self.vehicles:
            _check_vehicle(self, own)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.wanted)

    @property
    def allowed(self) -> npt.NDArray[np.bool_]:
        """(k, n): whether a vehicle can inspect a segment that is not locked to another one."""
        allowed = self.able.copy()
        for segment, keeper in self.locked.items():
            allowed[np.arange(len(allowed)) != keeper, segment] = False
        return allowed


def _check_base(base: SortieBase) -> None:
    figures = {"turnaround_s": base.turnaround_s, "recharge_s": base.recharge_s or 0.0, "packs": base.packs or 0}
    for name, figure in figures.items():
        if not 0 <= figure < math.inf:
            raise InstanceError(f"{name} of base {base.name}: expected 0 or more")


def _check_vehicle(instance: SortieInstance, own: SortieVehicle) -> None:
    d = len(instance.bases)
    if not all(0 <= base < d for base in (own.base, *own.lands)):
        raise InstanceError(f"vehicle {own.name}: expected bases from 0 to {d - 1}")
    if not 0 <= own.profile < instance.moves.profiles:
        raise InstanceError(f"vehicle {own.name}: expected a profile below {instance.moves.profiles}")
    if not (math.isfinite(own.budget_pct) and own.consumption > 0 and math.isfinite(own.ready_s)):
        raise InstanceError(f"vehicle {own.name}: expected a budget, a consumption and a time")
    _check_windows(f"windows of vehicle {own.name}", own.windows)
    for begin, end in own.windows:
        if not any(opens <= begin and end <= closes for opens, closes in instance.days):
            raise InstanceError(f"windows of vehicle {own.name}: expected each within a day")


def _check_windows(name: str, windows: Iterable[Window]) -> None:
    before = -math.inf
    for begin, end in windows:
        if not before <= begin < end < math.inf:
            raise InstanceError(f"{name}: expected a begin before its end, one after the other, got {begin} to {end}")
        before = end


def subtract_quiet_times(days: Iterable[Window], quiet: Iterable[Window]) -> tuple[Window, ...]:
    """Return the days with quiet times removed.

    >>> subtract_quiet_times([(8.0, 16.0)], [(12.0, 13.0), (15.0, 20.0)])
    ((8.0, 12.0), (13.0, 15.0))
    """
    windows = list(days)
    for begin, end in quiet:
        windows = [
            part
            for opens, closes in windows
            for part in ((opens, min(closes, begin)), (max(opens, end), closes))
            if part[0] < part[1]
        ]
    return tuple(windows)


TOLERANCE = 1e-6
"""Tolerance of sums in seconds or percent: they depend on the order of addition."""


@dataclass(frozen=True, slots=True)
class SortieEvaluation:
    """The figures of a plan."""

    finish_s: float
    """Landing time of the last sortie; 0 without one."""
    flight_s: float
    """Total flight time of all sorties."""
    durations_s: tuple[float, ...]
    """Duration of each sortie, in plan order."""
    energies_pct: tuple[float, ...]
    violations: tuple[str, ...]
    """Violations in words; empty if every wanted segment is flown or listed as uncovered, by valid sorties."""

    @property
    def count(self) -> int:
        """Number of sorties: each uses a pack."""
        return len(self.durations_s)

    def value_of(self, objective: Objective) -> float:
        """Return the plan's value of an objective: seconds, or a number of sorties."""
        figures = {Objective.FINISH: self.finish_s, Objective.FLIGHT: self.flight_s, Objective.SWAPS: self.count}
        return float(figures[objective])


@dataclass(frozen=True, slots=True)
class SortieResult:
    """The best plan found by a search, with its reference figures."""

    plan: Plan
    evaluation: SortieEvaluation
    iterations: int
    seconds: float
    stopped_by: str


def sortie_duration_s(instance: SortieInstance, sortie: Route) -> float:
    """Return the duration of a sortie.

    Raises:
        PlanError: it has no visit, or a vehicle, a visit or a base that the instance does not have.
    """
    return _measure_sortie(instance, sortie)[0]


def _measure_sortie(instance: SortieInstance, sortie: Route) -> tuple[float, float]:
    """Return a sortie's duration in seconds and energy in percent of a full pack."""
    _check(instance, sortie)
    vehicle, visits = sortie.vehicle, list(sortie.visits)
    own = instance.vehicles[vehicle]
    out, home = (vehicle, sortie.base, visits[0]), (vehicle, visits[-1], sortie.lands)
    between_s = instance.moves.seconds(own.profile, visits[:-1], visits[1:]).sum()
    between_pct = own.consumption * instance.moves.pct(own.profile, visits[:-1], visits[1:]).sum()
    return (
        float(instance.out_s[out] + between_s + instance.home_s[home]),
        float(instance.out_pct[out] + between_pct + instance.home_pct[home]),
    )


def _check(instance: SortieInstance, sortie: Route) -> None:
    if not sortie.visits:
        raise PlanError("sortie: expected a visit at least")
    if not 0 <= sortie.vehicle < len(instance.vehicles):
        raise PlanError(f"sortie: expected one of {len(instance.vehicles)} vehicles")
    if not all(0 <= visit < 2 * instance.segments for visit in sortie.visits):
        raise PlanError(f"sortie: expected visits of {instance.segments} segments")
    if not all(0 <= base < len(instance.bases) for base in (sortie.base, sortie.lands)):
        raise PlanError(f"sortie: expected bases of {len(instance.bases)}")


def evaluate_sorties(instance: SortieInstance, plan: Plan) -> SortieEvaluation:
    """Return the figures and violations of a plan.

    Raises:
        PlanError: it has other vehicles, segments or bases.
    """
    if not all(0 <= segment < instance.segments for segment in plan.uncovered):
        raise PlanError(f"uncovered: expected some of {instance.segments} segments")
    figures = [_measure_sortie(instance, one) for one in plan.routes]
    lasts, energies = (tuple(pair[place] for pair in figures) for place in range(2))
    found = [
        *_check_coverage(instance, plan), *_check_vehicles(instance, plan, lasts, energies),
        *_check_take_offs(instance, plan), *_check_packs(instance, plan, lasts),
    ]  # fmt: skip
    finish_s, flights_s = 0.0, [0.0] * len(instance.vehicles)
    for one, long in zip(plan.routes, lasts, strict=True):
        finish_s = max(finish_s, one.start_s + long)
        flights_s[one.vehicle] += long
    return SortieEvaluation(finish_s, sum(flights_s), lasts, energies, tuple(found))


def _check_coverage(instance: SortieInstance, plan: Plan) -> Iterator[str]:
    accounted = {*plan.uncovered, *(visit >> 1 for one in plan.routes for visit in one.visits)}
    for segment, wanted in enumerate(instance.wanted.tolist()):
        if (segment in accounted) != wanted:
            times = f"{int(segment in accounted)} times, expected {int(wanted)}"
            yield f"segment {segment} is flown or named as uncovered {times}"


def _check_vehicles(
    instance: SortieInstance, plan: Plan, lasts: Sequence[float], energies: Sequence[float]
) -> Iterator[str]:
    stands, allowed = {row: (own.base, own.ready_s) for row, own in enumerate(instance.vehicles)}, instance.allowed
    for one, long, pct in zip(plan.routes, lasts, energies, strict=True):
        own, (place, ready_s) = instance.vehicles[one.vehicle], stands[one.vehicle]
        name = f"{own.name} at {one.start_s:.1f} s"
        if one.start_s < ready_s + float(instance.transfer_s[place, one.base]) - TOLERANCE:
            yield f"{name}: cannot be at base {instance.bases[one.base].name} so soon"
        for base in {one.base, one.lands} - set(own.lands):
            yield f"{name}: is not allowed at base {instance.bases[base].name}"
        if pct > own.budget_pct + TOLERANCE:
            yield f"{name}: uses {pct:.3f} %, its budget is {own.budget_pct:.3f} %"
        if not any(
            begin - TOLERANCE <= one.start_s and one.start_s + long <= end + TOLERANCE for begin, end in own.windows
        ):
            yield f"{name}: flies outside of its hours"
        for visit in one.visits:
            if not allowed[one.vehicle, visit >> 1]:
                yield f"{name}: may not inspect segment {visit >> 1}"
        stands[one.vehicle] = one.lands, one.start_s + long + instance.bases[one.lands].turnaround_s


def _check_take_offs(instance: SortieInstance, plan: Plan) -> Iterator[str]:
    for number, base in enumerate(instance.bases):
        starts = sorted(one.start_s for one in plan.routes if one.base == number)
        for before, after in pairwise((base.taken_off_s, *starts)):
            if after - before < instance.stagger_s - TOLERANCE:
                yield f"base {base.name}: take-offs at {before:.1f} and {after:.1f} s, {instance.stagger_s:g} s apart"


def _check_packs(instance: SortieInstance, plan: Plan, lasts: Sequence[float]) -> Iterator[str]:
    timed = sorted(zip(plan.routes, lasts, strict=True), key=lambda pair: pair[0].start_s)
    for day, (opens, closes) in enumerate(instance.days):
        pools = [base.list_packs(day, opens) for base in instance.bases]
        for one, long in timed:
            if not opens <= one.start_s < closes:
                continue
            base, lands = instance.bases[one.base], instance.bases[one.lands]
            if base.packs is not None:
                pool = pools[one.base]
                if not pool or min(pool) > one.start_s + TOLERANCE:
                    yield f"base {base.name}: no charged pack for the take-off at {one.start_s:.1f} s"
                else:
                    pool.remove(min(pool))
            if lands.recharge_s is not None:
                pools[one.lands].append(one.start_s + long + lands.recharge_s)


def count_packs_needed(instance: SortieInstance, sorties: Sequence[Route]) -> tuple[int, ...]:
    """Return the packs that each base needs on its busiest day so that no sortie has to wait.

    A pack counts for the base where it lands; it can fly again from there once it is charged.
    """
    need = [0] * len(instance.bases)
    for opens, closes in instance.days:
        events = []
        for one in sorties:
            if opens <= one.start_s < closes:
                recharge_s = instance.bases[one.lands].recharge_s
                events.append((one.start_s, 1, one.base))
                if recharge_s is not None:
                    events.append((one.start_s + sortie_duration_s(instance, one) + recharge_s, 0, one.lands))
        away = [0] * len(instance.bases)
        for _, taken, base in sorted(events):
            away[base] += 1 if taken else -1
            need[base] = max(need[base], away[base])
    return tuple(need)
