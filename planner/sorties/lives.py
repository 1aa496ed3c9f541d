"""How many vehicles and packs days need: flown many times on paper, with losses by chance, each re-planned.

A vehicle in the air fails at random and is lost for good with its pack. What it had on board is flown again by the
others, spares among them; a spare stands at a base and flies only once somebody is lost. A re-plan is the first that
is found to inspect everything in the hours that are left, so a share is a lower bound of what the best re-plans reach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.moves import MoveTables
from planner.risk import Chance, wilson
from planner.sorties.evaluate import evaluate_sorties, packs_at_once, sortie_s
from planner.sorties.losses import ENOUGH, replanned, sorties_left
from planner.sorties.model import SortieInstance, SortiePlan

if TYPE_CHECKING:
    from planner.sorties.construct import MoveTable

HOUR_S = 3600.0


@dataclass(frozen=True, slots=True)
class Lives:
    """What many times the same days came to."""

    samples: int
    finished: Chance
    losses: float
    """On average, up to where the days could not be finished any more."""
    packs: tuple[tuple[int, ...], ...]
    """For each sample in which everything was inspected the packs that each base needed, as ``packs_at_once``."""

    def packs_for(self, share: float) -> tuple[int, ...]:
        """Return how many packs of each base are enough in such a share of the finished samples."""
        if not self.packs:
            return ()
        return tuple(int(count) for count in np.quantile(np.array(self.packs), share, axis=0, method="higher"))


@dataclass(frozen=True, slots=True)
class Spares:
    """What so many spares came to."""

    spares: tuple[int, ...]
    """Whose likeness each of them is."""
    lives: Lives


def with_spares(instance: SortieInstance, spares: Sequence[int]) -> SortieInstance:
    """Return the instance with a likeness of each of some vehicles, standing where it stands."""
    rows = [*range(len(instance.vehicles)), *spares]
    fleet = [replace(instance.vehicles[one], name=f"spare{number}") for number, one in enumerate(spares, 1)]
    return replace(
        instance, vehicles=(*instance.vehicles, *fleet), able=instance.able[rows],
        out_s=instance.out_s[rows], out_pct=instance.out_pct[rows],
        home_s=instance.home_s[rows], home_pct=instance.home_pct[rows],
    )  # fmt: skip


def fly_lives(
    instance: SortieInstance,
    plan: SortiePlan,
    mtbf_h: float,
    samples: int,
    *,
    seed: int = 0,
    iterations: int = ENOUGH,
    table: MoveTable | None = None,
    told: Callable[[int, int], None] = lambda _done, _of: None,
) -> Lives:
    """Fly days many times.

    Args:
        instance: the days, spares included.
        plan: everybody's sorties without a loss; of spares there need not be any.
        mtbf_h: mean flight hours between failures of one vehicle.
        samples: how many times.
        seed: of all random numbers: with the same one vehicles fail alike, however many spares there are.
        iterations: of one re-plan, at most.
        table: the moves, where they are priced already.
        told: how many samples are done.
    """
    # Only here: it loads the kernels.
    from planner.sorties.construct import move_table

    table = move_table(instance) if table is None else table
    # Each sortie is priced again and again here.
    instance = replace(instance, moves=MoveTables(table.move[..., 0], table.move[..., 1]))
    missing = len(instance.vehicles) - len(plan.sorties)
    plan = SortiePlan(plan.sorties + ((),) * missing, plan.uncovered)
    finished = losses = 0
    packs = []
    for sample in range(samples):
        chance = np.random.default_rng((seed, sample))
        # Spares come last, and drawn one by one: the others' fates do not depend on how many there are.
        life_s = [float(chance.exponential(mtbf_h * HOUR_S)) for _ in instance.vehicles]
        flown, lost = _once(instance, plan, life_s, seed, iterations, table)
        losses += lost
        if not flown.uncovered:
            finished += 1
            packs.append(packs_at_once(instance, flown, evaluate_sorties(instance, flown)))
        told(sample + 1, samples)
    return Lives(samples, wilson(finished, samples), losses / samples, tuple(packs))


def _once(
    instance: SortieInstance,
    plan: SortiePlan,
    life_s: Sequence[float],
    seed: int,
    iterations: int,
    table: MoveTable | None,
) -> tuple[SortiePlan, int]:
    """Return all sorties that took off, and how many vehicles were lost."""
    lost: dict[int, float] = {}
    while not plan.uncovered:
        failures = [
            (at_s, number)
            for number in range(len(instance.vehicles))
            if number not in lost and (at_s := _fails_s(instance, plan, number, life_s[number])) is not None
        ]
        if not failures:
            break
        at_s, number = min(failures)
        lost[number] = at_s
        left = sorties_left(instance, plan, lost, at_s)
        plan = left.known(replanned(left, seed, iterations, table))
    return plan, len(lost)


def _fails_s(instance: SortieInstance, plan: SortiePlan, vehicle: int, life_s: float) -> float | None:
    """Return when a vehicle fails that lasts so many seconds in the air; None if it outlasts its sorties."""
    for one in plan.sorties[vehicle]:
        long = sortie_s(instance, vehicle, one)
        if life_s < long:
            return one.start_s + life_s
        life_s -= long
    return None
