"""Small days of sorties solved exactly: minimise the last landing, then flight time, with a proof.

An *option* is the whole day of one vehicle: a set of segments, the landing time of its last sortie, its time in the
air, the packs that it takes from each base. An option that another of the same set beats in all of these is dropped.
The best plan chooses one option per vehicle so that the segments are shared out and no base lacks a pack: HiGHS
chooses. There is no waiting for packs: they are not charged by day, and take-offs need no distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks import highs
from benchmarks.row_matrix import build_row_matrix
from planner.errors import InstanceError
from planner.model import Plan, Route
from planner.sorties.sortie_model import TOLERANCE, SortieInstance

MOST_SEGMENTS = 10
"""Maximum number of wanted segments."""
MOST_OPTIONS = 200_000


@dataclass(frozen=True, slots=True)
class _UntimedSortie:
    """A sortie without its time."""

    seconds: float
    pct: float
    visits: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Option:
    lands_s: float
    """Landing time of the last sortie."""
    flight_s: float
    base: int
    """Landing base."""
    packs: tuple[int, ...]
    """Packs taken from each base with a limited supply."""
    sorties: tuple[Route, ...]

    def is_dominating(self, other: _Option) -> bool:
        """Return whether this option is at least as good in all respects, whatever follows."""
        return (
            self.lands_s <= other.lands_s and self.flight_s <= other.flight_s
            and all(mine <= its for mine, its in zip(self.packs, other.packs, strict=True))
        )  # fmt: skip


_Flights = dict[tuple[int, int, int], _UntimedSortie]
"""Shortest sorties within the budget by base, set of segments as bits, and landing base."""


_UnderWay = dict[tuple[int, int], list[_UntimedSortie]]
"""Flights in the air, by set of segments and last visit."""


def solve_sorties_exact(instance: SortieInstance) -> Plan | None:
    """Return the best plan that inspects everything, or None if there is none: both are proven.

    Raises:
        InstanceError: too many segments or options to enumerate, packs that are charged by day or are wanted on
            several days, or take-offs with a distance.
    """
    wanted = [int(segment) for segment in np.flatnonzero(instance.wanted)]
    if len(wanted) > MOST_SEGMENTS:
        raise InstanceError(f"segments: expected at most {MOST_SEGMENTS} for a proof, got {len(wanted)}")
    limited = [number for number, base in enumerate(instance.bases) if base.packs is not None]
    if instance.stagger_s > 0 or any(
        instance.bases[number].recharge_s is not None or instance.bases[number].charged_s is not None or
        len(instance.days) > 1 for number in limited
    ):  # fmt: skip
        raise InstanceError("bases: expected packs for one day that are not charged by day, and no stagger_s")
    options = [_list_options(instance, vehicle, wanted, limited) for vehicle in range(len(instance.vehicles))]
    return _choose_options(instance, options, len(wanted), limited)


def _find_shortest_sorties(instance: SortieInstance, vehicle: int, wanted: Sequence[int]) -> _Flights:
    """Return the shortest sorties."""
    found: _Flights = {}
    for base in instance.vehicles[vehicle].lands:
        under_way: _UnderWay = {
            (1 << number, visit): [
                _UntimedSortie(
                    float(instance.out_s[vehicle, base, visit]), float(instance.out_pct[vehicle, base, visit]), (visit,)
                )
            ]
            for number, segment in enumerate(wanted) if instance.able[vehicle, segment]
            for visit in (2 * segment, 2 * segment + 1)
        }  # fmt: skip
        while under_way:
            for (done, last), flights in under_way.items():
                for one in flights:
                    _add_landings(instance, vehicle, found, base, done, last, one)
            under_way = _extend_sorties(instance, vehicle, wanted, under_way)
    return found


def _add_landings(
    instance: SortieInstance, vehicle: int, found: _Flights, base: int, done: int, last: int, one: _UntimedSortie
) -> None:
    own = instance.vehicles[vehicle]
    for land in own.lands:
        seconds = one.seconds + float(instance.home_s[vehicle, last, land])
        pct = one.pct + float(instance.home_pct[vehicle, last, land])
        known = found.get((base, done, land))
        if pct <= own.budget_pct + TOLERANCE and (known is None or seconds < known.seconds):
            found[base, done, land] = _UntimedSortie(seconds, pct, one.visits)


def _extend_sorties(instance: SortieInstance, vehicle: int, wanted: Sequence[int], under_way: _UnderWay) -> _UnderWay:
    """Return flights with one more visit; besides the shortest, those that use less are kept."""
    own, longer = instance.vehicles[vehicle], dict[tuple[int, int], list[_UntimedSortie]]()
    for (done, last), flights in under_way.items():
        onward = [
            (number, visit) for number, segment in enumerate(wanted)
            if not done >> number & 1 and instance.able[vehicle, segment] for visit in (2 * segment, 2 * segment + 1)
        ]  # fmt: skip
        for number, visit in onward:
            more_s = float(instance.moves.seconds(own.profile, last, visit))
            more_pct = own.consumption * float(instance.moves.pct(own.profile, last, visit))
            for one in flights:
                if one.pct + more_pct <= own.budget_pct + TOLERANCE:
                    _keep(
                        longer.setdefault((done | 1 << number, visit), []),
                        _UntimedSortie(one.seconds + more_s, one.pct + more_pct, (*one.visits, visit)),
                    )
    return longer


def _keep(kept: list[_UntimedSortie], new: _UntimedSortie) -> None:
    if not any(one.seconds <= new.seconds and one.pct <= new.pct for one in kept):
        kept[:] = [one for one in kept if not (new.seconds <= one.seconds and new.pct <= one.pct)] + [new]


def _list_options(
    instance: SortieInstance, vehicle: int, wanted: Sequence[int], limited: Sequence[int]
) -> list[tuple[int, _Option]]:
    """Return a vehicle's options, by set of segments; the first is to do nothing."""
    own, flights = instance.vehicles[vehicle], _find_shortest_sorties(instance, vehicle, wanted)
    by_set: dict[int, list[_Option]] = {0: [_Option(0.0, 0.0, own.base, (0,) * len(limited), ())]}
    for done in range(1, 1 << len(wanted)):
        for (base, part, land), one in flights.items():
            if part & ~done:
                continue
            for before in by_set.get(done & ~part, []):
                start_s = _start_s(instance, vehicle, before, base, one.seconds)
                if start_s is None:
                    continue
                packs = tuple(count + (base == place) for count, place in zip(before.packs, limited, strict=True))
                if any(count > (instance.bases[place].packs or 0) for count, place in zip(packs, limited, strict=True)):
                    continue
                sorties = (*before.sorties, Route(vehicle, one.visits, base, land, start_s))
                new = _Option(start_s + one.seconds, before.flight_s + one.seconds, land, packs, sorties)
                kept = by_set.setdefault(done, [])
                if not any(other.base == land and other.is_dominating(new) for other in kept):
                    kept[:] = [other for other in kept if other.base != land or not new.is_dominating(other)] + [new]
    found = [(done, option) for done, kept in by_set.items() for option in kept]
    if len(found) > MOST_OPTIONS:
        raise InstanceError(f"segments: a vehicle has more than {MOST_OPTIONS} options, expected fewer")
    return found


def _start_s(instance: SortieInstance, vehicle: int, before: _Option, base: int, seconds: float) -> float | None:
    own = instance.vehicles[vehicle]
    ready_s = before.lands_s + instance.bases[before.base].turnaround_s if before.sorties else own.ready_s
    ready_s += float(instance.transfer_s[before.base, base])
    for begin, end in own.windows:
        if max(ready_s, begin) + seconds <= end:
            return max(ready_s, begin)
    return None


def _choose_options(
    instance: SortieInstance, options: Sequence[Sequence[tuple[int, _Option]]], segments: int, limited: Sequence[int]
) -> Plan | None:
    columns = [(vehicle, done, option) for vehicle, own in enumerate(options) for done, option in own]
    last = len(columns)
    rows: list[tuple[dict[int, float], float, float]] = []
    for vehicle in range(len(options)):
        rows.append(({number: 1.0 for number, one in enumerate(columns) if one[0] == vehicle}, 1.0, 1.0))
        lands = {number: one[2].lands_s for number, one in enumerate(columns) if one[0] == vehicle}
        rows.append(({**lands, last: -1.0}, -np.inf, 0.0))
    rows += [
        ({number: 1.0 for number, one in enumerate(columns) if one[1] >> segment & 1}, 1.0, 1.0)
        for segment in range(segments)
    ]
    for place, base in enumerate(limited):
        taken = {number: float(one[2].packs[place]) for number, one in enumerate(columns)}
        rows.append((taken, -np.inf, float(instance.bases[base].packs or 0)))
    best = _solve_program(len(columns), rows, {last: 1.0})
    if best is None:
        return None
    rows.append(({last: 1.0}, -np.inf, best[last] + TOLERANCE))
    flight = {number: one[2].flight_s for number, one in enumerate(columns)}
    best = _solve_program(len(columns), rows, flight) or best
    taken_by = {columns[number][0]: columns[number][2] for number in range(len(columns)) if best[number] > 0.5}
    return Plan(tuple(one for vehicle in range(len(options)) for one in taken_by[vehicle].sorties))


def _solve_program(
    columns: int, rows: Sequence[tuple[dict[int, float], float, float]], cost: dict[int, float]
) -> list[float] | None:
    """Return the choice of HiGHS: whether each column is taken, and the last landing."""
    import highspy

    solver = highs.build_program(
        [cost.get(number, 0.0) for number in range(columns + 1)],
        [1.0] * columns + [np.inf],
        ([lower for _, lower, _ in rows], [upper for _, _, upper in rows]),
        build_row_matrix([row for row, _, _ in rows], columns + 1),
        whole=[True] * columns + [False],
    )
    solver.run()
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    return list(solver.getSolution().col_value)
