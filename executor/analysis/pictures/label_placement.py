"""Where words go on a map: near what they name, on nothing else."""

from __future__ import annotations

import math

import numpy as np

from executor.analysis.flight_record import Place
from missions.geo import FloatArray

DIRECTIONS = 24
REACHES = (0.7, 1.0, 1.4, 1.9, 2.6, 3.5, 4.6)
"""How far from what it names a label is tried, in its own widths."""
COVERED = 40.0
"""What one covered point weighs, in label heights of distance."""


def sample_line_m(begin_m: Place, end_m: Place, step_m: float) -> FloatArray:
    """Return (n, 2) float64, points on a straight line at most a step apart, both ends included."""
    count = max(2, math.ceil(math.dist(begin_m, end_m) / step_m) + 1)
    return np.linspace(begin_m, end_m, count)


class LabelPlacer:
    """Finds room for one label after the other, each with a leader to what it names; each takes the room it gets."""

    def __init__(self, taken_m: FloatArray, low_m: Place, high_m: Place) -> None:
        """Begin with (n, 2) points that should stay visible, and the corners of the map."""
        self._taken_m = taken_m
        self._words_m = np.zeros((0, 2))
        self._low_m = np.array(low_m)
        self._high_m = np.array(high_m)

    def place_label(self, anchors_m: FloatArray, size_m: tuple[float, float]) -> tuple[Place, Place]:
        """Return where a label's leader begins and where the label's middle lies.

        Args:
            anchors_m: (n, 2) places, any of which the label may name.
            size_m: The label's width and height.
        """
        size = np.array(size_m)
        anchors, middles = self._generate_candidates(anchors_m, size)
        nearness = np.hypot(*(middles - anchors).T) / size[1]
        best, best_price = 0, math.inf
        for index in np.argsort(nearness, kind="stable"):
            if nearness[index] >= best_price:
                break  # whatever is farther costs more than this by its distance alone
            price = float(nearness[index]) + COVERED * self._count_hidden(anchors[index], middles[index], size)
            if price < best_price:
                best, best_price = int(index), price
        self._occupy(anchors[best], middles[best], size)
        return to_place(anchors[best]), to_place(middles[best])

    def _generate_candidates(self, anchors_m: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (c, 2) anchors and (c, 2) middles of labels about them, inside the map."""
        angles = np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
        ring = np.column_stack((np.cos(angles), np.sin(angles)))
        # Ellipses as flat as the label, yet never nearer than two heights above or below.
        radii = [(reach * size[0], max(reach * size[0] / 2.0, 2.0 * size[1])) for reach in REACHES]
        offsets = np.concatenate([ring * radius for radius in radii])
        anchors = np.repeat(anchors_m, len(offsets), axis=0)
        middles = anchors + np.tile(offsets, (len(anchors_m), 1))
        return anchors, np.clip(middles, self._low_m + size / 2.0, self._high_m - size / 2.0)

    def _count_hidden(self, anchor: FloatArray, middle: FloatArray, size: FloatArray) -> int:
        """Return how many points the label would hide, and its leader of the words that lie already."""
        hidden = (np.abs(self._taken_m - middle) <= 0.6 * size).all(axis=1).sum()
        # Of words, a point is as far from the next as a twelfth of their height.
        crossed = nearest_distance_m(_sample_leader_m(anchor, middle), self._words_m) < size[1] / 6.0
        return int(hidden + crossed.sum())

    def _occupy(self, anchor: FloatArray, middle: FloatArray, size: FloatArray) -> None:
        axes = [np.linspace(-0.5, 0.5, 13) * side for side in size]
        box = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) + middle
        self._words_m = np.concatenate((self._words_m, box))
        self._taken_m = np.concatenate((self._taken_m, box, _sample_leader_m(anchor, middle)))


def to_place(point_m: FloatArray) -> Place:
    """Return a point as a tuple."""
    return float(point_m[0]), float(point_m[1])


def _sample_leader_m(anchor_m: FloatArray, middle_m: FloatArray) -> FloatArray:
    return np.linspace(anchor_m, middle_m, 24)[1:]


def nearest_distance_m(places_m: FloatArray, others_m: FloatArray) -> FloatArray:
    """Return (n,) float64: how far each of (n, 2) places is from the nearest of (m, 2) others; infinite without any."""
    if len(others_m) == 0:
        return np.full(len(places_m), math.inf)
    apart_m = np.hypot(*(places_m[:, np.newaxis] - others_m).transpose(2, 0, 1))
    return np.asarray(apart_m.min(axis=1), dtype=np.float64)


def find_farthest(candidates_m: FloatArray, others_m: FloatArray) -> int:
    """Return which of (n, 2) places is the farthest from all of (m, 2) others; the first if there are no others."""
    return int(nearest_distance_m(candidates_m, others_m).argmax())
