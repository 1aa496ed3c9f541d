"""What DroneKit, as its fork dronekit2 keeps it alive, can do with a vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import common as mav

from tests.peers.judging import NORTH_DEG, PATIENCE_S, PLACE_DEG, Subject, Suite, wait


@dataclass(frozen=True, slots=True)
class Drone:
    """DroneKit's vehicle, connected."""

    subject: Subject
    vehicle: Any


@asynccontextmanager
async def connected(subject: Subject) -> AsyncIterator[Drone]:
    """Connect, and wait until it knows the parameters."""
    from dronekit import connect

    address = subject.listen()
    vehicle = await asyncio.to_thread(connect, address, wait_ready=True, timeout=PATIENCE_S)
    try:
        yield Drone(subject, vehicle)
    finally:
        await asyncio.to_thread(vehicle.close)


def hear_place(at: Drone) -> None:
    wait(lambda: abs((at.vehicle.location.global_frame.lat or 0.0) - PLACE_DEG[0]) < NORTH_DEG, PATIENCE_S)
    wait(lambda: at.vehicle.battery is not None and at.vehicle.battery.level is not None, PATIENCE_S)


def set_parameter(at: Drone) -> None:
    at.vehicle.parameters["FS_GCS_TIMEOUT"] = 33.5
    at.subject.wait_until(lambda now: now.parameters["FS_GCS_TIMEOUT"] == 33.5)


def upload(at: Drone) -> None:
    from dronekit import Command

    commands = at.vehicle.commands
    commands.download()
    commands.wait_ready(timeout=PATIENCE_S)
    commands.clear()
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
    for command, north in ((mav.MAV_CMD_NAV_TAKEOFF, 0), (mav.MAV_CMD_NAV_WAYPOINT, 1), (mav.MAV_CMD_NAV_WAYPOINT, 2)):
        commands.add(
            Command(0, 0, 0, frame, command, 0, 0, 0, 0, 0, 0, PLACE_DEG[0] + north * NORTH_DEG, PLACE_DEG[1], 20)
        )
    commands.upload(timeout=PATIENCE_S)
    at.subject.wait_until(lambda now: len(now.mission) == 4)


def download(at: Drone) -> None:
    upload(at)
    commands = at.vehicle.commands
    commands.download()
    commands.wait_ready(timeout=PATIENCE_S)
    assert [item.command for item in commands][:1] == [mav.MAV_CMD_NAV_TAKEOFF]


def take_off(at: Drone) -> None:
    at.vehicle.wait_for_armable(timeout=PATIENCE_S)
    at.vehicle.wait_for_mode("GUIDED", timeout=PATIENCE_S)
    at.vehicle.arm(timeout=PATIENCE_S)
    at.vehicle.simple_takeoff(15)
    at.vehicle.wait_for_alt(5, epsilon=2.0, timeout=PATIENCE_S)
    at.subject.prove(lambda now: now.up_m > 2.0)


def go_to(at: Drone) -> None:
    from dronekit import LocationGlobalRelative

    take_off(at)
    at.vehicle.simple_goto(LocationGlobalRelative(PLACE_DEG[0] + NORTH_DEG, PLACE_DEG[1], 15))
    at.subject.wait_until(lambda now: now.lat_deg - PLACE_DEG[0] > NORTH_DEG / 20)


def go_home(at: Drone) -> None:
    take_off(at)
    at.vehicle.wait_for_mode("RTL", timeout=PATIENCE_S)
    at.subject.wait_until(lambda now: now.mode == "RTL")


def read_capabilities(at: Drone) -> None:
    assert at.vehicle.capabilities.mission_int
    assert str(at.vehicle.version).startswith("APM:Copter-")


def move_home(at: Drone) -> None:
    from dronekit import LocationGlobal

    at.vehicle.commands.download()
    at.vehicle.commands.wait_ready(timeout=PATIENCE_S)
    assert at.vehicle.home_location is not None
    at.vehicle.home_location = LocationGlobal(PLACE_DEG[0] + NORTH_DEG / 100, PLACE_DEG[1], 488.0)


SUITES = {
    "DroneKit": Suite("dronekit2", connected, {
        "telemetry": hear_place, "set a parameter": set_parameter, "upload": upload, "download": download,
        "take off": take_off, "go to a place": go_to, "return": go_home, "version": read_capabilities,
        "set the home": move_home,
    }, ("ardupilot",)),
}  # fmt: skip
