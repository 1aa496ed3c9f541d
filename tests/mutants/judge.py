"""Runs the tests that execute a changed line, in a fork of a process that has imported everything but the project."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import os
import re
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import TypedDict

import coverage
import pytest

from tests.mutants.forks import OPTIONS, Chosen, Died, TookTooLong, in_fork
from tests.mutants.mutate import Mutant, Verdict
from tests.mutants.quick import Collected

TIMES = 3.0
"""The tests of a mutant may take so many times what they took before, while they were watched."""
OWN = 0.2
"""A test of a file that is named like it comes before others that take more than this share of its time."""
LEARNING_S = 1800.0
FORM = 3
"""Of what is stored."""


class Learnt(TypedDict):
    """What was seen while a test file ran."""

    at: dict[str, dict[str, list[str]]]
    imported: dict[str, list[int]]
    """Lines that were executed while it was imported, with the project or alone."""
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
    imported: dict[str, set[int]]
    """By file, the lines that are executed while test files are imported."""

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
        # The quickest first; those that are named after the file know it best, and may take some time.
        own = f"/test_{Path(mutant.path).name}::"
        quickest = sorted(chosen, key=lambda test: (self.took_s[test] * (OWN if own in test else 1.0), test))
        sums_s = accumulate(self.took_s[test] for test in quickest)
        return [
            test for test, sum_s in zip(quickest, sums_s, strict=True) if sum_s <= patience_s or test == quickest[0]
        ]


class _Recording:
    """A plugin: which test executes which lines, how long it takes, and what is executed while its file is imported."""

    def __init__(self, recorder: coverage.Coverage) -> None:
        self.recorder = recorder
        self.took_s: dict[str, float] = {}
        self.failed = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector: pytest.Collector) -> Iterator[None]:
        with self._context(collector.nodeid if isinstance(collector, pytest.Module) else ""):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        with self._context(item.nodeid):
            return (yield)

    @contextlib.contextmanager
    def _context(self, name: str) -> Iterator[None]:
        self.recorder.switch_context(name)
        try:
            yield
        finally:
            self.recorder.switch_context("")

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.failed = self.failed or report.nodeid

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.took_s[report.nodeid] = self.took_s.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed = self.failed or report.nodeid


def _helpers(test: Path, seen: frozenset[Path] = frozenset()) -> frozenset[Path]:
    """Return the files of the tests that a test file imports, itself among them."""
    seen |= {test}
    for package, names in re.findall(
        r"^from (tests[\w.]*) import ([^#\n]*)", test.read_text(encoding="utf-8"), re.MULTILINE
    ):
        folder = Path(package.replace(".", "/"))
        for file in (folder.with_suffix(".py"), *(folder / f"{name}.py" for name in re.findall(r"\w+", names))):
            if file not in seen and file.exists():
                seen = _helpers(file, seen)
    return seen


def _fingerprint(test: Path) -> str:
    """Return what changes with the test file, the project, or what the test imports of other tests."""
    files = [path for path in Path().rglob("*.py") if path.parts[0] != "tests" or path.name == "conftest.py"]
    digest = hashlib.sha256(repr((FORM, sys.version_info)).encode())
    for path in [*sorted({*files, *_helpers(test)} - {test}), test]:
        digest.update(f"{path}\n".encode() + path.read_bytes())
    return digest.hexdigest()[:32]


def _learn(tests: Sequence[Path], sources: Sequence[str]) -> dict[str, Learnt] | str:
    """Run test files once, unchanged, in a fork; return what was seen of each, or a test that does not pass."""

    def work() -> dict[str, Learnt] | str:
        include = [str(Path.cwd() / path) for path in sources]
        recorder = coverage.Coverage(data_file=None, include=include, config_file=False)
        recording = _Recording(recorder)
        recorder.start()
        code = pytest.main([*OPTIONS, *map(str, tests)], plugins=[recording])
        recorder.stop()
        if recording.failed or code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            return recording.failed or f"one of {', '.join(map(str, tests))}"
        files = {name: getattr(module, "__file__", None) or "" for name, module in list(sys.modules.items())}
        installed = [name for name, file in files.items() if "site-packages" in file]
        learnt = {str(test): Learnt(at={}, imported={}, took_s={}, installed=installed) for test in tests}
        for name, took_s in recording.took_s.items():
            learnt[_file(name)]["took_s"][name] = took_s
        for path in sources:
            for line, names in recorder.get_data().contexts_by_lineno(str(Path.cwd() / path)).items():
                for name in sorted(filter(None, names)):
                    one = learnt[_file(name)]
                    if name in one["took_s"]:
                        one["at"].setdefault(path, {}).setdefault(str(line), []).append(name)
                    else:
                        one["imported"].setdefault(path, []).append(line)
        return learnt

    try:
        return in_fork(work, LEARNING_S)
    except (TookTooLong, Died):
        return f"one of {', '.join(map(str, tests))}"


def _file(test: str) -> str:
    return test.partition("::")[0]


def files_of(tests: Sequence[str]) -> list[Path]:
    """Return the test files that some files and folders are."""
    return [file for name in tests for file in (sorted(Path(name).rglob("test_*.py")) or [Path(name)])]


def learn(tests: Sequence[str], sources: Sequence[str], store: Path) -> Known:
    """Learn what each test of a module executes, and import for later what they import beside the project.

    Args:
        tests: Files, and folders of them.
        sources: The files of the project that matter.
        store: Where to keep it, for as long as neither the test nor the project changes.

    Raises:
        AlreadyFailing: They do not pass without any change.
    """
    store.mkdir(exist_ok=True)
    kept = {test: store / f"{_fingerprint(test)}.json" for test in files_of(tests)}
    if new := [test for test, file in kept.items() if not file.exists()]:
        found = _learn(new, sources)
        if isinstance(found, str):
            raise AlreadyFailing(f"without any change it does not pass: {found}")
        for test in new:
            kept[test].write_text(json.dumps(found[str(test)]), encoding="utf-8")
    known = Known({path: {} for path in sources}, {}, {path: set() for path in sources})
    installed: set[str] = set()
    for file in kept.values():
        learnt: Learnt = json.loads(file.read_text(encoding="utf-8"))
        known.took_s.update(learnt["took_s"])
        for path in sources:
            for line, names in learnt["at"].get(path, {}).items():
                known.tests_at[path].setdefault(int(line), set()).update(names)
            known.imported[path].update(learnt["imported"].get(path, []))
        installed.update(learnt["installed"])
    for name in sorted(installed):
        with contextlib.suppress(Exception), warnings.catch_warnings(action="ignore"):
            importlib.import_module(name)
    return known


def _from_anew(tests: Sequence[str], most_s: float) -> Verdict:
    """Return what these tests, in this order, make of the tree as it is now."""
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
    try:
        code = in_fork(lambda: int(pytest.main([*OPTIONS, *files], plugins=[Chosen(tests)])), most_s)
    except TookTooLong:
        return Verdict.TIMED_OUT
    except Died:
        return Verdict.KILLED
    return Verdict.SURVIVED if code == 0 else Verdict.KILLED


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


def judge(
    mutant: Mutant, text: bytes, known: Known, sources: Mapping[str, str], limits: Limits, collected: Collected
) -> Verdict:
    """Exchange a function, or change the file and put it back as it was, and run what can notice it."""
    tests = known.judging(mutant, sources, limits.patience_s)
    if not tests:
        return Verdict.SURVIVED
    most_s = limits.slack_s + TIMES * sum(known.took_s[test] for test in tests)
    verdict = collected.judged(mutant.path, mutant.apply(text), tests, most_s)
    # What a test file made of the function while it was imported did not see the change.
    unseen = known.imported[mutant.path].intersection(range(mutant.lines[0], mutant.lines[1] + 1))
    if verdict is not None and not (verdict is Verdict.SURVIVED and unseen):
        return verdict
    path = Path(mutant.path)
    stamp = path.stat()
    path.write_bytes(mutant.apply(text))
    try:
        return _from_anew(tests, most_s)
    finally:
        path.write_bytes(text)
        # What was compiled from it before is still what it says.
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
