"""Killed at a random instant: the resumed flight ends well, judged by the simulator's truth."""

from __future__ import annotations

import pytest

from executor.core.replanning import replan_cycle
from tests.executor.runtime.kills import flown

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]


@pytest.mark.parametrize("seed", [2, 1002])
async def test_a_flight_that_was_killed_ends_well(seed: int) -> None:
    outcome = await flown(seed)
    assert outcome.moments
    assert outcome.wrongs() == []
    assert not outcome.twice() or outcome.explained()


@pytest.mark.parametrize("seed", [1003, 1009])
async def test_a_flight_that_was_killed_while_its_missions_were_made_ends_well(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every mission takes a turn of its own, and at one of them the ground station dies."""
    monkeypatch.setattr(replan_cycle, "WAYS_AT_ONCE", 1)
    outcome = await flown(seed, at_unmade=True)
    assert outcome.moments[0] == "unmade"
    assert outcome.wrongs() == []
    assert not outcome.twice() or outcome.explained()


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(1000, 1200))
async def test_two_hundred_flights_that_were_killed_end_well(seed: int, record_property: pytest.FixtureRequest) -> None:
    outcome = await flown(seed)
    record_property("moments", "; ".join(outcome.moments))  # type: ignore[operator]
    record_property("twice", str(outcome.twice()))  # type: ignore[operator]
    assert outcome.wrongs() == []
    assert not outcome.twice() or outcome.explained()
