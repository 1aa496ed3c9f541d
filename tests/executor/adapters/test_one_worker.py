"""A pool of one process: work waiting for a killed one fails at once, and the next work gets a new one."""

from __future__ import annotations

import os
import time
from concurrent.futures.process import BrokenProcessPool

import pytest

from executor.adapters.one_worker import SPAWNED, OneWorker
from tests.patience import PATIENCE_S


def take(_: object) -> None:
    """Take what is shared."""


def test_work_waiting_for_a_killed_process_fails_and_the_next_gets_a_new_one() -> None:
    worker = OneWorker(take, SPAWNED.RawValue("q", 0))
    first = worker.submit(os.getpid).result(PATIENCE_S)
    hanging, waiting = worker.submit(time.sleep, 3600.0), worker.submit(os.getpid)
    worker.kill()
    for one in (hanging, waiting):
        with pytest.raises(BrokenProcessPool):
            one.result(PATIENCE_S)
    assert worker.submit(os.getpid).result(PATIENCE_S) != first
    assert worker.end() == 0


def test_one_that_was_never_asked_has_nothing_to_end() -> None:
    worker = OneWorker(take, None)
    worker.kill()
    assert worker.end() == 0
