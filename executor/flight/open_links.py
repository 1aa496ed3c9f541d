"""Open the clock and the links of a flight: real time, or the faster time of our simulated fleet.

Links are opened, kept up with our heartbeat, and used for several vehicles concurrently.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial
from typing import TypeVar

from executor.adapters.clock import FairEventLoop, FleetTime, SystemClock, steady_s
from executor.adapters.extras import Extra, require_extra
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.forward import Forwarder, open_station_ports
from executor.adapters.mavlink.joined_link import open_joined_links
from executor.adapters.mavlink.tlog_writer import TelemetryLog
from executor.adapters.mavsdk import mavsdk_link as mavsdk
from executor.adapters.mavsdk.mavsdk_link import WANTED_BY
from executor.adapters.run_directory import RunDirectory
from executor.core.forwarding import ForwardRules
from executor.core.interface.commands import Level
from executor.core.interface.connection import Scheme
from executor.core.interface.ports import Keyring, LinkRequest, OpenLink
from executor.flight.run_start import FlightRequest, MessageSink
from executor.runtime.channel import channel_of
from executor.runtime.dialogue import awake
from executor.runtime.flight_loop import send_heartbeats
from executor.runtime.procedures import keep_asking_links
from executor.site.site_file import Site, read_signing_key
from executor.site.site_model import radio_share_of
from executor.supervised import run_beside
from missions import dialect_for

CALL_AGAIN_S = 0.2
"""Real seconds between two attempts to find the fleet; it may start later, or restart."""
WINDOW_S = 5.0
"""Seconds of flight time over which the speed is measured."""
KEPT = 0.9
"""Share of the requested speed below which the crew is warned."""


@asynccontextmanager
async def follow_fleet_time(site: Site, console: MessageSink) -> AsyncIterator[FleetTime]:
    """Follow the clock of this site's simulated fleet, if one of ours runs on this computer.

    Real vehicles, SITL autopilots and everything at real time use the computer's clock.
    """
    loop, fleet = asyncio.get_running_loop(), FleetTime(site.flight.speedup, steady_s)
    ports = [one.link.number for one in site.vehicle if one.link.scheme in {Scheme.UDP_IN, Scheme.UDP_OUT}]
    if site.flight.speedup <= 1 or not ports or not isinstance(loop, FairEventLoop):
        yield fleet
        return
    with loop.follow_pacemaker(fleet):
        await fleet.connect(ports[0])
        try:
            async with (
                run_beside("keeping the fleet's time", partial(_keep_connecting, fleet, ports[0])),
                run_beside(
                    "comparing the fleet's time", partial(_report_slow_host_once, fleet, site.flight.speedup, console)
                ),
            ):
                yield fleet
        finally:
            fleet.disconnect()


async def _keep_connecting(fleet: FleetTime, port: int) -> None:
    while True:
        if not fleet.is_connected:
            await fleet.connect(port)
        await asyncio.sleep(CALL_AGAIN_S)


async def _report_slow_host_once(fleet: FleetTime, speedup: float, console: MessageSink) -> None:
    """Report once that the computer cannot keep up with the requested speed."""
    while True:
        ours_s, own_s, whole = fleet.steady_s(), steady_s(), fleet.is_synchronised
        await asyncio.sleep(WINDOW_S)
        kept = (fleet.steady_s() - ours_s) / (steady_s() - own_s)
        if whole and fleet.is_synchronised and kept < KEPT:
            console.say(Level.INFO, describe_slow_host(kept * speedup, speedup))
            return


def describe_slow_host(kept: float, speedup: float) -> str:
    """Return the warning for the crew."""
    return f"host too slow: running at {kept:.1f}x instead of {speedup:g}x real time; results are unaffected"


def check_backends(site: Site) -> None:
    """Check that the library for the site's vehicles is installed, before planning for them.

    Raises:
        ExtraMissing: MAVSDK is not installed.
    """
    if any(table.backend == "mavsdk" for table in site.vehicle):
        require_extra(Extra.MAVSDK, WANTED_BY)


@asynccontextmanager
async def open_links(
    request: FlightRequest, clock: SystemClock, *, recorded: bool = True, strict: bool = True
) -> AsyncIterator[Mapping[str, OpenLink]]:
    """Open the links to all vehicles, record them in the run directory, and keep up our heartbeat on them.

    Args:
        request: The flight request.
        clock: Clock of the flight.
        recorded: Whether telemetry logs are written.
        strict: Whether a port of `[forward]`, or the device of one of several links, must be available at once; False
            if vehicles are in the air.

    Raises:
        ConnectionFailed: one cannot be opened.
    """
    async with AsyncExitStack() as stack:
        wanted: dict[str, dict[str, LinkRequest]] = {"native": {}, "mavsdk": {}}
        for table in request.site.vehicle:
            orders = []
            for number, order in enumerate(table.requests, start=1):
                if recorded:
                    log = TelemetryLog(RunDirectory(request.run).telemetry_path(table.name, number), clock.label_usec)
                    stack.callback(log.close)
                    order = replace(order, log=log.write)
                orders.append(order)
            wanted[table.backend][table.name] = replace(orders[0], more=tuple(orders[1:]))
        key = read_signing_key(request.site, request.base)
        keyring = None if key is None else Keyring(key, clock.steady_unix_s)
        link = request.site.link
        forwarder = build_forwarder(request.site, clock)
        now_s = stack.enter_context(awake(clock)).now_s
        native = await stack.enter_async_context(
            open_joined_links(
                wanted["native"], now_s, keyring, link.senders, one_radio=link.one_radio,
                may_be_absent=not strict, station=link.station, tap=forwarder.tap,
            )
        )  # fmt: skip
        forwarder.links.update((one.sysid, one) for one in native.values())
        ports = request.site.forward.ports
        await stack.enter_async_context(open_station_ports(forwarder, ports, keyring, link.station, strict=strict))
        others = await stack.enter_async_context(
            mavsdk.open_mavsdk_links(wanted["mavsdk"], MavlinkCodec(radios=link.senders, station=link.station))
        )
        links = {table.name: native.get(table.name) or others[table.name] for table in request.site.vehicle}
        setups = {
            table.name: (dialect_for(table.autopilot), radio_share_of(request.site, table.name))
            for table in request.site.vehicle
        }
        async with (
            run_beside("our heartbeat", partial(send_heartbeats, links, clock), at_once=True),
            run_beside("the streams of further links", partial(keep_asking_links, links, clock, setups)),
        ):
            yield links


def build_forwarder(site: Site, clock: SystemClock) -> Forwarder:
    """Build the forwarder of frames between a site's vehicles and other ground stations."""
    systems = {table.sysid: table.name for table in site.vehicle}
    rules = ForwardRules(site.link.station_sysid, frozenset(systems), site.forward.allow_orders)
    shares = {sysid: radio_share_of(site, name) for sysid, name in systems.items()}
    return Forwarder(rules, clock.now_s, shares, lambda link: channel_of(link).is_busy)


T = TypeVar("T")
AT_ONCE = 10
"""Most vehicles addressed at once; radios and simulators have limits."""


async def run_concurrently(works: Iterable[Coroutine[None, None, T]]) -> list[T]:
    """Run coroutines concurrently; the first failure cancels the others, and is raised unwrapped."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        return await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def run_for_each(names: Iterable[str], work: Callable[[str], Coroutine[None, None, T]]) -> dict[str, T]:
    """Run a coroutine for every vehicle, `AT_ONCE` of them at a time; otherwise as `run_concurrently`."""
    turn, every = asyncio.Semaphore(AT_ONCE), list(names)

    async def one(name: str) -> T:
        async with turn:
            return await work(name)

    return dict(zip(every, await run_concurrently(map(one, every)), strict=True))
