"""Run long work in a separate process, so that the page keeps answering and hung work can be killed."""

from __future__ import annotations

import asyncio
import ctypes
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

from executor.adapters.interrupts import end_with_parent
from executor.adapters.one_worker import SPAWNED, OneWorker
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
    """Cost of the best plan so far."""
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


def make_reader() -> Worker:
    """Return what reads a site, and answers questions about its plans."""
    return Worker("reading the site")


class Worker:
    """One process, made when it is first asked, and anew if it died."""

    def __init__(self, name: str) -> None:
        """Name it, for messages."""
        self._name = name
        # Without a lock: a worker that is killed while it holds one would keep it.
        self._shared = SPAWNED.RawArray("d", [-1.0, 0.0, 0.0, 0.0, -1.0])
        self._worker = OneWorker(_prepare, self._shared)
        self._closed = False

    @property
    def progress(self) -> WorkProgress:
        """How far it is; of the job that has said something last."""
        job, iterations, value, uncovered, _ = self._shared
        return WorkProgress(int(job), int(iterations), value, int(uncovered))

    def cancel(self, job: int) -> None:
        """Have a job, and all before it, end at its next look."""
        self._shared[4] = max(self._shared[4], float(job))

    def submit(self, work: Callable[P, T], *words: P.args, **named: P.kwargs) -> Future[T]:
        """Hand over some work; the first starts the process."""
        return self._worker.submit(work, *words, **named)

    async def run(self, work: Callable[P, T], *words: P.args, **named: P.kwargs) -> T:
        """Do some work there.

        Raises:
            ExecutorError: the process died; or as the work does.
        """
        try:
            return await asyncio.wrap_future(self.submit(work, *words, **named))
        except BrokenProcessPool as error:
            if self._closed:
                raise asyncio.CancelledError from error  # nobody waits any more
            self.kill()
            raise ExecutorError(f"{self._name}: its process died; is there enough memory?") from error

    def kill(self) -> None:
        """End the process at once; the next work starts another."""
        self._worker.kill()

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self.cancel(2**50)
        self._worker.end()
