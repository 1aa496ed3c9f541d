"""A pool of one known process, which can be ended politely, or killed if it hangs."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing.process import BaseProcess
from typing import ParamSpec, TypeVar

from executor.adapters.interrupts import defer_ctrl_c, end_processes

P = ParamSpec("P")
T = TypeVar("T")
SPAWNED = multiprocessing.get_context("spawn")
"""Spawn context: a process with threads, such as the compiler's, must not be forked."""


class OneWorker:
    """One process, started on first use, and again after `release` or `kill`."""

    def __init__(self, prepare: Callable[..., None], *shared: object) -> None:
        """Set what the process calls first, and its shared data: no locks, as a killed process would keep them."""
        self._prepare, self._shared = prepare, shared
        self._pool: ProcessPoolExecutor | None = None
        self._processes: set[BaseProcess] = set()

    def submit(self, work: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> Future[T]:
        """Submit a task."""
        with defer_ctrl_c():  # the first task of a pool starts its process
            before = set(multiprocessing.active_children())
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    1, mp_context=SPAWNED, initializer=self._prepare, initargs=self._shared
                )
            submitted = self._pool.submit(work, *arguments, **named)
            self._processes |= set(multiprocessing.active_children()) - before
            return submitted

    def kill(self) -> None:
        """End the process at once: it may hang, and would keep the program from ending. Waiting tasks get an error."""
        for process in self._release(cancel=False):
            process.kill()

    def end(self) -> int:
        """End the process, as politely as it allows, and wait for that; return how many had to be killed."""
        return end_processes(self._release(cancel=True))

    def _release(self, *, cancel: bool) -> set[BaseProcess]:
        """Let a new process do the next task; return the old ones, which end when idle."""
        processes, self._processes = self._processes, set()
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=cancel)
            self._pool = None
        return processes
