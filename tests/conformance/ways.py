"""Ways to reach a vehicle: each of our links, to each kind of vehicle that can be had without hardware."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass, replace

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action_server import ActionServer
from mavsdk.plugins.mission_raw_server import MissionRawServer
from mavsdk.plugins.param_server import ParamServer
from mavsdk.plugins.telemetry_server import (
    Battery,
    Heading,
    Position,
    TelemetryServer,
    TelemetryServerError,
    VelocityNed,
)

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.joined_link import open_joined_links
from executor.adapters.mavsdk import mavsdk_link as mavsdk_links
from executor.adapters.mavsdk.mavsdk_link import load_mavsdk
from executor.core.interface.connection import parse_connection
from executor.core.interface.ports import LinkRequest, OpenLink
from executor.runtime.flight_loop import send_heartbeats
from missions import ARDUPILOT, PX4, Dialect, MissionItem
from simulator.config import AutopilotKind, SimFleet
from simulator.fault_kinds import parse_fault
from simulator.testing import Fleet
from tests.simulator.harness import (
    ALT_M,
    LAT_DEG,
    LON_DEG,
    land,
    numbered,
    sim_vehicle,
    speed,
    takeoff,
    waypoint,
)

SPEEDUP = 3.0

Links = AbstractAsyncContextManager[Mapping[str, OpenLink]]
OpenLinks = Callable[[Mapping[str, LinkRequest]], Links]


@dataclass(frozen=True)
class Vehicles:
    """A kind of vehicle; all of them call the ground station at one UDP port."""

    name: str
    dialect: Dialect
    autopilot: int
    """What its heartbeat says."""
    kind: int
    """MAV_TYPE of its heartbeat: 2 is a quadrotor, 0 a generic vehicle."""
    parameters: tuple[tuple[str, float, int], ...]
    """Some that it has, with another value for each and the type."""
    lossy: bool
    """Whether its side of the link can be made worse."""
    start: Callable[[int, Sequence[int], Sequence[str]], AbstractAsyncContextManager[object]]
    """Given the port, the system ids and the faults."""


@dataclass(frozen=True)
class Way:
    """One of our links to a kind of vehicle."""

    link: str
    open_links: OpenLinks
    vehicles: Vehicles

    def __str__(self) -> str:
        return f"{self.link}-{self.vehicles.name}"


@dataclass(frozen=True)
class Ground:
    """The ground station's side."""

    links: Mapping[int, OpenLink]
    """By system id."""
    clock: SystemClock


def route(dialect: Dialect, legs: int = 3) -> tuple[MissionItem, ...]:
    """Return a mission of so many legs that the autopilot can fly."""
    flown = [waypoint(100 + 20.25 * leg, 40.5 * (leg % 2), 25.1, hold_s=1.0) for leg in range(legs)]
    items = (takeoff(), speed(5.3), *flown, land())
    return numbered((waypoint(0, 0, 0.0), *items) if dialect.home_item else items, current=dialect.flag_first)


@asynccontextmanager
async def station(way: Way, port: int, sysids: Sequence[int]) -> AsyncIterator[Ground]:
    """Open links to these systems at one port, and keep up the heartbeat."""
    clock, connection = SystemClock(SPEEDUP), parse_connection(f"udpin://127.0.0.1:{port}")
    async with way.open_links({str(sysid): LinkRequest(connection, sysid) for sysid in sysids}) as links:
        beat = asyncio.create_task(send_heartbeats(links, clock))
        try:
            yield Ground({int(name): link for name, link in links.items()}, clock)
        finally:
            beat.cancel()
            await asyncio.wait([beat])


def simulated(
    kind: AutopilotKind,
    links: int = 1,
) -> Callable[[int, Sequence[int], Sequence[str]], AbstractAsyncContextManager[object]]:
    """Return what starts simulated vehicles with so many links, at a port and those that follow it."""

    @asynccontextmanager
    async def start(port: int, sysids: Sequence[int], faults: Sequence[str]) -> AsyncIterator[None]:
        connections = tuple(f"udpin://127.0.0.1:{port + number}" for number in range(links))
        vehicles = tuple(
            sim_vehicle(kind, name=f"uav{sysid}", sysid=sysid, connection=connections, ready_after_s=1.0)
            for sysid in sysids
        )
        async with Fleet(SimFleet(vehicles, SPEEDUP, tuple(parse_fault(fault) for fault in faults))) as fleet:
            yield
            # Where answers take long, items go out and questions are asked ahead of their turn, on purpose.
            fleet.check_client(but={"upload", "download"} if faults else ())

    return start


@asynccontextmanager
async def served(port: int, sysids: Sequence[int], faults: Sequence[str]) -> AsyncIterator[None]:
    """Start vehicles that MAVSDK's server plugins play: none of this code wrote any of their words."""
    assert not faults
    load_mavsdk()
    running = [_MavsdkVehicle(port, sysid) for sysid in sysids]
    publishing = [asyncio.create_task(vehicle.publish()) for vehicle in running]
    try:
        yield
    finally:
        for task in publishing:
            task.cancel()
        await asyncio.wait(publishing)
        for vehicle in running:
            await asyncio.to_thread(vehicle.mavsdk.destroy)


class _MavsdkVehicle:
    def __init__(self, port: int, sysid: int) -> None:
        configuration = Configuration.create_with_component_type(ComponentType.AUTOPILOT)
        configuration.system_id = sysid
        self.mavsdk = Mavsdk(configuration)
        component = self.mavsdk.server_component(0)
        self._parameters = ParamServer(component)
        self._parameters.provide_param_int("NAV_DLL_ACT", 2)
        self._parameters.provide_param_float("COM_DL_LOSS_T", 10.5)
        self._missions = MissionRawServer(component)
        self._action = ActionServer(component)
        self._action.set_armable(True, True)
        self._telemetry = TelemetryServer(component)
        self.mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")

    async def publish(self) -> None:
        while True:
            with suppress(TelemetryServerError):  # until it has heard a ground station
                self._telemetry.publish_position(
                    Position(LAT_DEG, LON_DEG, ALT_M, 0.0), VelocityNed(0.0, 0.0, 0.0), Heading(0.0)
                )
                self._telemetry.publish_battery(Battery(16.0, 0.99))  # a share, whatever its name
            await asyncio.sleep(0.2)


ARDUPILOTS = Vehicles(
    "ardupilot", ARDUPILOT, 3, 2, (("RTL_ALT", 4200.0, 6), ("FS_GCS_TIMEOUT", 7.5, 9)), True,
    simulated(AutopilotKind.ARDUPILOT),
)  # fmt: skip
PX4S = Vehicles(
    "px4", PX4, 12, 2, (("NAV_DLL_ACT", 0.0, 6), ("RTL_RETURN_ALT", 42.5, 9)), True, simulated(AutopilotKind.PX4)
)
TWICE = {
    one.name: replace(one, name=f"{one.name}-twice", start=simulated(kind, 2))
    for one, kind in ((ARDUPILOTS, AutopilotKind.ARDUPILOT), (PX4S, AutopilotKind.PX4))
}
"""The same with two links each."""
MAVSDKS = Vehicles("mavsdk", PX4, 0, 0, (("NAV_DLL_ACT", 3.0, 6), ("COM_DL_LOSS_T", 12.25, 9)), False, served)


def through_mavsdk(orders: Mapping[str, LinkRequest]) -> Links:
    """Open links as the flight does for vehicles with the backend mavsdk."""
    return mavsdk_links.open_mavsdk_links(orders, MavlinkCodec())


def joined(orders: Mapping[str, LinkRequest]) -> Links:
    """Open the links to vehicles that have another one at the next port."""
    both = {
        name: replace(one, more=(replace(one, connection=replace(one.connection, number=one.connection.number + 1)),))
        for name, one in orders.items()
    }
    return open_joined_links(both, SystemClock(SPEEDUP).now_s)


WAYS = (
    Way("native", endpoints.open_mavlink_links, ARDUPILOTS),
    Way("native", endpoints.open_mavlink_links, PX4S),
    Way("native", endpoints.open_mavlink_links, MAVSDKS),
    *(Way("joined", joined, vehicles) for vehicles in TWICE.values()),
    Way("mavsdk", through_mavsdk, ARDUPILOTS),
    Way("mavsdk", through_mavsdk, PX4S),
)
