"""Find shortest paths around outlines at a clearance from all of them.

An obstacle is a set of outlines and a clearance: an area, a line that others fly along, or a single place, the centre
of a column. A shortest path turns only at convex corners, on an arc about the corner. The arc is flown as a few
straight legs tangent to it from outside; the places where they meet are the nodes of the path search.

Data that does not depend on a path's start and goal is computed once per set of obstacles and cached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from missions.geo import BoolArray, FloatArray, IntArray
from missions.geometry import find_nearest_on_legs, is_enclosed, is_in_triangles
from missions.no_fly_areas import Area, Ring
from missions.validation import Figure

Place = tuple[float, float]

TURN = math.radians(30.0)
"""Largest turn of a path at one node."""
SLACK_SHARE, SLACK_M = 0.01, 0.02
"""Nodes are this much farther out, so that legs between them stay clear after rounding to a centimetre."""
ROUNDING_M = 1e-6
AT_ONCE = 1_000_000
"""Leg and corner pairs checked in one step."""
REMEMBERED = 50_000
"""Number of places for which graphs cache the visible nodes."""


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An obstacle to fly around."""

    rings_m: tuple[Ring, ...]
    """Closed outlines, including those of holes; or lines, or single places."""
    keep_m: Figure
    """Clearance."""
    is_line: bool = False
    """Whether the rings are open lines or single places, with nothing inside."""


def build_obstacle(area: Area) -> Obstacle:
    """Return an area as an obstacle."""
    return Obstacle(area.rings_m, area.keep_m, area.is_line)


def build_column(centre_m: Place, radius_m: float) -> Obstacle:
    """Return a column of air as an obstacle."""
    return Obstacle(((centre_m,),), radius_m, is_line=True)


@lru_cache(maxsize=64)
def build_visibility_graph(obstacles: tuple[Obstacle, ...]) -> VisibilityGraph:
    """Return the visibility graph of obstacles, cached for equal obstacles."""
    return VisibilityGraph(obstacles)


def build_area_graph(*areas: Area) -> VisibilityGraph:
    """Return the visibility graph of areas."""
    return build_visibility_graph(tuple(map(build_obstacle, areas)))


class _Shape:
    """One obstacle as arrays."""

    def __init__(self, obstacle: Obstacle) -> None:
        self.keep_m = obstacle.keep_m
        self.is_line = obstacle.is_line
        self.rings_m = [_orient(ring, number, is_line=obstacle.is_line)
                        for number, ring in enumerate(obstacle.rings_m)]  # fmt: skip
        self.begins_m = np.concatenate(self.rings_m)
        self.ends_m = np.concatenate([np.roll(ring, -1, axis=0) for ring in self.rings_m])
        sizes = [len(ring) for ring in self.rings_m]
        firsts = np.cumsum([0, *sizes[:-1]])
        self.after = np.concatenate(
            [first + (np.arange(size) + 1) % size for first, size in zip(firsts, sizes, strict=True)]
        )
        """Next corner in the ring, for each corner."""
        self.centre_m = (self.begins_m.min(axis=0) + self.begins_m.max(axis=0)) / 2
        self.radius_m = float(np.hypot(*(self.begins_m - self.centre_m).T).max()) + self.keep_m

    def is_hit(self, starts_m: FloatArray, goals_m: FloatArray) -> BoolArray:
        """Return (n,) whether straight legs between places outside come nearer than the clearance."""
        along_m = goals_m - starts_m
        passed_m = find_nearest_on_legs(self.centre_m[np.newaxis], starts_m, along_m)[0][0]
        found = np.zeros(len(starts_m), dtype=np.bool_)
        near = np.flatnonzero(passed_m < self.radius_m)
        step = max(1, AT_ONCE // len(self.begins_m))
        for first in range(0, len(near), step):
            part = near[first : first + step]
            found[part] = self._is_hit_along(starts_m[part], along_m[part])
        return found

    def _is_hit_along(self, starts_m: FloatArray, along_m: FloatArray) -> BoolArray:
        # Leg and outline are nearest at a corner, at an end of the leg, which is outside, or they cross.
        off_e = self.begins_m[:, 0] - starts_m[:, :1]
        off_n = self.begins_m[:, 1] - starts_m[:, 1:]
        along_e, along_n = along_m[:, :1], along_m[:, 1:]
        share = (off_e * along_e + off_n * along_n) / np.maximum(along_e**2 + along_n**2, 1e-12)
        np.clip(share, 0.0, 1.0, out=share)
        apart = (off_e - share * along_e) ** 2 + (off_n - share * along_n) ** 2
        near = apart.min(axis=1) < (self.keep_m - ROUNDING_M) ** 2
        left = along_e * off_n - along_n * off_e  # side of the leg on which each corner lies
        edges = self.ends_m - self.begins_m
        start_left = edges[:, 1] * off_e - edges[:, 0] * off_n  # side of each edge on which the leg's ends lie
        goal_left = start_left + edges[:, 0] * along_n - edges[:, 1] * along_e
        crossed = (left * left[:, self.after] < 0) & (start_left * goal_left < 0)
        return np.asarray(near | crossed.any(axis=1))

    def is_inside(self, places_m: FloatArray) -> BoolArray:
        """Return (n,) whether places are within the clearance, or enclosed."""
        found = np.hypot(*(places_m - self.centre_m).T) < self.radius_m
        which, step = np.flatnonzero(found), max(1, AT_ONCE // len(self.begins_m))
        for first in range(0, len(which), step):
            part = which[first : first + step]
            away_m = find_nearest_on_legs(places_m[part], self.begins_m, self.ends_m - self.begins_m)[0].min(axis=1)
            found[part] = away_m < self.keep_m - ROUNDING_M
            if not self.is_line:
                found[part] |= is_enclosed(places_m[part], self.begins_m, self.ends_m)
        return np.asarray(found)

    def nodes_m(self) -> Iterator[FloatArray]:
        """Yield (k, 2) places around every convex corner, such that legs between them keep the clearance."""
        for ring in self.rings_m:
            before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
            for corner, came, goes in zip(ring, before, after, strict=True):
                turn = math.atan2(came[0] * goes[1] - came[1] * goes[0], float(came @ goes))
                if len(ring) == 1:
                    first, turn = 0.0, 2.0 * math.pi
                else:
                    first = math.atan2(came[1], came[0]) - math.pi / 2
                    turn = math.pi if turn < -math.pi + 1e-9 else turn
                if turn > 1e-9:
                    count = math.ceil(turn / TURN - 1e-9)
                    angles = first + (np.arange(count) + 0.5) * turn / count
                    out_m = (self.keep_m * (1.0 + SLACK_SHARE) + SLACK_M) / math.cos(turn / count / 2)
                    yield corner + out_m * np.column_stack((np.cos(angles), np.sin(angles)))

    def ways_out_m(self, place_m: FloatArray) -> FloatArray:
        """Return (k, 2) places just outside to which a place inside can exit."""
        edges = self.ends_m - self.begins_m
        (_, share) = find_nearest_on_legs(place_m[np.newaxis], self.begins_m, edges)
        on_m = self.begins_m + share[0, :, np.newaxis] * edges
        out_m = self.keep_m * (1.0 + SLACK_SHARE) + SLACK_M
        away = place_m - on_m
        lengths = np.hypot(*edges.T)
        right = np.column_stack((edges[:, 1], -edges[:, 0])) / np.maximum(lengths, 1e-9)[:, np.newaxis]
        far = np.hypot(*away.T)
        straight = away / np.maximum(far, 1e-9)[:, np.newaxis]
        return np.concatenate((on_m + out_m * right, on_m - out_m * right, on_m + out_m * straight))


class VisibilityGraph:
    """The nodes around obstacles, and the shortest paths between them."""

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        self._shapes = [_Shape(obstacle) for obstacle in obstacles]
        nodes = [place for shape in self._shapes for place in shape.nodes_m()]
        places_m = np.concatenate(nodes) if nodes else np.zeros((0, 2))
        self.nodes_m = places_m[~self.is_inside(places_m)]
        self._between: tuple[FloatArray, IntArray] | None = None
        self._seen: dict[Place, FloatArray] = {}
        self._reached: dict[Place, tuple[FloatArray, IntArray]] = {}

    def is_inside(self, places_m: FloatArray) -> BoolArray:
        """Return (n,) whether (n, 2) places are in an obstacle, or within its clearance."""
        found = np.zeros(len(places_m), dtype=np.bool_)
        for shape in self._shapes:
            found |= shape.is_inside(places_m)
        return found

    def is_blocked(self, starts_m: FloatArray, goals_m: FloatArray) -> BoolArray:
        """Return (n,) whether straight legs between (n, 2) places outside come nearer than the clearance."""
        found = np.zeros(len(starts_m), dtype=np.bool_)
        for shape in self._shapes:
            open_ = np.flatnonzero(~found)
            found[open_] = shape.is_hit(starts_m[open_], goals_m[open_])
        return found

    def is_met(self, starts_m: FloatArray, goals_m: FloatArray) -> BoolArray:
        """Return (n,) whether straight legs between (n, 2) places violate the clearance, or begin or end inside."""
        ends = self.is_inside(starts_m) | self.is_inside(goals_m)
        return np.asarray(ends | self.is_blocked(starts_m, goals_m))

    def is_triangle_free(self, corners_m: FloatArray) -> bool:
        """Return whether no part of a triangle of (3, 2) corners is in an obstacle or within its clearance."""
        if self.is_inside(corners_m).any() or self.is_blocked(corners_m, np.roll(corners_m, 1, axis=0)).any():
            return False
        # An outline inside the triangle that crosses none of its sides lies entirely inside.
        return not any(is_in_triangles(shape.begins_m, corners_m[np.newaxis]).any() for shape in self._shapes)

    def ways_m(self, starts_m: FloatArray, goals_m: FloatArray) -> list[FloatArray | None]:
        """Return (w, 2) corners of a shortest path for each of (n, 2) starts to its goal.

        None stands for no path, including a goal in an obstacle.
        """
        starts, goals = [_to_place(one) for one in starts_m], [_to_place(one) for one in goals_m]
        every = list(dict.fromkeys((*starts, *goals)))
        inside = self.is_inside(np.array(every).reshape(-1, 2))
        blocked = {place for place, within in zip(every, inside.tolist(), strict=True) if within}
        met = self.is_blocked(starts_m, goals_m)
        ways: list[FloatArray | None] = [np.zeros((0, 2))] * len(starts)
        led: dict[Place, list[int]] = {}
        for number, (start, goal) in enumerate(zip(starts, goals, strict=True)):
            if goal in blocked:
                ways[number] = None
            elif start in blocked:
                ways[number] = self._way_from_inside_m(starts_m[number], goals_m[number])
            elif met[number]:
                led.setdefault(start, []).append(number)
        self._add_visibility_from([*led, *(goals[number] for numbers in led.values() for number in numbers)])
        for start, numbers in led.items():
            reached_m, first = self._find_shortest_from(start)
            totals_m = reached_m + np.array([self._seen[goals[number]] for number in numbers])
            for number, total_m in zip(numbers, totals_m, strict=True):
                last = int(total_m.argmin()) if len(total_m) else -1
                reachable = last >= 0 and math.isfinite(total_m[last])
                ways[number] = self.nodes_m[self._path_between(int(first[last]), last)] if reachable else None
        return ways

    def _way_from_inside_m(self, start_m: FloatArray, goal_m: FloatArray) -> FloatArray | None:
        """Return the corners of a path that leaves an obstacle by the nearest exit; None if there is none."""
        outs_m = np.concatenate([one.ways_out_m(start_m) for one in self._shapes if one.is_inside(start_m[np.newaxis])])
        outs_m = outs_m[~self.is_inside(outs_m)]
        if not len(outs_m):
            return None
        out_m = outs_m[[np.hypot(*(outs_m - start_m).T).argmin()]]
        (rest_m,) = self.ways_m(out_m, goal_m[np.newaxis])
        return None if rest_m is None else np.concatenate((out_m, rest_m))

    def is_cut_off(self, start_m: FloatArray, goals_m: FloatArray) -> BoolArray:
        """Return (n,) whether no path leads from a place to (n, 2) others."""
        ways = self.ways_m(np.broadcast_to(start_m, goals_m.shape), goals_m)
        return np.array([way_m is None for way_m in ways], dtype=np.bool_)

    def _add_visibility_from(self, places: Sequence[Place]) -> None:
        if len(self._seen) > REMEMBERED:
            self._seen.clear()
            self._reached.clear()
        new = [place for place in dict.fromkeys(places) if place not in self._seen]
        if not new:
            return
        count = len(self.nodes_m)
        starts_m = np.repeat(np.array(new).reshape(-1, 2), count, axis=0)
        goals_m = np.tile(self.nodes_m, (len(new), 1))
        away_m = np.hypot(*(goals_m - starts_m).T)
        away_m[self.is_blocked(starts_m, goals_m)] = math.inf
        for place, row in zip(new, away_m.reshape(len(new), count), strict=True):
            self._seen[place] = row

    def _find_shortest_from(self, start: Place) -> tuple[FloatArray, IntArray]:
        """Return (n,) lengths of shortest paths to all nodes, and the first node of each."""
        if start not in self._reached:
            between_m, _ = self._find_all_shortest()
            total_m = self._seen[start][:, np.newaxis] + between_m
            first = total_m.argmin(axis=0) if len(total_m) else np.zeros(0, dtype=np.int64)
            reached_m = total_m.min(axis=0) if len(total_m) else np.zeros(0)
            self._reached[start] = (reached_m, first)
        return self._reached[start]

    def _path_between(self, first: int, last: int) -> list[int]:
        _, following = self._find_all_shortest()
        way = [first]
        while way[-1] != last:
            way.append(int(following[way[-1], last]))
        return way

    def _find_all_shortest(self) -> tuple[FloatArray, IntArray]:
        """Return (n, n) lengths of shortest paths between nodes, and the next node of each (Floyd, Warshall)."""
        if self._between is None:
            count = len(self.nodes_m)
            ones, others = np.triu_indices(count, 1)
            seen = ~self.is_blocked(self.nodes_m[ones], self.nodes_m[others])
            ones, others = ones[seen], others[seen]
            between_m = np.full((count, count), math.inf)
            between_m[ones, others] = np.hypot(*(self.nodes_m[ones] - self.nodes_m[others]).T)
            between_m = np.minimum(between_m, between_m.T)
            np.fill_diagonal(between_m, 0.0)
            following = np.tile(np.arange(count), (count, 1))
            for node in range(count):
                over_m = between_m[:, node, np.newaxis] + between_m[node]
                shorter = over_m < between_m - 1e-9
                between_m[shorter] = over_m[shorter]
                following = np.where(shorter, following[:, node, np.newaxis], following)
            self._between = between_m, following
        return self._between


def _orient(ring: Ring, number: int, *, is_line: bool) -> FloatArray:
    """Return (k, 2) corners with the forbidden side to the left; a line is traced in both directions."""
    corners = np.array(ring, dtype=np.float64).reshape(-1, 2)
    if is_line:
        return np.concatenate((corners, corners[-2:0:-1]))
    after = np.roll(corners, -1, axis=0)
    area = float((corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]).sum())
    return corners if (area > 0) is (number == 0) else corners[::-1]


def _to_place(place_m: FloatArray) -> Place:
    return float(place_m[0]), float(place_m[1])
