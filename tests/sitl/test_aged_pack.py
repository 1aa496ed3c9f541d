"""A pack of half the capacity that its counter divides by, on real ArduPilot."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1500)]

COUNTED_AH, HELD_AH = 9.0, 4.5
"""It hovers at 29 A: half an hour and 62 minutes would be honest; the flight takes some ten minutes."""
LOW_V = 10.5


def test_a_pack_of_half_its_capacity_is_found_before_its_own_failsafe_acts(tmp_path: Path) -> None:
    """Every vehicle has one; its own failsafe would act at 3.5 V a cell under load."""
    settings = {
        "BATT_CAPACITY": 1000 * COUNTED_AH, "BATT_LOW_VOLT": LOW_V, "BATT_FS_LOW_ACT": 2.0, "MOT_BAT_VOLT_MAX": 12.6,
    }  # fmt: skip
    flight = flown(ARDUPILOT, Story(settings=settings, pack_ah=HELD_AH, radius_m=400.0), tmp_path)
    found_s = flight.says("its pack rests at")
    assert found_s is not None
    acts_s = flight.says("Battery Failsafe")
    assert acts_s is None or found_s < acts_s - 60.0
    assert "it counts by a pack of 9 Ah" in flight.said
