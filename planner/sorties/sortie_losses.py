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
from planner.moves import MoveTables
from planner.risk import FlightChunk, ProbabilityEstimate, estimate_probability
from planner.sorties.sortie_model import (
    Objective,
    Sortie,
    SortieBase,
    SortieInstance,
    SortiePlan,
    SortieResult,
    count_packs_needed,
    evaluate_sorties,
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
    initial: Sequence[Sequence[Sortie]] = (),
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
        initial: sorties to begin with for each vehicle; the search puts in what is missing.
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

    kept: tuple[tuple[Sortie, ...], ...]
    """Sorties that count or are under way."""
    instance: SortieInstance
    """The rest: from where everybody and every pack will be."""
    tails: tuple[tuple[Sortie, ...], ...]
    """What those who are left were to fly next."""
    broken: tuple[tuple[Sortie, ...], ...]
    """What the lost were flying: nothing of it counts, but its packs are gone."""

    def list_known_sorties(self, plan: SortiePlan) -> SortiePlan:
        """Return all sorties that have taken off or will: for the next loss."""
        joined = zip(self.kept, self.broken, plan.sorties, strict=True)
        return SortiePlan(tuple(kept + broken + after for kept, broken, after in joined), plan.uncovered)


def build_sorties_after_loss(
    instance: SortieInstance, plan: SortiePlan, lost: Mapping[int, float], at_s: float
) -> SortiesAfterLoss:
    """Return what is left at a time when some vehicles are lost.

    Args:
        instance: the whole days.
        plan: everybody's sorties, as known until now; those of the lost that count may be among them.
        lost: when each was, by its number.
        at_s: now.

    Raises:
        PlanError: a vehicle that there is not.
    """
    if len(plan.sorties) != len(instance.vehicles) or not all(0 <= one < len(instance.vehicles) for one in lost):
        raise PlanError(f"expected sorties and losses of {len(instance.vehicles)} vehicles")
    lasts = [[sortie_duration_s(instance, number, one) for one in own] for number, own in enumerate(plan.sorties)]
    kept, tails, broken, vehicles = [], [], [], []
    flown: list[tuple[Sortie, float]] = []
    """All that took off, with how long it took, also what was lost: packs and take-offs are gone with it."""
    wanted = instance.wanted.copy()
    for number, own in enumerate(instance.vehicles):
        begun, later, gone, place, ready_s = [], [], [], own.base, max(own.ready_s, at_s)
        for one, long in zip(plan.sorties[number], lasts[number], strict=True):
            if one.start_s >= min(at_s, lost.get(number, at_s)) - SAME_TIME_S:
                later.append(one)
                continue
            counts = number not in lost or one.start_s + long < lost[number] - SAME_TIME_S
            flown.append((one, long if counts else np.inf))
            if counts:
                begun.append(one)
                place, ready_s = one.lands, max(ready_s, one.start_s + long + instance.bases[one.lands].turnaround_s)
                wanted[[visit >> 1 for visit in one.visits]] = False
            else:
                gone.append(one)
        kept.append(tuple(begun))
        broken.append(tuple(gone))
        tails.append(() if number in lost else tuple(later))
        windows = () if number in lost else own.windows
        vehicles.append(replace(own, base=place, ready_s=ready_s, windows=windows))
    day = next((number for number, (_, closes) in enumerate(instance.days) if at_s < closes), len(instance.days) - 1)
    days = instance.days[day:]
    vehicles = [
        replace(own, windows=tuple(window for window in own.windows if window[0] >= days[0][0])) for own in vehicles
    ]
    today = [(one, long) for one, long in flown if one.start_s >= days[0][0] - SAME_TIME_S]
    rest = replace(
        instance,
        vehicles=tuple(vehicles),
        days=days,
        wanted=wanted,
        bases=_build_bases(instance, days[0][0], today, day),
    )
    return SortiesAfterLoss(tuple(kept), rest, tuple(tails), tuple(broken))


def _build_bases(
    instance: SortieInstance, opens_s: float, flown: Sequence[tuple[Sortie, float]], day: int
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
    """When one vehicle may be lost for good so that everything is still inspected by the end of the last day."""

    vehicle: int
    from_s: float
    """From here on, on its last stretch of sorties that the others can all make good; NEVER lost too early is 0."""
    breaks: int | None
    """The number of its last sortie whose loss no re-plan was found for; None if it may be lost at any time."""


def find_loss_windows(
    instance: SortieInstance,
    plan: SortiePlan,
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
    total, done = sum(map(len, plan.sorties)), 0
    found = []
    for vehicle, own in enumerate(plan.sorties):
        from_s, breaks = 0.0, None
        for number in range(len(own) - 1, -1, -1):
            lands_s = own[number].start_s + sortie_duration_s(instance, vehicle, own[number])
            done += 1
            told(done, total)
            left = build_sorties_after_loss(instance, plan, {vehicle: lands_s}, lands_s)
            if replan_sorties(left, seed, table).uncovered:
                from_s, breaks = lands_s, number
                done += number
                break
        found.append(LossWindow(vehicle, from_s, breaks))
    return tuple(found)


def replan_sorties(left: SortiesAfterLoss, seed: int, table: MoveTable | None) -> SortiePlan:
    """Return a plan for what is left: one that inspects everything, else the best after all iterations."""
    if not left.instance.wanted.any():
        return SortiePlan(tuple(() for _ in left.tails))
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
    plan: SortiePlan
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
    missing = len(instance.vehicles) - len(campaign.plan.sorties)
    plan = SortiePlan(campaign.plan.sorties + ((),) * missing, campaign.plan.uncovered)
    outcomes = []
    for sample in range(chunk.first, chunk.first + chunk.flights):
        chance = np.random.default_rng((campaign.seed, sample))
        # Spares come last, and drawn one by one: the others' fates do not depend on how many there are.
        life_s = [float(chance.exponential(campaign.mtbf_h * HOUR_S)) for _ in instance.vehicles]
        flown, lost = _simulate_once(instance, plan, life_s, campaign.seed, table)
        packs = None if flown.uncovered else count_packs_needed(instance, flown, evaluate_sorties(instance, flown))
        outcomes.append(SampleResult(lost, packs))
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
    instance: SortieInstance,
    plan: SortiePlan,
    life_s: Sequence[float],
    seed: int,
    table: MoveTable,
) -> tuple[SortiePlan, int]:
    """Return all sorties that took off, and how many vehicles were lost."""
    lost: dict[int, float] = {}
    while not plan.uncovered:
        failures = [
            (at_s, number)
            for number in range(len(instance.vehicles))
            if number not in lost and (at_s := _failure_time_s(instance, plan, number, life_s[number])) is not None
        ]
        if not failures:
            break
        at_s, number = min(failures)
        lost[number] = at_s
        left = build_sorties_after_loss(instance, plan, lost, at_s)
        plan = left.list_known_sorties(replan_sorties(left, seed, table))
    return plan, len(lost)


def _failure_time_s(instance: SortieInstance, plan: SortiePlan, vehicle: int, life_s: float) -> float | None:
    """Return when a vehicle fails that lasts so many seconds in the air; None if it outlasts its sorties."""
    for one in plan.sorties[vehicle]:
        long = sortie_duration_s(instance, vehicle, one)
        if life_s < long:
            return one.start_s + life_s
        life_s -= long
    return None
