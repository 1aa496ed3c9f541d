"""Many flights in virtual time, in parallel processes."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from executor.adapters.interrupts import start_worker_pool

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class FlightCase:
    """One flight to generate and fly."""

    number: int
    seed: int
    autopilot: str


def make_flight_cases(flights: int, seed: int, autopilots: Sequence[str]) -> list[FlightCase]:
    """Return the flights, alternating autopilots."""
    return [FlightCase(number, seed, autopilots[number % len(autopilots)]) for number in range(flights)]


def map_in_processes(
    work: Callable[[T], R], orders: Sequence[T], *, jobs: int, told: Callable[[int, int], None] = lambda *_: None
) -> list[R]:
    """Apply a function to every order; answers are in the order of the orders, for any number of processes.

    Args:
        work: A function of a module, so that processes can import it.
        orders: Its inputs.
        jobs: Processes; 1 runs everything in this one.
        told: Receives the number of finished orders, and the total.
    """
    one = partial(_run_without_collector, work)
    if jobs <= 1 or len(orders) <= 1:
        return list(_report_progress(map(one, orders), len(orders), told))
    with start_worker_pool(min(jobs, len(orders))) as pool:
        return list(_report_progress(pool.map(one, orders), len(orders), told))


def _report_progress(answers: Iterator[R], total: int, told: Callable[[int, int], None]) -> Iterator[R]:
    for number, answer in enumerate(answers, start=1):
        told(number, total)
        yield answer


def _run_without_collector(work: Callable[[T], R], order: T) -> R:
    with _pause_collector():
        return work(order)


@contextmanager
def _pause_collector() -> Iterator[None]:
    """Collect cycles after a flight, not during it: saves a tenth of the time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.collect()
