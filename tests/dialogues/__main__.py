"""Writes down what real autopilots answer, and the tables of the page about it."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from missions import dialect_for
from tests.dialogues import facts
from tests.dialogues.real import real
from tests.dialogues.script import CHAPTERS
from tests.dialogues.station import Station


def record(autopilot: str) -> None:
    """Hold every chapter with a real autopilot and keep the answers."""
    dialect = dialect_for(autopilot)
    answers: dict[str, facts.Chapter] = {}
    for name, chapter in CHAPTERS.items():
        with tempfile.TemporaryDirectory() as work, real(autopilot, Path(work)) as wire:
            held = Station(wire, dialect).hold(chapter(dialect))
        answers[name] = {step: answer.lines() for step, answer in held.items()}
    facts.write(autopilot, answers)


def document() -> None:
    """Write the page's tables."""
    facts.PAGE.write_text(facts.with_tables(facts.PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["record", autopilot]:
            record(autopilot)
        case ["document"]:
            document()
        case _:
            sys.exit("usage: python -m tests.dialogues record ardupilot|px4, or document")
