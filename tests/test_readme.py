"""README is true: its figures are on the linked pages, and its lines are the program's."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MEASURED = re.findall(r"^\| (.+?) \| .+? \| \[.+?\]\((docs/results/.+?)\) \|$", README, re.MULTILINE)
RESULTS = (ROOT / "docs" / "results" / "index.md").read_text(encoding="utf-8")
COMMITS = re.findall(r"^\| .+? \| .+? \| ([0-9a-f, ]{7,}) \| (.+?) \|$", RESULTS, re.MULTILINE)
"""The commits of a row of all results, and the pages that it links."""
PRINTED = re.findall(r"```text\n(.*?)```", README, re.DOTALL)
FIGURE = re.compile(r"\d+(?:\.\d+)?")
MARK = re.compile(r"^ *(?:ok|warn|STOP) ")
CHANGES = re.compile(r"\d+ (?:more )?segments?|uav\d+|run\d+|\w+\.\w+|[\d.,:;%()+]+")
"""What differs from flight to flight in a line: names, times, numbers and counts, and the marks between them."""


@cache
def source() -> str:
    """Return the whole program, with texts that go over several lines joined."""
    texts = [
        path.read_text(encoding="utf-8")
        for package in ("executor", "missions", "planner")
        for path in sorted((ROOT / package).rglob("*.py"))
    ]
    return re.sub(r'"\s*\n\s*f?"', "", "\n".join(texts))


def test_it_fits_on_a_few_screens() -> None:
    assert len(README.splitlines()) <= 100


def test_what_it_was_flown_on_stands_on_the_first_screen() -> None:
    top = "\n".join(README.splitlines()[:15])
    for word in ("Status", "simulation only", "PX4 1.17", "ArduPilot Copter 4.7-dev", "Never on a real aircraft"):
        assert word in top


def test_there_are_figures_and_lines_to_hold() -> None:
    assert len(MEASURED) == 5
    assert len(PRINTED) == 1
    assert len(PRINTED[0].splitlines()) >= 10


@pytest.mark.parametrize(("said", "page"), MEASURED)
def test_a_figure_stands_on_the_page_that_it_links(said: str, page: str) -> None:
    """Counts in the words of the table, such as '3 vehicles', are figures too."""
    shown = set(FIGURE.findall((ROOT / page).read_text(encoding="utf-8")))
    assert set(FIGURE.findall(said)) - shown == set()


@pytest.mark.parametrize(("commits", "pages"), COMMITS)
def test_a_result_is_of_the_commit_that_its_page_names(commits: str, pages: str) -> None:
    texts = [(ROOT / "docs" / "results" / page).read_text(encoding="utf-8") for page in re.findall(r"\((.+?)\)", pages)]
    assert [commit for commit in commits.split(", ") if not any(commit in text for text in texts)] == []


@pytest.mark.parametrize("line", PRINTED[0].splitlines())
def test_a_line_of_the_demo_is_one_that_the_program_says(line: str) -> None:
    program = source()
    constant = [words for piece in CHANGES.split(MARK.sub("", line)) if len(words := piece.strip()) >= 6]
    assert constant
    assert [words for words in constant if words not in program] == []
