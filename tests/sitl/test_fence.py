"""Real autopilots with a fence each: verified by read-back, and a vehicle that leaves it returns, declared lost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.core.preflight.parameter_changes import ChangeStage
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import VehicleState
from executor.flight.restore_vehicles import LISTS
from missions.fences import find_list_differences
from missions.items import MissionItem, MissionKind, PlaceCommand
from tests.sitl.flights import VICTIM, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, PX4, Autopilot, RealVehicle

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(590)]

FENCE = {"enabled": True, "action": "return"}
OUT = {
    ARDUPILOT: "Polygon fence breached",
    # By its event, which comes before its text "Geofence: exceeding maximum distance to Home".
    PX4: "geofence violation: maximum distance to home",
}


class Look:
    """What another station finds on board, before it makes the fence too small."""

    def __init__(self, autopilot: Autopilot, *, shrinks: bool = True) -> None:
        self.fence: list[MissionItem] = []
        self.rally: list[MissionItem] = []
        self._autopilot = autopilot
        self._shrinks = shrinks

    def strike(self, vehicle: RealVehicle) -> None:
        self.fence = as_items(vehicle.other.mission(vehicle.sysid, MissionKind.FENCE))
        self.rally = as_items(vehicle.other.mission(vehicle.sysid, MissionKind.RALLY))
        if not self._shrinks:
            return
        if self._autopilot is PX4:
            vehicle.set("GF_MAX_HOR_DIST", 10.0)  # it drops a polygon that it is not in itself
            return
        # A square about its pad that ends 50 m before it: more than 100 m outside it would land where it is.
        request = mav.MAVLink_command_long_message(vehicle.sysid, 1, mav.MAV_CMD_REQUEST_MESSAGE, 0, 33, *[0] * 6)
        place, pad = vehicle.other.ask(request, "GLOBAL_POSITION_INT"), self.rally[0]
        north_m, east_m = 0.0111 * (place.lat - pad.x), 0.0072 * (place.lon - pad.y)
        half_m = max(abs(north_m), abs(east_m)) - 50.0
        assert half_m > 10.0, f"it is {north_m:.0f} m north and {east_m:.0f} m east of its pad"
        north, east = round(half_m / 0.0111), round(half_m / 0.0072)
        corners = [(pad.x - north, pad.y - east), (pad.x - north, pad.y + east), (pad.x + north, pad.y + east),
                   (pad.x + north, pad.y - east)]  # fmt: skip
        vehicle.other.upload(
            vehicle.sysid,
            [
                mav.MAVLink_mission_item_int_message(
                    vehicle.sysid,
                    1,
                    seq,
                    0,
                    PlaceCommand.INCLUSION_VERTEX,
                    0,
                    1,
                    4,
                    0,
                    0,
                    0,
                    x,
                    y,
                    0,
                    MissionKind.FENCE,
                )
                for seq, (x, y) in enumerate(corners)
            ],
            MissionKind.FENCE,
        )


def in_its_first_segment(vehicle: VehicleState, _: FleetState) -> bool:
    """Whether uav2 inspects its first segment."""
    return vehicle.assignment.run is not None


def as_items(frames: Sequence[mav.MAVLink_mission_item_int_message]) -> list[MissionItem]:
    return [MissionItem(one.seq, one.frame, one.command, one.param1, x=one.x, y=one.y, z=one.z) for one in frames]


@BOTH
def test_a_vehicle_that_leaves_its_fence_returns_and_is_declared_lost(autopilot: Autopilot, tmp_path: Path) -> None:
    look = Look(autopilot)
    flight = flown(autopilot, Story(look.strike, fence=FENCE), tmp_path)
    print(flight.said)
    kept = {(one.vehicle, one.kind): one for one in LISTS.read(flight.run)}
    # What was on board in flight is what was put there.
    assert find_list_differences(kept[VICTIM, MissionKind.FENCE].new, look.fence) == ()
    assert find_list_differences(kept[VICTIM, MissionKind.RALLY].new, look.rally) == ()
    for name in ("uav1", VICTIM, "uav3"):
        assert f"{name}: fence of " in flight.said
    # It did what its autopilot should, and that was declared as what it was.
    [fault] = flight.report["faults"]
    assert (fault["vehicle"], fault["kind"], fault["code"]) == (VICTIM, "fence", "fence_breached")
    assert OUT[autopilot] in fault["reason"]
    assert flight.struck_s is not None
    assert fault["detected_s"] - (flight.struck_s - flight.launched_s) < 10.0
    assert flight.vehicle(VICTIM)["landed"]
    assert flight.report["finished"]
    assert flight.report["replans"][0]["feasible"]
    # Everybody has again what was there before, but for what another station has put there since.
    assert {kept[name, MissionKind.FENCE].stage for name in ("uav1", "uav3")} == {ChangeStage.RESTORED}
    left = ChangeStage.LEFT if autopilot is ARDUPILOT else ChangeStage.RESTORED
    assert kept[VICTIM, MissionKind.FENCE].stage is left


@BOTH
def test_a_replan_that_leads_out_of_a_fence_widens_it_first(autopilot: Autopilot, tmp_path: Path) -> None:
    look = Look(autopilot, shrinks=False)
    flight = flown(autopilot, Story(look.strike, fence=FENCE, loses="uav3", loses_at=in_its_first_segment), tmp_path)
    print(flight.said)
    assert {fault["vehicle"] for fault in flight.report["faults"]} == {"uav3"}
    assert "fence widened first" in flight.said
    assert "fence breached" not in flight.said
    assert flight.report["finished"]
    widened = [one for one in LISTS.read(flight.run) if one.kind is MissionKind.FENCE and one.earlier]
    assert widened
    assert all(one.stage is ChangeStage.RESTORED for one in widened if one.vehicle != "uav3")
