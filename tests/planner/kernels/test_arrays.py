"""Work space of the kernels: arrays of the shapes that their types name."""

from __future__ import annotations

import numpy as np

from planner.kernels.arrays import SearchWorkspace, State, allocate
from planner.kernels.repair import RepairWorkspace
from planner.kernels.sortie_schedule import SortieState


def test_work_space_has_the_shapes_that_its_type_names() -> None:
    state = allocate(State, k=2, n=5)
    assert [array.shape for array in state] == [(2, 5), (2, 6), (2,), (2,), (5,)]
    assert [array.dtype for array in state] == [np.int64, np.float64, np.int64, np.float64, np.int64]
    assert not any(array.any() for array in state)
    assert allocate(SearchWorkspace, k=2, n=5).came_from.shape == (5, 2)
    assert allocate(SortieState, r=3, c=4, k=2, n=3, d=1).sums.shape == (5,)


def test_work_space_within_work_space_is_its_own() -> None:
    desk = allocate(RepairWorkspace, k=2, n=5)
    assert desk.current.visits.shape == desk.trial.visits.shape == (2, 5)
    desk.current.lengths[0] = 1
    assert desk.trial.lengths[0] == 0
