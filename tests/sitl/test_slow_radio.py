"""Three real autopilots behind one telemetry radio: everything is asked, set and put on board."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.clock import SystemClock
from executor.core.interface.codes import Severity
from executor.flight import open_links
from executor.flight.preparation import (
    apply_changes,
    build_context_and_checklist,
    interview_vehicles,
    read_changes,
    upload_first_missions,
)
from executor.flight.run_start import FlightRequest
from executor.simulated.simulated_fleet import build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from missions import dialect_for
from tests.benchmarks.virtual.short_line import shared, write_line
from tests.sitl.flights import Story, WatchfulConsole
from tests.sitl.radio import RadioRelay, slowed
from tests.sitl.real import BOTH, PX4, RELAYED, Autopilot, RealVehicle, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(590)]

PROFILE = "sik-ecc-mended"


def ground_of(folder: Path, autopilot: Autopilot) -> SiteModel:
    ports = range(autopilot.port + RELAYED, autopilot.port + RELAYED + 3)
    site = build_demo_site(
        network=write_line(folder / "line.geojson"), radius_m=1e6, vehicles=3, speedup=1.0, autopilot=autopilot.name,
        ports=ports,
    )  # fmt: skip
    site["flight"] = {"speedup": 1.0, "connect_timeout_s": 120.0, "ready_timeout_s": 240.0}
    return site_model.load_site_model(check_site(site, "test"), folder)


@BOTH
def test_a_checklist_and_missions_over_a_slow_radio(autopilot: Autopilot, tmp_path: Path) -> None:
    if autopilot.binary is None:
        pytest.skip(f"{autopilot.variable}: expected the path of a real {autopilot.name}")
    ground = ground_of(tmp_path, autopilot)
    setup = ground.setup
    pads = {pad.vehicle: pad for pad in setup.pads}
    wanted = Wanted(pads, ground.network.frame, 1.0, {}, frozenset())
    order = FlightRequest(ground.site, tmp_path, ground, shared(ground), tmp_path, lambda _: ())
    ports = range(autopilot.port, autopilot.port + 3)
    radio = RadioRelay(ports, range(ports.start + RELAYED, ports.stop + RELAYED), PROFILE)
    with radio.running(), running(autopilot, Path(autopilot.binary), tmp_path / "work", wanted) as vehicles:
        if autopilot is PX4:
            for number, name in enumerate(vehicles):
                slowed(number, tmp_path / "work" / name)
        asyncio.run(_prepare(order, autopilot, vehicles, radio))


async def _prepare(
    order: FlightRequest, autopilot: Autopilot, vehicles: Mapping[str, RealVehicle], radio: RadioRelay
) -> None:
    clock, console, began_s = SystemClock(1.0), WatchfulConsole(Story()), time.monotonic()

    def told(what: str) -> None:
        air = f"down {radio.offered[False]} B, up {radio.offered[True]} B, {radio.dropped} B dropped"
        print(f"{time.monotonic() - began_s:6.1f} s {what}; {air}")

    async with open_links.open_links(order, clock, recorded=False) as links:
        facts = await interview_vehicles(order, links, clock, console)
        told(f"asked, {[len(one.parameters) for one in facts.values()]} parameters")
        context, boards, found = build_context_and_checklist(order, facts)
        proposal = await read_changes(context, links, clock)
        told("looked at what is to be set")
        found += proposal.checks
        print("\n".join(f"{one.severity.value} {one.subject}: {one.text}" for one in found))
        assert not [one.text for one in found if one.severity is Severity.STOP]
        assert not any(one.unread for one in facts.values())
        await apply_changes(order.run, proposal, context, links, clock, console)
        told("set")
        await upload_first_missions(context, links, clock, boards, console)
        told(f"on board; {len(radio.items)} items, {sum(radio.items.values())} sent, at most "
             f"{max(radio.items.values())} times")  # fmt: skip
    rule = dialect_for(autopilot.name).return_parameters
    for name, vehicle in vehicles.items():
        question = mav.MAVLink_param_request_read_message(vehicle.sysid, 1, rule.height.encode(), -1)
        height_m = vehicle.other.ask(question, "PARAM_VALUE").param_value * rule.unit_m
        assert height_m == pytest.approx(context.return_height_m(name), abs=0.2)
    if not radio.dropped:
        assert max(radio.items.values()) <= 2
