"""Where words go on a map: near what they name, on nothing else."""

from __future__ import annotations

import math

import numpy as np

from executor.core.record import Place
from missions.geo import FloatArray

DIRECTIONS = 24
REACHES = (0.7, 1.0, 1.4, 1.9, 2.6, 3.5, 4.6)
"""How far from what it names a label is tried, in its own widths."""
COVERED = 40.0
"""What one covered point weighs, in label heights of distance."""


def along(begin_m: Place, end_m: Place, step_m: float) -> FloatArray:
    """Return (n, 2) float64, points on a straight line at most a step apart, both ends included."""
    count = max(2, math.ceil(math.dist(begin_m, end_m) / step_m) + 1)
    return np.linspace(begin_m, end_m, count)


class Placer:
    """Finds room for one label after the other; each takes the room that it gets."""

    def __init__(self, taken_m: FloatArray, low_m: Place, high_m: Place) -> None:
        """Begin with (n, 2) points that should stay visible, and the corners of the map."""
        self._taken_m = taken_m
        self._low_m = np.array(low_m)
        self._high_m = np.array(high_m)

    def place(self, anchor_m: Place, size_m: tuple[float, float]) -> Place:
        """Return the middle of a label of a width and a height that names an anchor."""
        size = np.array(size_m)
        best, best_price = np.array(anchor_m), math.inf
        for reach in REACHES:
            for step in range(DIRECTIONS):
                angle = 2.0 * math.pi * step / DIRECTIONS
                # An ellipse as flat as the label, yet never nearer than two heights above or below.
                radii = np.array([reach * size[0], max(reach * size[0] / 2.0, 2.0 * size[1])])
                middle = np.array(anchor_m) + radii * (math.cos(angle), math.sin(angle))
                middle = np.clip(middle, self._low_m + size / 2.0, self._high_m - size / 2.0)
                price = float(math.dist(middle, anchor_m) / size[1] + COVERED * self._covered(middle, size))
                if price < best_price:
                    best, best_price = middle, price
        self.take(best, size)
        return float(best[0]), float(best[1])

    def take(self, middle_m: FloatArray, size_m: FloatArray) -> None:
        """Keep others off a box."""
        axes = [np.linspace(-0.5, 0.5, 9) * size for size in size_m]
        box = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) + middle_m
        # A box weighs more than lines: words on words cannot be read.
        self._taken_m = np.concatenate((self._taken_m, box, box))

    def _covered(self, middle_m: FloatArray, size_m: FloatArray) -> int:
        inside = np.abs(self._taken_m - middle_m) <= 0.6 * size_m
        return int(inside.all(axis=1).sum())


def calmest(candidates_m: FloatArray, others_m: FloatArray) -> int:
    """Return which of (n, 2) places is the farthest from all of (m, 2) others; the first if there are no others."""
    if len(others_m) == 0:
        return 0
    apart_m = np.hypot(*(candidates_m[:, np.newaxis] - others_m).transpose(2, 0, 1))
    return int(apart_m.min(axis=1).argmax())
