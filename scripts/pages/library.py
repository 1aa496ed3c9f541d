"""References of the library and of the fleet for tests, generated from docstrings."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass
from enum import Enum
from types import ModuleType

import faultline
from executor.adapters.run_directory import Document
from executor.site.site_schema import read_docstrings
from simulator import testing

PAGE = "reference/library.md"
HEAD = """\
# Library

`import faultline` is the program as a library; [Use it as a library](../how-to/library.md) shows it by example. The
names on this page are stable: they change their meaning only with the major version. Every name has types (`py.typed`).

"""
TESTING_PAGE = "reference/test-fleet.md"
TESTING_HEAD = """\
# The simulated fleet for tests

`from simulator.testing import fleet`; [Test your own program with a simulated fleet](../how-to/test-a-fleet.md) shows
it by example. In pytest there are also the fixture `simulated_fleet`, a fleet in a thread of its own that the mark of
the same name orders, and the mark `virtual_time(limit_s=3600)`, which runs an async test in time that jumps.

"""
SECTION = re.compile(r"^(Args|Raises):$", re.MULTILINE)
LONGEST = 100
"""Maximum characters of a signature on one line."""
MODULE = re.compile(r"\bplan_parts\.")
ENTRY = re.compile(r"^    (\w+): ", re.MULTILINE)


def library_page(made: str) -> str:
    """Return the page of the library; `made` is the comment that it is generated."""
    values = [f"| `{name}` | {VALUES[name]} |" for name in faultline.__all__ if name in VALUES]
    lines = [*_members(faultline, "faultline."), "", "## Values", "", "| name | holds |", "| --- | --- |", *values]
    return f"{made}\n\n{HEAD}" + "\n".join(lines) + "\n"


def testing_page(made: str) -> str:
    """Return the page of the fleet for tests."""
    return f"{made}\n\n{TESTING_HEAD}" + "\n".join(_members(testing, "")) + "\n"


def _members(module: ModuleType, before: str) -> Iterator[str]:
    offered = [(name, getattr(module, name)) for name in module.__all__]
    yield "## Functions"
    for name, one in offered:
        if inspect.isfunction(one):
            yield from _function(f"{before}{name}", one, "###")
    yield from ("", "## Classes")
    for name, one in offered:
        if inspect.isclass(one):
            yield from _class(name, one)


VALUES = {
    "ERRORS": "what bad input raises, to be caught together (`except faultline.ERRORS`); the text is one line",
    "PRESETS": "the energy models of drones by name, for `travel_for`",
    "__version__": "the version of faultline, as `faultline --version` prints it",
}


def _function(name: str, function: Callable[..., object], heading: str) -> Iterator[str]:
    signature = inspect.signature(function)
    words, keyword = list[str](), False
    for one in signature.parameters.values():
        if one.name == "self":
            continue
        if one.kind is one.KEYWORD_ONLY and not keyword:
            words, keyword = [*words, "*"], True
        default = "" if one.default is one.empty else f" = {_default(one.default)}"
        words.append(f"{one.name}: {one.annotation}{default}")
    returned = f") -> {signature.return_annotation}"
    name = ("async " if inspect.iscoroutinefunction(function) else "") + name
    whole = f"{name}({', '.join(words)}{returned}"
    broken = [f"{name}(", *(f"    {one}," for one in words), returned]
    shown = [whole] if len(whole) <= LONGEST else broken
    yield from ("", f"{heading} {function.__name__}", "", "```python", *shown, "```", "", _text(function))


def _default(value: object) -> str:
    if is_dataclass(value) or inspect.isfunction(value):
        return "..."
    return str(value) if isinstance(value, Enum) else repr(value)


def _text(documented: object) -> str:
    """Return a docstring as Markdown: its sections become lists."""
    first, *sections = SECTION.split(inspect.getdoc(documented) or "")
    text = first.strip()
    for heading, body in zip(sections[::2], sections[1::2], strict=True):
        rows = re.sub(r"\n {8}", " ", ENTRY.sub(r"- `\1`: ", body.strip("\n")))
        text += f"\n\n{'Parameters' if heading == 'Args' else heading}:\n\n{rows.strip()}"
    return text


def _class(name: str, kind: type) -> Iterator[str]:
    yield from ("", f"### {name}", "", _text(kind))
    if issubclass(kind, Enum):
        yield from ("", ", ".join(f"`{one.name}`" for one in kind))
        return
    bases = [one for one in kind.__mro__[::-1] if is_dataclass(one) or issubclass(one, Document) or one is kind]
    modules = {sys.modules[one.__module__] for one in bases}
    words = {(one, key): text for module in modules for one, key, text in read_docstrings(module)}
    rows = {}
    for base in bases:
        for key, held in getattr(base, "__annotations__", {}).items():
            if key[0] != "_" and not held.startswith("ClassVar"):
                rows[key] = (_plain(held), words.get((base.__name__, key), ""))
        # A copy: a model is built when it is first looked at, which adds to it.
        for key, held in tuple(vars(base).items()):
            getter = getattr(held, "fget", getattr(held, "func", None))
            if key[0] != "_" and inspect.isfunction(getter):
                rows[key] = (
                    _plain(getter.__annotations__["return"]),
                    (inspect.getdoc(getter) or "").partition("\n")[0],
                )
    yield from ("", "| attribute | type | |", "| --- | --- | --- |")
    yield from (f"| `{key}` | `{_cell(held)}` | {_cell(text)} |" for key, (held, text) in rows.items())
    if kind.__module__ == testing.__name__:
        for key, held in vars(kind).items():
            if key[0] != "_" and inspect.isfunction(held):
                yield from _function(f"{(name.removeprefix('Fleet') or name).lower()}.{key}", held, "####")


def _plain(annotation: str) -> str:
    """Return a type without constraints on its values, and without the modules of our own types.

    >>> _plain("Annotated[tuple[int, str], Field(min_length=1)]"), _plain("plan_parts.Pad | None")
    ('tuple[int, str]', 'Pad | None')
    """
    annotation = MODULE.sub("", annotation)
    held = annotation.removeprefix("Annotated[")
    if held == annotation:
        return held
    depth = 0
    for place, letter in enumerate(held):
        depth += {"[": 1, "]": -1}.get(letter, 0)
        if letter == "," and not depth:
            return held[:place]
    return held


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
