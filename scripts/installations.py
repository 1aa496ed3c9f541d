"""The table of docs/results/install.md: ``python -m scripts.installations FOUND.xml ...``.

The files are what ``pytest --junit-xml`` wrote of tests/e2e/test_wheel.py; ``./scripts/try-install`` prints the table.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

_CASE = re.compile(r"test_(\w+)\[python(3\.\d+) (lowest-direct|highest)\]")
_WORDS = {"lowest-direct": "lowest", "highest": "newest"}


def make_table(found: Iterable[Path]) -> str:
    """Return a column for each environment and a row for each test in it, in Markdown.

    The first row has the versions that were installed. Of a test that was run twice the last run counts.
    """
    rows: dict[str, dict[str, str]] = {"versions": {}}
    columns: dict[str, None] = {}
    for case in (case for path in found for case in ET.parse(path).iter("testcase")):  # noqa: S314 - pytest wrote it
        if (named := _CASE.fullmatch(case.get("name", ""))) is None:
            continue
        column = f"{named[2]}, {_WORDS[named[3]]}"
        columns[column] = None
        unlike = {one.tag for one in case} & {"failure", "error", "skipped"}
        rows.setdefault(named[1].replace("_", " "), {})[column] = unlike.pop() if unlike else "yes"
        for written in case.iter("property"):
            rows[written.get("name", "")][column] = written.get("value", "")
    lines = [["", *columns], ["---"] * (len(columns) + 1)]
    lines += [[name, *(cells.get(column, "not run") for column in columns)] for name, cells in rows.items()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    print(make_table(map(Path, sys.argv[1:])), end="")
