"""What mavkit, a MAVLink client in Rust, can do with a vehicle."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import common as mav

from tests.peers.judging import NORTH_DEG, PLACE_DEG, Subject, Suite


@dataclass(frozen=True, slots=True)
class Kit:
    """mavkit's vehicle, connected."""

    subject: Subject
    vehicle: Any


@asynccontextmanager
async def connected(subject: Subject) -> AsyncIterator[Kit]:
    """Connect."""
    from mavkit import Vehicle

    vehicle = await Vehicle.connect(subject.listen())
    try:
        yield Kit(subject, vehicle)
    finally:
        await vehicle.disconnect()


def build_plan(kind: str, *commands: int) -> Any:
    """Return a plan of items further and further north."""
    from mavkit import HomePosition, MissionFrame, MissionItem, MissionPlan, MissionType

    items = [
        MissionItem(
            seq=seq, command=command, frame=MissionFrame.GlobalRelativeAltInt,
            x=round((PLACE_DEG[0] + seq * NORTH_DEG) * 1e7), y=round(PLACE_DEG[1] * 1e7), z=20.0,
            current=seq == 0 and kind == "Mission", param1=40.0 if kind == "Fence" else 0.0,
        )
        for seq, command in enumerate(commands)
    ]  # fmt: skip
    home = HomePosition(latitude_deg=PLACE_DEG[0], longitude_deg=PLACE_DEG[1], altitude_m=488.0)
    return MissionPlan(mission_type=getattr(MissionType, kind), items=items, home=home if kind == "Mission" else None)


PLANS = {
    "Mission": (mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_WAYPOINT, mav.MAV_CMD_NAV_WAYPOINT),
    "Fence": (mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,) * 2,
    "Rally": (mav.MAV_CMD_NAV_RALLY_POINT,) * 2,
}


def put_and_read(kind: str) -> Callable[[Kit], Awaitable[None]]:
    """Return a case: a plan uploaded, and held against what it reads back."""

    async def case(at: Kit) -> None:
        plan = build_plan(kind, *PLANS[kind])
        await at.vehicle.upload_mission(plan)
        assert await at.vehicle.verify_mission_roundtrip(plan)
        assert kind != "Fence" or at.subject.has_stored(fence=2)
        assert kind != "Rally" or at.subject.has_stored(rally=2)
        assert kind != "Mission" or at.subject.is_so(lambda now: len(now.mission) >= len(plan))

    return case


def clear(kind: str) -> Callable[[Kit], Awaitable[None]]:
    """Return a case: a plan uploaded, and cleared."""

    async def case(at: Kit) -> None:
        plan = build_plan(kind, *PLANS[kind])
        await at.vehicle.upload_mission(plan)
        await at.vehicle.clear_mission(plan.mission_type)
        await at.subject.until_stored()
        await at.subject.until(lambda now: len(now.mission) <= 1)

    return case


async def read_parameters(at: Kit) -> None:
    names = set((await at.vehicle.download_params()).keys())
    assert len(names) > 10
    at.subject.prove(lambda now: now.parameters.keys() == names)


async def set_parameter(at: Kit) -> None:
    name = "RTL_RETURN_ALT" if at.subject.px4 else "FS_GCS_TIMEOUT"
    await at.vehicle.download_params()
    assert (await at.vehicle.write_param(name, 33.5)).value == 33.5
    at.subject.prove(lambda now: now.parameters[name] == 33.5)


async def hear_place(at: Kit) -> None:
    async with asyncio.timeout(10.0):
        while (await at.vehicle.wait_telemetry()).latitude_deg is None:
            pass


async def take_off(at: Kit) -> None:
    if not at.subject.px4:
        await at.vehicle.set_mode_by_name("GUIDED")
    await at.vehicle.arm(False)
    await at.vehicle.takeoff(15.0)
    await at.subject.until(lambda now: now.up_m > 1.0)


async def go_to(at: Kit) -> None:
    await take_off(at)
    await at.vehicle.goto(PLACE_DEG[0] + NORTH_DEG, PLACE_DEG[1], 15.0)
    await at.subject.until(lambda now: now.lat_deg - PLACE_DEG[0] > NORTH_DEG / 20)


SUITES = {
    "mavkit": Suite("mavkit", connected, {
        "mission": put_and_read("Mission"), "fence": put_and_read("Fence"), "rally points": put_and_read("Rally"),
        "clear a mission": clear("Mission"), "clear a fence": clear("Fence"), "clear rally points": clear("Rally"),
        "read all parameters": read_parameters, "set a parameter": set_parameter, "telemetry": hear_place,
        "take off": take_off, "go to a place": go_to,
    }),
}  # fmt: skip
