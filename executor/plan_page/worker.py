"""What takes long is done in a process of its own: the page answers meanwhile, and what hangs can be ended."""

from __future__ import annotations

import asyncio
import ctypes
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import ParamSpec, TypeVar

from executor.adapters.interrupts import defer_ctrl_c, end_processes, end_with_parent
from executor.errors import ExecutorError
from planner import Progress

P = ParamSpec("P")
T = TypeVar("T")


class WorkCancelled(ExecutorError):
    """Nobody waits for an answer any more."""


@dataclass(frozen=True, slots=True)
class WorkProgress:
    """How far the search of a worker is."""

    job: int
    iterations: int
    value: float
    """Of the best plan so far."""
    uncovered: int


_shared: ctypes.Array[ctypes.c_double] | None = None


def report_progress(job: int) -> Callable[[Progress], None]:
    """Return how to say in a worker how far a job is; it raises `WorkCancelled` where that is asked for."""

    def report(progress: Progress) -> None:
        if _shared is None:
            return
        _shared[1:4] = [float(progress.iterations), progress.value, float(progress.uncovered)]
        _shared[0] = float(job)
        if _shared[4] >= job:
            raise WorkCancelled("cancelled")

    return report


def _prepare(shared: ctypes.Array[ctypes.c_double]) -> None:
    global _shared  # noqa: PLW0603 - a worker process holds exactly one, given when it starts
    _shared = shared
    end_with_parent()


class Worker:
    """One process, made when it is first asked, and anew if it died."""

    def __init__(self, name: str) -> None:
        """Name it, for messages."""
        self._name = name
        self._context = multiprocessing.get_context("spawn")
        # Without a lock: a worker that is killed while it holds one would keep it.
        self._shared = self._context.RawArray("d", [-1.0, 0.0, 0.0, 0.0, -1.0])
        self._pool: ProcessPoolExecutor | None = None
        self._processes: set[BaseProcess] = set()
        self._closed = False

    @property
    def progress(self) -> WorkProgress:
        """How far it is; of the job that has said something last."""
        job, iterations, value, uncovered, _ = self._shared
        return WorkProgress(int(job), int(iterations), value, int(uncovered))

    def cancel(self, job: int) -> None:
        """Have a job, and all before it, end at its next look."""
        self._shared[4] = max(self._shared[4], float(job))

    async def run(self, work: Callable[P, T], *words: P.args, **named: P.kwargs) -> T:
        """Do some work there.

        Raises:
            ExecutorError: the process died; or as the work does.
        """
        with defer_ctrl_c():  # the first task of a pool starts its process
            before = set(multiprocessing.active_children())
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    1, mp_context=self._context, initializer=_prepare, initargs=(self._shared,)
                )
            asked = self._pool.submit(work, *words, **named)
            self._processes |= set(multiprocessing.active_children()) - before
        try:
            return await asyncio.wrap_future(asked)
        except BrokenProcessPool as error:
            if self._closed:
                raise asyncio.CancelledError from error  # nobody waits any more
            self.kill()
            raise ExecutorError(f"{self._name}: its process died; is there enough memory?") from error

    def kill(self) -> None:
        """End the process at once; the next work starts another."""
        self._release(cancel=False)  # what waits there is told that the process died
        for process in self._processes:
            process.kill()
        self._processes = set()

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self.cancel(2**50)
        self._release(cancel=True)
        end_processes(self._processes)
        self._processes = set()

    def _release(self, *, cancel: bool) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=cancel)
            self._pool = None
