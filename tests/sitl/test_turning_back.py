"""A vehicle recalled from its return, on real autopilots: not straight through an area in between."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from shapely.geometry import LineString, Point, Polygon

from benchmarks.prediction import plan_with
from executor.core.state.fleet_state import FleetState
from executor.core.state.legs import remaining_leg_share
from executor.core.state.vehicle_state import VehicleState
from executor.site import site_model
from missions import Phase
from tests.e2e.tlog import messages
from tests.sitl.flights import Prepared, Story, flown, site_of
from tests.sitl.real import BOTH, Autopilot, RealVehicle
from tests.sitl.verdict import ended_well, inspected_by

ROUTES = {"uav1": (8, 10), "uav2": (4, 2, 0), "uav3": (6, 12)}
"""uav1 comes home from the far west, 330 m; then uav2 has V101.1 before it, north of that way."""
AREA_M = ((-260.0, 15.0), (-60.0, 15.0), (-60.0, 50.0), (-260.0, 50.0))
"""Between the two."""
MARGIN_M = 10.0
CUT_M = 2.0
"""A corner is cut by less."""


def comes_home(_: VehicleState, state: FleetState) -> bool:
    """Whether uav1 has flown a fifth of its way home."""
    own = state.vehicles["uav1"]
    board, fix = own.assignment.board, own.motion.fix
    if own.leg is None or own.leg.phase is not Phase.RETURN or board is None or fix is None:
        return False
    return remaining_leg_share(board, own.assignment.waypoint, fix) < 0.8


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_a_vehicle_recalled_from_its_return_avoids_the_area_between(autopilot: Autopilot, tmp_path: Path) -> None:
    frame = site_model.load_site_model(site_of(autopilot, Story()), tmp_path).network.frame
    polygon = [frame.to_wgs84_deg(*corner) for corner in AREA_M]
    story = Story(
        RealVehicle.suspend, at=comes_home, faults={"link_timeout_s": 4.0},
        tables={"area": [{"name": "village", "polygon": polygon, "margin_m": MARGIN_M}]},
        prepared=lambda ground: Prepared(ground, plan_with(ground, ROUTES), None),
    )  # fmt: skip
    done = flown(autopilot, story, tmp_path)
    ended_well(done, ["link"], down=("uav1", "uav3"))
    assert 0 in {one.id for one in inspected_by(done, "uav1")}, done.said
    sent_s = done.says("uav1: new mission on board")
    assert sent_s is not None
    places_m = [
        frame.to_local_m(one.lat / 1e7, one.lon / 1e7)
        for _, one in messages(done.run / "uav1.tlog", "GLOBAL_POSITION_INT")
        if one.get_srcComponent() == 1
    ]
    village = Polygon(AREA_M)
    farthest = max(range(len(places_m)), key=lambda number: math.dist(places_m[number], (0.0, 0.0)))
    turned_m = min(places_m[farthest:], key=lambda place_m: Point(place_m).distance(village))
    print(f"nearest {LineString(places_m).distance(village):.1f} m, at {turned_m}")
    assert LineString(places_m).distance(village) >= MARGIN_M - CUT_M, done.said
