"""Chooses mutants, judges them, and says what became of them."""

from __future__ import annotations

import random
import sys
import time
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.mutants.judge import AlreadyFailing, Known, Limits, files_of, judge, learn
from tests.mutants.modules import Module
from tests.mutants.mutate import Mutant, Verdict, mutants, readable
from tests.mutants.quick import Collected

EQUIVALENTS = Path(__file__).with_name("equivalents.toml")
TOLD_S = 30.0
Key = tuple[str, str, str]
"""Where a change is, as FILE:FUNCTION, and its line before and after."""


class BadList(Exception):
    """The list of equivalent changes is not what it should be."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A change of a file of a module."""

    module: str
    mutant: Mutant
    text: bytes

    @property
    def key(self) -> Key:
        """What names it for as long as its line stays as it is."""
        return (f"{self.mutant.path}:{self.mutant.within}", *self.mutant.difference(self.text))

    def shown(self) -> str:
        """Return it as lines for a reader."""
        _, before, after = self.key
        return f"{self.mutant.path}:{self.mutant.line} in {self.mutant.within or 'the module'}\n- {before}\n+ {after}"


@dataclass(slots=True)
class Results:
    """What became of the mutants."""

    judged: list[tuple[Candidate, Verdict]] = field(default_factory=list)

    def rate(self, module: str | None = None) -> float:
        """Return the share of those that can be noticed and were."""
        count = self.counts(module)
        noticed = count[Verdict.KILLED] + count[Verdict.TIMED_OUT]
        return noticed / (noticed + count[Verdict.SURVIVED]) if noticed + count[Verdict.SURVIVED] else 1.0

    def counts(self, module: str | None = None) -> Counter[Verdict]:
        """Return how many there are of each."""
        return Counter(verdict for one, verdict in self.judged if module in (None, one.module))

    def lines(self) -> list[str]:
        """Return the table."""
        head = ("mutants", "killed", "survived", "timed out", "equivalent", "rate")
        rows = [f"{'module':<10}" + "".join(f"{title:>11}" for title in head)]
        names = list(dict.fromkeys(one.module for one, _ in self.judged))
        for name, module in [*((name, name) for name in names), ("all", None)]:
            count = self.counts(module)
            kinds = (Verdict.KILLED, Verdict.SURVIVED, Verdict.TIMED_OUT, Verdict.EQUIVALENT)
            numbers = "".join(f"{number:>11}" for number in (count.total(), *(count[kind] for kind in kinds)))
            rows.append(f"{name:<10}{numbers}{self.rate(module):>11.1%}")
        return rows


def candidates(modules: Mapping[str, Module], root: Path) -> list[Candidate]:
    """Return every change of every file of these modules."""
    found = []
    for name, module in modules.items():
        for path in module.paths(root):
            text = (root / path).read_bytes()
            found += [Candidate(name, mutant, text) for mutant in mutants(path, text)]
    return found


def at_place(found: Sequence[Candidate], place: str) -> list[Candidate]:
    """Return the changes of one file, or of one line of it: FILE or FILE:LINE."""
    path, _, line = place.partition(":")
    return [one for one in found if one.mutant.path == path and line in ("", str(one.mutant.line))]


def chosen(found: Sequence[Candidate], count: int, seed: int) -> list[Candidate]:
    """Return so many of them in an order that a seed decides."""
    some: list[Candidate] = []
    for one in random.Random(seed).sample(found, len(found)):
        if len(some) == count:
            break
        if readable(one.mutant, one.text):
            some.append(one)
    return some


def equivalents(path: Path, found: Sequence[Candidate]) -> dict[Key, str]:
    """Read the changes that no test can notice, each with its reason.

    Raises:
        BadList: One of them has no reason, or is no change that can be made any more.
    """
    known: dict[Key, str] = {}
    there = {one.key for one in found}
    for number, entry in enumerate(tomllib.loads(path.read_text(encoding="utf-8")).get("equivalent", []), start=1):
        missing = {"in", "before", "after", "reason"} - {name for name, value in entry.items() if value}
        if missing:
            raise BadList(f"{path.name}: equivalent {number}: expected {', '.join(sorted(missing))}")
        key = (entry["in"], entry["before"], entry["after"])
        if key not in there:
            raise BadList(
                f"{path.name}: equivalent {number}: {entry['in']} has no such change any more: {entry['before']}"
            )
        known[key] = entry["reason"]
    return known


def run(
    todo: Sequence[Candidate], modules: Mapping[str, Module], reasons: Mapping[Key, str], store: Path, limits: Limits
) -> Results:
    """Judge the mutants in the tree that is the working directory; print what survives."""
    results, began_s = Results(), time.monotonic()
    learnt: dict[str, tuple[Known, Collected]] = {}
    told_s = began_s
    root = Path.cwd()
    sources = {
        str(path.relative_to(root)): path.read_text(encoding="utf-8")
        for name in sorted({one.module for one in todo})
        for path in sorted(path for pattern in modules[name].readers for path in root.glob(pattern))
    }
    for one in todo:
        if time.monotonic() - began_s >= limits.seconds:
            break
        if one.key in reasons:
            results.judged.append((one, Verdict.EQUIVALENT))
            continue
        if one.module not in learnt:
            learnt[one.module] = _ready(modules[one.module], list(sources), store)
        known, collected = learnt[one.module]
        verdict = judge(one.mutant, one.text, known, sources, limits, collected)
        results.judged.append((one, verdict))
        if verdict is Verdict.SURVIVED:
            print(f"{one.shown()}\n", flush=True)
        if time.monotonic() - told_s >= TOLD_S:
            told_s = time.monotonic()
            print(f"  {len(results.judged)} of {len(todo)}, {results.rate():.0%} noticed", file=sys.stderr, flush=True)
    for _, collected in learnt.values():
        collected.end()
    return results


def _ready(module: Module, sources: list[str], store: Path) -> tuple[Known, Collected]:
    known = learn(module.tests, sources, store)
    collected = Collected(tuple(sources))
    if not collected.begin([str(file) for file in files_of(module.tests)]):
        raise AlreadyFailing("without any change the tests cannot be collected")
    return known, collected
