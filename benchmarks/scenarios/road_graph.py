"""A road graph: travel times between all places, and the shortest paths."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import InstanceError
from planner.moves import FloatArray


@dataclass(frozen=True, slots=True)
class RoadGraph:
    """All shortest paths of a graph with undirected edges."""

    along_s: FloatArray
    """(m, m) float64: time of the edge between two places, infinite without one."""
    times_s: FloatArray
    """(m, m) float64: time of the shortest path, infinite without one."""
    onward: npt.NDArray[np.int64]
    """(m, m): the place after i on the shortest path from i to j; -1 without one."""

    def find_way(self, begin: int, end: int) -> tuple[int, ...]:
        """Return the places of a shortest path, both ends included.

        Raises:
            InstanceError: there is no path.
        """
        if not np.isfinite(self.times_s[begin, end]):
            raise InstanceError(f"no way leads from place {begin} to place {end}")
        places = [begin]
        while places[-1] != end:
            places.append(int(self.onward[places[-1], end]))
        return tuple(places)


def build_road_graph(places: int, edges: Iterable[tuple[int, int, float]]) -> RoadGraph:
    """Return the shortest paths between ``places`` places (Floyd, Warshall 1962).

    Args:
        places: their number; edges name them from 0.
        edges: two places and the seconds between them; of parallel ones the shortest counts.

    Raises:
        InstanceError: an edge names an unknown place, is a loop, or has a negative time.
    """
    times = np.full((places, places), np.inf)
    onward = np.full((places, places), -1, dtype=np.int64)
    np.fill_diagonal(times, 0.0)
    np.fill_diagonal(onward, np.arange(places))
    for a, b, seconds in edges:
        if not (0 <= a < places and 0 <= b < places and a != b):
            raise InstanceError(f"edge {a} to {b}: expected two places from 0 to {places - 1}")
        if not (np.isfinite(seconds) and seconds >= 0):
            raise InstanceError(f"edge {a} to {b}: expected 0 seconds or more")
        if seconds < times[a, b]:
            times[a, b] = times[b, a] = seconds
            onward[a, b], onward[b, a] = b, a
    along = times.copy()
    np.fill_diagonal(along, np.inf)
    for middle in range(places):
        through = times[:, middle, np.newaxis] + times[middle]
        shorter = through < times
        times[shorter] = through[shorter]
        onward[shorter] = np.broadcast_to(onward[:, middle, np.newaxis], shorter.shape)[shorter]
    return RoadGraph(along, times, onward)
