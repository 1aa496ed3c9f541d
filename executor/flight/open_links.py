"""Opens the links of a flight, and keeps up our heartbeat on them."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial

from executor.adapters.clock import SystemClock
from executor.adapters.extras import Extra, require_extra
from executor.adapters.mavlink import endpoints
from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.tlog_writer import TelemetryLog
from executor.adapters.mavsdk import mavsdk_link as mavsdk
from executor.adapters.mavsdk.library import WANTED_BY
from executor.adapters.run_directory import RunDirectory
from executor.core.interface.ports import Keyring, LinkRequest, OpenLink
from executor.flight.flight_request import FlightRequest
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
