"""What comes before a flight: everybody is asked, the checklist is made, the first missions are put on board."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from functools import partial

from executor.adapters.clock import SystemClock
from executor.core.context import Context
from executor.core.interface.check_codes import Check
from executor.core.interface.commands import Level
from executor.core.interface.ports import OpenLink
from executor.core.preflight import vehicle_checks
from executor.core.preflight.failsafe_parameters import read_link_failsafe
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.vehicle_parts import OnboardMission
from executor.flight.checklist import build_checklist
from executor.flight.concurrency import run_concurrently, run_for_each
from executor.flight.flight_request import Console, FlightRequest
from executor.flight.run_start import build_context_and_boards
from executor.runtime import vehicle_preflight as asking
from executor.site import site_model
from executor.site.site_file import Site
from executor.site.site_model import SiteModel
from executor.site.tables.aircraft import VehicleTable
from missions import FlightSetup, dialect_for, encode


async def interview_vehicles(
    order: FlightRequest, links: Mapping[str, OpenLink], clock: SystemClock, console: Console
) -> Mapping[str, VehicleFacts]:
    """Ask everybody.

    Raises:
        ConnectionFailed: somebody does not answer.
        PreflightFailed: somebody does not become ready.
    """
    console.say(Level.INFO, f"waiting for {len(links)} vehicles")
    everybody = order.site.vehicle
    facts = await run_concurrently(
        connect_and_interview(order.site, table, links[table.name], clock, console) for table in everybody
    )
    return {table.name: fact for table, fact in zip(everybody, facts, strict=True)}


async def connect_and_interview(
    site: Site, table: VehicleTable, link: OpenLink, clock: SystemClock, console: Console
) -> VehicleFacts:
    """Wait for one vehicle, and ask it what it is and whether it is ready.

    Raises:
        ConnectionFailed: it does not answer.
        PreflightFailed: it does not become ready.
    """
    name, timeout_s = table.name, site.flight.connect_timeout_s
    await asking.wait_for_vehicle(name, table.connection, table.sysid, link, timeout_s, clock)

    def waits(missing: str) -> None:
        console.say(Level.INFO, f"{name}: not ready yet: {missing}")

    dialect = dialect_for(table.autopilot)
    more = () if site.terrain is None else vehicle_checks.list_terrain_parameters(dialect)
    more += vehicle_checks.list_shutter_parameters(dialect) if site.look else ()
    facts = await asking.interview_vehicle(name, link, clock, dialect, site.flight.ready_timeout_s, waits, more)
    console.say(Level.INFO, f"{name}: ready, {facts.words}, battery {facts.remaining_pct:.0f} %")
    return facts


def build_context_and_checklist(
    order: FlightRequest, facts: Mapping[str, VehicleFacts]
) -> tuple[Context, Mapping[str, OnboardMission | None], list[Check]]:
    """Return the context of the flight, everybody's first mission, and the checklist."""
    ground = order.ground
    setup = _build_setup(ground, facts)
    dialects = {table.name: dialect_for(table.autopilot) for table in order.site.vehicle}
    own = {name: read_link_failsafe(dialects[name], fact.parameters, fact.unread) for name, fact in facts.items()}
    parameters = {name: fact.parameters for name, fact in facts.items()}
    context, boards = build_context_and_boards(ground, setup, order.plan, order.day, own, parameters)
    return context, boards, build_checklist(order, context, facts, own, boards, shutil.disk_usage(order.run).free)


def _build_setup(ground: SiteModel, facts: Mapping[str, VehicleFacts]) -> FlightSetup:
    frame = ground.network.frame
    pads = []
    for name in ground.names:
        position = facts[name].position
        east_m, north_m = frame.to_local_m(position.lat_deg, position.lon_deg)
        pads.append(vehicle_checks.pad_from(facts[name], east_m, north_m))
    return site_model.build_flight_setup(ground, pads)


async def upload_first_missions(
    context: Context,
    links: Mapping[str, OpenLink],
    clock: SystemClock,
    boards: Mapping[str, OnboardMission | None],
    console: Console,
) -> None:
    """Put everybody's first mission on board.

    Raises:
        VehicleRefused: a vehicle did not take its mission.
    """
    carried = {name: board for name, board in boards.items() if board is not None}

    async def load(name: str) -> None:
        dialect = context.vehicles[name].dialect
        mission = encode(carried[name].path, dialect)
        await asking.load_mission(name, links[name], clock, dialect, mission, partial(console.say, Level.WARNING))
        console.say(Level.INFO, f"{name}: {len(mission.items)} mission items on board, verified by read-back")

    await run_for_each(carried, load)
