"""MAVSDK, which shares no line with the simulator, flies the simulated vehicles."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TypeVar

import pytest
from mavsdk.asyncio import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.asyncio.system import System
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk.plugins.telemetry import FlightMode

from missions.items import MissionItem
from simulator.config import AutopilotKind, SimCamera
from simulator.testing import fleet
from tests.ports import free_port
from tests.simulator.harness import LAT_DEG, LON_DEG, numbered, rtl, sim_vehicle, speed, takeoff, waypoint

T = TypeVar("T")
SPEEDUP = 2.0
"""MAVSDK's heartbeats come at 1 Hz: at 5 they would set off ArduPilot's failsafe, as measured with the real one."""
PATIENCE_S = 60
ROUTE = (takeoff(), speed(5.0), waypoint(300, 0, hold_s=1.0), waypoint(300, 300, hold_s=1.0), rtl())


async def wait_for(stream: AsyncIterator[T], good: Callable[[T], bool]) -> T:
    """Return the first value that is good; the stream is closed behind it."""
    try:
        async with asyncio.timeout(PATIENCE_S):
            async for value in stream:
                if good(value):
                    return value
    finally:
        await stream.aclose()  # type: ignore[attr-defined]
    raise AssertionError("the stream ended")


def raw(item: MissionItem) -> RawItem:
    return RawItem(
        item.seq, item.frame, item.command, int(item.current), 1, item.param1, item.param2, item.param3, item.param4,
        item.x, item.y, item.z, 0,
    )  # fmt: skip


@asynccontextmanager
async def connected(kind: AutopilotKind, scheme: str, cameras: tuple[SimCamera, ...] = ()) -> AsyncIterator[System]:
    port = free_port()
    # MAVSDK's heartbeats keep real time, so a busy computer must not set off the vehicle's failsafe.
    off = {"FS_GCS_ENABLE": 0.0} if kind is AutopilotKind.ARDUPILOT else {"NAV_DLL_ACT": 0.0}
    connection = f"{scheme}://127.0.0.1:{port}"
    vehicle = sim_vehicle(kind, connection=connection, ready_after_s=1.0, parameters=off, cameras=cameras)
    configuration = Configuration.create_manual(255, 190, True)
    async with fleet([vehicle], speedup=SPEEDUP), Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(connection)
        system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
        assert system is not None
        yield system


@pytest.mark.asyncio
@pytest.mark.parametrize("scheme", ["udpin", "udpout"])
@pytest.mark.parametrize("kind", list(AutopilotKind))
async def test_mavsdk_reads_uploads_downloads_starts_and_pauses(kind: AutopilotKind, scheme: str) -> None:
    items = numbered((waypoint(0, 0, 0.0), *ROUTE) if kind is AutopilotKind.ARDUPILOT else ROUTE, current=0)
    async with connected(kind, scheme) as system:
        assert await system.get_system_id() == 11
        telemetry, mission, action = TelemetryAsync(system), MissionRawAsync(system), ActionAsync(system)
        if kind is AutopilotKind.ARDUPILOT:
            await telemetry.set_rate_position(4.0)
            await telemetry.set_rate_battery(1.0)
            await telemetry.set_rate_health(2.0)
        place = await wait_for(telemetry.subscribe_position(), lambda _: True)
        assert (place.latitude_deg, place.longitude_deg) == pytest.approx((LAT_DEG, LON_DEG), abs=1e-6)
        battery = await wait_for(telemetry.subscribe_battery(), lambda value: value.remaining_percent > 0)
        assert 99 <= battery.remaining_percent <= 100

        await mission.upload_mission([raw(item) for item in items])
        back = await mission.download_mission()
        assert [(item.seq, item.command, item.x, item.y) for item in back[1:]] == [
            (item.seq, item.command, item.x, item.y) for item in items[1:]
        ]

        await wait_for(telemetry.subscribe_health_all_ok(), bool)
        await action.arm()
        await mission.start_mission()
        await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.MISSION)
        await wait_for(telemetry.subscribe_position(), lambda value: value.relative_altitude_m > 3)
        await mission.pause_mission()
        await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)
