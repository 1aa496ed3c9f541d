"""Ctrl-C reaches every process of a program at once; those that only work for another leave it to that one."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back() -> Iterator[None]:
    """Start processes that Ctrl-C does not reach; one that comes meanwhile is delivered afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    came: list[int] = []
    # Another thread may take the signal all the same; half a pool of processes would wait for the rest for ever.
    raises = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    plain = raises and threading.current_thread() is threading.main_thread()
    if plain:
        signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        if plain:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if came:
            signal.raise_signal(signal.SIGINT)


def end_children() -> None:
    """End the processes that work for this one: nobody waits for their answers any more."""
    for child in multiprocessing.active_children():
        child.terminate()
