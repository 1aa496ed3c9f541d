"""Plan days of sorties, re-plan them after permanent losses, and estimate the vehicles and packs that they need.

A sortie that has begun is flown to its end. A vehicle's inspections count once it has landed: a lost vehicle loses all
data on board. New sorties of the others follow those under way. Plans for the rest after each loss show until when a
loss still lets the days be finished.

The number of vehicles and packs comes from simulation: the days are flown many times with random losses, each
re-planned. An airborne vehicle fails at random and is permanently lost with its pack. The others, spares included, fly
its lost inspections again; a spare stands at a base and flies only after a loss. Each re-plan is the first one found
that inspects everything in the hours that are left, so a share is a lower bound for the best re-plans.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.errors import PlanError
from planner.model import Plan, Route
from planner.moves import MoveTables
from planner.risk import FlightChunk, ProbabilityEstimate, estimate_probability
from planner.sorties.sortie_model import (
    Objective,
    SortieBase,
    SortieInstance,
    SortieResult,
    count_packs_needed,
    sortie_duration_s,
)
from planner.stop_rules import (
    FirstFeasible,
    Iterations,
    Progress,
    StopRule,
    StopVerdict,
    add_progress_report,
    combine_stop_rules,
)

if TYPE_CHECKING:
    from planner.sorties.sortie_annealing import MoveTable

ENOUGH = 3_000
"""Iterations within which a re-plan must inspect everything."""
POLISHED = 400
"""Minimum iterations of each re-plan: one that only just fits would leave no time for the next loss."""
SAME_TIME_S = 1e-6


def solve_sorties(
    instance: SortieInstance,
    *,
    stop: StopRule,
    objective: Objective = Objective.FINISH,
    seed: int = 0,
    starts: int = 1,
    initial: Sequence[Route] | None = None,
    table: MoveTable | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> SortieResult:
    """Return the best plan found until ``stop`` ends the search.

    Segments that no vehicle can inspect or that do not fit into any day are left uncovered.

    Args:
        instance: the problem.
        stop: checked at least every 200 iterations of a start.
        objective: the primary objective.
        seed: seed of all randomness.
        starts: parallel searches, one thread each; iterations are counted over all of them.
        initial: first sorties, by vehicle and time; the search inserts the missing segments.
        table: the moves, if already computed.
        on_progress: called with the progress of the search.

    Raises:
        PlanError: ``initial`` has a segment twice.
    """
    # Imported here because numba takes a second to load, and many callers never make a plan.
    from planner.sorties.sortie_annealing import SortieSearch

    search = SortieSearch(instance, objective=objective, seed=seed, starts=starts, initial=initial, table=table)
    return search.run(add_progress_report(stop, on_progress))


def _stop_once_polished(progress: Progress) -> StopVerdict:
    """Stop after POLISHED iterations once a plan covers everything, or when it is certain that there is none."""
    if progress.feasible and not progress.impossible and progress.iterations < POLISHED:
        return StopVerdict(POLISHED - progress.iterations, "polished")
    return FirstFeasible()(progress)


@dataclass(frozen=True, slots=True)
class SortiesAfterLoss:
    """The sorties and the problem after losses."""

    kept: tuple[Route, ...]
    """Sorties that count or are under way."""
    instance: SortieInstance
    """The remaining problem, with the next position of every vehicle and pack."""
    tails: tuple[Route, ...]
    """Sorties that the remaining vehicles were to fly next."""
    broken: tuple[Route, ...]
    """Sorties that the lost vehicles were flying: no inspection counts, and the packs are lost."""


def build_sorties_after_loss(
    instance: SortieInstance, sorties: Sequence[Route], lost: Mapping[int, float], at_s: float
) -> SortiesAfterLoss:
    """Return the sorties and the problem left at a time when some vehicles are lost.

    Args:
        instance: the whole days.
        sorties: sorties of all vehicles known so far, by vehicle and time, including those of lost ones that count.
        lost: the time of each loss, by vehicle number.
        at_s: the current time.

    Raises:
        PlanError: a vehicle does not exist.
    """
    fleet = len(instance.vehicles)
    if not all(0 <= one < fleet for one in (*lost, *(sortie.vehicle for sortie in sorties))):
        raise PlanError(f"expected sorties and losses of {fleet} vehicles")
    kept, tails, broken = list[Route](), list[Route](), list[Route]()
    flown: list[tuple[Route, float]] = []
    """All sorties that took off, with their durations, lost ones included: these also used packs and take-offs."""
    wanted = instance.wanted.copy()
    vehicles = [replace(own, ready_s=max(own.ready_s, at_s)) for own in instance.vehicles]
    for one in sorties:
        number, long, own = one.vehicle, sortie_duration_s(instance, one), vehicles[one.vehicle]
        if one.start_s >= min(at_s, lost.get(number, at_s)) - SAME_TIME_S:
            tails += [] if number in lost else [one]
            continue
        counts = number not in lost or one.start_s + long < lost[number] - SAME_TIME_S
        flown.append((one, long if counts else np.inf))
        (kept if counts else broken).append(one)
        if counts:
            ready_s = max(own.ready_s, one.start_s + long + instance.bases[one.lands].turnaround_s)
            vehicles[number] = replace(own, base=one.lands, ready_s=ready_s)
            wanted[[visit >> 1 for visit in one.visits]] = False
    day = next((number for number, (_, closes) in enumerate(instance.days) if at_s < closes), len(instance.days) - 1)
    opens_s = instance.days[day][0]
    rest = replace(
        instance,
        vehicles=tuple(
            replace(own, windows=() if number in lost else tuple(one for one in own.windows if one[0] >= opens_s))
            for number, own in enumerate(vehicles)
        ),
        days=instance.days[day:],
        wanted=wanted,
        locked={segment: keeper for segment, keeper in instance.locked.items() if keeper not in lost},
        bases=_build_bases(instance, opens_s, [one for one in flown if one[0].start_s >= opens_s - SAME_TIME_S], day),
    )
    return SortiesAfterLoss(tuple(kept), rest, tuple(tails), tuple(broken))


def _build_bases(
    instance: SortieInstance, opens_s: float, flown: Sequence[tuple[Route, float]], day: int
) -> tuple[SortieBase, ...]:
    """Return the bases with the packs that they have left today."""
    pools = [base.list_packs(day, opens_s) for base in instance.bases]
    last = [base.taken_off_s for base in instance.bases]
    for one, long in sorted(flown, key=lambda pair: pair[0].start_s):
        lands, pool = instance.bases[one.lands], pools[one.base]
        last[one.base] = max(last[one.base], one.start_s)
        if pool:
            pool.remove(min(pool))
        if lands.recharge_s is not None and np.isfinite(long):
            pools[one.lands].append(one.start_s + long + lands.recharge_s)
    return tuple(
        replace(base, charged_s=None if base.packs is None else tuple(pool), taken_off_s=taken_off)
        for base, pool, taken_off in zip(instance.bases, pools, last, strict=True)
    )


@dataclass(frozen=True, slots=True)
class LossWindow:
    """The time from which a vehicle may be permanently lost with everything inspected by the end of the last day."""

    vehicle: str
    from_s: float
    """Seconds from the first midnight; 0 for any time."""
    breaks: int | None = None
    """Its last sortie, counted from 0, for whose loss no re-plan was found."""


def find_loss_windows(
    instance: SortieInstance,
    plan: Plan,
    *,
    seed: int = 0,
    told: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[LossWindow, ...]:
    """Return each vehicle's window over the days.

    A loss is known at once. A later notice is never better for the others, so of all loss times in a sortie the last
    one, just before landing, decides. A re-plan that was found proves that one exists; if none was found, one may
    still exist.
    """
    # Imported here because it loads the kernels.
    from planner.sorties.sortie_annealing import build_move_table

    table = build_move_table(instance)
    total, done = len(plan.routes), 0
    found = []
    for vehicle in range(len(instance.vehicles)):
        from_s, breaks, own = 0.0, None, plan.routes_of(vehicle)
        for number in range(len(own) - 1, -1, -1):
            lands_s = own[number].start_s + sortie_duration_s(instance, own[number])
            done += 1
            told(done, total)
            left = build_sorties_after_loss(instance, plan.routes, {vehicle: lands_s}, lands_s)
            if replan_sorties(left, seed, table).uncovered:
                from_s, breaks = lands_s, number
                done += number
                break
        found.append(LossWindow(instance.vehicles[vehicle].name, from_s, breaks))
    return tuple(found)


def replan_sorties(left: SortiesAfterLoss, seed: int, table: MoveTable | None) -> Plan:
    """Return a plan for the remaining problem: one that inspects everything, else the best after all iterations."""
    if not left.instance.wanted.any():
        return Plan(())
    stop = combine_stop_rules(_stop_once_polished, Iterations(ENOUGH))
    return solve_sorties(
        left.instance, stop=stop, objective=Objective.FLIGHT, seed=seed, initial=left.tails, table=table
    ).plan


HOUR_S = 3600.0


@dataclass(frozen=True, slots=True)
class SurvivalEstimate:
    """Results of flying the same days many times."""

    samples: int
    finished: ProbabilityEstimate
    losses: float
    """Mean number of losses, up to the point where the days could no longer be finished."""
    packs: tuple[tuple[int, ...], ...]
    """Packs needed at each base, for each sample that inspected everything, as by ``count_packs_needed``."""

    def packs_for_share(self, share: float) -> tuple[int, ...]:
        """Return the packs of each base that suffice in a given share of the finished samples."""
        if not self.packs:
            return ()
        return tuple(int(count) for count in np.quantile(np.array(self.packs), share, axis=0, method="higher"))


@dataclass(frozen=True, slots=True)
class SparesEstimate:
    """Results for a number of spares."""

    spares: tuple[int, ...]
    """Number of the vehicle that each spare copies."""
    lives: SurvivalEstimate


def add_spares(instance: SortieInstance, spares: Sequence[int]) -> SortieInstance:
    """Return the instance with a spare for each given vehicle: a copy of it at the same place."""
    rows = [*range(len(instance.vehicles)), *spares]
    fleet = [replace(instance.vehicles[one], name=f"spare{number}") for number, one in enumerate(spares, 1)]
    return replace(
        instance, vehicles=(*instance.vehicles, *fleet), able=instance.able[rows],
        out_s=instance.out_s[rows], out_pct=instance.out_pct[rows],
        home_s=instance.home_s[rows], home_pct=instance.home_pct[rows],
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SurvivalCampaign:
    """Settings of a campaign that flies the same days many times."""

    instance: SortieInstance
    """The instance including the spares, which come last."""
    plan: Plan
    """Sorties of all vehicles without a loss; spares may have none."""
    mtbf_h: float
    """Mean flight hours between failures of one vehicle."""
    seed: int = 0
    """Seed of all random numbers: the same seed gives the same failures, whatever the number of spares."""


@dataclass(frozen=True, slots=True)
class SampleResult:
    """Result of one sample."""

    losses: int
    packs: tuple[int, ...] | None
    """Packs needed at each base; none if a segment was left over."""


DAYS_PER_CHUNK = 10
"""Samples flown per chunk; random numbers depend on the campaign and the number of each sample."""


def simulate_days(campaign: SurvivalCampaign, chunk: FlightChunk) -> tuple[SampleResult, ...]:
    """Fly the days of a chunk; the result does not depend on the process that runs it."""
    # Imported here because it loads the kernels.
    from planner.sorties.sortie_annealing import build_move_table

    table = build_move_table(campaign.instance)
    # Each sortie is evaluated many times here.
    instance = replace(campaign.instance, moves=MoveTables(table.move[..., 0], table.move[..., 1]))
    outcomes = []
    for sample in range(chunk.first, chunk.first + chunk.flights):
        chance = np.random.default_rng((campaign.seed, sample))
        # Spares come last and lives are drawn one by one: those of the others do not depend on the number of spares.
        life_s = [float(chance.exponential(campaign.mtbf_h * HOUR_S)) for _ in instance.vehicles]
        flown, lost, finished = _simulate_once(instance, campaign.plan, life_s, campaign.seed, table)
        outcomes.append(SampleResult(lost, count_packs_needed(instance, flown) if finished else None))
    return tuple(outcomes)


def summarise_samples(chunks: Sequence[Sequence[SampleResult]]) -> SurvivalEstimate:
    """Return the estimate from all samples."""
    outcomes = [one for chunk in chunks for one in chunk]
    packs = tuple(one.packs for one in outcomes if one.packs is not None)
    losses = sum(one.losses for one in outcomes)
    return SurvivalEstimate(
        len(outcomes), estimate_probability(len(packs), len(outcomes)), losses / len(outcomes), packs
    )


def _simulate_once(
    instance: SortieInstance, plan: Plan, life_s: Sequence[float], seed: int, table: MoveTable
) -> tuple[Sequence[Route], int, bool]:
    """Return all sorties that took off, the number of lost vehicles, and whether everything was inspected."""
    lost: dict[int, float] = {}
    flown: Sequence[Route] = plan.routes
    while not plan.uncovered:
        failures = [
            (at_s, number)
            for number in range(len(instance.vehicles))
            if number not in lost and (at_s := _failure_time_s(instance, flown, number, life_s[number])) is not None
        ]
        if not failures:
            break
        at_s, number = min(failures)
        lost[number] = at_s
        left = build_sorties_after_loss(instance, flown, lost, at_s)
        plan = replan_sorties(left, seed, table)
        flown = sorted([*left.kept, *left.broken, *plan.routes], key=lambda one: (one.vehicle, one.start_s))
    return flown, len(lost), not plan.uncovered


def _failure_time_s(instance: SortieInstance, flown: Sequence[Route], vehicle: int, life_s: float) -> float | None:
    """Return when a vehicle with this life in flight seconds fails; None if it outlasts its sorties."""
    for one in flown:
        if one.vehicle != vehicle:
            continue
        long = sortie_duration_s(instance, one)
        if life_s < long:
            return one.start_s + life_s
        life_s -= long
    return None
