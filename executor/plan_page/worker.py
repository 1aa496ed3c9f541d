"""Run long work in a separate process, so that the page keeps answering and hung work can be killed."""

from __future__ import annotations

import asyncio
import ctypes
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from typing import ParamSpec, TypeVar

from executor.adapters.interrupts import end_with_parent
from executor.adapters.one_worker import SPAWNED, OneWorker
from executor.errors import ExecutorError
from planner import Progress

P = ParamSpec("P")
T = TypeVar("T")


class WorkCancelled(ExecutorError):
    """Raised when an answer is no longer needed."""


_shared: ctypes.Array[ctypes.c_double] | None = None
"""Job that last reported, cost of its best plan, number of segments that this leaves out, and last cancelled job."""


def report_progress(job: int) -> Callable[[Progress], None]:
    """Return a callback that reports a job's progress; it raises `WorkCancelled` once the job is cancelled."""

    def report(progress: Progress) -> None:
        if _shared is None:
            return
        _shared[1:3] = [progress.value, float(progress.uncovered)]
        _shared[0] = float(job)
        if _shared[3] >= job:
            raise WorkCancelled("cancelled")

    return report


def _prepare(shared: ctypes.Array[ctypes.c_double]) -> None:
    global _shared  # noqa: PLW0603 - a worker process holds exactly one, set at its start
    _shared = shared
    end_with_parent()


def make_reader() -> Worker:
    """Return the worker that reads a site, and answers questions about its plans."""
    return Worker("reading the site")


class Worker:
    """One process, started at the first call, and again if it died."""

    def __init__(self, name: str) -> None:
        """Set its name, for messages."""
        self._name = name
        # Without a lock: a worker killed while holding one would keep it.
        self._shared = SPAWNED.RawArray("d", [-1.0, 0.0, 0.0, -1.0])
        self._worker = OneWorker(_prepare, self._shared)
        self._closed = False

    @property
    def progress(self) -> tuple[int, float, int]:
        """Job that last reported, cost of its best plan so far, and number of segments that this leaves out."""
        job, value, uncovered, _ = self._shared
        return int(job), value, int(uncovered)

    def cancel(self, job: int) -> None:
        """Cancel a job, and all before it, at its next check."""
        self._shared[3] = max(self._shared[3], float(job))

    def submit(self, work: Callable[P, T], *words: P.args, **named: P.kwargs) -> Future[T]:
        """Submit work; the first call starts the process."""
        return self._worker.submit(work, *words, **named)

    async def run(self, work: Callable[P, T], *words: P.args, **named: P.kwargs) -> T:
        """Run work in the process.

        Raises:
            ExecutorError: the process died; or as the work does.
        """
        try:
            return await asyncio.wrap_future(self.submit(work, *words, **named))
        except BrokenProcessPool as error:
            if self._closed:
                raise asyncio.CancelledError from error  # the caller no longer waits
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
