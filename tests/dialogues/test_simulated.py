"""The simulated autopilots answer as the real ones did, but for the differences that are listed."""

from __future__ import annotations

import pytest

from missions import dialect_for
from simulator.config import AutopilotKind
from tests.dialogues import facts, survey
from tests.dialogues.script import CHAPTERS
from tests.dialogues.station import Station
from tests.dialogues.wires import SimulatedWire


@pytest.mark.parametrize("chapter", CHAPTERS)
@pytest.mark.parametrize("kind", AutopilotKind, ids=lambda kind: kind.value)
def test_a_simulated_autopilot_answers_as_the_real_one(kind: AutopilotKind, chapter: str) -> None:
    dialect = dialect_for(kind.value)
    held = Station(SimulatedWire(kind), dialect).hold(CHAPTERS[chapter](dialect))
    assert {step: answer.lines() for step, answer in held.items()} == facts.expected(kind.value)[chapter]


@pytest.mark.parametrize("autopilot", facts.VERSIONS)
def test_every_difference_is_one_and_has_a_reason(autopilot: str) -> None:
    steps = {step for chapter in facts.real(autopilot).values() for step in chapter}
    for step, difference in facts.DIFFERENCES[autopilot].items():
        assert step in steps
        assert difference.line != difference.simulated
        assert difference.reason in facts.PAGE.read_text(encoding="utf-8")


def test_the_page_shows_the_answers() -> None:
    page = facts.PAGE.read_text(encoding="utf-8")
    assert facts.with_tables(page) == page


def test_the_page_shows_what_the_real_ones_answer_alone() -> None:
    page = facts.PAGE.read_text(encoding="utf-8")
    assert survey.with_table(page) == page
