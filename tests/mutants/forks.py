"""Work in forks of this process, and how tests are run there."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import sys
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

import pytest
from hypothesis import Phase, settings

OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
MEMORY_B = 4 << 30
T = TypeVar("T")
CAN_FORK = get_context("fork")


class TookTooLong(Exception):
    """The work did not come to its end in its time."""


class Died(Exception):
    """The process of the work ended before the work did."""


class Hasty:
    """A plugin: nobody looks for the smallest example of a failure."""

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        settings.register_profile("mutants", settings(), phases=(Phase.explicit, Phase.generate))
        settings.load_profile("mutants")


class Chosen(Hasty):
    """A plugin: runs these tests in this order."""

    def __init__(self, tests: Sequence[str]) -> None:
        self.ranks = {test: rank for rank, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted((item for item in items if item.nodeid in self.ranks), key=lambda one: self.ranks[one.nodeid])
        if len(items) < len(self.ranks):
            raise pytest.UsageError("the change made tests disappear")


def quiet() -> None:
    """Make this process one that can be ended with all that it starts, and that prints nothing."""
    os.setsid()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(nowhere, number)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_B, MEMORY_B))
    sys.dont_write_bytecode = True


def in_fork(work: Callable[[], T], most_s: float) -> T:
    """Return what a function returns in a fork of this process.

    Raises:
        TookTooLong: It did not return in time.
        Died: It ended its process, or raised.
    """
    ours, theirs = CAN_FORK.Pipe(duplex=False)

    def child(answer: Connection) -> None:
        quiet()
        answer.send(work())
        answer.close()
        os._exit(0)

    process = CAN_FORK.Process(target=child, args=(theirs,))
    process.start()
    theirs.close()
    assert process.pid is not None
    try:
        if not ours.poll(most_s):
            raise TookTooLong
        try:
            answer: T = ours.recv()
        except EOFError as why:
            raise Died from why
        return answer
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.join()
        ours.close()
