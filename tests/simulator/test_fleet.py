"""Real UDP: both directions of a link, several vehicles, peers, time."""

from __future__ import annotations

import asyncio
import time
from functools import partial
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from simulator.config import AutopilotKind
from simulator.fleet import MAX_LAG_S, SimClock
from simulator.testing import fleet
from tests.patience import PATIENCE_S
from tests.ports import free_port
from tests.simulator.harness import (
    ALT_M,
    LAT_DEG,
    LON_DEG,
    is_happening,
    numbered,
    on_wire,
    rtl,
    sim_vehicle,
    speed,
    takeoff,
    waypoint,
)
from tests.simulator.station import Station


def is_from(sysid: int, message: Any) -> bool:
    return bool(message.get_srcSystem() == sysid)


PAD = (LAT_DEG, LON_DEG, ALT_M)
KINDS = pytest.mark.parametrize("kind", list(AutopilotKind))


@pytest.mark.asyncio
@KINDS
async def test_a_listening_ground_station_is_called_unasked(kind: AutopilotKind) -> None:
    vehicle = sim_vehicle(kind, connection=f"udpin://127.0.0.1:{(port := free_port())}")
    async with Station.listening(port) as station, fleet([vehicle], speedup=5):
        heartbeat = await station.wait_for("HEARTBEAT")
        assert heartbeat.get_srcSystem() == 11
        assert heartbeat.autopilot == (3 if kind is AutopilotKind.ARDUPILOT else 12)


@pytest.mark.asyncio
@KINDS
async def test_a_calling_ground_station_is_answered(kind: AutopilotKind) -> None:
    async with fleet(autopilot=kind.value, speedup=5) as living, Station.calling(living[0].port) as station:
        station.heartbeat()
        await station.wait_for("HEARTBEAT")
        route = (takeoff(), speed(5), waypoint(30, 0), rtl())
        items = numbered((waypoint(0, 0, 0.0), *route) if kind is AutopilotKind.ARDUPILOT else route, 0)
        assert await station.upload([on_wire(item) for item in items], sysid=1) == 0


@pytest.mark.asyncio
@KINDS
async def test_a_mission_goes_on_board_over_a_radio_that_two_share(kind: AutopilotKind) -> None:
    two = fleet(2, autopilot=kind.value, speedup=5, radio="sik")
    async with two as living, Station.calling(living[0].port) as station:
        station.heartbeat()
        assert (await station.wait_for("RADIO_STATUS")).txbuf > 80
        assert is_from(1, await station.wait_for("HEARTBEAT"))
        items = numbered((waypoint(0, 0, 0.0), rtl()) if kind is AutopilotKind.ARDUPILOT else (takeoff(), rtl()), 0)
        assert await station.upload([on_wire(item) for item in items], sysid=1) == 0


@pytest.mark.asyncio
async def test_several_vehicles_on_one_port_and_several_ground_stations() -> None:
    port = free_port()
    vehicles = tuple(
        sim_vehicle(AutopilotKind.PX4, name=f"uav{sysid}", sysid=sysid, connection=f"udpin://127.0.0.1:{port}")
        for sysid in (1, 2, 3)
    )
    async with Station.listening(port) as station, fleet(vehicles, speedup=5):
        for sysid in (1, 2, 3):
            await station.wait_for("HEARTBEAT", good=partial(is_from, sysid))
    async with (
        fleet(speedup=5) as living,
        Station.calling(living[0].port) as one,
        Station.calling(living[0].port) as two,
    ):
        for station in (one, two):
            station.heartbeat()
            await station.wait_for("HEARTBEAT")


@pytest.mark.asyncio
async def test_a_mission_is_flown_over_udp_and_its_truths_are_dated() -> None:
    # At this speed a busy machine would set the failsafe off.
    flown = fleet(speedup=50, faults=["uav1:crash@50%"], parameters={"NAV_DLL_ACT": 0}, home=PAD)
    began_unix_s, truths = time.time(), flown.truths
    async with flown, Station.calling(flown[0].port) as station, asyncio.timeout(PATIENCE_S):
        station.heartbeat()
        items = numbered((takeoff(10.0), speed(5), waypoint(60, 0, 10.0), rtl()), 0)
        assert await station.upload([on_wire(item) for item in items], sysid=1) == 0
        while not any(truth.what == "mission_started" for truth in truths):
            station.heartbeat()
            station.send(dialect.MAVLink_command_long_message(1, 1, 300, 0, 0, 0, 0, 0, 0, 0, 0))
            await station.wait_for("COMMAND_ACK")
        while not any(truth.what == "crash" for truth in truths):
            station.heartbeat()
            await station.wait_for("GLOBAL_POSITION_INT", "HEARTBEAT")
    assert [truth.what for truth in truths if is_happening(truth)] == [
        "armed", "mission_started", "took_off", "fault uav1:crash@50%", "crash", "disarmed",
    ]  # fmt: skip
    assert {truth.vehicle for truth in truths} == {"uav1"}
    seconds = truths[-1].t_s - truths[0].t_s
    assert truths[-1].unix_s - truths[0].unix_s == pytest.approx(seconds / 50, abs=0.01)
    assert began_unix_s - 1 <= truths[0].unix_s <= time.time()


@pytest.mark.asyncio
async def test_a_taken_port_is_an_error_and_leaves_nothing_open() -> None:
    free = sim_vehicle(AutopilotKind.PX4, name="uav2", connection=f"udpout://127.0.0.1:{free_port()}")
    async with fleet() as living:
        taken = sim_vehicle(AutopilotKind.PX4, connection=living[0].connection)
        with pytest.raises(OSError, match="already in use"):
            async with fleet([free, taken]):
                pass
        with pytest.raises(OSError, match="already in use"), fleet([free, taken]):
            pass
        async with fleet([free]):
            assert True


@pytest.mark.asyncio
async def test_twenty_vehicles_at_speed_1_keep_up() -> None:
    port = free_port()
    vehicles = tuple(
        sim_vehicle(AutopilotKind.PX4, name=f"uav{sysid}", sysid=sysid, connection=f"udpin://127.0.0.1:{port}")
        for sysid in range(1, 21)
    )
    async with Station.listening(port) as station, fleet(vehicles):
        for _ in range(2):
            for sysid in range(1, 21):
                await station.wait_for("HEARTBEAT", good=partial(is_from, sysid))


def test_the_clock_makes_up_for_a_short_stall_and_not_for_a_long_one() -> None:
    clock = SimClock(10, monotonic_s=100.0, unix_s=1.7e9)
    assert clock.now_s(0.0, 101.0) == pytest.approx(10)
    assert clock.now_s(10.0, 161.0) == pytest.approx(10 + MAX_LAG_S * 10)
    assert clock.now_s(30.0, 161.5) == pytest.approx(35)
    # The time of day goes on, so what happens later is dated rightly.
    assert clock.unix_s(35.0) == pytest.approx(1.7e9 + 61.5)
