"""Random numbers whose whole state is one number that the caller holds (xorshift64, Marsaglia 2003).

Only shifts and xors: the same bits with and without compilation, and no overflow to warn of.
"""

from __future__ import annotations

import numpy as np

from planner.kernels.arrays import RandomState
from planner.kernels.compiled import kernel


@kernel(inline=True)
def draw_uniform(rng: RandomState) -> float:
    """Return a number in [0, 1); ``rng`` is (1,) uint64 and not zero."""
    x = rng[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    rng[0] = x
    return float(x >> np.uint64(11)) * 2.0**-53


@kernel(inline=True)
def draw_integer(rng: RandomState, limit: int) -> int:
    """Return an integer in [0, limit)."""
    return int(draw_uniform(rng) * limit)
