"""The reference of the library, made from the docstrings of what `faultline` offers."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass
from enum import Enum

import faultline
from executor.adapters.run_directory import Document
from executor.site.site_schema import read_docstrings

PAGE = "reference/library.md"
HEAD = """\
# Library

`import faultline` is the program as a library; [Use it as a library](../how-to/library.md) shows it by example. The
names on this page are stable: they change their meaning only with the major version. Every name has types (`py.typed`).

"""
SECTION = re.compile(r"^(Args|Raises):$", re.MULTILINE)
LONGEST = 100
"""Letters of a signature that stands in one line."""
ENTRY = re.compile(r"^    (\w+): ", re.MULTILINE)


def library_page(made: str) -> str:
    """Return the page; `made` is the comment that says how."""
    functions = [name for name in faultline.__all__ if inspect.isfunction(getattr(faultline, name))]
    kinds = [name for name in faultline.__all__ if inspect.isclass(getattr(faultline, name))]
    values = [name for name in faultline.__all__ if name not in {*functions, *kinds}]
    lines = ["## Functions", *(line for name in functions for line in _function(name, getattr(faultline, name)))]
    lines += ["", "## Classes", *(line for name in kinds for line in _class(name, getattr(faultline, name)))]
    lines += ["", "## Values", "", "| name | holds |", "| --- | --- |"]
    lines += [f"| `{name}` | {VALUES[name]} |" for name in values]
    return f"{made}\n\n{HEAD}" + "\n".join(lines) + "\n"


VALUES = {
    "ERRORS": "what bad input raises, to be caught together (`except faultline.ERRORS`); the text is one line",
    "PRESETS": "the energy models of drones by name, for `travel_for`",
    "__version__": "the version of faultline, as `faultline --version` prints it",
}


def _function(name: str, function: Callable[..., object]) -> Iterator[str]:
    signature = inspect.signature(function)
    words, keyword = list[str](), False
    for one in signature.parameters.values():
        if one.kind is one.KEYWORD_ONLY and not keyword:
            words, keyword = [*words, "*"], True
        default = "" if one.default is one.empty else f" = {_default(one.default)}"
        words.append(f"{one.name}: {one.annotation}{default}")
    returned = f") -> {signature.return_annotation}"
    whole = f"faultline.{name}({', '.join(words)}{returned}"
    broken = [f"faultline.{name}(", *(f"    {one}," for one in words), returned]
    yield from ("", f"### {name}", "", "```python", *([whole] if len(whole) <= LONGEST else broken), "```")
    yield from ("", _text(function))


def _default(value: object) -> str:
    if is_dataclass(value):
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
    bases = [one for one in reversed(kind.__mro__) if is_dataclass(one) or issubclass(one, Document)]
    modules = {sys.modules[one.__module__] for one in bases}
    words = {(one, key): text for module in modules for one, key, text in read_docstrings(module)}
    rows = {}
    for base in bases:
        for key, held in base.__annotations__.items():
            if key[0] != "_" and not held.startswith("ClassVar"):
                rows[key] = (_plain(held), words.get((base.__name__, key), ""))
        for key, held in vars(base).items():
            getter = getattr(held, "fget", getattr(held, "func", None))
            if key[0] != "_" and inspect.isfunction(getter):
                rows[key] = (getter.__annotations__["return"], (inspect.getdoc(getter) or "").partition("\n")[0])
    yield from ("", "| attribute | type | |", "| --- | --- | --- |")
    yield from (f"| `{key}` | `{_cell(held)}` | {_cell(text)} |" for key, (held, text) in rows.items())


def _plain(annotation: str) -> str:
    """Return a type without what a document asks of its values.

    >>> _plain("Annotated[tuple[int, str], Field(min_length=1)]"), _plain("int | None")
    ('tuple[int, str]', 'int | None')
    """
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
