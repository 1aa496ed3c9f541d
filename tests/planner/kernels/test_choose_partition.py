"""The choice of routes that visit each segment once, against every choice."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from planner.kernels.arrays import allocate
from planner.kernels.pricing import WORD, Choosable, Partial, choose_partition

KINDS = np.array([2, 1])
"""Routes of each kind that may be chosen."""


def choose(
    sets: list[set[int]], costs: list[float], kinds: list[int], segments: int, checks: int = 10**9
) -> tuple[float, bool, list[int]]:
    """Return the least cost below 100, whether all choices were tried, and the chosen routes."""
    order = sorted(range(len(sets)), key=lambda one: (min(sets[one]), costs[one]))
    words = np.zeros((len(sets), 2), dtype=np.int64)
    for place, route in enumerate(order):
        for segment in sets[route]:
            words[place, segment // WORD] |= 1 << segment % WORD
    lowest, price = [min(sets[route]) for route in order], np.array([costs[route] for route in order])
    begin = np.searchsorted(lowest, np.arange(segments + 1))
    routes = Choosable(words, price, price, np.array([kinds[route] for route in order]), begin)
    left, chosen = KINDS.copy(), np.full(3, -1)
    best, is_all = choose_partition(
        routes, segments, left, 100.0, 100.0, False, checks, allocate(Partial, k=3), chosen
    )  # fmt: skip
    return best, is_all, [order[place] for place in chosen.tolist() if place >= 0]


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_cheapest_of_all_choices(seed: int) -> None:
    chance, segments = np.random.default_rng(seed), 6
    sets = [set(chance.choice(segments, chance.integers(1, 5), replace=False).tolist()) for _ in range(40)]
    costs, kinds = chance.uniform(1, 30, 40).tolist(), chance.integers(0, 2, 40).tolist()
    sums = [100.0]
    for count in (1, 2, 3):
        for routes in itertools.combinations(range(40), count):
            visited = sorted(segment for route in routes for segment in sets[route])
            used = np.bincount([kinds[route] for route in routes], minlength=2)
            if visited == list(range(segments)) and (used <= KINDS).all():
                sums.append(sum(costs[route] for route in routes))
    best, is_all, chosen = choose(sets, costs, kinds, segments)
    assert is_all
    assert best == pytest.approx(min(sums))
    assert best == 100.0 or sum(costs[route] for route in chosen) == pytest.approx(best)


def test_segments_of_the_second_word_are_told_apart() -> None:
    first, second = set(range(WORD + 1)), {WORD + 1, WORD + 2}
    best, is_all, chosen = choose([first, second, {WORD + 1}], [3.0, 4.0, 1.0], [0, 0, 0], WORD + 3)
    assert (best, is_all, sorted(chosen)) == (7.0, True, [0, 1])


def test_it_says_when_it_did_not_try_all() -> None:
    best, is_all, chosen = choose([{0}, {1}], [1.0, 1.0], [0, 0], 2, checks=1)
    assert (best, is_all, chosen) == (100.0, False, [])
