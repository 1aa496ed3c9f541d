"""The fixed part of a day: streets, tasks, depots; and the remaining work as an instance of ``planner.sorties``.

A *task* is an edge of the streets, done once, in either direction, by a trip that includes it. Bases are the depots,
followed by the other places where vehicles begin their day: a first trip begins there, none ever lands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.scenarios.road_graph import RoadGraph, build_road_graph
from planner import InstanceError, MoveTables, PlanError, Route
from planner.moves import FloatArray
from planner.sorties import SortieBase, SortieInstance, SortieVehicle

LONG_S = 1e15
"""No day ends before this."""
TOLERANCE_S = 1e-6
"""Tolerance on the longest trip: sums depend on their order."""


@dataclass(frozen=True, slots=True)
class TimedTrip:
    """A trip as flown."""

    start_s: float
    lasts_s: float
    places: tuple[int, ...]
    """All places, from its begin to its landing."""

    @property
    def end_s(self) -> float:
        """Landing time."""
        return self.start_s + self.lasts_s


Timeline = tuple[TimedTrip, ...]
"""One vehicle's trips, past ones included."""


@dataclass(frozen=True, slots=True)
class Day:
    """The fixed part of a day."""

    streets: RoadGraph
    tasks: tuple[tuple[int, int], ...]
    """Both ends of each task."""
    depots: tuple[int, ...]
    starts: tuple[int, ...]
    """Place where each vehicle begins its day."""
    capacity_s: float
    """The longest trip."""
    turnaround_s: float
    """Time from a trip's end to the vehicle's next one: unloading, recharging."""

    def __post_init__(self) -> None:
        """Check what the sorties do not check.

        Raises:
            InstanceError: names the mismatch.
        """
        places = len(self.streets.times_s)
        for place in (*self.depots, *self.starts, *(end for task in self.tasks for end in task)):
            if not 0 <= place < places:
                raise InstanceError(f"place {place}: expected one from 0 to {places - 1}")
        if not self.depots or not self.starts:
            raise InstanceError("depots, starts: expected one at least of each")
        if not 0 <= self.capacity_s < LONG_S:
            raise InstanceError("capacity_s: expected 0 or more")

    @property
    def bases(self) -> tuple[int, ...]:
        """The places of the bases."""
        depots = sorted(set(self.depots))
        return (*depots, *sorted(set(self.starts) - set(depots)))

    def time_walks(self, walks: Iterable[Sequence[int]], from_s: float = 0.0) -> Timeline:
        """Return trips along walks, one after the other, separated by the turnaround only.

        Raises:
            PlanError: a walk uses no edge.
        """
        trips: list[TimedTrip] = []
        start_s = from_s
        for walk in walks:
            lasts_s = sum(float(self.streets.along_s[step]) for step in pairwise(walk))
            if not lasts_s < float("inf"):
                raise PlanError(f"the trip through {list(walk)} leads along no edge")
            trips.append(TimedTrip(start_s, lasts_s, tuple(walk)))
            start_s += lasts_s + self.turnaround_s
        return tuple(trips)

    def find_hops(self) -> tuple[RoadGraph, FloatArray]:
        """Return fastest connections of depots by trips without a task, and (d, d) the first trip from a base.

        Each trip includes its turnaround; a trip above the limit counts as infinite.
        """
        bases, depots = self.bases, len(set(self.depots))
        direct_s = self.streets.times_s[np.ix_(bases, bases[:depots])]
        direct_s = np.where(direct_s <= self.capacity_s + TOLERANCE_S, direct_s + self.turnaround_s, np.inf)
        ends = zip(*np.nonzero(np.isfinite(direct_s[:depots])), strict=True)
        edges = [(int(a), int(b), float(direct_s[a, b])) for a, b in ends if a != b]
        return build_road_graph(depots, edges), direct_s

    def list_walks(self, tasks: Sequence[int], base: int, sorties: Iterable[Route]) -> Iterator[tuple[int, ...]]:
        """Yield the places of a vehicle's trips, including those without a task.

        Args:
            tasks: task of each segment in the sorties.
            base: the vehicle's present base.
            sorties: its sorties.
        """
        hops, direct_s = self.find_hops()
        bases, depots = self.bases, len(set(self.depots))
        for sortie in sorties:
            if base < depots or base == sortie.base:
                stops = hops.find_way(base, sortie.base) if base < depots else (base,)
            else:
                nearest = int((direct_s[base] + hops.times_s[:, sortie.base]).argmin())
                stops = (base, *hops.find_way(nearest, sortie.base))
            yield from (self.streets.find_way(bases[a], bases[b]) for a, b in pairwise(stops))
            places = [bases[sortie.base]]
            for visit in sortie.visits:
                begin, end = self.tasks[tasks[visit >> 1]][:: -1 if visit & 1 else 1]
                places += [*self.streets.find_way(places[-1], begin)[1:], end]
            yield (*places, *self.streets.find_way(places[-1], bases[sortie.lands])[1:])
            base = sortie.lands


@dataclass(frozen=True, slots=True)
class TripStart:
    """Begin of a vehicle's next trip: place, and earliest time."""

    place: int
    ready_s: float = 0.0


def build_day_instance(day: Day, tasks: Sequence[int], starts: Sequence[TripStart]) -> SortieInstance:
    """Return some of a day's tasks for some vehicles; ``transfer_s`` is the time of trips without a task.

    A trip uses its seconds of a budget that is the longest trip: whole seconds stay exact.
    """
    bases, depots = day.bases, len(set(day.depots))
    times_s = day.streets.times_s
    first = [end for task in tasks for end in day.tasks[task]]
    last = [end for task in tasks for end in reversed(day.tasks[task])]
    own_s = day.streets.along_s[first, last]
    move_s = np.minimum(times_s[np.ix_(last, first)] + own_s, LONG_S)
    out_s, home_s = times_s[np.ix_(bases, first)] + own_s, times_s[np.ix_(last, bases)]
    home_s[:, depots:] = np.inf
    hops, direct_s = day.find_hops()
    transfer_s = np.full((len(bases), len(bases)), np.inf)
    transfer_s[:, :depots] = (direct_s[:, :, np.newaxis] + hops.times_s).min(axis=1)
    transfer_s[:depots, :depots] = hops.times_s
    np.fill_diagonal(transfer_s, 0.0)
    vehicles = []
    for number, start in enumerate(starts):
        base = bases.index(start.place)
        lands = tuple(sorted({*range(depots), base}))
        vehicles.append(
            SortieVehicle(f"{number}", base, day.capacity_s, ((0.0, LONG_S),), lands, ready_s=start.ready_s)
        )
    fleet = len(starts)
    out_s, home_s = np.stack([out_s] * fleet), np.stack([home_s] * fleet)
    return SortieInstance(
        moves=MoveTables(move_s[np.newaxis], move_s[np.newaxis]),
        bases=tuple(SortieBase(f"{place}", day.turnaround_s) for place in bases),
        vehicles=tuple(vehicles),
        days=((0.0, LONG_S),),
        out_s=out_s, out_pct=out_s, home_s=home_s, home_pct=home_s, transfer_s=transfer_s,
        able=np.ones((fleet, len(tasks)), dtype=np.bool_), wanted=np.ones(len(tasks), dtype=np.bool_),
    )  # fmt: skip
