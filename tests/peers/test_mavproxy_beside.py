"""MAVProxy as it is behind `[forward]`: it sees the fleet, and what it orders is its own."""

from __future__ import annotations

import asyncio
from asyncio.subprocess import Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from executor.adapters.clock import SystemClock
from executor.core.interface.messages import Message, OrderSeen, StationActed, StationHeard
from executor.core.interface.ports import OpenLink
from executor.core.lines import link
from executor.flight.open_links import open_links
from executor.flight.run_start import FlightRequest
from executor.simulated.simulated_fleet import fleet_of
from executor.site.flight_keys import ForwardTable, LinkTable
from simulator.testing import Fleet
from tests.benchmarks.virtual.short_line import shared, short_ground
from tests.patience import PATIENCE_S
from tests.peers.mavproxy_cases import read_until, start
from tests.ports import free_port, free_ports

OURS = 254
MAVPROXY = (255, 230)
KINDS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])


class Ground:
    """Our end of two vehicles, with MAVProxy beside it."""

    def __init__(self, name: str, links: dict[str, OpenLink], process: Process) -> None:
        self.name, self.process, self.heard = name, process, list[Message]()
        self._new = asyncio.Event()
        links[name].listen(self._hear)

    def _hear(self, message: Message) -> None:
        self.heard.append(message)
        self._new.set()

    async def wait_for(self, *messages: Message) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not all(message in self.heard for message in messages):
                self._new.clear()
                await self._new.wait()

    def type(self, words: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{words}\n".encode())


@asynccontextmanager
async def beside(folder: Path, autopilot: str, *, allow: bool) -> AsyncIterator[Ground]:
    """Fly two vehicles on their pads, and yield once MAVProxy has found the first."""
    ground, port = short_ground(folder, 2, autopilot), free_port()
    forward = ForwardTable(to=(f"tcpin://127.0.0.1:{port}",), allow_orders=allow)
    vehicles = tuple(
        table.model_copy(update={"connection": f"udpin://127.0.0.1:{free}"})
        for table, free in zip(ground.site.vehicle, free_ports(2), strict=True)
    )
    update = {"link": LinkTable(station_sysid=OURS), "forward": forward, "vehicle": vehicles}
    ground = replace(ground, site=ground.site.model_copy(update=update))
    fleet = fleet_of(ground, speedup=1.0, faults=(), seed=1, wind=1.0, failsafe=True)
    request = FlightRequest(ground.site, folder, ground, shared(ground), folder, lambda _: ())
    async with Fleet(fleet), open_links(request, SystemClock(1.0), recorded=False) as links:
        process = await start(
            f"tcp:127.0.0.1:{port}", "mode,cmdlong", folder, "--target-system=1", "--target-component=1"
        )
        try:
            async with asyncio.timeout(PATIENCE_S):
                await read_until(process, "Detected vehicle 2:1")  # the other one, before or after
            yield Ground(ground.names[0], dict(links), process)
        finally:
            process.kill()
            await process.communicate()


@pytest.mark.asyncio
@KINDS
async def test_what_mavproxy_orders_over_us_is_done_and_is_mavproxys(autopilot: str, tmp_path: Path) -> None:
    async with beside(tmp_path, autopilot, allow=True) as ground:
        await ground.wait_for(StationHeard(*MAVPROXY, behind=True))
        ground.type("long MAV_CMD_NAV_RETURN_TO_LAUNCH 0 0 0 0 0 0 0")
        async with asyncio.timeout(PATIENCE_S):
            await read_until(ground.process, "Got COMMAND_ACK: NAV_RETURN_TO_LAUNCH: ACCEPTED")
        await ground.wait_for(
            OrderSeen(20, None, MAVPROXY[0], 1), StationActed(*MAVPROXY, "sends MAV_CMD_NAV_RETURN_TO_LAUNCH")
        )


@pytest.mark.asyncio
@KINDS
async def test_mavproxy_sees_the_fleet_and_orders_nothing_unless_the_site_lets_it(
    autopilot: str, tmp_path: Path
) -> None:
    async with beside(tmp_path, autopilot, allow=False) as ground:
        ground.type("long MAV_CMD_NAV_RETURN_TO_LAUNCH 0 0 0 0 0 0 0")
        await ground.wait_for(
            StationHeard(*MAVPROXY, behind=True), StationActed(*MAVPROXY, link.ORDERS_NOT_ALLOWED, passed=False)
        )
    assert not any(isinstance(one, OrderSeen) for one in ground.heard)
