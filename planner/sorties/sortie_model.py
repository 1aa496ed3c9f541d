"""Days of many sorties, as frozen data. Times are seconds from the first midnight, energies percent of a full pack."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.moves import FloatArray, Moves

Window = tuple[float, float]
"""Begin and end."""


class Objective(Enum):
    """What a plan is chosen by; the others decide between equals."""

    FINISH = "finish"
    """When the last sortie lands."""
    FLIGHT = "flight"
    """The time in the air of all sorties."""
    SWAPS = "swaps"
    """The number of sorties, each of which takes a pack."""


@dataclass(frozen=True, slots=True)
class SortieBase:
    """Where sorties begin and end."""

    name: str
    turnaround_s: float
    """From a landing here to the vehicle's next take-off: the pack is swapped, or charged in the vehicle."""
    packs: int | None = None
    """Charged at the begin of each day; None where there are always enough."""
    recharge_s: float | None = None
    """From a landing here until the pack can fly again; None where packs are charged overnight alone."""
    charged_s: tuple[float, ...] | None = None
    """When each pack is charged on the first day, once that day has begun; None for all of ``packs`` at its begin."""
    taken_off_s: float = -math.inf
    """When a vehicle took off here last."""

    def list_packs(self, day: int, opens_s: float) -> list[float]:
        """Return when each pack is charged, at the begin of a day; nothing where there are always enough."""
        if self.packs is not None and day == 0 and self.charged_s is not None:
            return list(self.charged_s)
        return [opens_s] * (self.packs or 0)


@dataclass(frozen=True, slots=True)
class SortieVehicle:
    """A vehicle, and where it is."""

    name: str
    base: int
    """Where it stands."""
    budget_pct: float
    """What a sortie may use."""
    windows: tuple[Window, ...]
    """When it may fly, ascending: a sortie lies in one of them. Empty for a vehicle that does not fly any more."""
    lands: tuple[int, ...]
    """Bases where it may land and take off."""
    profile: int = 0
    """Of the moves."""
    consumption: float = 1.0
    """What it uses of what moves say."""
    ready_s: float = 0.0
    """No sortie of its own begins earlier."""


@dataclass(frozen=True, slots=True, eq=False)
class SortieInstance:
    """``n`` segments, ``d`` bases, ``k`` vehicles. Visit ``2 * segment + reversed`` is a segment in one direction."""

    moves: Moves
    """From the end of a visit to the end of another."""
    bases: tuple[SortieBase, ...]
    vehicles: tuple[SortieVehicle, ...]
    days: tuple[Window, ...]
    """Between them all packs are charged and back at their bases."""
    out_s: FloatArray
    """(k, d, 2n) float64: from the pad of a base to the end of a visit, the climb included."""
    out_pct: FloatArray
    """(k, d, 2n) float64, the vehicle's consumption included."""
    home_s: FloatArray
    """(k, 2n, d) float64: from the end of a visit onto the pad of a base."""
    home_pct: FloatArray
    """(k, 2n, d) float64."""
    transfer_s: FloatArray
    """(d, d) float64: to move a vehicle on the ground; infinite where it cannot be."""
    able: npt.NDArray[np.bool_]
    """(k, n): whether a vehicle may inspect a segment: its camera is good for it."""
    wanted: npt.NDArray[np.bool_]
    """(n,): segments that are to be inspected."""
    stagger_s: float = 0.0
    """The least time between two take-offs from a base."""

    def __post_init__(self) -> None:
        """Check shapes and numbers.

        Raises:
            InstanceError: what does not fit.
        """
        if not self.bases or not self.vehicles or not self.days:
            raise InstanceError("bases, vehicles, days: expected one at least of each")
        if not self.stagger_s >= 0:
            raise InstanceError("stagger_s: expected 0 or more")
        _check_tables(self)
        _check_windows("days", self.days)
        for base in self.bases:
            _check_base(base)
        for own in self.vehicles:
            _check_vehicle(self, own)

    @property
    def segments(self) -> int:
        """How many there are."""
        return len(self.wanted)


def _check_tables(instance: SortieInstance) -> None:
    visits, d, k = instance.moves.visits, len(instance.bases), len(instance.vehicles)
    shapes: dict[str, tuple[npt.NDArray[np.generic], tuple[int, ...]]] = {
        "out_s": (instance.out_s, (k, d, visits)), "out_pct": (instance.out_pct, (k, d, visits)),
        "home_s": (instance.home_s, (k, visits, d)), "home_pct": (instance.home_pct, (k, visits, d)),
        "transfer_s": (instance.transfer_s, (d, d)), "able": (instance.able, (k, visits // 2)),
        "wanted": (instance.wanted, (visits // 2,)),
    }  # fmt: skip
    for name, (table, shape) in shapes.items():
        if table.shape != shape:
            raise InstanceError(f"{name} has shape {table.shape}, expected {shape}")
        if not bool((np.asarray(table, dtype=np.float64) >= 0).all()):
            raise InstanceError(f"{name}: expected numbers, 0 or more")


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


@dataclass(frozen=True, slots=True)
class Sortie:
    """One flight on one pack."""

    base: int
    visits: tuple[int, ...]
    lands: int
    """The base where it ends."""
    start_s: float


@dataclass(frozen=True, slots=True)
class SortiePlan:
    """Each vehicle's sorties in the order of time, and the wanted segments that nobody flies."""

    sorties: tuple[tuple[Sortie, ...], ...]
    uncovered: tuple[int, ...] = ()


def subtract_quiet_times(days: Iterable[Window], quiet: Iterable[Window]) -> tuple[Window, ...]:
    """Return days without quiet times.

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
