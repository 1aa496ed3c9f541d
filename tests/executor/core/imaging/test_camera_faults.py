"""Cameras and gimbals that fail, by what is known of them at one moment; whole flights are in tests/stories."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.context import Context
from executor.core.imaging.camera_faults import BESIDE, OFF_S, VIEWPOINTS_LATE, check_cameras
from executor.core.interface.commands import Say
from executor.core.interface.messages import GimbalAttitude
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import FaultCode, VehicleState
from missions.cameras import Region
from tests.executor.builders import with_facts
from tests.executor.core.telemetry.test_camera_reports import NOW_S, flying

GIMBAL: dict[str, object] = {"name": "rgb", "id": 100, "gimbal": True}
WIRED: dict[str, object] = {"name": "rgb", "id": 1}
FRESH_S = 1.0


def at_a_pylon(carried: dict[str, object] = GIMBAL, **memory: object) -> tuple[Context, VehicleState]:
    """Return a vehicle that flies from viewpoint to viewpoint, and what is remembered of its camera."""
    context, vehicle = flying(low=True, camera=carried)
    board = vehicle.assignment.board
    assert board is not None
    first = next(index for index, point in enumerate(board.path.waypoints) if point.captures)
    fix = PositionFix(NOW_S, NOW_S, board.places_m[first], 45.0, 495.0, (3.0, 0.0, 0.0), 90.0)
    vehicle = with_facts(vehicle, waypoint=first + 1)
    vehicle = replace(vehicle, motion=replace(vehicle.motion, fix=fix))
    vehicle = replace(vehicle, link=replace(vehicle.link, heard_s=NOW_S, stale=False))
    camera = replace(vehicle.payload.camera_of("rgb", int(str(carried["id"]))), **memory)  # type: ignore[arg-type]
    return context, replace(vehicle, payload=vehicle.payload.with_camera(camera))


def at_the_region(context: Context, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle whose leg under way leads to a region of interest."""
    board = vehicle.assignment.board
    assert board is not None
    region = Region(49.6, 15.6, 20.0)
    points = tuple(
        replace(point, captures=tuple(replace(one, region=region) for one in point.captures))
        for point in board.path.waypoints
    )
    return with_facts(vehicle, board=replace(board, path=replace(board.path, waypoints=points)))


def said(context: Context, vehicle: VehicleState, *, for_s: float = 0.0) -> list[str]:
    """Return the faults that are declared, looking once a second while its gimbal goes on saying where it points."""
    state, codes = FleetState(vehicles={"uav1": vehicle}), []
    for number in range(int(for_s) + 1):
        now_s = NOW_S + number
        own = state.vehicles["uav1"]
        if own.payload.gimbal is not None:
            state = state.put(replace(own, payload=replace(own.payload, gimbal_s=now_s)))
        state, commands = check_cameras(context, state, now_s)
        codes += [command.text for command in commands if isinstance(command, Say)]
    fault = state.vehicles["uav1"].fault
    return codes if fault is None else [fault.code.value, *codes]


@pytest.mark.parametrize(
    ("memory", "code"),
    [
        ({"left_behind": VIEWPOINTS_LATE}, FaultCode.CAMERA_SILENT),
        ({"left_behind": VIEWPOINTS_LATE, "heard_s": NOW_S - FRESH_S}, FaultCode.CAMERA_MUTE),
        ({"left_behind": VIEWPOINTS_LATE - 1}, None),
        ({"beside": BESIDE}, FaultCode.GIMBAL_STUCK),
        ({"beside": BESIDE - 1}, None),
        ({"free_mib": 0.0}, FaultCode.CARD_FULL),
    ],
)
def test_a_camera_that_fails_between_viewpoints(memory: dict[str, object], code: FaultCode | None) -> None:
    found = said(*at_a_pylon(GIMBAL, **memory))
    assert found[:1] == ([] if code is None else [code.value])


def test_a_gimbal_follows_a_region_on_the_way_there() -> None:
    context, vehicle = at_a_pylon()
    level = GimbalAttitude(pitch_deg=-5.0, yaw_deg=0.0, from_north=True, failed=False)
    vehicle = replace(vehicle, payload=replace(vehicle.payload, gimbal=level, gimbal_s=NOW_S))
    assert said(context, vehicle, for_s=OFF_S + 1)[:1] == [FaultCode.GIMBAL_STUCK.value]
    vehicle = at_the_region(context, vehicle)
    assert said(context, vehicle, for_s=OFF_S + 1) == []
    failed = replace(vehicle, payload=replace(vehicle.payload, gimbal=replace(level, failed=True)))
    assert said(context, failed, for_s=OFF_S + 1)[:1] == [FaultCode.GIMBAL_STUCK.value]


@pytest.mark.parametrize(
    ("camera", "lost", "row"),
    [(WIRED, None, 6), (WIRED, 0.05, 6), (WIRED, 0.2, 8), (WIRED, 0.5, 17), (WIRED, 0.9, 17), (GIMBAL, 0.2, 6)],
)
def test_a_link_that_loses_much_is_no_silent_camera(camera: dict[str, object], lost: float | None, row: int) -> None:
    for left_behind, found in ((row - 1, []), (row, [FaultCode.CAMERA_SILENT.value])):
        context, vehicle = at_a_pylon(camera, left_behind=left_behind)
        quality = replace(vehicle.link.quality, lost=lost)
        vehicle = replace(vehicle, link=replace(vehicle.link, quality=quality))
        assert said(context, vehicle)[:1] == found


@pytest.mark.parametrize("pending", [None, 1])
def test_during_an_upload_the_gimbal_may_follow_either_mission(pending: int | None) -> None:
    context, vehicle = at_a_pylon()
    level = GimbalAttitude(pitch_deg=40.0, yaw_deg=0.0, from_north=True, failed=False)
    vehicle = replace(vehicle, payload=replace(vehicle.payload, gimbal=level, gimbal_s=NOW_S))
    vehicle = with_facts(vehicle, pending=pending)
    found = said(context, vehicle, for_s=OFF_S + 1)
    assert found[:1] == ([] if pending else [FaultCode.GIMBAL_STUCK.value])
