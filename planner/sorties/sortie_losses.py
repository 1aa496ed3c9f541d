"""From an instance to days of sorties, what losses for good leave of them, and how many vehicles and packs they need.

A sortie that has begun is flown to its end. What a vehicle did counts once it has landed: a lost one loses what it had
on board. For the others new sorties are planned after those under way. Until when a loss still lets the days be
finished is found out by plans for what each one leaves.

How many it needs is found out on paper: days are flown many times with losses by chance, each re-planned. A vehicle in
the air fails at random and is lost for good with its pack. What it had on board is flown again by the others, spares
among them; a spare stands at a base and flies only once somebody is lost. A re-plan is the first that is found to
inspect everything in the hours that are left, so a share is a lower bound of what the best re-plans reach.
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
"""Iterations in which a re-plan must be found that inspects everything."""
POLISHED = 400
"""Iterations that each re-plan has: one that only just fits would leave no time for the next loss."""
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

    What no vehicle can do, and what finds no day, is left uncovered.

    Args:
        instance: the problem.
        stop: asked at least every 200 iterations of a start.
        objective: what comes first.
        seed: of all randomness.
        starts: searches side by side, a thread each; iterations are counted over all of them.
        initial: sorties to begin with, by vehicle and time; the search puts in what is missing.
        table: the moves, where they are priced already.
        on_progress: told where the search stands.

    Raises:
        PlanError: ``initial`` has a segment twice.
    """
    # Only here: numba takes a second to load, and whoever imports the planner may never make a plan.
    from planner.sorties.sortie_annealing import SortieSearch

    search = SortieSearch(instance, objective=objective, seed=seed, starts=starts, initial=initial, table=table)
    return search.run(add_progress_report(stop, on_progress))


def _stop_once_polished(progress: Progress) -> StopVerdict:
    """Stop at the first plan that covers everything, but not at once; or when it is certain that there is none."""
    if progress.feasible and not progress.impossible and progress.iterations < POLISHED:
        return StopVerdict(POLISHED - progress.iterations, "polished")
    return FirstFeasible()(progress)


@dataclass(frozen=True, slots=True)
class SortiesAfterLoss:
    """What is left of a plan after losses."""

    kept: tuple[Route, ...]
    """Sorties that count or are under way."""
    instance: SortieInstance
    """The rest: from where everybody and every pack will be."""
    tails: tuple[Route, ...]
    """What those who are left were to fly next."""
    broken: tuple[Route, ...]
    """What the lost were flying: nothing of it counts, but its packs are gone."""


def build_sorties_after_loss(
    instance: SortieInstance, sorties: Sequence[Route], lost: Mapping[int, float], at_s: float
) -> SortiesAfterLoss:
    """Return what is left at a time when some vehicles are lost.

    Args:
        instance: the whole days.
        sorties: everybody's, as known until now, by vehicle and time; those of the lost that count may be among them.
        lost: when each was, by its number.
        at_s: now.

    Raises:
        PlanError: a vehicle that there is not.
    """
    fleet = len(instance.vehicles)
    if not all(0 <= one < fleet for one in (*lost, *(sortie.vehicle for sortie in sorties))):
        raise PlanError(f"expected sorties and losses of {fleet} vehicles")
    kept, tails, broken = list[Route](), list[Route](), list[Route]()
    flown: list[tuple[Route, float]] = []
    """All that took off, with how long it took, also what was lost: packs and take-offs are gone with it."""
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
    """Return bases with the packs that they have left today."""
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
    """From when on a vehicle may be lost for good, and everything is still inspected by the end of the last day."""

    vehicle: str
    from_s: float
    """Seconds from the first midnight; 0 if at any time."""
    breaks: int | None = None
    """Its last sortie, counted from 0, whose loss no re-plan was found for."""


def find_loss_windows(
    instance: SortieInstance,
    plan: Plan,
    *,
    seed: int = 0,
    told: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[LossWindow, ...]:
    """Return each vehicle's window over the days.

    A loss is known at once. For the others it is never better to hear of it later, so of all the times of one sortie
    the last, just before it lands, decides. That a re-plan exists was shown by one that was found; that none does is
    only that the search found none.
    """
    # Only here: it loads the kernels.
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
    """Return a plan for what is left: one that inspects everything, else the best after all iterations."""
    if not left.instance.wanted.any():
        return Plan(())
    stop = combine_stop_rules(_stop_once_polished, Iterations(ENOUGH))
    return solve_sorties(
        left.instance, stop=stop, objective=Objective.FLIGHT, seed=seed, initial=left.tails, table=table
    ).plan


HOUR_S = 3600.0


@dataclass(frozen=True, slots=True)
class SurvivalEstimate:
    """What many times the same days came to."""

    samples: int
    finished: ProbabilityEstimate
    losses: float
    """On average, up to where the days could not be finished any more."""
    packs: tuple[tuple[int, ...], ...]
    """For each sample in which everything was inspected the packs that each base needed, as ``count_packs_needed``."""

    def packs_for_share(self, share: float) -> tuple[int, ...]:
        """Return how many packs of each base are enough in such a share of the finished samples."""
        if not self.packs:
            return ()
        return tuple(int(count) for count in np.quantile(np.array(self.packs), share, axis=0, method="higher"))


@dataclass(frozen=True, slots=True)
class SparesEstimate:
    """What so many spares came to."""

    spares: tuple[int, ...]
    """Whose likeness each of them is."""
    lives: SurvivalEstimate


def add_spares(instance: SortieInstance, spares: Sequence[int]) -> SortieInstance:
    """Return the instance with a likeness of each of some vehicles, standing where it stands."""
    rows = [*range(len(instance.vehicles)), *spares]
    fleet = [replace(instance.vehicles[one], name=f"spare{number}") for number, one in enumerate(spares, 1)]
    return replace(
        instance, vehicles=(*instance.vehicles, *fleet), able=instance.able[rows],
        out_s=instance.out_s[rows], out_pct=instance.out_pct[rows],
        home_s=instance.home_s[rows], home_pct=instance.home_pct[rows],
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SurvivalCampaign:
    """Days that are to be flown many times."""

    instance: SortieInstance
    """Spares included; they come last."""
    plan: Plan
    """Everybody's sorties without a loss; of spares there need not be any."""
    mtbf_h: float
    """Mean flight hours between failures of one vehicle."""
    seed: int = 0
    """Of all random numbers: with the same one vehicles fail alike, however many spares there are."""


@dataclass(frozen=True, slots=True)
class SampleResult:
    """What one time came to."""

    losses: int
    packs: tuple[int, ...] | None
    """That each base needed; none where something was left over."""


DAYS_PER_CHUNK = 10
"""So many times days are flown at once; chance is the campaign's, by the number of each time."""


def simulate_days(campaign: SurvivalCampaign, chunk: FlightChunk) -> tuple[SampleResult, ...]:
    """Fly days some times; what they come to is the same wherever that is done."""
    # Only here: it loads the kernels.
    from planner.sorties.sortie_annealing import build_move_table

    table = build_move_table(campaign.instance)
    # Each sortie is priced again and again here.
    instance = replace(campaign.instance, moves=MoveTables(table.move[..., 0], table.move[..., 1]))
    outcomes = []
    for sample in range(chunk.first, chunk.first + chunk.flights):
        chance = np.random.default_rng((campaign.seed, sample))
        # Spares come last, and drawn one by one: the others' fates do not depend on how many there are.
        life_s = [float(chance.exponential(campaign.mtbf_h * HOUR_S)) for _ in instance.vehicles]
        flown, lost, finished = _simulate_once(instance, campaign.plan, life_s, campaign.seed, table)
        outcomes.append(SampleResult(lost, count_packs_needed(instance, flown) if finished else None))
    return tuple(outcomes)


def summarise_samples(chunks: Sequence[Sequence[SampleResult]]) -> SurvivalEstimate:
    """Return what all times came to."""
    outcomes = [one for chunk in chunks for one in chunk]
    packs = tuple(one.packs for one in outcomes if one.packs is not None)
    losses = sum(one.losses for one in outcomes)
    return SurvivalEstimate(
        len(outcomes), estimate_probability(len(packs), len(outcomes)), losses / len(outcomes), packs
    )


def _simulate_once(
    instance: SortieInstance, plan: Plan, life_s: Sequence[float], seed: int, table: MoveTable
) -> tuple[Sequence[Route], int, bool]:
    """Return all sorties that took off, how many vehicles were lost, and whether nothing is left over."""
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
    """Return when a vehicle fails that lasts so many seconds in the air; None if it outlasts its sorties."""
    for one in flown:
        if one.vehicle != vehicle:
            continue
        long = sortie_duration_s(instance, one)
        if life_s < long:
            return one.start_s + life_s
        life_s -= long
    return None
