"""Moves that lead around the columns above others' pads and around areas, priced as they are flown.

Few moves of a network meet a column, but each of them costs its corners as well as its length: on the default network
one route in four crosses the pads, and takes 3 % longer for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from missions.geo import FloatArray
from missions.pads import way_around_m
from missions.ways import Obstacle, column_of, graph_of, ways_between_m

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Columns:
    """What one vehicle's ways lead around."""

    centres_m: tuple[tuple[float, float], ...] = ()
    """East and north."""
    radius_m: float = 0.0
    areas: tuple[Obstacle, ...] = ()
    """That they lead around as well."""

    def way_m(self, start_m: FloatArray, goal_m: FloatArray) -> FloatArray:
        """Return (w, 2) corners of the way between two (2,) places: as it is flown, and as it is priced."""
        return self._corners_m(start_m[np.newaxis], goal_m[np.newaxis])[0]

    def _corners_m(self, starts_m: FloatArray, goals_m: FloatArray) -> list[FloatArray]:
        """Return (w, 2) corners of the ways from (n, 2) places to others."""
        if self.areas:
            columns = tuple(column_of(centre_m, self.radius_m) for centre_m in self.centres_m)
            return ways_between_m(starts_m, goals_m, self.areas, columns)
        centres_m, found = np.array(self.centres_m).reshape(-1, 2), dict[tuple[float, ...], FloatArray]()
        keys = [(*start, *goal) for start, goal in zip(starts_m.tolist(), goals_m.tolist(), strict=True)]
        for key in keys:
            if key not in found:
                found[key] = way_around_m(np.array(key[:2]), np.array(key[2:]), centres_m, self.radius_m)
        return [found[key] for key in keys]

    def met(self, from_m: FloatArray, to_m: FloatArray) -> IntArray:
        """Return (k,) which of (n, 3) straight ways lead through a column that there is a way around, or an area."""
        start_m, along_m = from_m[:, :2], to_m[:, :2] - from_m[:, :2]
        squares = np.maximum((along_m**2).sum(axis=1), 1e-12)
        hit = np.zeros(len(from_m), dtype=np.bool_)
        for centre_m in np.array(self.centres_m).reshape(-1, 2):
            away_m = centre_m - start_m
            share = np.clip((away_m * along_m).sum(axis=1) / squares, 0.0, 1.0)
            ends_m = np.minimum(np.hypot(*away_m.T), np.hypot(*(away_m - along_m).T))
            passed_m = np.hypot(*(away_m - share[:, np.newaxis] * along_m).T)
            hit |= (passed_m < self.radius_m - 1e-9) & (ends_m >= self.radius_m)
        if self.areas:
            hit |= self._in_areas(from_m[:, :2], to_m[:, :2])
        return np.flatnonzero(hit)

    def _in_areas(self, starts_m: FloatArray, goals_m: FloatArray) -> npt.NDArray[np.bool_]:
        """Return (n,) whether straight ways lead through an area, or begin in one."""
        graph = graph_of(self.areas)
        return np.asarray(graph.met(starts_m, goals_m) | graph.inside(starts_m))

    def ways(self, from_m: FloatArray, to_m: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield ways around the columns, all with as many corners at once.

        Args:
            from_m: (n, 3) float64, where ways begin.
            to_m: (n, 3) float64, where they end.

        Yields:
            (k,) which of them, and (k, w, 3) through which places, both ends included.
        """
        corners_m = self._corners_m(from_m[:, :2], to_m[:, :2])
        lengths: dict[int, list[int]] = {}
        for number, way_m in enumerate(corners_m):
            lengths.setdefault(len(way_m), []).append(number)
        for numbers in lengths.values():
            between_m = np.array([corners_m[number] for number in numbers])
            yield np.array(numbers), _with_heights(from_m[numbers], to_m[numbers], between_m)


def led_around(
    columns: Columns, from_m: FloatArray, to_m: FloatArray, straight: tuple[FloatArray, FloatArray],
    along: Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return seconds and energies of ways of which some lead around a column.

    Args:
        columns: That they lead around.
        from_m: (..., 3) float64, where ways begin.
        to_m: (..., 3) float64, where they end.
        straight: (...) float64 seconds and energies of the straight ways.
        along: The same (k,) of ways through (k, w, 3) places; the first argument is which of the flattened ways.
    """
    shape = straight[0].shape
    flat_from, flat_to = (np.broadcast_to(places, (*shape, 3)).reshape(-1, 3) for places in (from_m, to_m))
    which = columns.met(flat_from, flat_to)
    if len(which) == 0:
        return straight
    seconds, pct = straight[0].flatten(), straight[1].flatten()
    for part, ways_m in columns.ways(flat_from[which], flat_to[which]):
        seconds[which[part]], pct[which[part]] = along(which[part], ways_m)
    return seconds.reshape(shape), pct.reshape(shape)


def _with_heights(from_m: FloatArray, to_m: FloatArray, corners_m: FloatArray) -> FloatArray:
    """Return (k, w + 2, 3) ways from (k, 3) places through (k, w, 2) corners to others, rising evenly."""
    level_m = np.concatenate((from_m[:, np.newaxis, :2], corners_m, to_m[:, np.newaxis, :2]), axis=1)
    legs_m = np.diff(level_m, axis=1)
    flown_m = np.cumsum(np.hypot(legs_m[..., 0], legs_m[..., 1]), axis=1)
    rise_m = (to_m[:, 2] - from_m[:, 2])[:, np.newaxis]
    up_m = np.column_stack(
        (from_m[:, 2], from_m[:, 2, np.newaxis] + rise_m * flown_m / np.maximum(flown_m[:, -1:], 1e-9))
    )
    return np.concatenate((level_m, up_m[..., np.newaxis]), axis=2)
