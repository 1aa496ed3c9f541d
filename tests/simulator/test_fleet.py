"""Real UDP, spoken by pymavlink: both directions of a link, several vehicles, peers, time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

from missions.items import MissionItem
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
    rtl,
    sim_vehicle,
    speed,
    takeoff,
    waypoint,
)

PAD = (LAT_DEG, LON_DEG, ALT_M)
KINDS = pytest.mark.parametrize("kind", list(AutopilotKind))


@contextmanager
def linked(address: str) -> Iterator[Any]:
    """Join a vehicle that listens, after a HEARTBEAT, or listen for one that calls."""
    link = mavutil.mavlink_connection(address, source_system=255)
    try:
        if address.startswith("udpout"):
            beat(link)
        yield link
    finally:
        link.close()


def beat(link: Any) -> None:
    link.mav.heartbeat_send(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 0)


def hear(link: Any, *names: str, good: Callable[[Any], bool] = lambda _: True) -> Any:
    """Return the next such message; it must come."""
    while not good(message := link.recv_match(type=list(names), blocking=True, timeout=PATIENCE_S)):
        assert message is not None, f"no {' or '.join(names)}"
    return message


def is_from(sysid: int, message: Any) -> bool:
    return bool(message.get_srcSystem() == sysid)


def upload(link: Any, items: Sequence[MissionItem]) -> int:
    """Upload a mission to system 1 and return the type of the final ACK."""
    link.mav.mission_count_send(1, 1, len(items))
    while (asked := hear(link, "MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT")).get_type() != "MISSION_ACK":
        item = items[asked.seq]
        link.mav.mission_item_int_send(
            1, 1, item.seq, item.frame, item.command, item.current, 1, item.param1, item.param2, item.param3,
            item.param4, item.x, item.y, item.z,
        )  # fmt: skip
    return int(asked.type)


def build_route(kind: AutopilotKind, *route: MissionItem) -> Sequence[MissionItem]:
    """Return a mission as the autopilot lists it: ArduPilot's first item is its home."""
    return numbered((waypoint(0, 0, 0.0), *route) if kind is AutopilotKind.ARDUPILOT else route, 0)


@KINDS
def test_a_listening_ground_station_is_called_unasked(kind: AutopilotKind) -> None:
    vehicle = sim_vehicle(kind, connection=f"udpin://127.0.0.1:{(port := free_port())}")
    with linked(f"udpin:127.0.0.1:{port}") as station, fleet([vehicle], speedup=5):
        heartbeat = hear(station, "HEARTBEAT")
        assert heartbeat.get_srcSystem() == 11
        assert heartbeat.autopilot == (3 if kind is AutopilotKind.ARDUPILOT else 12)


@KINDS
def test_a_calling_ground_station_is_answered(kind: AutopilotKind) -> None:
    with fleet(autopilot=kind.value, speedup=5) as living, linked(living[0].pymavlink) as station:
        hear(station, "HEARTBEAT")
        assert upload(station, build_route(kind, takeoff(), speed(5), waypoint(30, 0), rtl())) == 0


@KINDS
def test_a_mission_goes_on_board_over_a_radio_that_two_share(kind: AutopilotKind) -> None:
    two = fleet(2, autopilot=kind.value, speedup=5, radio="sik")
    with two as living, linked(living[0].pymavlink) as station:
        assert hear(station, "RADIO_STATUS").txbuf > 80
        assert is_from(1, hear(station, "HEARTBEAT"))
        assert upload(station, build_route(kind, takeoff(), rtl())) == 0


def test_several_vehicles_on_one_port_and_several_ground_stations() -> None:
    port = free_port()
    vehicles = tuple(
        sim_vehicle(AutopilotKind.PX4, name=f"uav{sysid}", sysid=sysid, connection=f"udpin://127.0.0.1:{port}")
        for sysid in (1, 2, 3)
    )
    with linked(f"udpin:127.0.0.1:{port}") as station, fleet(vehicles, speedup=5):
        for sysid in (1, 2, 3):
            hear(station, "HEARTBEAT", good=partial(is_from, sysid))
    with fleet(speedup=5) as living, linked(living[0].pymavlink) as one, linked(living[0].pymavlink) as two:
        for station in (one, two):
            hear(station, "HEARTBEAT")


def test_a_mission_is_flown_over_udp_and_its_truths_are_dated() -> None:
    # At this speed a busy machine would set the failsafe off.
    flown = fleet(speedup=50, faults=["uav1:crash@50%"], parameters={"NAV_DLL_ACT": 0}, home=PAD)
    began_unix_s, truths = time.time(), flown.truths
    with flown, linked(flown[0].pymavlink) as station:
        assert upload(station, numbered((takeoff(10.0), speed(5), waypoint(60, 0, 10.0), rtl()), 0)) == 0
        while not any(truth.what == "mission_started" for truth in truths):
            beat(station)
            station.mav.command_long_send(1, 1, dialect.MAV_CMD_MISSION_START, 0, 0, 0, 0, 0, 0, 0, 0)
            hear(station, "COMMAND_ACK")
        while not any(truth.what == "crash" for truth in truths):
            beat(station)
            hear(station, "GLOBAL_POSITION_INT", "HEARTBEAT")
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


def test_twenty_vehicles_at_speed_1_keep_up() -> None:
    port = free_port()
    vehicles = tuple(
        sim_vehicle(AutopilotKind.PX4, name=f"uav{sysid}", sysid=sysid, connection=f"udpin://127.0.0.1:{port}")
        for sysid in range(1, 21)
    )
    with linked(f"udpin:127.0.0.1:{port}") as station, fleet(vehicles):
        for _ in range(2):
            for sysid in range(1, 21):
                hear(station, "HEARTBEAT", good=partial(is_from, sysid))


def test_the_clock_makes_up_for_a_short_stall_and_not_for_a_long_one() -> None:
    clock = SimClock(10, monotonic_s=100.0, unix_s=1.7e9)
    assert clock.now_s(0.0, 101.0) == pytest.approx(10)
    assert clock.now_s(10.0, 161.0) == pytest.approx(10 + MAX_LAG_S * 10)
    assert clock.now_s(30.0, 161.5) == pytest.approx(35)
    # The time of day goes on, so what happens later is dated rightly.
    assert clock.unix_s(35.0) == pytest.approx(1.7e9 + 61.5)
