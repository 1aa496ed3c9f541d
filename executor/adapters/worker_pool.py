"""Processes that work for this one, and are gone with it."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from executor.adapters.interrupts import end_with_parent


def start_worker_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of so many processes.

    They are spawned: one that has had threads, as the compiler's, must not be forked. However this process dies, they
    end, instead of computing for nobody.
    """
    return ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn"), initializer=end_with_parent)
