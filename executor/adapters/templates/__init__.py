"""Texts made from the templates beside this: pages, in which what comes from outside is escaped, and a site."""

from __future__ import annotations

from base64 import b64encode
from enum import Enum
from functools import cache
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from missions.files import write_whole


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
    found.filters |= {"words": format_value, "data_url": _encode_data_url}
    found.tests |= {"figure": _is_figure}
    return found


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


def _is_figure(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _encode_data_url(content: bytes, kind: str) -> str:
    return f"data:{kind};base64,{b64encode(content).decode('ascii')}"
