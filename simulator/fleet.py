"""Runs a fleet of simulated vehicles on UDP in one event loop, at any speed of time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from typing import cast

from simulator.autopilot import STEP_S
from simulator.common_time import LOOK_REAL_S, Stations
from simulator.config import SimFleet, parse_vehicle_endpoint
from simulator.truth import Truth
from simulator.vehicle import SimulatedVehicle

Address = tuple[str, int]

PEER_S = 10.0
"""A ground station that was not heard for so long, in real seconds, is not answered any more."""
TICK_S = (0.005, 0.05)
"""Shortest and longest real pause between two looks at the clock."""
CHUNK_STEPS = 40
"""Steps lived in a row before the sockets are looked at again: after a stall, heartbeats that wait there must be heard
before the vehicle's own time-outs pass."""
MAX_LAG_S = 2.0
"""A longer stall, in real seconds, is not made up for: the vehicles' clocks lag, as those of a suspended process do."""


class _Link(asyncio.DatagramProtocol):
    """One vehicle's socket."""

    def __init__(self, vehicle: SimulatedVehicle, target: Address | None) -> None:
        self.vehicle = vehicle
        self._target = target
        self._heard_s: dict[Address, float] = {}
        self._transport: asyncio.DatagramTransport | None = None
        self._closed = asyncio.Event()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Note the socket."""
        # asyncio's own datagram transport is no subclass of the class that its documentation names (3.11).
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: Address) -> None:
        """Hear a ground station, and answer at once."""
        self._heard_s[addr] = time.monotonic()
        self.vehicle.receive(data)
        self.flush()

    def error_received(self, exc: Exception) -> None:
        """Ignore that nobody listens yet or any more: a vehicle goes on talking."""

    def flush(self) -> None:
        """Send what the vehicle has to say to everybody who was heard lately, and to the configured target."""
        datagrams = self.vehicle.drain()
        if not datagrams or self._transport is None:
            return
        oldest_s = time.monotonic() - PEER_S
        peers = {addr for addr, heard_s in self._heard_s.items() if heard_s >= oldest_s}
        if self._target is not None:
            peers.add(self._target)
        for addr in peers:
            for datagram in datagrams:
                self._transport.sendto(datagram, addr)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Note that the socket is closed."""
        self._closed.set()

    async def close(self) -> None:
        """Close the socket, and wait until it is."""
        if self._transport is not None:
            self._transport.close()
            await self._closed.wait()


class SimClock:
    """Simulated time that follows a monotonic clock and never jumps over a long stall."""

    def __init__(self, speedup: float, *, monotonic_s: float, unix_s: float) -> None:
        self._speedup = speedup
        self._origin_s = monotonic_s
        self._unix_s = unix_s

    def now_s(self, lived_s: float, monotonic_s: float, *, dated: bool = True) -> float:
        """Return the simulated time that the fleet should have lived to, given how far it has.

        Args:
            lived_s: How far it has lived.
            monotonic_s: Now.
            dated: Whether dates go by the computer's clock; without it they go by the simulated time alone.
        """
        due_s = (monotonic_s - self._origin_s) * self._speedup
        excess_s = due_s - lived_s - MAX_LAG_S * self._speedup
        if excess_s > 0:
            self._origin_s += excess_s / self._speedup
            self._unix_s += excess_s / self._speedup if dated else 0.0
            due_s -= excess_s
        return due_s

    def unix_s(self, at_s: float) -> float:
        """Return this machine's time of day at a simulated time."""
        return self._unix_s + at_s / self._speedup


async def run_fleet(
    fleet: SimFleet,
    *,
    stop: asyncio.Event,
    on_truth: Callable[[Truth], None],
    ready: asyncio.Event | None = None,
    watched: Callable[[Sequence[SimulatedVehicle]], None] = lambda _: None,
) -> None:
    """Fly until ``stop`` is set.

    Args:
        fleet: what to fly.
        stop: ends it.
        on_truth: is told what really happens.
        ready: is set when every vehicle has its socket.
        watched: is shown the vehicles whenever all have lived on.

    Raises:
        OSError: a port is taken.
    """
    loop = asyncio.get_running_loop()
    links: list[_Link] = []
    try:
        for config in fleet.vehicles:
            endpoint = parse_vehicle_endpoint(config.connection)
            link = _Link(SimulatedVehicle(config, fleet.faults), endpoint.target)
            await loop.create_datagram_endpoint(lambda link=link: link, local_addr=endpoint.bind)  # type: ignore[misc]
            links.append(link)
        clock = SimClock(fleet.speedup, monotonic_s=time.monotonic(), unix_s=time.time())
        async with _keep_common_time(fleet, clock) as stations:
            if ready is not None:
                ready.set()
            await _fly(links, clock, stations, stop, on_truth, watched)
    finally:
        for link in links:
            await link.close()


@asynccontextmanager
async def _keep_common_time(fleet: SimFleet, clock: SimClock) -> AsyncIterator[Stations]:
    """Keep the time together with those who ask for it, unless it is real time."""
    stations = Stations(fleet.speedup, clock.unix_s)
    server: asyncio.Server | None = None
    if fleet.speedup > 1:
        endpoint = parse_vehicle_endpoint(fleet.vehicles[0].connection)
        _, port = endpoint.target or endpoint.bind
        with suppress(OSError):  # the port is another program's: the time is the fleet's own, as for any ground station
            server = await stations.open(port)
    try:
        yield stations
    finally:
        stations.close()
        if server is not None:
            server.close()


async def _fly(
    links: list[_Link],
    clock: SimClock,
    stations: Stations,
    stop: asyncio.Event,
    on_truth: Callable[[Truth], None],
    watched: Callable[[Sequence[SimulatedVehicle]], None],
) -> None:
    tick_s = min(max(STEP_S / stations.speedup, TICK_S[0]), TICK_S[1])
    lived_s = 0.0
    while not stop.is_set():
        stations.moved.clear()
        due_s = clock.now_s(lived_s, time.monotonic(), dated=not stations.ever)
        behind = due_s - lived_s > CHUNK_STEPS * STEP_S
        wanted_s = lived_s + CHUNK_STEPS * STEP_S if behind else due_s
        # It may have lived further while a ground station was stopped.
        until_s = max(lived_s, stations.safe_time_s())
        lived_s = min(wanted_s, until_s)
        for link in links:
            link.vehicle.advance(lived_s)
            for truth in link.vehicle.drain_truths(clock.unix_s):
                on_truth(truth)
            link.flush()
        watched([link.vehicle for link in links])
        stations.send_time(lived_s)
        if lived_s < wanted_s:
            await _pause(stations.moved, LOOK_REAL_S / 5)
        else:
            await _pause(stop, 0.0 if behind else tick_s)


async def _pause(end: asyncio.Event, seconds: float) -> None:
    """Let the sockets be read for a while, or until the end."""
    if seconds == 0.0:
        await asyncio.sleep(0)
        return
    try:
        async with asyncio.timeout(seconds):
            await end.wait()
    except TimeoutError:
        return
