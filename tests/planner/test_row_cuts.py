"""Subset-row cuts on routes that one can count by hand; a visit is a segment's number, doubled."""

from __future__ import annotations

import numpy as np

from planner.row_cuts import Cut, count_routes, find_memory, find_violated_triples, tabulate_cuts


def route(*segments: int) -> tuple[int, ...]:
    return tuple(2 * segment for segment in segments)


def test_three_routes_that_each_visit_two_of_three_segments_are_one_too_many_by_half() -> None:
    visited = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1], [0, 0, 0]], dtype=np.int8)
    assert find_violated_triples(visited, np.array([0.5, 0.5, 0.5])).tolist() == [[0, 1, 2]]
    assert find_violated_triples(visited, np.array([1.0, 0.0, 0.0])).tolist() == []


def test_a_cut_remembers_what_lies_between_two_visits_that_count_as_a_pair() -> None:
    assert find_memory(route(0, 7, 1, 8, 2), (0, 1, 2)) == {7}
    assert find_memory(route(7, 0, 8), (0, 1, 2)) == set()


def test_a_route_pays_for_each_pair_that_it_remembers() -> None:
    remembers = Cut((0, 1, 2), frozenset({0, 1, 2, 7}))
    forgets = Cut((0, 1, 2), frozenset({0, 1, 2}))
    routes = [route(0, 7, 1), route(0, 1, 2), route(3, 0, 4)]
    counted = count_routes(*tabulate_cuts([remembers, forgets], 9), routes)
    assert counted.tolist() == [[1, 1, 0], [0, 1, 0]]
