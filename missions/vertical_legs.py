"""Which ways lead straight up from a line to the vehicle's own layer, and straight down from there to the line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from missions.geo import BoolArray, FloatArray

NEVER: BoolArray = np.array(False)
"""As every move is where vehicles inspect in their layers; it broadcasts against any others."""


@dataclass(frozen=True, slots=True, eq=False)
class VerticalLegs:
    """Of some moves: which begin with a way up, and which come down before their inspection."""

    up: BoolArray
    down: BoolArray

    @classmethod
    def find_between(
        cls, from_m: FloatArray, first_m: FloatArray, from_low: BoolArray, to_low: BoolArray, near_m: float
    ) -> VerticalLegs:
        """Return those of moves between (..., 3) places; arrays broadcast against each other.

        Args:
            from_m: Where moves begin.
            first_m: Where their visits begin.
            from_low: Which of the former are below the layer.
            to_low: Which of the latter are.
            near_m: A visit that begins this near to there follows on without a way between.
        """
        if not (from_low.any() or to_low.any()):
            return cls(NEVER, NEVER)
        there_m = first_m - from_m
        away = np.hypot(there_m[..., 0], there_m[..., 1]) > near_m
        return cls(from_low & (away | ~to_low), to_low & (away | ~from_low))
