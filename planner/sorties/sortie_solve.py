"""The front: one call from an instance to days of sorties."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from planner.sorties.sortie_evaluation import SortieResult
from planner.sorties.sortie_model import Objective, Sortie, SortieInstance
from planner.stop_rules import Progress, StopRule, add_progress_report

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
