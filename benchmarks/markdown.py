"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

MISSING = "-"
Rows = list[tuple[str, ...]]
"""Rows of a table, cell by cell."""


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table with all columns but the first right-aligned."""
    lines = ["| " + " | ".join(columns) + " |", "| --- |" + " ---: |" * (len(columns) - 1)]
    lines += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
    return "\n".join(lines)


def markdown_page(title: str, *parts: str) -> str:
    """Return a page of paragraphs and tables."""
    return "\n\n".join([f"# {title}", *(part for part in parts if part)]) + "\n"


def figure(value: float | None, digits: int = 1) -> str:
    """Return a figure with this number of decimals, or a dash for None."""
    if value is None:
        return MISSING
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0 else text


def percent_over(value: float | None, reference: float | None, digits: int = 2) -> str:
    """Return the signed excess of a value over a reference, in percent."""
    if value is None or reference is None or reference == 0:
        return MISSING
    return f"{100.0 * (value / reference - 1.0):+.{digits}f} %"


def _cell(value: object) -> str:
    return MISSING if value is None else str(value).replace("|", "\\|").replace("\n", " ")
