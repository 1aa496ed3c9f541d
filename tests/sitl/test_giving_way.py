"""A vehicle above a climbing RTL waits for it, on real autopilots, judged by their own positions."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from benchmarks.prediction import plan_with
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import VehicleState
from executor.site.site_model import SiteModel
from missions import Phase
from missions.geometry import locate_on_leg
from tests.e2e.flights import began_unix_s
from tests.e2e.tlog import messages
from tests.sitl.custody import switches
from tests.sitl.flights import VICTIM, Flown, Prepared, Story, flown
from tests.sitl.real import BOTH, Autopilot

ROUTES = {"uav1": (6,), VICTIM: (9, 1), "uav3": (2, 10, 4)}
"""uav3's way leads over where uav2 inspects, a layer above it."""
ABOVE = "uav3"
AHEAD_M, ASIDE_M, UNDER_M = (45.0, 75.0), 8.0, 3.0
LAYER_M, SLOW_M_S, FAST_M_S = 5.0, 4.0, 5.0


def routed(ground: SiteModel) -> Prepared:
    return Prepared(ground, plan_with(ground, ROUTES), None)


def is_under_its_way(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether uav2 inspects where uav3 will pass above it."""
    own, other = vehicle.motion.fix, state.vehicles[ABOVE]
    board, fix = other.assignment.board, other.motion.fix
    if own is None or fix is None or board is None or vehicle.assignment.run is None:
        return False
    ways = list(zip(board.path.waypoints, board.places_m, strict=True))[other.assignment.waypoint :]
    along_m = math.dist(fix.place_m, ways[0][1]) if ways else 0.0
    for (_, begin_m), (waypoint, end_m) in itertools.pairwise(ways):
        if waypoint.phase in {Phase.TRANSIT, Phase.RETURN} and math.dist(begin_m, end_m) > 2.0 * AHEAD_M[1]:
            at_m, aside_m = locate_on_leg(begin_m, end_m, own.place_m)
            if aside_m < UNDER_M and at_m > AHEAD_M[1] and along_m + at_m > AHEAD_M[1]:
                return waypoint.alt_rel_m > own.alt_rel_m + LAYER_M
        along_m += math.dist(begin_m, end_m)
    return False


def above_comes_near(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether uav3 comes towards uav2, above it."""
    own, other, leg = vehicle.motion.fix, state.vehicles[ABOVE].motion.fix, state.vehicles[ABOVE].leg
    if own is None or other is None or leg is None or leg.phase not in {Phase.TRANSIT, Phase.RETURN}:
        return False
    east_m_s, north_m_s, _ = other.velocity_m_s
    speed_m_s = math.hypot(east_m_s, north_m_s)
    if speed_m_s < FAST_M_S or other.alt_msl_m < own.alt_msl_m + LAYER_M:
        return False
    east_m, north_m = own.place_m[0] - other.place_m[0], own.place_m[1] - other.place_m[1]
    ahead_m = (east_m * east_m_s + north_m * north_m_s) / speed_m_s
    aside_m = abs(east_m * north_m_s - north_m * east_m_s) / speed_m_s
    return AHEAD_M[0] < ahead_m < AHEAD_M[1] and aside_m < ASIDE_M


def speeds_m_s(done: Flown, name: str, from_s: float, to_s: float) -> list[float]:
    """Return a vehicle's speeds over ground between two times of the flight, by its own positions."""
    began_s = began_unix_s(done.run)
    return [
        math.hypot(one.vx, one.vy) / 100.0
        for stamp_s, one in messages(done.run / f"{name}.tlog", "GLOBAL_POSITION_INT")
        if one.get_srcComponent() == 1 and from_s <= stamp_s - began_s <= to_s
    ]


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_a_vehicle_above_a_climbing_rtl_is_slow_until_it_is_over(autopilot: Autopilot, tmp_path: Path) -> None:
    story = Story(
        strike=switches(autopilot, "stands"), at=is_under_its_way, lift=switches(autopilot, "rtl"),
        lift_at=above_comes_near, prepared=routed, flight={"fly_again": "ask", "pilot_grace_s": 600.0},
    )  # fmt: skip
    done = flown(autopilot, story, tmp_path)
    assert done.lifted_s is not None, done.said
    waits_s = done.says(f"{ABOVE}: slowing: {VICTIM} ahead is climbing in RTL")
    over_s = done.says(f"{ABOVE}: flies on at ")
    assert waits_s is not None, done.said
    assert over_s is not None, done.said
    assert over_s > waits_s
    assert min(speeds_m_s(done, ABOVE, waits_s, over_s + 2.0)) < SLOW_M_S, "it has slowed down"
    assert max(speeds_m_s(done, ABOVE, over_s, over_s + 15.0)) > FAST_M_S, "and it is as fast as before again"
    assert done.report["min_separation_m"] >= LAYER_M
    assert done.vehicle(ABOVE)["landed"], done.said
