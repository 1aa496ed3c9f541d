"""A pack of half the capacity that its counter divides by, on real ArduPilot."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1500)]

COUNTED_AH, HELD_AH = 25.0, 12.5


def test_a_pack_of_half_its_capacity_is_found_in_flight(tmp_path: Path) -> None:
    """Every vehicle has one; it suffices for this flight, so that it is said, and ends nothing."""
    settings = {"BATT_CAPACITY": 1000 * COUNTED_AH, "BATT_LOW_VOLT": 10.5, "MOT_BAT_VOLT_MAX": 12.6}
    flight = flown(ARDUPILOT, Story(settings=settings, pack_ah=HELD_AH, radius_m=400.0), tmp_path)
    assert "it counts by a pack of 25 Ah, the plan by 5 Ah" in flight.said
    assert flight.says("times what is counted") is not None
    assert flight.says("Battery Failsafe") is None
    assert not flight.report.get("faults")
