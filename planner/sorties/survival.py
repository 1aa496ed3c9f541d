"""How many vehicles and packs days need: flown many times on paper, with losses by chance, each re-planned.

A vehicle in the air fails at random and is lost for good with its pack. What it had on board is flown again by the
others, spares among them; a spare stands at a base and flies only once somebody is lost. A re-plan is the first that
is found to inspect everything in the hours that are left, so a share is a lower bound of what the best re-plans reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.moves import MoveTables
from planner.risk import FlightChunk, ProbabilityEstimate, estimate_probability, split_flights
from planner.sorties.sortie_evaluation import count_packs_needed, evaluate_sorties, sortie_duration_s
from planner.sorties.sortie_losses import ENOUGH, build_sorties_after_loss, replan_sorties
from planner.sorties.sortie_model import SortieInstance, SortiePlan

if TYPE_CHECKING:
    from planner.sorties.sortie_state import MoveTable

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
    iterations: int = ENOUGH
    """Of one re-plan, at most."""


@dataclass(frozen=True, slots=True)
class SampleResult:
    """What one time came to."""

    losses: int
    packs: tuple[int, ...] | None
    """That each base needed; none where something was left over."""


DAYS_PER_CHUNK = 10


def split_samples(samples: int) -> tuple[FlightChunk, ...]:
    """Return so many times in chunks; chance is the campaign's, by the number of each time.

    Raises:
        InstanceError: there is none.
    """
    return split_flights(samples, 0, per_chunk=DAYS_PER_CHUNK)


def simulate_days(campaign: SurvivalCampaign, chunk: FlightChunk) -> tuple[SampleResult, ...]:
    """Fly days some times; what they come to is the same wherever that is done."""
    # Only here: it loads the kernels.
    from planner.sorties.sortie_state import build_move_table

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
        flown, lost = _simulate_once(instance, plan, life_s, campaign.seed, campaign.iterations, table)
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
    iterations: int,
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
        plan = left.list_known_sorties(replan_sorties(left, seed, iterations, table))
    return plan, len(lost)


def _failure_time_s(instance: SortieInstance, plan: SortiePlan, vehicle: int, life_s: float) -> float | None:
    """Return when a vehicle fails that lasts so many seconds in the air; None if it outlasts its sorties."""
    for one in plan.sorties[vehicle]:
        long = sortie_duration_s(instance, vehicle, one)
        if life_s < long:
            return one.start_s + life_s
        life_s -= long
    return None
