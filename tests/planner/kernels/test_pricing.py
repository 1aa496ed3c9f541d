"""Pricing against all routes: cuts are paid for, and the least reduced cost is found."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from planner.columns import BUCKETS, RouteKind, list_kinds
from planner.kernels.arrays import allocate
from planner.kernels.pricing import (
    SAME_MEMORY,
    SAME_NODE,
    WORD,
    Completions,
    Cuts,
    Labels,
    Priced,
    bound_completions,
    count_cuts,
    price_routes,
)
from tests.planner.builders import fleet, random_instance

SEGMENTS = 4
TRIPLES = list(itertools.combinations(range(SEGMENTS), 3))


def list_routes() -> list[tuple[int, ...]]:
    """Return every route that visits no segment twice."""
    return [
        tuple(2 * segment + way for segment, way in zip(order, ways, strict=True))
        for length in range(1, SEGMENTS + 1)
        for order in itertools.permutations(range(SEGMENTS), length)
        for ways in itertools.product((0, 1), repeat=length)
    ]


def measure(kind: RouteKind, visits: tuple[int, ...]) -> float:
    between = sum(kind.move[one, onward] for one, onward in itertools.pairwise(visits))
    return float(kind.start[visits[0]] + between + kind.home[visits[-1]])


def price(kind: RouteKind, prize: np.ndarray, cuts: Cuts, rule: int) -> float:
    """Return the least reduced cost that pricing finds, infinite without a route."""
    near = np.full((SEGMENTS, 2), 2**WORD - 1)
    start, home, move = (np.ascontiguousarray(table) for table in (kind.start, kind.home, kind.move))
    priced = Priced(start, home, move, near, kind.limit, kind.limit / BUCKETS * (1 + 1e-9) + 1e-12, SEGMENTS)
    completions = allocate(Completions, b=BUCKETS, v=2 * SEGMENTS)
    labels = allocate(Labels, c=10_000, b=BUCKETS, v=2 * SEGMENTS)
    bound_completions(priced, 1.0, prize, completions)
    found = np.full(2 * SEGMENTS, -1)
    count, _ = price_routes(priced, 1.0, prize, cuts, completions, 1e9, rule, labels, found)
    assert count >= 0
    ends = found[found >= 0]
    return float((labels.cost[ends] + home[labels.visit[ends]]).min(initial=np.inf))


@pytest.mark.parametrize("seed", range(20))
def test_the_least_reduced_cost_with_cuts_is_that_of_all_routes(seed: int) -> None:
    chance = np.random.default_rng(seed)
    [kind] = list_kinds(random_instance(seed, SEGMENTS, fleet(40.0)))
    prize, prices = chance.uniform(0, 20, SEGMENTS), chance.uniform(0, 10, len(TRIPLES))
    member, memory = np.zeros((2, len(TRIPLES), SEGMENTS), dtype=np.int64)
    for number, triple in enumerate(TRIPLES):
        member[number, list(triple)] = 1
        memory[number] = np.maximum(member[number], chance.integers(0, 2, SEGMENTS))
    # One word holds the first two cuts, the other one the rest.
    cuts, place = allocate(Cuts, n=SEGMENTS), [(0, 0), (0, 61), (1, 5), (1, 9)]
    bits = np.arange(256)[:, np.newaxis] >> np.arange(8) & 1
    for number, (word, bit) in enumerate(place):
        cuts.member[:, word] |= member[number] << bit
        cuts.memory[:, word] |= memory[number] << bit
        cuts.price[8 * word + bit // 8] += bits[:, bit % 8] * prices[number]
    routes = [route for route in list_routes() if measure(kind, route) <= kind.limit]
    counts = np.zeros((len(TRIPLES), len(routes)), dtype=np.int64)
    count_cuts(np.concatenate(routes), np.cumsum([len(route) for route in routes]), member, memory, counts)
    costs = [measure(kind, route) - sum(prize[visit >> 1] for visit in route) for route in routes]
    least = min(costs + prices @ counts)
    assert price(kind, prize, cuts, SAME_MEMORY) == pytest.approx(least)
    assert price(kind, prize, cuts, SAME_NODE) >= least - 1e-9


def test_a_route_pays_for_each_two_visits_that_a_cut_remembers() -> None:
    member = np.array([[1, 1, 1, 0]] * 2)
    memory = np.array([[1, 1, 1, 1], [1, 1, 1, 0]])
    routes = [(0, 2), (0, 6, 2), (0, 2, 4), (0, 2, 4, 1), (6, 0)]
    counts = np.zeros((2, len(routes)), dtype=np.int64)
    count_cuts(np.concatenate(routes), np.cumsum([len(route) for route in routes]), member, memory, counts)
    assert counts.tolist() == [[1, 1, 1, 2, 0], [1, 0, 1, 2, 0]]
