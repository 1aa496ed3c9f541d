"""Programs for HiGHS: linear and integer ones, each solved by one thread to the proven optimum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import highspy

Matrix = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any]]
"""Sparse matrix by columns: start of each column's entries, their rows, and their values."""


def build_program(
    cost: npt.ArrayLike,
    most: npt.ArrayLike,
    limits: tuple[npt.ArrayLike, npt.ArrayLike],
    matrix: Matrix,
    *,
    whole: Sequence[bool] = (),
) -> highspy.Highs:
    """Return HiGHS with a program to solve.

    Args:
        cost: Cost of each column.
        most: Upper bound of each column; the lower bound is 0.
        limits: Lower and upper bound of each row.
        matrix: Matrix by columns.
        whole: Which columns are integers; none if not given.
    """
    # Imported here: loading takes a tenth of a second, and few callers need a proof.
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
