"""Lead moves around the columns above other vehicles' pads and around areas, and price them as flown.

Few moves of a network meet a column, but each of these costs its corners as well as its length: on the default network
one route in four crosses the pads and takes 3 % longer because of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from missions.geo import BoolArray, FloatArray, IntArray
from missions.geometry import distances_between_m, place_distances_m
from missions.pads import way_around_m
from missions.shortest_ways import Obstacle, build_column, build_visibility_graph

Place = tuple[float, float]
"""East and north."""
WAYS_KEPT = 1 << 15
"""Most cached detours around columns; three vehicles over 96 segments have a thousand."""


@dataclass(frozen=True, slots=True)
class DetourObstacles:
    """Obstacles to the paths of one vehicle."""

    centres_m: tuple[Place, ...] = ()
    radius_m: float = 0.0
    areas: tuple[Obstacle, ...] = ()
    """Areas that routes also lead around."""

    def way_m(self, start_m: FloatArray, goal_m: FloatArray) -> FloatArray:
        """Return (w, 2) corners of the path between two (2,) places, as flown and as priced."""
        return self._corners_m(start_m[np.newaxis], goal_m[np.newaxis])[0]

    def is_triangle_free(self, corners_m: FloatArray) -> bool:
        """Return whether no leg within a triangle of (3, 2) corners crosses a column or an area."""
        columns = (build_column(centre_m, self.radius_m) for centre_m in self.centres_m)
        return build_visibility_graph((*self.areas, *columns)).is_triangle_free(corners_m)

    def _corners_m(self, starts_m: FloatArray, goals_m: FloatArray) -> list[FloatArray]:
        """Return (w, 2) corners of the paths from (n, 2) places to others."""
        if self.areas:
            return self._find_ways_around(starts_m, goals_m)
        ends = zip(map(tuple, starts_m.tolist()), map(tuple, goals_m.tolist()), strict=True)
        return [
            _find_way_m(start, goal, self.centres_m, self.radius_m)
            if start <= goal
            else _find_way_m(goal, start, self.centres_m, self.radius_m)[::-1]
            for start, goal in ends
        ]

    def _find_ways_around(self, starts_m: FloatArray, goals_m: FloatArray) -> list[FloatArray]:
        """Return paths around areas, and around the columns that these meet.

        If no path leads around the areas, it is straight. Columns that contain the start or the goal are ignored: they
        cannot be avoided.
        """
        found = build_visibility_graph(self.areas).ways_m(starts_m, goals_m)
        ways = [np.zeros((0, 2)) if way_m is None else way_m for way_m in found]
        if not self.centres_m:
            return ways
        centres_m = np.array(self.centres_m)
        near_m = self._ends_off_m(starts_m, goals_m)
        stops = [np.vstack((start, way, goal)) for start, way, goal in zip(starts_m, ways, goals_m, strict=True)]
        owner = np.repeat(np.arange(len(ways)), [len(one) - 1 for one in stops])
        legs_m = np.concatenate([np.stack((one[:-1], one[1:]), axis=1) for one in stops])
        for number in np.unique(owner[self._is_through_column(legs_m, near_m[owner])]):
            others_m = centres_m[near_m[number] >= self.radius_m]
            ways[number] = self._avoid_columns(others_m, starts_m[number], ways[number], goals_m[number])
        return ways

    def _ends_off_m(self, starts_m: FloatArray, goals_m: FloatArray) -> FloatArray:
        """Return (n, c) distances of the nearer end of each path from each column's centre."""
        centres_m = np.array(self.centres_m).reshape(-1, 2)
        return np.minimum(distances_between_m(starts_m, centres_m), distances_between_m(goals_m, centres_m))

    def _is_through_column(self, legs_m: FloatArray, near_m: FloatArray) -> BoolArray:
        """Return (n,) whether (n, 2, 2) legs cross a column that contains neither end of their path."""
        passed_m = place_distances_m(legs_m, np.array(self.centres_m).reshape(-1, 2)).T
        return np.asarray(((passed_m < self.radius_m - 1e-9) & (near_m >= self.radius_m)).any(axis=1))

    def _avoid_columns(
        self, centres_m: FloatArray, start_m: FloatArray, way_m: FloatArray, goal_m: FloatArray
    ) -> FloatArray:
        """Return a path around areas that also avoids columns.

        Columns are small: usually it is enough to lead each leg around them. Only if that enters an area, or a corner
        is in a column, search for the shortest path around all of them together.
        """
        stops = [start_m, *way_m, goal_m]
        corners: list[FloatArray] = []
        met = place_distances_m(np.stack((stops[:-1], stops[1:]), axis=1), centres_m).min(axis=0) < self.radius_m
        for (begin_m, end_m), through in zip(itertools.pairwise(stops), met.tolist(), strict=True):
            corners += [*way_around_m(begin_m, end_m, centres_m, self.radius_m), end_m] if through else [end_m]
        led_m = np.array(corners[:-1]).reshape(-1, 2)
        legs_m = np.stack((np.array([start_m, *corners[:-1]]), np.array(corners)), axis=1)
        areas = build_visibility_graph(self.areas)
        apart_m = place_distances_m(legs_m, centres_m)
        if not areas.is_blocked(legs_m[:, 0], legs_m[:, 1]).any() and (apart_m >= self.radius_m - 1e-9).all():
            return led_m
        columns = (build_column((float(east), float(north)), self.radius_m) for east, north in centres_m)
        (around_m,) = build_visibility_graph((*self.areas, *columns)).ways_m(start_m[np.newaxis], goal_m[np.newaxis])
        return way_m if around_m is None else around_m

    def find_obstructed(self, from_m: FloatArray, to_m: FloatArray) -> IntArray:
        """Return (k,) indices of (n, 3) straight paths that cross an avoidable column or an area."""
        starts_m, goals_m = from_m[:, :2], to_m[:, :2]
        hit = self._is_through_column(np.stack((starts_m, goals_m), axis=1), self._ends_off_m(starts_m, goals_m))
        if self.areas:
            graph = build_visibility_graph(self.areas)
            hit |= graph.is_blocked(starts_m, goals_m) | graph.is_inside(starts_m)
        return np.flatnonzero(hit)

    def iterate_ways(self, from_m: FloatArray, to_m: FloatArray) -> Iterator[tuple[IntArray, FloatArray]]:
        """Yield the paths that have detours, grouped by number of corners.

        Args:
            from_m: (n, 3) float64, where paths begin.
            to_m: (n, 3) float64, where they end.

        Yields:
            (k,) their indices, and (k, w, 3) their places, both ends included.
        """
        which = self.find_obstructed(from_m, to_m)
        corners_m = self._corners_m(from_m[which, :2], to_m[which, :2]) if len(which) else []
        lengths: dict[int, list[int]] = {}
        for number, way_m in enumerate(corners_m):
            lengths.setdefault(len(way_m), []).append(number)
        for numbers in lengths.values():
            own, between_m = which[numbers], np.array([corners_m[number] for number in numbers])
            yield own, _add_heights(from_m[own], to_m[own], between_m)


@lru_cache(maxsize=WAYS_KEPT)
def _find_way_m(start: Place, goal: Place, centres: tuple[Place, ...], radius_m: float) -> FloatArray:
    """Return (w, 2) corners of a path around columns; cached: each re-plan prices the same paths, also reversed.

    The array is read-only, because callers share it.
    """
    way_m = way_around_m(np.array(start), np.array(goal), np.array(centres).reshape(-1, 2), radius_m)
    way_m.flags.writeable = False
    return way_m


def _add_heights(from_m: FloatArray, to_m: FloatArray, corners_m: FloatArray) -> FloatArray:
    """Return (k, w + 2, 3) paths from (k, 3) places through (k, w, 2) corners to others, climbing evenly."""
    level_m = np.concatenate((from_m[:, np.newaxis, :2], corners_m, to_m[:, np.newaxis, :2]), axis=1)
    legs_m = np.diff(level_m, axis=1)
    flown_m = np.cumsum(np.hypot(legs_m[..., 0], legs_m[..., 1]), axis=1)
    rise_m = (to_m[:, 2] - from_m[:, 2])[:, np.newaxis]
    up_m = np.column_stack(
        (from_m[:, 2], from_m[:, 2, np.newaxis] + rise_m * flown_m / np.maximum(flown_m[:, -1:], 1e-9))
    )
    return np.concatenate((level_m, up_m[..., np.newaxis]), axis=2)
