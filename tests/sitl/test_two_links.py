"""Two links to one real autopilot, of which one is cut in the middle of an upload."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink.joined_link import open_joined_links
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.messages import Message, MissionRequest
from executor.core.interface.ports import LinkRequest
from executor.core.radio_budget import ALONE
from executor.runtime import procedures
from executor.runtime.dialogue import listen_to
from executor.runtime.flight_loop import send_heartbeats
from executor.runtime.procedures import keep_asking_links
from missions import dialect_for
from tests.sitl.real import BOTH, PX4, RELAYED, Autopilot, RealVehicle, Wanted, running
from tests.sitl.relay import HOST
from tests.sitl.test_transfers import PATIENCE_S, SETUP, _is_started, mission

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

NUMBER = 0
"""Of the vehicle, among those that run on this computer."""
CUT_AT = 10
"""The item that is asked for when the first link is cut."""


@BOTH
def test_an_upload_continues_over_the_other_link(autopilot: Autopilot, tmp_path: Path) -> None:
    if autopilot.binary is None:
        pytest.skip(f"{autopilot.variable}: expected the path of a real {autopilot.name}")
    wanted = Wanted({pad.vehicle: pad for pad in SETUP.pads}, SETUP.frame, 1.0, {}, frozenset({"uav1"}))
    with running(autopilot, Path(autopilot.binary), tmp_path / "work", wanted) as vehicles:
        asyncio.run(_upload(autopilot, vehicles["uav1"]))


async def _upload(autopilot: Autopilot, vehicle: RealVehicle) -> None:
    clock, dialect = SystemClock(1.0), dialect_for(autopilot.name)
    scheme, port = (Scheme.UDP_OUT, 18570 + NUMBER) if autopilot is PX4 else (Scheme.TCP_OUT, 5763 + 10 * NUMBER)
    other, sysid = Connection(scheme, HOST, port), 1 + NUMBER
    relayed = Connection(Scheme.UDP_IN, HOST, autopilot.port + NUMBER + RELAYED)
    first = LinkRequest(relayed, sysid, more=(LinkRequest(other, sysid),))
    async with open_joined_links({"uav1": first}, clock.now_s) as links:
        link = links["uav1"]
        tasks = [
            asyncio.create_task(send_heartbeats(links, clock)),
            asyncio.create_task(keep_asking_links(links, clock, {"uav1": (dialect, ALONE)})),
        ]
        try:
            assert await procedures.wait_for(link, clock, _is_started, PATIENCE_S)
            await procedures.request_streams(link, clock, ALONE.choose_streams_hz(dialect, on_radio=False))
            assert await procedures.wait_for(
                link, clock, lambda _: link.connection == str(relayed) and all(one.is_alive for one in link.ways), 60.0
            )
            took_s = {}
            for cut in (False, True):
                items = mission(dialect, 14 + cut)

                def see(message: Message, cut: bool = cut) -> None:
                    if cut and isinstance(message, MissionRequest) and message.seq >= CUT_AT:
                        vehicle.cut()

                began_s = time.monotonic()
                with listen_to(link, see):
                    done = await procedures.upload_and_verify(link, clock, dialect, items)
                assert done.accepted, done.reason
                took_s[cut] = time.monotonic() - began_s
            print(f"{autopilot.name}: {len(items)} items in {took_s[False]:.1f} s, cut {took_s[True]:.1f} s")
            assert link.ways[0].connection == str(other)
            assert took_s[True] - took_s[False] < (3.0 if not dialect.upload_is_atomic else 8.0)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
