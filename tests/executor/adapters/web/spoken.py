"""The texts of the program that readers of its pages see, found in its source as `xgettext` would: with `{names}`."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from executor.core.interface.codes import ChecklistLine
from executor.core.interface.commands import CrewLine
from tests.test_architecture import ROOT

LINES = sorted((ROOT / "executor/core/lines").glob("[a-z]*.py"))
SILENT = {
    "compile",
    "Field",
    "Option",
    "encode",
    "removeprefix",
    "startswith",
    "endswith",
    "split",
    "partition",
    "format_count",
    "run_beside",
    "keep_going",
    "call_safely",
    "report_internal_error",
    "report_on_loop",
    "_run_job",
    "create_task",
}
"""Calls whose texts nobody reads, such as the names of what goes on beside a flight."""
HAS_WORDS = re.compile(r"[a-zA-Z]{2}")


def crew_lines() -> Iterator[str]:
    """Yield the words of every line for the crew, and of every part of one."""
    for path in LINES:
        for name, value in vars(import_module(f"executor.core.lines.{path.stem}")).items():
            if name.isupper():
                yield from _texts_of(value)


def _texts_of(value: object) -> Iterator[str]:
    if isinstance(value, CrewLine | ChecklistLine):
        yield value.words
    elif isinstance(value, str) and type(value) is str:
        yield value
    elif isinstance(value, dict):
        yield from (text for one in value.values() for text in _texts_of(one))
    elif isinstance(value, tuple):
        yield from (text for one in value for text in _texts_of(one))


@cache
def sentences(path: Path) -> frozenset[str]:
    """Return the texts of a module that have more than one word."""
    return frozenset(_read_sentences(path))


def _read_sentences(path: Path) -> Iterator[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    silent = {id(part) for node in ast.walk(tree) for part in _list_silent(node)}
    for node in ast.walk(tree):
        text = None if id(node) in silent else template_of(node)
        if text is not None and re.search(r"[a-z]{2}.* |^ .*[a-z]{2}", text):
            yield text


def _list_silent(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what a node has in it that is no text for people: documentation, and parts of a text."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        for part in node.values:
            if isinstance(part, ast.Constant):
                yield part
            elif isinstance(part, ast.FormattedValue) and part.format_spec is not None:
                yield from ast.walk(part.format_spec)
    elif isinstance(node, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if called in SILENT:
            yield from ast.walk(node)
    elif isinstance(node, ast.Subscript):
        yield from ast.walk(node.slice)


def template_of(node: ast.AST) -> str | None:
    """Return a text of the source with `{names}` for what it is given.

    >>> template_of(ast.parse('f"{area.margin_m:g} m, {len(own)}"', mode="eval").body)
    '{margin_m:g} m, {own}'
    """
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if not isinstance(node, ast.JoinedStr):
        return None
    made, names = "", dict[str, int]()
    for part in node.values:
        if isinstance(part, ast.FormattedValue):
            name = _name_of(part.value)
            names[name] = names.get(name, 0) + 1
            name = name if names[name] == 1 else f"{name}_{names[name]}"
            spec = "" if part.format_spec is None else ":" + ast.unparse(part.format_spec)[2:-1]
            made += "{" + name + (spec if re.fullmatch(r":[.\d,]*[fgd]", spec) else "") + "}"
        elif isinstance(part, ast.Constant):
            made += str(part.value)
    return made


def _name_of(node: ast.expr) -> str:
    names = [
        (part.lineno, part.end_col_offset or 0, part.attr if isinstance(part, ast.Attribute) else part.id)
        for part in ast.walk(node) if isinstance(part, ast.Attribute | ast.Name)
    ]  # fmt: skip
    return max(names)[2] if names else "value"


def counted_things(paths: Iterable[Path]) -> Iterator[str]:
    """Yield what `format_count` makes of each thing that is counted."""
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("format_count"):
                for part in ast.walk(node.args[1]):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str):
                        yield from (f"{{number:d}} {part.value}", f"{{number:d}} {part.value}s")
