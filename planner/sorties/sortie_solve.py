"""The front: one call from an instance to days of sorties."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from planner.moves import MoveTables
from planner.sorties.sortie_evaluation import SortieResult
from planner.sorties.sortie_model import Objective, Sortie, SortieBase, SortieInstance, SortieVehicle
from planner.stop_rules import Iterations, Progress, StopRule, add_progress_report

if TYPE_CHECKING:
    from planner.sorties.sortie_state import MoveTable


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


def warm_up_sorties(starts: int = 1) -> None:
    """Load the search's kernels, compiling them if no process has before, and start its threads once."""
    ones = np.ones((1, 1, 4))
    instance = SortieInstance(
        moves=MoveTables(np.ones((1, 4, 4)), np.ones((1, 4, 4))),
        bases=(SortieBase("base", 1.0),),
        vehicles=(SortieVehicle("uav1", 0, 10.0, ((0.0, 100.0),), (0,)),),
        days=((0.0, 100.0),),
        out_s=ones, out_pct=ones, home_s=ones.reshape(1, 4, 1), home_pct=ones.reshape(1, 4, 1),
        transfer_s=np.zeros((1, 1)), able=np.ones((1, 2), dtype=np.bool_), wanted=np.ones(2, dtype=np.bool_),
    )  # fmt: skip
    solve_sorties(instance, stop=Iterations(10 * starts), starts=starts)
