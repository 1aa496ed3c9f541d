"""The same work for many: in one process or in several, the answers are the same."""

from __future__ import annotations

import gc
import math

from benchmarks.parallel_flights import map_in_processes

NUMBERS = [16.0, 4.0, 9.0]


def test_the_answers_have_the_order_of_the_orders() -> None:
    told: list[tuple[int, int]] = []
    assert map_in_processes(math.sqrt, NUMBERS, jobs=1, told=lambda *done: told.append(done)) == [4.0, 2.0, 3.0]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert map_in_processes(math.sqrt, NUMBERS, jobs=2) == [4.0, 2.0, 3.0]
    assert map_in_processes(math.sqrt, [], jobs=2) == []


def test_cycles_are_looked_for_again_afterwards() -> None:
    def looks(_: float) -> bool:
        return gc.isenabled()

    assert map_in_processes(looks, NUMBERS, jobs=1) == [False, False, False]
    assert gc.isenabled()
