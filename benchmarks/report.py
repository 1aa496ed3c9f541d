"""The report of a measurement: the same content as a page of the results, as JSON, and on a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich import table
from rich.console import Console

from benchmarks.markdown import Rows, markdown_page, markdown_table
from benchmarks.store import keep_result


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a report."""

    columns: Sequence[str]
    rows: Rows
    title: str = ""
    """Heading on a terminal, where a table without a title is left out."""
    shown: int | None = None
    """Columns that fit on a terminal; all if None."""


@dataclass(frozen=True, slots=True)
class Report:
    """Content of a measurement's output and files."""

    name: str
    """Name of its files."""
    title: str
    content: Mapping[str, Any]
    parts: Sequence[str | Table]
    """Paragraphs and tables of its page; empty paragraphs are left out."""
    lines: Sequence[str] = ()
    """Lines after the tables on a terminal."""

    def page(self) -> str:
        """Return the page."""
        texts = (markdown_table(one.columns, one.rows) if isinstance(one, Table) else one for one in self.parts)
        return markdown_page(self.title, *texts)

    def keep(self, folder: Path) -> None:
        """Write NAME.json and NAME.md."""
        keep_result(self.name, self.content, self.page(), folder)

    def show(self) -> None:
        """Print the tables and lines; the page if no table is for a terminal."""
        tables = [one for one in self.parts if isinstance(one, Table) and one.title]
        if not tables and not self.lines:
            print(self.page())
        console = Console()
        for one in tables:
            console.print(_format_table(one))
        for line in self.lines:
            console.print(line, markup=False, highlight=False)


def _format_table(one: Table) -> table.Table:
    """Return a table for the terminal, with its figures right-aligned."""
    shown = table.Table(title=one.title, title_justify="left")
    for number, column in enumerate(one.columns[: one.shown]):
        shown.add_column(column, justify="right" if number else "left")
    for row in one.rows:
        shown.add_row(*row[: one.shown])
    return shown


def list_lines(heading: str, lines: Sequence[str]) -> tuple[str, str]:
    """Return a section with a list; nothing without lines."""
    return (heading, "\n".join(f"- {line}" for line in lines)) if lines else ("", "")
