"""Programs for HiGHS: linear ones, and those in whole numbers, each solved by one thread to the proven optimum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import highspy

Matrix = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]
"""Where each column's entries begin, the rows that they are in, and what they are."""


def build_program(
    cost: npt.ArrayLike,
    most: npt.ArrayLike,
    limits: tuple[npt.ArrayLike, npt.ArrayLike],
    matrix: Matrix,
    *,
    whole: Sequence[bool] = (),
) -> highspy.Highs:
    """Return HiGHS with a program that it is to solve.

    Args:
        cost: Of each column.
        most: Of each column, which is 0 at least.
        limits: What each row is at least, and at most.
        matrix: Of the columns, one after the other.
        whole: Which columns are whole numbers; none if not given.
    """
    # Only here: it takes a tenth of a second to load, and few ever ask for a proof.
    import highspy

    solver = highspy.Highs()  # type: ignore[no-untyped-call]
    for option, setting in (("output_flag", False), ("threads", 1), ("mip_rel_gap", 0.0), ("mip_abs_gap", 1e-7)):
        solver.setOptionValue(option, setting)
    lp = highspy.HighsLp()
    lp.col_cost_, lp.col_upper_ = np.asarray(cost), np.asarray(most)
    lp.row_lower_, lp.row_upper_ = map(np.asarray, limits)
    lp.num_col_, lp.num_row_ = len(lp.col_cost_), len(lp.row_lower_)
    lp.col_lower_ = np.zeros(lp.num_col_)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = matrix
    integer, real = highspy.HighsVarType.kInteger, highspy.HighsVarType.kContinuous
    lp.integrality_ = [integer if one else real for one in whole]
    solver.passModel(lp)
    return solver
