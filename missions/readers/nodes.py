"""The poles of a network while it is put together: those of the file, and those that its lines ask for.

In a plane of metres: what lies beside what, and which spans cross.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from missions.geo import FloatArray, IndexArray, LocalFrame
from missions.geometry import find_nearest_on_legs, place_distances_m
from missions.readers.raw_network import Pole, Remark, RemarkTopic, Vertex

SAME_POLE_M = 0.5
"""Two poles of a file that are nearer than this are one."""


@dataclass(slots=True)
class Node:
    """A pole, or a place that may become one."""

    name: str
    lat_deg: float
    lon_deg: float
    at_m: tuple[float, float]
    elevation_m: float | None = None
    height_m: float | None = None
    third_m: float | None = None
    drawn: bool = True
    """Whether the file has it as a pole."""
    hinted: Mapping[str, str] = field(default_factory=dict)
    """As its pole has it."""


@dataclass(slots=True)
class Nodes:
    """All of them, by name and by place: a grid of cells as wide as what is joined."""

    frame: LocalFrame
    snap_m: float
    nodes: list[Node] = field(default_factory=list)
    by_name: dict[str, int] = field(default_factory=dict)
    found: list[Remark] = field(default_factory=list)
    _cells: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def find_nearest(self, at_m: tuple[float, float], within_m: float) -> tuple[int | None, float]:
        """Return the nearest node, at most as far as what is joined, and how far it is."""
        row, column = self._cell_of(at_m)
        least_m, found = math.inf, None
        for cell in ((row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
            for index in self._cells.get(cell, ()):
                away_m = math.dist(at_m, self.nodes[index].at_m)
                if away_m < least_m:
                    least_m, found = away_m, index
        return (found, least_m) if least_m <= within_m else (None, least_m)

    def add_poles(self, poles: Iterable[Pole], named: frozenset[str]) -> None:
        """Add the file's poles; those that spans name stay as they are, of others two at one place are one."""
        unnamed = []
        for pole in poles:
            at_m = self.frame.to_local_m(pole.lat_deg, pole.lon_deg)
            index, away_m = (None, 0.0)
            if pole.name not in named:
                index, away_m = self.find_nearest(at_m, min(self.snap_m, SAME_POLE_M))
            if index is not None and self.nodes[index].name not in named:
                self._join(self.nodes[index], pole, away_m)
                continue
            name = self._choose_name(pole) if pole.name else ""
            if not name:
                unnamed.append(len(self.nodes))
            heights = pole.elevation_m, pole.height_m, pole.third_m
            self._add(Node(name, pole.lat_deg, pole.lon_deg, at_m, *heights, hinted=pole.hinted))
        for index in unnamed:
            self._name(index)

    def find_or_add(self, vertex: Vertex, at_m: tuple[float, float]) -> tuple[int, float]:
        """Return the node of a line's vertex, a new one if none is near, and how far it was."""
        lat_deg, lon_deg, third_m = vertex
        index, away_m = self.find_nearest(at_m, self.snap_m)
        if index is None:
            self._add(Node("", lat_deg, lon_deg, at_m, third_m=third_m, drawn=False))
            return len(self.nodes) - 1, 0.0
        if self.nodes[index].third_m is None:
            self.nodes[index].third_m = third_m
        return index, away_m

    def add_between(self, at_m: tuple[float, float]) -> int:
        """Add a place of which the file knows nothing."""
        lat_deg, lon_deg = self.frame.to_wgs84_deg(*at_m)
        self._add(Node("", lat_deg, lon_deg, at_m, drawn=False))
        return len(self.nodes) - 1

    def discard_hinted_heights(self, used: Iterable[int], asset: str) -> None:
        """Forget heights that count only if all poles on lines have them, where some have not."""
        poles = [self.nodes[index] for index in used if self.nodes[index].drawn]
        for key in ("elevation_m", "height_m"):
            hinted = [node for node in poles if key in node.hinted]
            known = sum(getattr(node, key) is not None for node in poles)
            if hinted and known < len(poles):
                text = f"{hinted[0].hinted[key]} is known of {known} of {len(poles)} poles: not used"
                self.found.append(Remark(RemarkTopic.HEIGHTS, asset, text))
            for node in hinted if known < len(poles) else ():
                setattr(node, key, None)

    def name_unnamed(self, indices: Iterable[int]) -> None:
        """Name what has no name yet."""
        for index in indices:
            if not self.nodes[index].name:
                self._name(index)

    def _add(self, node: Node) -> None:
        if node.name:
            self.by_name[node.name] = len(self.nodes)
        self._cells.setdefault(self._cell_of(node.at_m), []).append(len(self.nodes))
        self.nodes.append(node)

    def _name(self, index: int) -> None:
        number = index + 1
        while (name := f"P{number}") in self.by_name:
            number += len(self.nodes)
        self.nodes[index].name = name
        self.by_name[name] = index

    def _join(self, node: Node, pole: Pole, away_m: float) -> None:
        """Take a pole for one that is there already; what only one of them knows is kept."""
        node.hinted = {**{key: by for key, by in pole.hinted.items() if getattr(node, key) is None}, **node.hinted}
        node.elevation_m = pole.elevation_m if node.elevation_m is None else node.elevation_m
        node.height_m = pole.height_m if node.height_m is None else node.height_m
        node.third_m = pole.third_m if node.third_m is None else node.third_m
        if pole.name in {"", node.name} and pole.line:
            return  # a table has a pole of two lines in the rows of both
        if pole.name != node.name:
            text = f"{away_m:.2f} m from {node.name or 'a pole without a name'!r}: taken for the same pole"
            self.found.append(Remark(RemarkTopic.SAME_PLACE, pole.name or pole.place, text))
            if pole.name and pole.name not in self.by_name:
                self.by_name[pole.name] = self.by_name.get(node.name, len(self.nodes))
        else:
            self.found.append(Remark(RemarkTopic.SAME_PLACE, pole.name or pole.place, "drawn twice: taken once"))

    def _choose_name(self, pole: Pole) -> str:
        if pole.name not in self.by_name:
            return pole.name
        name, number = f"{pole.line} {pole.name}" if pole.line else f"{pole.name} (2)", 2
        while name in self.by_name:
            number += 1
            name = f"{pole.name} ({number})"
        text = f"another pole has this name: it is called {name!r} here"
        self.found.append(Remark(RemarkTopic.SAME_NAME, pole.name, text))
        return name

    def _cell_of(self, at_m: tuple[float, float]) -> tuple[int, int]:
        wide_m = max(self.snap_m, SAME_POLE_M)
        return math.floor(at_m[0] / wide_m), math.floor(at_m[1] / wide_m)


class PlaceIndex:
    """PlaceIndex that are looked up by where they are."""

    def __init__(self, places_m: FloatArray) -> None:
        """Sort (n, 2) places along the longer side of what they cover."""
        self._axis = int(np.argmax(np.ptp(places_m, axis=0))) if len(places_m) else 0
        self._order = np.argsort(places_m[:, self._axis], kind="stable")
        self._sorted_m = places_m[self._order]

    def find_beside(
        self, a_m: FloatArray, b_m: FloatArray, within_m: float
    ) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Return the places near a span: their numbers, how far along it (0 to 1), and how far from it."""
        low, high = sorted((float(a_m[self._axis]), float(b_m[self._axis])))
        first, last = np.searchsorted(self._sorted_m[:, self._axis], (low - within_m, high + within_m))
        distances_m, shares = find_nearest_on_legs(self._sorted_m[first:last], a_m[np.newaxis], (b_m - a_m)[np.newaxis])
        near = np.flatnonzero(distances_m[:, 0] <= within_m)
        return self._order[first:last][near], shares[near, 0], distances_m[near, 0]


def find_crossings(ends_m: FloatArray, nodes: IndexArray) -> Iterator[tuple[int, int, tuple[float, float]]]:
    """Yield pairs of (n, 2, 2) spans that cross between their ends, and where; nodes (n, 2) tell who shares an end."""
    if not len(ends_m):
        return
    lows, highs = ends_m.min(axis=1), ends_m.max(axis=1)
    axis = int(np.argmax(np.ptp(ends_m.reshape(-1, 2), axis=0)))
    order = np.argsort(lows[:, axis], kind="stable")
    ends_m, nodes, lows, highs = ends_m[order], nodes[order], lows[order], highs[order]
    other = 1 - axis
    last = np.searchsorted(lows[:, axis], highs[:, axis], side="right")
    for index in range(len(order)):
        rest = np.arange(index + 1, last[index])
        rest = rest[(lows[rest, other] <= highs[index, other]) & (highs[rest, other] >= lows[index, other])]
        if rest.size:
            rest = rest[~np.isin(nodes[rest], nodes[index]).any(axis=1)]
        if rest.size:
            yield from _find_crossings_of(ends_m, index, rest, order)


def _find_crossings_of(
    ends_m: FloatArray, index: int, rest: IndexArray, order: IndexArray
) -> Iterator[tuple[int, int, tuple[float, float]]]:
    a_m, way_m = ends_m[index, 0], ends_m[index, 1] - ends_m[index, 0]
    from_m, ways_m = ends_m[rest, 0] - a_m, ends_m[rest, 1] - ends_m[rest, 0]
    turned = way_m[0] * ways_m[:, 1] - way_m[1] * ways_m[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        mine = (from_m[:, 0] * ways_m[:, 1] - from_m[:, 1] * ways_m[:, 0]) / turned
        theirs = (from_m[:, 0] * way_m[1] - from_m[:, 1] * way_m[0]) / turned
        meet = (mine > 0) & (mine < 1) & (theirs > 0) & (theirs < 1)
    for number in np.flatnonzero(meet):
        east_m, north_m = (a_m + mine[number] * way_m).tolist()
        pair = sorted((int(order[index]), int(order[rest[number]])))
        yield pair[0], pair[1], (east_m, north_m)


def find_nearest_span(place_m: FloatArray, ends_m: FloatArray, but: Sequence[int] = ()) -> tuple[int, float]:
    """Return the nearest of (n, 2, 2) spans to a place and how far away it is; ``but`` are not looked at."""
    distances_m = place_distances_m(ends_m, place_m[np.newaxis])[0]
    distances_m[list(but)] = np.inf
    nearest = int(np.argmin(distances_m))
    return nearest, float(distances_m[nearest])
