"""The links of a flight with other ground stations: our own number, and ports that cannot be opened."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.clock import SystemClock
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import Heartbeat, StationHeard
from executor.errors import ConnectionFailed
from executor.flight.open_links import build_forwarder, open_links
from executor.flight.run_start import FlightRequest
from executor.site.flight_keys import ForwardTable, LinkTable
from tests.benchmarks.virtual.short_line import shared, short_ground
from tests.executor.adapters.mavlink.test_endpoints import BEAT, inbox, received, socket_on_loopback
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio


def request_of(folder: Path, connection: str, *ports: str) -> FlightRequest:
    ground = short_ground(folder, 1, "ardupilot")
    [table] = ground.site.vehicle
    update = {
        "link": LinkTable(station_sysid=254),
        "forward": ForwardTable(to=ports, allow_orders=bool(ports)),
        "vehicle": (table.model_copy(update={"connection": connection}),),
    }
    ground = replace(ground, site=ground.site.model_copy(update=update))
    return FlightRequest(ground.site, folder, ground, shared(ground), folder, lambda _: ())


async def test_we_speak_under_the_sites_number_and_hear_a_station_of_the_usual_one(tmp_path: Path) -> None:
    port, to = free_port(), free_port()
    request = request_of(tmp_path, f"udpin://127.0.0.1:{port}", f"udpin://127.0.0.1:{to}")
    station = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    beat = bytes(mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 192, 0, 4, 3).pack(station))
    with socket_on_loopback() as vehicle, socket_on_loopback() as other:
        async with open_links(request, SystemClock(1.0), recorded=False) as links:
            [link] = links.values()
            heard = inbox(link)
            vehicle.sendto(bytes(BEAT.pack(mav.MAVLink(None, 1, 1))), ("127.0.0.1", port))
            async with asyncio.timeout(PATIENCE_S):
                while not isinstance(await heard.get(), Heartbeat):
                    pass
                ours = mav.MAVLink(None).decode(bytearray(await received(vehicle)))
                other.sendto(beat, ("127.0.0.1", to))
                while (said := await heard.get()) != StationHeard(255, 190, behind=True):
                    assert not isinstance(said, StationHeard)
                assert await received(vehicle) in {beat, bytes(ours.get_msgbuf())}
    assert (ours.get_type(), ours.get_srcSystem(), ours.get_srcComponent()) == ("HEARTBEAT", 254, 190)


async def test_a_port_that_is_taken_stops_a_flight_and_not_one_that_is_in_the_air(tmp_path: Path) -> None:
    with socket_on_loopback() as plug:
        taken = f"udpin://127.0.0.1:{plug.getsockname()[1]}"
        request = request_of(tmp_path, f"udpin://127.0.0.1:{free_port()}", taken)
        with pytest.raises(ConnectionFailed, match=r"^forward\.to: "):
            async with open_links(request, SystemClock(1.0), recorded=False):
                pass
        await asyncio.sleep(0)  # the vehicle's socket is let go
        async with open_links(request, SystemClock(1.0), recorded=False, strict=False) as links:
            assert len(links) == 1


async def test_the_rules_are_the_sites(tmp_path: Path) -> None:
    request = request_of(tmp_path, "serial:///dev/ttyUSB0:57600", "tcpin://127.0.0.1:5760")
    forwarder = build_forwarder(request.site, SystemClock(1.0))
    assert (forwarder.rules.ours, forwarder.rules.vehicles, forwarder.rules.allow_orders) == (254, frozenset({1}), True)
    [share] = forwarder.shares.values()
    assert share.is_radio
    assert share.find_others_bytes_s(1200.0) == 120.0
    assert parse_connection("tcpin://127.0.0.1:5760") in request.site.forward.ports
