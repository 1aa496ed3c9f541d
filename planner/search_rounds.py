"""Rounds of a search: the stop rule is asked before each, and starts go through it side by side, a thread each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from typing import TypeVar

from planner.stop_rules import Progress, StopRule

T = TypeVar("T")
R = TypeVar("R")


def run_rounds(
    stop: StopRule, progress: Callable[[], Progress], go_on: Callable[[int, Executor | None], None], starts: int
) -> str:
    """Go on for as many iterations as the stop rule allows, again and again; return why it ended."""
    with ThreadPoolExecutor(starts) if starts > 1 else nullcontext() as threads:
        while (verdict := stop(progress())).allowed > 0:
            go_on(verdict.allowed, threads)
    return verdict.reason


def run_in_threads(threads: Executor | None, work: Callable[[T], R], starts: Iterable[T]) -> list[R]:
    """Return what comes of all starts, done in threads where there are any."""
    return list(map(work, starts) if threads is None else threads.map(work, starts))
