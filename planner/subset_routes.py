"""The best routes of vehicles through all sets of segments, and what the vehicles can cover together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.cost import BUDGET_TOLERANCE_PCT
from planner.errors import InstanceError
from planner.model import Instance
from planner.moves import FloatArray

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class SubsetRoutes:
    """The best route of one vehicle through each set of segments; a set is a number with a bit for each segment."""

    energy_pct: FloatArray
    """(2^n,) float64: of the best route through exactly this set, inf where none is within the budget."""
    spent_pct: FloatArray
    """(2^n, 2n) float64: the least that is spent at the end of visit j when it is the last of the set."""
    home_pct: FloatArray
    """(2n,) float64: from the end of a visit home."""
    move_pct: FloatArray
    """(2n, 2n) float64: from visit to visit with the vehicle's consumption."""

    def route_of(self, chosen: int) -> tuple[int, ...]:
        """Return the visits of the best route through a set that has one."""
        route: list[int] = []
        onward = self.home_pct
        while chosen > 0:
            last = int((self.spent_pct[chosen] + onward).argmin())
            route.append(last)
            chosen ^= 1 << (last >> 1)
            onward = self.move_pct[:, last]
        return tuple(reversed(route))


def find_subset_routes(instance: Instance, most_segments: int) -> tuple[SubsetRoutes, ...]:
    """Return the best routes of each vehicle through all sets of segments; vehicles that are alike share theirs.

    Raises:
        InstanceError: more segments than ``most_segments``.
    """
    if instance.segments > most_segments:
        raise InstanceError(f"{instance.segments} segments, expected at most {most_segments} for an exact answer")
    known: dict[tuple[bytes | float, ...], SubsetRoutes] = {}
    answer = []
    for vehicle, kind in enumerate(compute_vehicle_kinds(instance)):
        if kind not in known:
            known[kind] = _subsets_of(instance, vehicle)
        answer.append(known[kind])
    return tuple(answer)


def compute_vehicle_kinds(instance: Instance) -> list[tuple[bytes | float, ...]]:
    """Return for each vehicle what its routes' energies depend on: alike for those that can stand for each other."""
    return [
        (
            instance.profile[number],
            vehicle.consumption,
            vehicle.budget_pct,
            float(instance.idle_pct[number]),
            instance.start_pct[number].tobytes(),
            instance.home_pct[number].tobytes(),
        )
        for number, vehicle in enumerate(instance.vehicles)
    ]


def _subsets_of(instance: Instance, number: int) -> SubsetRoutes:
    # Only here: it loads numba.
    from planner.kernels.subset_dynamics import find_best_routes

    vehicle, every = instance.vehicles[number], np.arange(2 * instance.segments)
    start = np.array(instance.start_pct[number], dtype=np.float64)
    home = np.array(instance.home_pct[number], dtype=np.float64)
    pct = instance.moves.pct(instance.profile[number], every[:, np.newaxis], every[np.newaxis])
    move = np.array(vehicle.consumption * pct, dtype=np.float64, order="C")
    most = vehicle.budget_pct + BUDGET_TOLERANCE_PCT
    sets = 2**instance.segments
    spent, energy = np.empty((sets, len(every))), np.empty(sets)
    idle = float(instance.idle_pct[number])
    energy[0] = idle if idle <= most else np.inf
    find_best_routes(start, home, move, most, spent, energy)
    return SubsetRoutes(energy, spent, home, move)


def find_most_valuable_sets(subsets: Sequence[SubsetRoutes], value: FloatArray) -> list[int]:
    """Return a set for each vehicle, together the most valuable that they can inspect; ``value`` is (n,) float64.

    A vehicle that cannot get home has the empty set.
    """
    fits = [np.isfinite(own.energy_pct) for own in subsets]
    for own in fits:
        own[0] = True
    covered, steps = _join_sets(fits, len(fits[0]))
    worth = build_membership_matrix(np.arange(len(covered)), len(value)) @ value
    return _trace_parts(steps, int(np.where(covered, worth, -np.inf).argmax()))


def build_membership_matrix(sets: npt.NDArray[np.int64], segments: int) -> FloatArray:
    """Return (m, n) float64, 1 where segment s is in the set and 0 where it is not."""
    return (sets[:, np.newaxis] >> np.arange(segments) & 1).astype(np.float64)


def find_covering_sets(fits: Sequence[Flags]) -> list[int] | None:
    """Return a set for each vehicle that fits it, together everything; None where there are none."""
    covered, steps = _join_sets(fits[:-1], len(fits[0]))
    # The last vehicle must take all that the others leave.
    complete = covered & fits[-1][::-1]
    chosen = int(complete.argmax())
    if not complete[chosen]:
        return None
    return [*_trace_parts(steps, chosen), len(covered) - 1 - chosen]


def _join_sets(fits: Sequence[Flags], sets: int) -> tuple[Flags, list[npt.NDArray[np.int64]]]:
    """Return which sets vehicles can cover together, and for each vehicle its part of them."""
    from planner.kernels.subset_dynamics import join_covered_sets

    covered = np.arange(sets) == 0
    steps = []
    for own in fits:
        together, part_of = np.zeros(sets, dtype=np.bool_), np.zeros(sets, dtype=np.int64)
        join_covered_sets(covered, own, together, part_of)
        steps.append(part_of)
        covered = together
    return covered, steps


def _trace_parts(steps: Sequence[npt.NDArray[np.int64]], chosen: int) -> list[int]:
    """Return each vehicle's part of a set that they cover together."""
    parts = []
    for part_of in reversed(steps):
        parts.append(int(part_of[chosen]))
        chosen ^= parts[-1]
    return parts[::-1]
