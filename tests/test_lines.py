"""Every line for the crew gets exactly the values that its template names."""

from __future__ import annotations

import ast
import string
from collections import defaultdict
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from executor.core.interface.codes import Check, CheckCode, ChecklistLine, Severity
from executor.core.interface.commands import CrewLine, Level, Say
from tests.test_architecture import ROOT, modules

LINES = {
    (path.stem, name): line.words if isinstance(line, CrewLine | ChecklistLine) else str(line)
    for path in (ROOT / "executor/core/lines").glob("[a-z]*.py")
    for name, line in vars(import_module(f"executor.core.lines.{path.stem}")).items()
    if name.isupper() and not isinstance(line, Level | Severity)
}
"""The words of each line, and of each part of one."""


def names(words: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(words) if name}


def constants(node: ast.expr) -> Iterator[tuple[str, str]]:
    """Yield `subject.NAME` of every line that an expression may be."""
    for part in ast.walk(node):
        if isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name):
            yield part.value.id, part.attr


def said(path: Path) -> Iterator[tuple[int, tuple[str, str], set[str]]]:
    """Yield each `subject.NAME.say(name=value)`, and each `format` of a part, of a file with its names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in {"say", "format"}:
            for line in constants(node.func.value):
                if line in LINES:
                    yield node.lineno, line, {word.arg for word in node.keywords if word.arg}


@pytest.mark.parametrize("path", modules("executor"), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_line_gets_a_value_for_each_of_its_names(path: Path) -> None:
    for number, line, given in said(path):
        missing = names(LINES[line]) - given
        assert not missing, f"{path}:{number}: {'.'.join(line)} says {missing}, which it is not given"


def test_every_line_is_used() -> None:
    texts = "\n".join(path.read_text(encoding="utf-8") for path in modules("executor"))
    assert [line for line in LINES if f"{line[0]}.{line[1]}" not in texts] == []


def test_a_line_has_its_level_or_another_one() -> None:
    line = CrewLine(Level.INFO, "{vehicle}: landed with {left_pct:.0f} %")
    assert line.say(vehicle="uav1", left_pct=61.4) == Say(Level.INFO, "uav1: landed with 61 %")
    assert line.with_level(Level.WARNING).say(vehicle="uav1", left_pct=61.4).level is Level.WARNING


def test_a_line_of_the_checklist_has_its_severity_or_another() -> None:
    line = ChecklistLine(Severity.OK, CheckCode.ENERGY, "battery {left_pct:.0f} %")
    assert line.say("uav1", left_pct=61.4) == Check(Severity.OK, "uav1", "battery 61 %", CheckCode.ENERGY)
    assert line.say("uav1", Severity.STOP, left_pct=61.4).severity is Severity.STOP


def test_no_words_are_written_twice() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for path in sorted((ROOT / "executor/core/lines").glob("[a-z]*.py")):
        for assigned in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(assigned, ast.Assign):
                for part in ast.walk(assigned.value):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str) and " " in part.value:
                        places[part.value].append(path.stem)
    assert {words: where for words, where in places.items() if len(where) > 1} == {}
