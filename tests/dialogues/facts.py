"""What the real autopilots answered, as text files that people can read, and where the simulated ones differ.

`python -m tests.dialogues record AUTOPILOT` writes such a file anew with the autopilot that the environment names, and
`python -m tests.dialogues document` the tables of docs/dialogues.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.dialogues.script import CHAPTERS

ANSWERS = Path(__file__).parent / "answers"
VERSIONS = {"ardupilot": "ArduPilot Copter 4.7.0-dev", "px4": "PX4 v1.17.0"}
PAGE = Path(__file__).parents[2] / "docs" / "dialogues.md"
BEGIN, END = "<!-- answers: {chapter} -->\n", "<!-- end -->\n"

Lines = tuple[str, ...]
Chapter = Mapping[str, Lines]


@dataclass(frozen=True, slots=True)
class Difference:
    """A step that a simulated autopilot answers otherwise than the real one, on purpose."""

    line: str
    """Of the real answer."""
    simulated: str
    """What stands there instead."""
    reason: str


CAPABILITIES = "a simulated vehicle reports only what it can do"
PARAMETERS = "a simulated vehicle has fewer parameters"
DIFFERENCES: Mapping[str, Mapping[str, Difference]] = {
    "ardupilot": dict.fromkeys(
        (
            "request the version", "request the version the old way", "command to another component",
            "command to every component",
        ),
        Difference(
            "AUTOPILOT_VERSION 4.7.0 DEV, capabilities 0 1 2 3 5 6 7 8 9 11 12 13 14 15",
            "AUTOPILOT_VERSION 4.7.0 DEV, capabilities 0 1 2 3 5 7 8 13 14 15",
            CAPABILITIES,
        ),
    ) | {"parameters": Difference(r"FILE OPENFILERO '0?||'", r"FILE OPENFILERO 'L\x02||'", PARAMETERS)},
    "px4": dict.fromkeys(
        ("request the version", "request the version the old way", "command to every component"),
        Difference(
            "AUTOPILOT_VERSION 1.17.0 OFFICIAL, capabilities 0 1 2 3 4 5 6 7 11 13 14 15",
            "AUTOPILOT_VERSION 1.17.0 OFFICIAL, capabilities 0 1 2 3 4 5 7 13 14 15",
            CAPABILITIES,
        ),
    ),
}  # fmt: skip


def real(autopilot: str) -> dict[str, Chapter]:
    """Return what the real autopilot answered: chapter, step, lines."""
    chapters: dict[str, dict[str, Lines]] = {}
    step = ""
    for line in (ANSWERS / f"{autopilot}.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            chapter = chapters.setdefault(line[2:], {})
        elif line.startswith("    "):
            chapter[step] = (*chapter[step], line[4:])
        elif line:
            step = line
            chapter[step] = ()
    return dict(chapters)


def expected(autopilot: str) -> dict[str, Chapter]:
    """Return what the simulated autopilot answers: the same, but for the differences."""
    known = DIFFERENCES[autopilot]
    return {
        name: {step: _changed(lines, known.get(step)) for step, lines in chapter.items()}
        for name, chapter in real(autopilot).items()
    }


def _changed(lines: Lines, difference: Difference | None) -> Lines:
    if difference is None:
        return lines
    assert difference.line in lines, f"the real autopilot does not answer {difference.line!r} any more"
    return tuple(difference.simulated if line == difference.line else line for line in lines)


def write(autopilot: str, chapters: Mapping[str, Chapter]) -> None:
    """Write what a real autopilot answered."""
    parts = []
    for name, chapter in chapters.items():
        parts.append(f"# {name}\n")
        parts += ["\n".join([step, *(f"    {line}" for line in lines)]) + "\n" for step, lines in chapter.items()]
    (ANSWERS / f"{autopilot}.txt").write_text("\n".join(parts), encoding="utf-8")


def table(chapter: str) -> str:
    """Return the answers to a chapter as a table for the page."""
    answers = {autopilot: real(autopilot)[chapter] for autopilot in VERSIONS}
    steps = next(iter(answers.values()))
    lines = [f"| step | {' | '.join(VERSIONS.values())} |", "| --- | --- | --- |"]
    lines += [f"| {step} | {' | '.join(_cell(answers[name][step]) for name in VERSIONS)} |" for step in steps]
    return "\n".join(lines) + "\n"


def _cell(lines: Lines) -> str:
    return "<br>".join(_italic(line) for line in lines) or "nothing"


def _italic(line: str) -> str:
    return f"*{line[2:]}*" if line.startswith("= ") else line


def with_tables(page: str) -> str:
    """Return the page with the tables as they should be."""
    for chapter in CHAPTERS:
        begin = BEGIN.format(chapter=chapter)
        head, found, rest = page.partition(begin)
        assert found, f"the page has no place for the chapter {chapter}"
        page = head + begin + table(chapter) + END + rest.partition(END)[2]
    return page
