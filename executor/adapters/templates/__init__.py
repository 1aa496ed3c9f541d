"""Render the templates in this package: pages, in which outside data is escaped, and a site file."""

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
"""Files of a flight's server for browsers; a stand-alone page includes them."""
IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./([\w-]+\.js)";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=let |(?:async )?(?:class|const|function) (\w+))", re.MULTILINE)


def render_template(template: str, **content: object) -> str:
    """Return the text of a page or a file.

    Args:
        template: Name of the template.
        content: Values for the template, by name.
    """
    return _load_environment().get_template(template).render(content)


def write_page(path: Path, text: str) -> None:
    """Write a page, whole or not at all.

    Raises:
        OSError: The file cannot be written.
    """
    # A vehicle's text may hold half a surrogate pair; that must not cost the page.
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
    """Return a module of the pages and all its imports as one script that needs no other file."""
    return "".join(('"use strict";\nconst modules = {};\n', *_list_modules(name, set())))


def _list_modules(name: str, known: set[str]) -> Iterator[str]:
    """Yield each new module as a function that is called, after its imports."""
    known.add(name)
    text = _read_static(name)
    for _, imported in IMPORT.findall(text):
        if imported not in known:
            yield from _list_modules(imported, known)
    given = ", ".join(filter(None, EXPORT.findall(text)))  # mutable values, declared with `let`, stay in place
    body = EXPORT.sub("", IMPORT.sub(r'const \1 = modules["\2"];', text))
    yield f'modules["{name}"] = (() => {{\n{body}return {{ {given} }};\n}})();\n'


@cache
def _read_static(name: str) -> str:
    return STATIC.joinpath(name).read_text(encoding="utf-8")


def _encode_json(content: object) -> str:
    """Return JSON that is safe inside an element: it neither ends nor begins one."""
    text = json_text(content, (",", ":"))
    return text.replace("&", r"\u0026").replace("<", r"\u003c").replace(">", r"\u003e")


def _compute_digest(script: str) -> str:
    """Return the digest that identifies a script in a content security policy."""
    return f"sha256-{b64encode(sha256(script.encode()).digest()).decode('ascii')}"


def format_value(value: object) -> str:
    """Return a page's value in words.

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
    """Return a data URL with a content."""
    return f"data:{kind};base64,{b64encode(content).decode('ascii')}"
