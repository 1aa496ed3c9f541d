"""The definition of every figure of days of sorties: slow, obvious, and what the kernels must agree with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from planner.errors import PlanError
from planner.sorties.sortie_model import Sortie, SortieInstance, SortiePlan, SortieVehicle

TOLERANCE = 1e-6
"""Seconds or percent by which sums may differ: they depend on their order."""


@dataclass(frozen=True, slots=True)
class SortieEvaluation:
    """The figures of a plan."""

    finish_s: float
    """When the last sortie lands; 0 without one."""
    flight_s: float
    """The time in the air of all sorties."""
    count: int
    """Of the sorties: each takes a pack."""
    lasts_s: tuple[tuple[float, ...], ...]
    """How long each sortie takes, as the plan has them."""
    energies_pct: tuple[tuple[float, ...], ...]
    violations: tuple[str, ...]
    """In words; empty if every wanted segment is flown or named as uncovered, by sorties that may be."""


@dataclass(frozen=True, slots=True)
class SortieResult:
    """The best plan that a search found, with its figures from the definition."""

    plan: SortiePlan
    evaluation: SortieEvaluation
    iterations: int
    seconds: float
    stopped_by: str


def sortie_duration_s(instance: SortieInstance, vehicle: int, sortie: Sortie) -> float:
    """Return how long a sortie takes.

    Raises:
        PlanError: it has no visit, or one that the instance does not have.
    """
    return _measure_sortie(instance, vehicle, sortie)[0]


def _measure_sortie(instance: SortieInstance, vehicle: int, sortie: Sortie) -> tuple[float, float]:
    """Return a sortie's seconds, and its percent of a full pack."""
    _check(instance, sortie)
    visits, own = list(sortie.visits), instance.vehicles[vehicle]
    out, home = (vehicle, sortie.base, visits[0]), (vehicle, visits[-1], sortie.lands)
    between_s = instance.moves.seconds(own.profile, visits[:-1], visits[1:]).sum()
    between_pct = own.consumption * instance.moves.pct(own.profile, visits[:-1], visits[1:]).sum()
    return (
        float(instance.out_s[out] + between_s + instance.home_s[home]),
        float(instance.out_pct[out] + between_pct + instance.home_pct[home]),
    )


def _check(instance: SortieInstance, sortie: Sortie) -> None:
    if not sortie.visits:
        raise PlanError("sortie: expected a visit at least")
    if not all(0 <= visit < 2 * instance.segments for visit in sortie.visits):
        raise PlanError(f"sortie: expected visits of {instance.segments} segments")
    if not all(0 <= base < len(instance.bases) for base in (sortie.base, sortie.lands)):
        raise PlanError(f"sortie: expected bases of {len(instance.bases)}")


def evaluate_sorties(instance: SortieInstance, plan: SortiePlan) -> SortieEvaluation:
    """Return a plan's figures, and what is wrong with it.

    Raises:
        PlanError: it has other vehicles, segments or bases.
    """
    if len(plan.sorties) != len(instance.vehicles):
        raise PlanError(f"plan: expected {len(instance.vehicles)} vehicles, got {len(plan.sorties)}")
    if not all(0 <= segment < instance.segments for segment in plan.uncovered):
        raise PlanError(f"uncovered: expected some of {instance.segments} segments")
    figures = [[_measure_sortie(instance, vehicle, one) for one in own] for vehicle, own in enumerate(plan.sorties)]
    lasts, energies = (tuple(tuple(pair[place] for pair in own) for own in figures) for place in range(2))
    ends = [one.start_s + long for own, row in zip(plan.sorties, lasts, strict=True)
            for one, long in zip(own, row, strict=True)]  # fmt: skip
    found = [
        *_check_coverage(instance, plan), *_check_vehicles(instance, plan, lasts, energies),
        *_check_take_offs(instance, plan), *_check_packs(instance, plan, lasts),
    ]  # fmt: skip
    return SortieEvaluation(max(ends, default=0.0), sum(map(sum, lasts)), len(ends), lasts, energies, tuple(found))


def _check_coverage(instance: SortieInstance, plan: SortiePlan) -> Iterator[str]:
    flown = Counter(visit >> 1 for own in plan.sorties for one in own for visit in one.visits)
    flown.update(plan.uncovered)
    for segment in range(instance.segments):
        expected = int(instance.wanted[segment])
        if flown[segment] != expected:
            yield f"segment {segment} is flown or named as uncovered {flown[segment]} times, expected {expected}"


def _check_vehicles(
    instance: SortieInstance,
    plan: SortiePlan,
    lasts: tuple[tuple[float, ...], ...],
    energies: tuple[tuple[float, ...], ...],
) -> Iterator[str]:
    for number, own in enumerate(instance.vehicles):
        place, ready_s = own.base, own.ready_s
        for one, long, pct in zip(plan.sorties[number], lasts[number], energies[number], strict=True):
            name = f"{own.name} at {one.start_s:.1f} s"
            if one.start_s < ready_s + float(instance.transfer_s[place, one.base]) - TOLERANCE:
                yield f"{name}: cannot be at base {instance.bases[one.base].name} so soon"
            for base in {one.base, one.lands} - set(own.lands):
                yield f"{name}: is not allowed at base {instance.bases[base].name}"
            if pct > own.budget_pct + TOLERANCE:
                yield f"{name}: uses {pct:.3f} %, its budget is {own.budget_pct:.3f} %"
            if not _is_within_hours(own, one.start_s, one.start_s + long):
                yield f"{name}: flies outside of its hours"
            for visit in one.visits:
                if not instance.able[number, visit >> 1]:
                    yield f"{name}: may not inspect segment {visit >> 1}"
            place, ready_s = one.lands, one.start_s + long + instance.bases[one.lands].turnaround_s


def _is_within_hours(own: SortieVehicle, start_s: float, end_s: float) -> bool:
    return any(begin - TOLERANCE <= start_s and end_s <= end + TOLERANCE for begin, end in own.windows)


def _check_take_offs(instance: SortieInstance, plan: SortiePlan) -> Iterator[str]:
    for number, base in enumerate(instance.bases):
        starts = sorted(one.start_s for own in plan.sorties for one in own if one.base == number)
        for before, after in pairwise((base.taken_off_s, *starts)):
            if after - before < instance.stagger_s - TOLERANCE:
                yield f"base {base.name}: take-offs at {before:.1f} and {after:.1f} s, {instance.stagger_s:g} s apart"


def _check_packs(instance: SortieInstance, plan: SortiePlan, lasts: tuple[tuple[float, ...], ...]) -> Iterator[str]:
    for day, (opens, closes) in enumerate(instance.days):
        pools = [base.list_packs(day, opens) for base in instance.bases]
        flown = sorted(
            ((one, long) for own, row in zip(plan.sorties, lasts, strict=True)
             for one, long in zip(own, row, strict=True) if opens <= one.start_s < closes),
            key=lambda pair: pair[0].start_s,
        )  # fmt: skip
        for one, long in flown:
            base, lands = instance.bases[one.base], instance.bases[one.lands]
            if base.packs is not None:
                pool = pools[one.base]
                if not pool or min(pool) > one.start_s + TOLERANCE:
                    yield f"base {base.name}: no charged pack for the take-off at {one.start_s:.1f} s"
                else:
                    pool.remove(min(pool))
            if lands.recharge_s is not None:
                pools[one.lands].append(one.start_s + long + lands.recharge_s)


def count_packs_needed(instance: SortieInstance, plan: SortiePlan, evaluation: SortieEvaluation) -> tuple[int, ...]:
    """Return the packs that each base needs on its hardest day: as many as never to keep one of these sorties waiting.

    A pack counts with the base where it lands, from where it may fly again once it is charged.
    """
    need = [0] * len(instance.bases)
    for opens, closes in instance.days:
        events = []
        for own, row in zip(plan.sorties, evaluation.lasts_s, strict=True):
            for one, long in zip(own, row, strict=True):
                if opens <= one.start_s < closes:
                    recharge_s = instance.bases[one.lands].recharge_s
                    events.append((one.start_s, 1, one.base))
                    if recharge_s is not None:
                        events.append((one.start_s + long + recharge_s, 0, one.lands))
        away = [0] * len(instance.bases)
        for _, taken, base in sorted(events):
            away[base] += 1 if taken else -1
            need[base] = max(need[base], away[base])
    return tuple(need)
