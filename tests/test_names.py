"""One name for one thing: what is defined more than once across the packages stands here, with its reason."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("planner", "missions", "simulator", "executor", "benchmarks")
APART = ("simulator/", "executor/cli/", "benchmarks/")
"""The simulator shares nothing with what flies it: it speaks the same protocol in words of its own. A function of the
command line is called as the agreement calls its command. Benchmarks are never imported by what they measure."""
REASONS = {
    "Mode": "each simulated autopilot has its own",
    "land_goal": "each simulated autopilot has its own",
    "make": "what every part of the measurements has",
    "report": "what every part of the measurements has",
    "Sortie": "one of a day's plan, and what has become of the one in flight",
    "disarm": "the order, and the dialogue that gives it",
}


def defined() -> Iterator[tuple[str, str]]:
    """Yield every public name at the top of a module, with its file."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                match node:
                    case ast.ClassDef(name) | ast.FunctionDef(name) | ast.AsyncFunctionDef(name) if name[0] != "_":
                        yield name, str(path.relative_to(ROOT))


def twice() -> dict[str, list[str]]:
    """Return the names that two rooms define, or one room that keeps apart defines twice."""
    found: dict[str, list[str]] = defaultdict(list)
    for name, file in defined():
        found[name].append(file)
    rooms = {
        name: [next((one for one in APART if file.startswith(one)), "") for file in files]
        for name, files in found.items()
    }
    return {name: found[name] for name, where in rooms.items() if len(where) > len(set(where))}


def test_no_name_is_defined_twice_without_a_reason() -> None:
    assert {name: files for name, files in twice().items() if name not in REASONS} == {}


def test_every_reason_is_of_a_name_that_is_there_twice() -> None:
    assert set(REASONS) <= set(twice())
