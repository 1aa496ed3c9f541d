"""Days of many sorties over a line: several bases, packs that are swapped and charged, hours in which may be flown.

    >>> instance = SortieInstance(moves, ...)                                     # doctest: +SKIP
    >>> found = solve_sorties(instance, stop=Seconds(5))                          # doctest: +SKIP
    >>> found.evaluation.finish_s                                                 # doctest: +SKIP

A *sortie* is one flight on one pack: from a base, along visits, to a base where its vehicle may land. Moves are priced
as for a single flight, so that one sortie of one vehicle is what ``planner.solve`` plans. Importing this package is
cheap; the first plan, or ``warm_up_sorties``, loads the compiled kernels.
"""

from planner.sorties.evaluate import SortieEvaluation, evaluate_sorties, packs_at_once, sortie_pct, sortie_s
from planner.sorties.exact import solve_sorties_exact
from planner.sorties.lives import DayCampaign, Lives, Spares, day_chunks, fly_days, lives_of, with_spares
from planner.sorties.losses import LossWindow, SortieLoss, sortie_window, sorties_left
from planner.sorties.model import (
    Objective,
    Sortie,
    SortieBase,
    SortieInstance,
    SortiePlan,
    SortieVehicle,
    parted_windows,
)
from planner.sorties.result import SortieResult
from planner.sorties.solve import solve_sorties, warm_up_sorties

__all__ = [
    "DayCampaign",
    "Lives",
    "LossWindow",
    "Objective",
    "Sortie",
    "SortieBase",
    "SortieEvaluation",
    "SortieInstance",
    "SortieLoss",
    "SortiePlan",
    "SortieResult",
    "SortieVehicle",
    "Spares",
    "day_chunks",
    "evaluate_sorties",
    "fly_days",
    "lives_of",
    "packs_at_once",
    "parted_windows",
    "solve_sorties",
    "solve_sorties_exact",
    "sortie_pct",
    "sortie_s",
    "sortie_window",
    "sorties_left",
    "warm_up_sorties",
    "with_spares",
]
