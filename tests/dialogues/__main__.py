"""Writes down what real autopilots answer, and the tables of the page about it."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from missions import dialect_for
from tests.dialogues import facts, survey
from tests.dialogues.real import real
from tests.dialogues.script import CHAPTERS
from tests.dialogues.station import Station


def record(autopilot: str, only: Sequence[str]) -> None:
    """Hold these chapters, or every one, with a real autopilot and keep the answers."""
    dialect = dialect_for(autopilot)
    answers: dict[str, facts.Chapter] = facts.real(autopilot) if only else {}
    for name in only or CHAPTERS:
        with tempfile.TemporaryDirectory() as work, real(autopilot, Path(work)) as wire:
            held = Station(wire, dialect).hold(CHAPTERS[name](dialect))
        answers[name] = {step: answer.lines() for step, answer in held.items()}
    facts.write(autopilot, answers)


def survey_all(autopilot: str) -> None:
    """Ask a real autopilot for everything and keep what it answers."""
    with tempfile.TemporaryDirectory() as work, real(autopilot, Path(work)) as wire:
        survey.write(autopilot, survey.Surveyor(wire, dialect_for(autopilot)).survey())


def document() -> None:
    """Write the page's tables."""
    page = facts.with_tables(facts.PAGE.read_text(encoding="utf-8"))
    facts.PAGE.write_text(survey.with_table(page), encoding="utf-8")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["record", autopilot, *chapters]:
            record(autopilot, chapters)
        case ["survey", autopilot]:
            survey_all(autopilot)
        case ["document"]:
            document()
        case _:
            sys.exit(
                "usage: python -m tests.dialogues record ardupilot|px4 [CHAPTER ...], survey ardupilot|px4, or document"
            )
