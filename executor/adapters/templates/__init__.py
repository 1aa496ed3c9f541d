"""Texts made from the templates beside this: pages, in which what comes from outside is escaped, and a site."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterator
from enum import Enum
from functools import cache
from hashlib import sha256
from importlib import resources
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from missions.files import json_text, write_whole

STATIC = resources.files("executor.adapters") / "web" / "static"
"""What browsers are given by a flight's server, too: a page that stands alone has it inside."""
IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./([\w-]+\.js)";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=let |(?:async )?(?:class|const|function) (\w+))", re.MULTILINE)


def render_template(template: str, **content: object) -> str:
    """Return the text of a page or a file.

    Args:
        template: The name of its template.
        content: What the template shows, by the names that it uses.
    """
    return _load_environment().get_template(template).render(content)


def write_page(path: Path, text: str) -> None:
    """Write a page, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    # A vehicle's words may hold half a surrogate pair; that must not cost the page.
    write_whole(path, text.encode("utf-8", errors="xmlcharrefreplace"))


@cache
def _load_environment() -> Environment:
    found = Environment(
        loader=PackageLoader("executor.adapters"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters |= {
        "words": format_value,
        "data_url": encode_data_url,
        "json": _encode_json,
        "digest": _compute_digest,
    }
    found.filters |= {"inlined": inline_script, "static": _read_static}
    return found


@cache
def inline_script(name: str) -> str:
    """Return a module of the pages, with all that it imports before it, as a script that needs no other file."""
    return "".join(('"use strict";\nconst modules = {};\n', *_list_modules(name, set())))


def _list_modules(name: str, known: set[str]) -> Iterator[str]:
    """Yield each module that is not known as a function that is called, what it imports first."""
    known.add(name)
    text = _read_static(name)
    for _, imported in IMPORT.findall(text):
        if imported not in known:
            yield from _list_modules(imported, known)
    given = ", ".join(filter(None, EXPORT.findall(text)))  # what changes, by `let`, stays where it is
    body = EXPORT.sub("", IMPORT.sub(r'const \1 = modules["\2"];', text))
    yield f'modules["{name}"] = (() => {{\n{body}return {{ {given} }};\n}})();\n'


@cache
def _read_static(name: str) -> str:
    return STATIC.joinpath(name).read_text(encoding="utf-8")


def _encode_json(content: object) -> str:
    """Return JSON that may stand in an element: nothing in it ends one, or begins one."""
    text = json_text(content, (",", ":"))
    return text.replace("&", r"\u0026").replace("<", r"\u003c").replace(">", r"\u003e")


def _compute_digest(script: str) -> str:
    """Return what a content security policy names a script by."""
    return f"sha256-{b64encode(sha256(script.encode()).digest()).decode('ascii')}"


def format_value(value: object) -> str:
    """Return a value of a page in words.

    >>> format_value(None), format_value(True), format_value([3, 4]), format_value(211.44)
    ('unknown', 'yes', '3, 4', '211.4')
    """
    match value:
        case None:
            return "unknown"
        case Enum():
            return str(value.value)
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
        case list() | tuple():
            return ", ".join(map(format_value, value)) or "none"
        case _:
            return str(value)


def encode_data_url(content: bytes, kind: str) -> str:
    """Return the address of a content that is in the address itself."""
    return f"data:{kind};base64,{b64encode(content).decode('ascii')}"
