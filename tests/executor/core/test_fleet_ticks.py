"""What happens in each tick: phases in one order, each with the reason why it stands where it does."""

from __future__ import annotations

import re

import pytest

from executor.core.fleet_step import PHASES

NAMES = [phase.name for phase in PHASES]
SENTENCES = [(phase.name, one) for phase in PHASES for one in re.split(r"(?<=\.)\s+", phase.why_here)]


def named(sentence: str) -> list[int]:
    """Return the places of the phases that a sentence names before its colon."""
    return [place for place, name in enumerate(NAMES) if re.search(rf"\b{name}\b", sentence.partition(":")[0])]


def test_each_phase_has_a_name_of_its_own_and_a_reason() -> None:
    assert len(set(NAMES)) == len(NAMES)
    assert [phase.name for phase in PHASES if not re.fullmatch(r"[A-Z].{20,}\.", phase.why_here)] == []


@pytest.mark.parametrize(("name", "sentence"), SENTENCES)
def test_a_phase_stands_where_its_reason_says(name: str, sentence: str) -> None:
    here = NAMES.index(name)
    match sentence.partition(" ")[0].rstrip(":"):
        case "First":
            assert here == 0
        case "Last":
            assert here == len(NAMES) - 1
        case "After":
            assert named(sentence)
            assert max(named(sentence)) < here
        case "Before":
            assert named(sentence)
            assert min(named(sentence)) > here
        case word:
            assert (word, named(sentence)) == ("Needs", [])
