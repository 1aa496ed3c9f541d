"""Load the sortie kernels before any timing."""

from __future__ import annotations

import numpy as np

from planner import Iterations, MoveTables
from planner.sorties import SortieBase, SortieInstance, SortieVehicle, solve_sorties


def warm_up_sorties(starts: int = 1) -> None:
    """Load the search's kernels, compiling them if they are not cached, and start its threads once."""
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
