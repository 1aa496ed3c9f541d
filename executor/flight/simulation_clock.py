"""Whose time a flight goes by: the computer's, or that of a simulated fleet of ours that runs faster."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial

from executor.adapters.clock import steady_s
from executor.adapters.fair_event_loop import FairEventLoop, FleetTime
from executor.core.interface.commands import Level
from executor.core.interface.connection import Scheme
from executor.flight.run_start import MessageSink
from executor.site.site_file import Site
from executor.supervised import run_beside

CALL_AGAIN_S = 0.2
"""Real seconds between two attempts to find the fleet: it may begin later, and again."""
WINDOW_S = 5.0
"""Seconds of our time over which it is compared with the computer's."""
KEPT = 0.9
"""Less than this part of the speed is said."""


@dataclass(frozen=True, slots=True)
class FlightTimeSource:
    """A steady clock, and what the time of day is on it."""

    steady: Callable[[], float] = steady_s
    date_unix_s: Callable[[], float | None] = lambda: None
    """None where the computer's own is as good."""


@asynccontextmanager
async def follow_fleet_time(site: Site, console: MessageSink) -> AsyncIterator[FlightTimeSource]:
    """Keep the time together with the simulated fleet of this site, if one of ours flies on this computer.

    Real vehicles, real autopilots in a simulation and everything at real time have the computer's.
    """
    loop = asyncio.get_running_loop()
    ports = [one.link.number for one in site.vehicle if one.link.scheme in {Scheme.UDP_IN, Scheme.UDP_OUT}]
    if site.flight.speedup <= 1 or not ports or not isinstance(loop, FairEventLoop):
        yield FlightTimeSource()
        return
    fleet = FleetTime(site.flight.speedup, steady_s)
    with loop.follow_pacemaker(fleet):
        await fleet.connect(ports[0])
        try:
            async with (
                run_beside("keeping the fleet's time", partial(_keep_connecting, fleet, ports[0])),
                run_beside(
                    "comparing the fleet's time", partial(_report_slow_host_once, fleet, site.flight.speedup, console)
                ),
            ):
                yield FlightTimeSource(fleet.steady_s, fleet.date_unix_s)
        finally:
            fleet.disconnect()


async def _keep_connecting(fleet: FleetTime, port: int) -> None:
    while True:
        if not fleet.is_connected:
            await fleet.connect(port)
        await asyncio.sleep(CALL_AGAIN_S)


async def _report_slow_host_once(fleet: FleetTime, speedup: float, console: MessageSink) -> None:
    """Say in one line when the computer cannot keep up with the speed that was asked for."""
    while True:
        ours_s, own_s, whole = fleet.steady_s(), steady_s(), fleet.is_synchronised
        await asyncio.sleep(WINDOW_S)
        kept = (fleet.steady_s() - ours_s) / (steady_s() - own_s)
        if whole and fleet.is_synchronised and kept < KEPT:
            console.say(Level.INFO, describe_slow_host(kept * speedup, speedup))
            return


def describe_slow_host(kept: float, speedup: float) -> str:
    """Return what the crew is told."""
    return f"host too slow: running at {kept:.1f}x instead of {speedup:g}x real time; results are unaffected"
