"""Minimum separation of any two vehicles in the air, from the simulator's positions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

LOOKS_A_SECOND = 10


@dataclass(slots=True)
class SeparationWatch:
    """The closest two so far."""

    nearest_m: float = math.inf
    nearest: str = ""
    """Their names, and the time."""
    looks: int = 0

    def compare(self, places_m: Mapping[str, tuple[float, float, float]]) -> None:
        """Take the positions of all vehicles in the air: east, north, up."""
        self.looks += 1
        for (one, one_m), (other, other_m) in itertools.combinations(places_m.items(), 2):
            apart_m = math.dist(one_m, other_m)
            if apart_m < self.nearest_m:
                self.nearest_m = apart_m
                self.nearest = f"{one} and {other} after {self.looks / LOOKS_A_SECOND:.0f} s"
