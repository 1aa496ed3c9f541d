"""What real autopilots answer is what is written down: FAULTLINE_ARDUCOPTER and FAULTLINE_PX4 name their binaries."""

from __future__ import annotations

from pathlib import Path

import pytest

from missions import dialect_for
from tests.dialogues import facts
from tests.dialogues.real import VARIABLES, binary, real
from tests.dialogues.script import CHAPTERS
from tests.dialogues.station import Station

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]
TRIES = 2
"""A computer that is busy answers late and loses datagrams; what an autopilot does, it does again."""


@pytest.mark.parametrize("chapter", CHAPTERS)
@pytest.mark.parametrize("autopilot", facts.VERSIONS)
def test_a_real_autopilot_answers_as_written_down(autopilot: str, chapter: str, tmp_path: Path) -> None:
    if not binary(autopilot):
        pytest.skip(f"{VARIABLES[autopilot]} does not name a simulator of {autopilot}")
    dialect = dialect_for(autopilot)
    answers: facts.Chapter = {}
    for attempt in range(TRIES):
        work = tmp_path / str(attempt)
        work.mkdir()
        with real(autopilot, work) as wire:
            held = Station(wire, dialect).hold(CHAPTERS[chapter](dialect))
        answers = without_size({step: answer.lines() for step, answer in held.items()})
        if answers == without_size(facts.real(autopilot)[chapter]):
            return
    assert answers == without_size(facts.real(autopilot)[chapter])


def without_size(chapter: facts.Chapter) -> facts.Chapter:
    """Leave out how long the parameters' file is: each build of one version has other parameters."""
    opened, *others = chapter.get("parameters", ("",))
    return {**chapter, "parameters": (opened[: len("FILE OPENFILERO '")], *others)}
