"""One name for one thing: what is defined more than once across the packages stands here, with its reason."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("planner", "missions", "executor")
SIMULATOR = "executor/simulator/"
"""Shares nothing with what flies it: it speaks the same protocol, in words of its own."""
MODES = "executor/simulator/{ardupilot,modes_px4}.py: each autopilot's own modes"
REASONS = {"Mode": MODES}


def defined(
    kind: type[ast.ClassDef] | tuple[type[ast.FunctionDef], type[ast.AsyncFunctionDef]],
) -> dict[str, list[str]]:
    """Return every public name of a kind at the top of a module, with the files that define it."""
    found = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, kind) and not node.name.startswith("_"):
                    found[node.name].append(str(path.relative_to(ROOT)))
    return found


def test_no_class_has_the_name_of_another() -> None:
    twice = {
        name: files
        for name, files in defined(ast.ClassDef).items()
        if len([file for file in files if not file.startswith(SIMULATOR)]) > 1 or (len(files) > 2)
    }
    assert {name: files for name, files in twice.items() if name not in REASONS} == {}


def test_the_reasons_are_of_names_that_are_there_twice() -> None:
    there = {name for name, files in defined(ast.ClassDef).items() if len(files) > 1}
    assert set(REASONS) <= there
