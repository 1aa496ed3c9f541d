from __future__ import annotations

import asyncio
import os
import signal

import pytest

from executor.errors import ExecutorError
from executor.plan_page.worker import WorkCancelled, Worker, report_progress
from planner import Progress


def search(job: int, rounds: int) -> int:
    """Stand for a search: it says how far it is, until it is told to end."""
    report = report_progress(job)
    for number in range(rounds):
        report(Progress(number, 0, 0.0, 100.0 - number, 2, feasible=False, impossible=False))
    return rounds


async def _one_after_another() -> None:
    worker = Worker("testing")
    try:
        assert await worker.run(search, 1, 5) == 5
        assert worker.progress == (1, 96.0, 2)
        worker.cancel(2)
        with pytest.raises(WorkCancelled):
            await worker.run(search, 2, 10**9)
        assert await worker.run(search, 3, 1) == 1
        first = await worker.run(os.getpid)
        with pytest.raises(ExecutorError, match="testing: its process died"):
            await worker.run(os.kill, first, signal.SIGKILL)
        assert await worker.run(os.getpid) != first
    finally:
        worker.close()


def test_a_worker_reports_progress_is_cancelled_and_replaced_when_it_dies() -> None:
    asyncio.run(_one_after_another())
