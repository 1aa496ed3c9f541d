"""The links of a flight: opened, kept up with our heartbeat, and used for several vehicles side by side."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from typing import TypeVar

from executor.adapters.clock import SystemClock
from executor.adapters.extras import Extra, require_extra
from executor.adapters.mavlink import endpoints
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.tlog_writer import TelemetryLog
from executor.adapters.mavsdk import mavsdk_link as mavsdk
from executor.adapters.mavsdk.mavsdk_link import WANTED_BY
from executor.adapters.run_directory import RunDirectory
from executor.core.interface.ports import Keyring, LinkRequest, OpenLink
from executor.flight.run_start import FlightRequest
from executor.runtime.flight_loop import send_heartbeats
from executor.site.site_file import Site, read_signing_key
from executor.supervised import run_beside


def check_backends(site: Site) -> None:
    """Check that what the site's vehicles are reached through is installed, before anything is planned for them.

    Raises:
        ExtraMissing: MAVSDK is not.
    """
    if any(table.backend == "mavsdk" for table in site.vehicle):
        require_extra(Extra.MAVSDK, WANTED_BY)


@asynccontextmanager
async def open_links(
    order: FlightRequest, clock: SystemClock, *, recorded: bool = True
) -> AsyncIterator[Mapping[str, OpenLink]]:
    """Open the links to all vehicles, record them in the run directory, and keep up our heartbeat on them.

    Raises:
        ConnectionFailed: one cannot be opened.
    """
    async with AsyncExitStack() as stack:
        wanted: dict[str, dict[str, LinkRequest]] = {"native": {}, "mavsdk": {}}
        for table in order.site.vehicle:
            log = None
            if recorded:
                log = TelemetryLog(RunDirectory(order.run).telemetry_path(table.name), clock.label_usec)
                stack.callback(log.close)
            wanted[table.backend][table.name] = LinkRequest(table.link, table.sysid, log)
        key = read_signing_key(order.site, order.base)
        keyring = None if key is None else Keyring(key, clock.steady_unix_s)
        radios = order.site.link.senders
        native = await stack.enter_async_context(endpoints.open_mavlink_links(wanted["native"], keyring, radios))
        others = await stack.enter_async_context(
            mavsdk.open_mavsdk_links(wanted["mavsdk"], MavlinkCodec(radios=radios))
        )
        links = {table.name: native.get(table.name) or others[table.name] for table in order.site.vehicle}
        async with run_beside("our heartbeat", partial(send_heartbeats, links, clock), at_once=True):
            yield links


T = TypeVar("T")
AT_ONCE = 10
"""Vehicles that are spoken to at the same time: a radio has its limits, and so has a simulator."""


async def run_concurrently(works: Iterable[Coroutine[None, None, T]]) -> list[T]:
    """Do several things side by side; the first that fails ends the others, and is raised as it is."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        return await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def run_for_each(names: Iterable[str], work: Callable[[str], Coroutine[None, None, T]]) -> dict[str, T]:
    """Do something with every vehicle, `AT_ONCE` of them at a time; as `run_concurrently` otherwise."""
    turn, every = asyncio.Semaphore(AT_ONCE), list(names)

    async def one(name: str) -> T:
        async with turn:
            return await work(name)

    return dict(zip(every, await run_concurrently(map(one, every)), strict=True))
