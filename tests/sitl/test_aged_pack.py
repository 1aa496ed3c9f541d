"""A pack of half the capacity that its counter divides by, on real ArduPilot: what is said of it before the flight."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1500)]

COUNTED_AH, HELD_AH = 25.0, 12.5


def test_what_it_counts_by_and_how_its_pack_rests(tmp_path: Path) -> None:
    """Full, its voltage says nothing of its capacity; that another one is planned with is said."""
    settings = {"BATT_CAPACITY": 1000 * COUNTED_AH, "BATT_LOW_VOLT": 10.5, "MOT_BAT_VOLT_MAX": 12.6}
    flight = flown(ARDUPILOT, Story(settings=settings, pack_ah=HELD_AH, radius_m=400.0), tmp_path)
    assert "it counts by a pack of 25 Ah, the plan by 5 Ah" in flight.said
    assert "its pack rests at 4.20 V a cell, about 100 %, and reports 100 % (3 cells)" in flight.said
