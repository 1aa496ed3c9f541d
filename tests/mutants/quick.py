"""Judges changes inside functions in forks of a process that has collected the tests: nothing is imported anew.

What a test file makes of the project while it is imported does not see such a change: whoever asks has to know that.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from inspect import CO_OPTIMIZED
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import CodeType, FunctionType

import pytest

from tests.mutants.forks import CAN_FORK, OPTIONS, Died, Hasty, TookTooLong, in_fork, quiet
from tests.mutants.mutate import Verdict

Swaps = list[tuple[CodeType, CodeType]]
COLLECTING_S = 600.0


def swaps(old: CodeType, new: CodeType) -> Swaps | None:
    """Return which functions of a file are to be exchanged for which; None if what its import executes differs."""
    if old.co_flags & CO_OPTIMIZED:
        return [] if old == new else [(old, new)]
    if (old.co_code, old.co_names, len(old.co_consts)) != (new.co_code, new.co_names, len(new.co_consts)):
        return None
    found: Swaps = []
    for one, other in zip(old.co_consts, new.co_consts, strict=True):
        if isinstance(one, CodeType) and isinstance(other, CodeType):
            inner = swaps(one, other)
            if inner is None:
                return None
            found += inner
        elif (type(one), one) != (type(other), other):
            return None
    return found


@dataclass(frozen=True, slots=True)
class _Job:
    path: str
    new: bytes
    tests: tuple[str, ...]
    most_s: float


class _Serving:
    """A plugin: in place of running the tests, it runs those that it is asked for, each time in a fork."""

    def __init__(self, jobs: Connection, answers: Connection, sources: Sequence[str]) -> None:
        self.jobs, self.answers, self.sources = jobs, answers, sources
        self.failed = ""
        self.fit: dict[str, bool] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.items = {item.nodeid: item for item in session.items}
        self.old = {path: compile(Path(path).read_bytes(), str(Path.cwd() / path), "exec") for path in self.sources}
        self.live: dict[CodeType, list[FunctionType]] = {}
        files = {str(Path.cwd() / path) for path in self.sources}
        for one in gc.get_objects():
            if isinstance(one, FunctionType) and one.__code__.co_filename in files:
                self.live.setdefault(one.__code__, []).append(one)
        gc.freeze()
        self.answers.send(True)
        while (job := self.jobs.recv()) is not None:
            self.answers.send(self._judged(job))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def _judged(self, job: _Job) -> Verdict | None:
        found = swaps(self.old[job.path], compile(job.new, str(Path.cwd() / job.path), "exec"))
        if found is None or not all(old in self.live for old, _ in found):
            return None
        tests = [test for test in job.tests if self.fit.get(test, True)]
        while tests:
            try:
                failed = in_fork(partial(self._first_failed, found, tests), job.most_s)
            except TookTooLong:
                return Verdict.TIMED_OUT
            except Died:
                return Verdict.KILLED
            if not failed:
                break
            if failed not in self.fit:
                # One that needs what was done before it, or a process of its own, says nothing here.
                self.fit[failed] = not in_fork(partial(self._first_failed, [], [failed]), job.most_s)
            if self.fit[failed]:
                return Verdict.KILLED
            tests.remove(failed)
        return Verdict.SURVIVED

    def _first_failed(self, found: Swaps, tests: Sequence[str]) -> str:
        for old, new in found:
            for function in self.live[old]:
                function.__code__ = new
        items = [self.items[test] for test in tests]
        for item, after in zip(items, [*items[1:], None], strict=True):
            item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
            if self.failed:
                break
        return self.failed


@dataclass(slots=True)
class Collected:
    """Test files that are imported, and whose tests are ready to run."""

    sources: tuple[str, ...]
    process: BaseProcess = field(init=False)
    jobs: Connection = field(init=False)
    answers: Connection = field(init=False)

    def begin(self, files: Sequence[str]) -> bool:
        """Collect the tests; tells whether that can be done."""
        theirs_in, self.jobs = CAN_FORK.Pipe(duplex=False)
        self.answers, theirs_out = CAN_FORK.Pipe(duplex=False)

        def child(jobs: Connection, answers: Connection) -> None:
            quiet()
            self.jobs.close()
            pytest.main([*OPTIONS, *files], plugins=[_Serving(jobs, answers, self.sources), Hasty()])
            os._exit(0)

        self.process = CAN_FORK.Process(target=child, args=(theirs_in, theirs_out))
        self.process.start()
        theirs_in.close()
        theirs_out.close()
        try:
            return self.answers.poll(COLLECTING_S) and bool(self.answers.recv())
        except EOFError:
            return False

    def judged(self, path: str, new: bytes, tests: Sequence[str], most_s: float) -> Verdict | None:
        """Return what these tests make of a file's new text; None if it does not only differ inside functions."""
        self.jobs.send(_Job(path, new, tuple(tests), most_s))
        verdict: Verdict | None = self.answers.recv()
        return verdict

    def end(self) -> None:
        """Let go of the tests."""
        self.process.kill()
        self.process.join()
