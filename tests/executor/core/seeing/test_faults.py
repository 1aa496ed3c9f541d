"""Cameras and gimbals that fail, by what is known of them at one moment; whole flights are in tests/stories."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.commands import Say
from executor.core.context import Context
from executor.core.messages import GimbalAttitude
from executor.core.parts import Fix
from executor.core.seeing.faults import BESIDE, OFF_S, VIEWPOINTS_LATE, cameras_looked_at
from executor.core.state import FleetState
from executor.core.vehicle import FaultCode, VehicleState
from tests.executor.builders import with_facts
from tests.executor.core.hearing.test_pictures import NOW_S, flying

GIMBAL = {"name": "rgb", "id": 100, "gimbal": True}
FRESH_S = 1.0


def at_a_pylon(**memory: object) -> tuple[Context, VehicleState]:
    """Return a vehicle that flies from viewpoint to viewpoint, and what is remembered of its camera."""
    context, vehicle = flying(low=True, camera=GIMBAL)
    board = vehicle.assignment.board
    assert board is not None
    first = next(index for index, point in enumerate(board.path.waypoints) if point.captures)
    fix = Fix(NOW_S, NOW_S, board.places_m[first], 45.0, 495.0, (3.0, 0.0, 0.0), 90.0)
    vehicle = with_facts(vehicle, waypoint=first + 1)
    vehicle = replace(vehicle, motion=replace(vehicle.motion, fix=fix))
    vehicle = replace(vehicle, link=replace(vehicle.link, heard_s=NOW_S, stale=False))
    camera = replace(vehicle.payload.camera("rgb", 100), **memory)  # type: ignore[arg-type]
    return context, replace(vehicle, payload=vehicle.payload.with_camera(camera))


def said(context: Context, vehicle: VehicleState, *, for_s: float = 0.0) -> list[str]:
    """Return the faults that are declared, looking once a second while its gimbal goes on saying where it points."""
    state, codes = FleetState(vehicles={"uav1": vehicle}), []
    for number in range(int(for_s) + 1):
        now_s = NOW_S + number
        own = state.vehicles["uav1"]
        if own.payload.gimbal is not None:
            state = state.put(replace(own, payload=replace(own.payload, gimbal_s=now_s)))
        state, commands = cameras_looked_at(context, state, now_s)
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
    found = said(*at_a_pylon(**memory))
    assert found[:1] == ([] if code is None else [code.value])


@pytest.mark.parametrize("pending", [None, 1])
def test_who_is_being_given_a_mission_may_point_its_gimbal_by_that(pending: int | None) -> None:
    context, vehicle = at_a_pylon()
    level = GimbalAttitude(pitch_deg=40.0, yaw_deg=0.0, from_north=True, failed=False)
    vehicle = replace(vehicle, payload=replace(vehicle.payload, gimbal=level, gimbal_s=NOW_S))
    vehicle = with_facts(vehicle, pending=pending)
    found = said(context, vehicle, for_s=OFF_S + 1)
    assert found[:1] == ([] if pending else [FaultCode.GIMBAL_STUCK.value])
