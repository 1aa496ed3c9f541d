"""What a flight should take is what real autopilots take."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import BOTH, Autopilot
from tests.sitl.verdict import ended_well

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

MOST_PCT = 3.0


@BOTH
@pytest.mark.parametrize("radius_m", [320.0, 400.0])
def test_routes_take_what_they_should(autopilot: Autopilot, radius_m: float, tmp_path: Path) -> None:
    """Three vehicles, from the order to take off until the motors have stopped."""
    flight = flown(autopilot, Story(radius_m=radius_m), tmp_path)
    ended_well(flight, [])
    routes = [route for route in flight.report["routes"] if route["whole"]]
    for route in routes:
        print(route["vehicle"], f"{route['planned_s']:.1f} {route['flown_s']:.1f} s {route['time_error_pct']:.2f} %")
        for leg in route["legs"]:
            print("  ", leg["phase"], leg["planned_s"], leg["flown_s"])
    assert len(routes) == 3
    assert all(abs(route["time_error_pct"]) <= MOST_PCT for route in routes)
