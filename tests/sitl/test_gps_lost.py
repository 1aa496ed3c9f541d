"""A real autopilot loses its GPS in flight: reported with the last fix and its age."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.sitl.flights import VICTIM, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, Autopilot, RealVehicle

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

SAID_S = 8.0
"""ArduPilot's driver waits four seconds for its receiver; a report of it comes every second."""


def switches_gps_off(autopilot: Autopilot) -> Callable[[RealVehicle], None]:
    """Return how the simulated receiver of a vehicle is switched off."""
    name = "SIM_GPS1_ENABLE" if autopilot is ARDUPILOT else "SIM_GPS_USED"
    return lambda vehicle: vehicle.set(name, 0)


@BOTH
def test_gps_is_lost_in_flight(autopilot: Autopilot, tmp_path: Path) -> None:
    flight = flown(autopilot, Story(switches_gps_off(autopilot)), tmp_path)
    lost_s = flight.says(f"{VICTIM}: GPS lost")
    assert lost_s is not None, flight.said
    assert flight.struck_s is not None
    # Not before either: an estimator that starts has none to lose.
    assert 0.0 <= lost_s - flight.struck_s <= SAID_S, flight.said
    assert flight.said.count("GPS lost") == 1, flight.said
    at = flight.vehicle(VICTIM)["last_position"]
    assert at["known"] == "reckoned", at
    assert at["accuracy_m"] > 10.0, at
    assert abs(at["last_fix"]["at_s"] + flight.launched_s - flight.struck_s) <= 2.0, at
    assert any(VICTIM in line and "last GPS fix" in line for line in flight.said.splitlines()), flight.said
