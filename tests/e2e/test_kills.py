"""Killed at a random instant with kill -9 and restarted: judged by an independent witness."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.kills import flown

pytestmark = [pytest.mark.asyncio, pytest.mark.campaign]


@pytest.mark.parametrize("seed", range(200))
async def test_a_ground_station_that_was_killed_finishes_its_flight(
    seed: int, tmp_path: Path, record_property: pytest.FixtureRequest
) -> None:
    outcome = await flown(tmp_path, seed)
    record_property("moments", "; ".join(outcome.moments))  # type: ignore[operator]
    record_property("twice", str(outcome.twice()))  # type: ignore[operator]
    assert outcome.wrongs() == []
    assert not outcome.twice() or outcome.explained()
