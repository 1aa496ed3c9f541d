"""Ctrl-C in a terminal reaches every process of a program at once; those that only work for another leave it to that one."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach; one that comes meanwhile is delivered afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_children() -> None:
    """End the processes that work for this one: nobody waits for their answers any more."""
    for child in multiprocessing.active_children():
        child.terminate()
