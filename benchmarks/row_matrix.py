"""Programs for HiGHS given row by row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.highs import Matrix


def build_row_matrix(rows: Sequence[Mapping[int, float]], columns: int) -> Matrix:
    """Return the matrix with ``columns`` columns from rows of column and weight."""
    entries = sorted((column, row, weight) for row, own in enumerate(rows) for column, weight in own.items())
    begins = np.searchsorted([column for column, _, _ in entries], np.arange(columns + 1))
    return begins, np.array([row for _, row, _ in entries]), np.array([weight for _, _, weight in entries])
