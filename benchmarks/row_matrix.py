"""Programs for HiGHS that are given row by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from planner.highs import Matrix


def build_row_matrix(rows: Sequence[Mapping[int, float]]) -> Matrix:
    """Return rows that are given by columns and weights."""
    return (
        np.cumsum([0, *map(len, rows)]),
        np.array([column for row in rows for column in row]),
        np.array([weight for row in rows for weight in row.values()]),
    )
