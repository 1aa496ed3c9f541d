"""Lists the slow tests anew: `./scripts/test all --junit-xml all.xml`, then `python -m tests.durations all.xml`.

Several reports are taken together: of a part of the tests each, such as `rest`.

Tests are left out of `./scripts/test`, longest first, until the rest fits into its time. What `KEPT` names stays in,
however long it takes.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree as ET

FITS_S = 480.0
"""Seconds of all tests together that `./scripts/test` may take, on all its workers: two of them take half of it."""
ROOT = Path(__file__).parents[1]
KEPT = {
    "tests/e2e/test_fleet.py::test_a_silent_link",
    "tests/e2e/test_page_assets.py::test_missed_ones_come_first_and_red",
    "tests/e2e/test_resume.py::test_stopped_for_half_a_minute_of_the_flight",
}
"""The demo with a link lost, in real processes; a page in Chromium; a resume."""


def durations_s(*reports: Path) -> dict[str, float]:
    """Return what each test took, all its parameters together, by its name as pytest has it without parameters."""
    found: dict[str, float] = defaultdict(float)
    cases = (ET.parse(report).getroot().iter("testcase") for report in reports)  # noqa: S314 - written by pytest
    for case in chain.from_iterable(cases):
        name = case.get("name", "").partition("[")[0]
        place = case.get("classname", "").split(".")
        cuts = range(len(place), 0, -1)
        file = next((cut for cut in cuts if ROOT.joinpath(*place[:cut]).with_suffix(".py").is_file()), 0)
        classes = "".join(f"::{one}" for one in place[file:])
        found[f"{'/'.join(place[:file])}.py{classes}::{name}"] += float(case.get("time", 0.0))
    return dict(found)


def slow_tests(took_s: dict[str, float], fits_s: float = FITS_S) -> list[str]:
    """Return which tests to leave out so that the others fit, in the order of their names."""
    left_s = sum(took_s.values())
    slow = []
    for name, lasted_s in sorted(took_s.items(), key=lambda pair: -pair[1]):
        if left_s <= fits_s:
            break
        if name not in KEPT:
            slow.append(name)
            left_s -= lasted_s
    return sorted(slow)


if __name__ == "__main__":
    Path(__file__).with_name("slow.txt").write_text(
        "\n".join(slow_tests(durations_s(*map(Path, sys.argv[1:])))) + "\n", encoding="utf-8"
    )
