"""Subset-row cuts of three segments (Jepsen et al. 2008) with limited memory (Pecin et al. 2017).

Of any three segments, the chosen shares of the routes that visit two or more of them sum to 1 at most. A route counts
pairs of visits; it forgets a single visit on the way through a segment outside the cut's memory, which keeps pricing
cheap.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from planner.kernels.arrays import FloatArray, IntArray
from planner.kernels.pricing import count_cuts
from planner.model import segment_of

CUTS = 40
"""Cuts that are found in one round."""
VIOLATED = 0.02
"""Least violation of a cut that is added."""
CHOSEN = 1e-6
"""Share below which a route is not chosen."""


class Cut(NamedTuple):
    """A triple of segments, and the segments on which a route remembers its visits to them."""

    triple: tuple[int, ...]
    memory: frozenset[int]


def tabulate_cuts(cuts: Sequence[Cut], segments: int) -> tuple[IntArray, IntArray]:
    """Return (c, n) int64 each, 1 where a cut is on a segment, and where it remembers an earlier visit."""
    member, memory = (np.zeros((len(cuts), segments), dtype=np.int64) for _ in range(2))
    for number, cut in enumerate(cuts):
        member[number, list(cut.triple)] = 1
        memory[number, list(cut.memory)] = 1
    return member, memory


def count_routes(member: IntArray, memory: IntArray, routes: Sequence[tuple[int, ...]]) -> IntArray:
    """Return (c, r) int64, how often routes pay for cuts."""
    counts = np.zeros((len(member), len(routes)), dtype=np.int64)
    flat = np.array([visit for visits in routes for visit in visits], dtype=np.int64)
    count_cuts(flat, np.cumsum([len(visits) for visits in routes], dtype=np.int64), member, memory, counts)
    return counts


def find_memory(visits: tuple[int, ...], triple: Sequence[int]) -> set[int]:
    """Return the segments between the visits of a route to a triple which are counted together."""
    memory, between, is_odd = set[int](), set[int](), False
    for visit in visits:
        segment = segment_of(visit)
        if segment in triple:
            memory |= between if is_odd else set()
            between, is_odd = set(), not is_odd
        else:
            between.add(segment)
    return memory


def find_violated_triples(visited: npt.NDArray[np.int8], shares: FloatArray) -> IntArray:
    """Return (c, 3) int64, the triples of segments of which routes visit two or more too often, the worst first.

    Args:
        visited: (n, r), 1 where a route visits a segment.
        shares: (r,), how much of each route is chosen.
    """
    used = np.flatnonzero(shares > CHOSEN)
    inside = visited[:, used].astype(np.float64)
    pairs = (inside * shares[used]) @ inside.T
    triples, excesses = [np.empty((0, 3), dtype=np.int64)], [np.empty(0)]
    for third in range(2, len(visited)):
        all_three = (inside[:third] * shares[used] * inside[third]) @ inside[:third].T
        to_third = pairs[third, :third]
        twice = pairs[:third, :third] + to_third[:, np.newaxis] + to_third[np.newaxis] - 2 * all_three
        first, second = np.nonzero(np.triu(twice, 1) > 1 + VIOLATED)
        triples.append(np.column_stack((first, second, np.full(len(first), third))))
        excesses.append(twice[first, second])
    worst = np.argsort(-np.concatenate(excesses), kind="stable")[:CUTS]
    return np.concatenate(triples)[worst]
