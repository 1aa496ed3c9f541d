"""Plan days of many sorties over a line: several bases, packs that are swapped and charged, flight hours.

    >>> instance = SortieInstance(moves, ...)                                     # doctest: +SKIP
    >>> found = solve_sorties(instance, stop=Seconds(5))                          # doctest: +SKIP
    >>> found.evaluation.finish_s                                                 # doctest: +SKIP

A *sortie* is one flight on one pack: from a base, along visits, to a base where its vehicle may land. Moves cost the
same as for a single flight, so one sortie of one vehicle is what ``planner.solve`` plans. Importing this package is
cheap; the first plan loads the compiled kernels.
"""

from planner.sorties.sortie_losses import (
    DAYS_PER_CHUNK,
    LossWindow,
    SparesEstimate,
    SurvivalCampaign,
    SurvivalEstimate,
    add_spares,
    build_sorties_after_loss,
    find_loss_windows,
    replan_sorties,
    simulate_days,
    solve_sorties,
    summarise_samples,
)
from planner.sorties.sortie_model import (
    Objective,
    SortieBase,
    SortieEvaluation,
    SortieInstance,
    SortieVehicle,
    count_packs_needed,
    evaluate_sorties,
    sortie_duration_s,
    subtract_quiet_times,
)
