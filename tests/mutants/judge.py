"""Runs the tests that execute a changed line, in a fork of a process that has imported everything but the project."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import os
import re
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from itertools import accumulate
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypedDict, TypeVar

import coverage
import pytest
from hypothesis import Phase, settings

from tests.mutants.mutate import Mutant

OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
TIMES = 3.0
"""The tests of a mutant may take so many times what they took before, while they were watched."""
LEARNING_S = 1800.0
MEMORY_B = 4 << 30
T = TypeVar("T")
CAN_FORK = get_context("fork")


class Verdict(Enum):
    """What became of a mutant."""

    KILLED = "killed"
    SURVIVED = "survived"
    TIMED_OUT = "timed out"
    EQUIVALENT = "equivalent"


class Learnt(TypedDict):
    """What was seen while a test file ran."""

    at: dict[str, dict[str, list[str]]]
    took_s: dict[str, float]
    installed: list[str]
    """What it imports beside the project."""


class AlreadyFailing(Exception):
    """The tests do not pass without any change."""


@cache
def _imports(test: Path, path: str) -> bool:
    """Tell whether a test file names a file of the project in an import."""
    package, _, name = path.removesuffix(".py").replace("/", ".").rpartition(".")
    names = rf"^(from|import) {re.escape(package)}(\.{name}\b| import .*\b{name}\b)"
    return re.search(names, test.read_text(encoding="utf-8"), re.MULTILINE) is not None


@dataclass(frozen=True, slots=True)
class Known:
    """What the tests of a module execute, and how long each of them takes."""

    tests_at: dict[str, dict[int, set[str]]]
    """By file and line; what is executed while modules are imported is not in it."""
    took_s: dict[str, float]

    def judging(self, mutant: Mutant, sources: Mapping[str, str], patience_s: float) -> list[str]:
        """Return the tests that can notice a change, the best ones first, as many as there is patience for.

        A value that is made while a module is imported shows where its name is read, and in tests that import that.
        """
        here = self.tests_at.get(mutant.path, {})
        chosen: set[str] = set()
        for line in range(mutant.lines[0], mutant.lines[1] + 1):
            chosen |= here.get(line, set())
        if mutant.bound:
            name = re.compile(rf"\b{re.escape(mutant.bound)}\b")
            for path, text in sources.items():
                at = self.tests_at.get(path, {})
                for number, line_text in enumerate(text.splitlines(), start=1):
                    if number in at and name.search(line_text):
                        chosen |= at[number]
            chosen |= {test for test in self.took_s if _imports(Path(test.partition("::")[0]), mutant.path)}
        # Those that are named after the file know it best.
        own = f"/test_{Path(mutant.path).name}::"
        quickest = sorted(chosen, key=lambda test: (own not in test, self.took_s[test], test))
        sums_s = accumulate(self.took_s[test] for test in quickest)
        return [
            test for test, sum_s in zip(quickest, sums_s, strict=True) if sum_s <= patience_s or test == quickest[0]
        ]


class _Chosen:
    """A plugin: runs these tests in this order, and does not look for the smallest example of a failure."""

    def __init__(self, tests: Sequence[str]) -> None:
        self.ranks = {test: rank for rank, test in enumerate(tests)}

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        settings.register_profile("mutants", settings(), phases=(Phase.explicit, Phase.generate))
        settings.load_profile("mutants")

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted((item for item in items if item.nodeid in self.ranks), key=lambda one: self.ranks[one.nodeid])
        if len(items) < len(self.ranks):
            raise pytest.UsageError("the change made tests disappear")


class _Recording:
    """A plugin: which test executes which lines, and how long it takes."""

    def __init__(self, recorder: coverage.Coverage) -> None:
        self.recorder = recorder
        self.took_s: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.recorder.switch_context(item.nodeid)
        try:
            return (yield)
        finally:
            self.recorder.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.took_s[report.nodeid] = self.took_s.get(report.nodeid, 0.0) + report.duration


def _quiet() -> None:
    """Make this process one that can be ended with all that it starts, and that prints nothing."""
    os.setsid()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(nowhere, number)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_B, MEMORY_B))
    sys.dont_write_bytecode = True


def _in_fork(work: Callable[[], T], most_s: float) -> T | None:
    """Return what a function returns in a fork of this process; None when it takes too long or dies."""
    ours, theirs = CAN_FORK.Pipe(duplex=False)

    def child(answer: Connection) -> None:
        _quiet()
        answer.send(work())
        answer.close()
        os._exit(0)

    process = CAN_FORK.Process(target=child, args=(theirs,))
    process.start()
    theirs.close()
    assert process.pid is not None
    try:
        return ours.recv() if ours.poll(most_s) else None
    except EOFError:
        return None
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.join()
        ours.close()


def _fingerprint(test: Path) -> str:
    """Return what changes with the test file, the project, or what tests share."""
    files = [path for path in Path().rglob("*.py") if not path.name.startswith("test_") and "mutants" not in path.parts]
    borrowed = re.findall(r"^from (tests\.\S*\.test_\w+) import", test.read_text(encoding="utf-8"), re.MULTILINE)
    files += [Path(name.replace(".", "/") + ".py") for name in borrowed]
    digest = hashlib.sha256(repr(sys.version_info).encode())
    for path in [*sorted(files), test]:
        digest.update(f"{path}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:32]


def _learn(test: Path, sources: Sequence[str]) -> Learnt | None:
    """Run a test file once, unchanged, in a fork."""

    def work() -> Learnt | None:
        include = [str(Path.cwd() / path) for path in sources]
        recorder = coverage.Coverage(data_file=None, include=include, config_file=False)
        recording = _Recording(recorder)
        recorder.start()
        code = pytest.main([*OPTIONS, str(test)], plugins=[recording])
        recorder.stop()
        data = recorder.get_data()
        at = {}
        for path in sources:
            lines = data.contexts_by_lineno(str(Path.cwd() / path))
            at[path] = {str(line): sorted(filter(None, contexts)) for line, contexts in lines.items() if any(contexts)}
        files = {name: getattr(module, "__file__", None) or "" for name, module in list(sys.modules.items())}
        installed = [name for name, file in files.items() if "site-packages" in file]
        passed = code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        return {"at": at, "took_s": recording.took_s, "installed": installed} if passed else None

    return _in_fork(work, LEARNING_S)


def learn(tests: Sequence[str], sources: Sequence[str], store: Path) -> Known:
    """Learn what each test of a module executes, and import for later what they import beside the project.

    Args:
        tests: Files, and folders of them.
        sources: The files of the project that matter.
        store: Where to keep it, for as long as neither the test nor the project changes.

    Raises:
        AlreadyFailing: They do not pass without any change.
    """
    known = Known({path: {} for path in sources}, {})
    for test in (file for name in tests for file in (sorted(Path(name).rglob("test_*.py")) or [Path(name)])):
        kept = store / f"{_fingerprint(test)}.json"
        if kept.exists():
            learnt: Learnt | None = json.loads(kept.read_text(encoding="utf-8"))
        else:
            learnt = _learn(test, sources)
        if learnt is None:
            raise AlreadyFailing(f"without any change it does not pass: {test}")
        store.mkdir(exist_ok=True)
        kept.write_text(json.dumps(learnt), encoding="utf-8")
        known.took_s.update(learnt["took_s"])
        for path in sources:
            for line, names in learnt["at"].get(path, {}).items():
                known.tests_at[path].setdefault(int(line), set()).update(names)
        for name in learnt["installed"]:
            with contextlib.suppress(Exception), warnings.catch_warnings(action="ignore"):
                importlib.import_module(name)
    return known


def passes(tests: Sequence[str], most_s: float) -> bool | None:
    """Tell whether these tests pass, in this order; None when they take too long."""
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
    began_s = time.monotonic()
    code = _in_fork(lambda: int(pytest.main([*OPTIONS, *files], plugins=[_Chosen(tests)])), most_s)
    if code is None and time.monotonic() - began_s >= most_s:
        return None
    return code == 0


@dataclass(frozen=True, slots=True)
class Limits:
    """How much is done."""

    seconds: float = float("inf")
    """No new mutant after this."""
    patience_s: float = 60.0
    """So long may the tests of one mutant take, as they took while they were watched, which is some three times as long
    as by themselves; the slowest are left out, and what only they notice survives."""
    slack_s: float = 15.0
    """What the tests of a mutant may take beside, before it is called endless."""


def judge(mutant: Mutant, text: bytes, known: Known, sources: Mapping[str, str], limits: Limits) -> Verdict:
    """Change the file, run what can notice it, and put the file back as it was."""
    tests = known.judging(mutant, sources, limits.patience_s)
    if not tests:
        return Verdict.SURVIVED
    path = Path(mutant.path)
    stamp = path.stat()
    path.write_bytes(mutant.apply(text))
    try:
        took_s = sum(known.took_s[test] for test in tests)
        passed = passes(tests, limits.slack_s + TIMES * took_s)
    finally:
        path.write_bytes(text)
        # What was compiled from it before is still what it says.
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    return Verdict.TIMED_OUT if passed is None else Verdict.SURVIVED if passed else Verdict.KILLED
