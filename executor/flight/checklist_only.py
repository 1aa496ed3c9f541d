"""The checklist alone: everybody is asked, nothing is changed on board, and nothing moves."""

from __future__ import annotations

import asyncio

from executor import supervised
from executor.adapters.clock import SystemClock
from executor.core.interface.check_codes import Check, CheckCode, Severity
from executor.core.interface.commands import Level
from executor.core.interface.ports import OpenLink
from executor.core.preflight import vehicle_checks
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.errors import ExecutorError
from executor.flight import fencing, open_links, preparation
from executor.flight.flight_request import Console, FlightRequest
from executor.flight.parameter_changes import read_changes
from executor.flight.simulation_clock import follow_fleet_time
from executor.site.plan_summary import build_plan_checks
from executor.site.tables.aircraft import VehicleTable
from missions import dialect_for


async def run_checklist_only(order: FlightRequest, console: Console) -> list[Check]:
    """Ask every vehicle, and return what a flight would be told before its take-off.

    A vehicle that does not answer, or is not ready, is a check that stops; the others are looked at all the same.

    Raises:
        ConnectionFailed: a connection cannot be opened.
    """
    with supervised.watch_mistakes(lambda text: console.say(Level.FAULT, text), None):
        async with follow_fleet_time(order.site, console) as found:
            return await _interview_and_check(
                order, console, SystemClock.start_on(order.site.flight.speedup, found.steady)
            )


async def _interview_and_check(order: FlightRequest, console: Console, clock: SystemClock) -> list[Check]:
    async def one(table: VehicleTable, link: OpenLink) -> VehicleFacts | Check:
        try:
            return await preparation.connect_and_interview(order.site, table, link, clock, console)
        except ExecutorError as error:
            return Check(Severity.STOP, table.name, str(error).removeprefix(f"{table.name}: "), CheckCode.NOT_READY)

    async with open_links.open_links(order, clock, recorded=False) as links:
        answers = await asyncio.gather(*(one(table, links[table.name]) for table in order.site.vehicle))
        facts = {answer.name: answer for answer in answers if isinstance(answer, VehicleFacts)}
        found = [answer for answer in answers if isinstance(answer, Check)]
        if not found:
            context, boards, found_of = preparation.build_context_and_checklist(order, facts)
            found_of += fencing.check_fences_on_board(
                context, facts, boards, await fencing.read_fences(context, links, clock)
            )
            return [*found_of, *(await read_changes(context, links, clock)).checks]
    found += build_plan_checks(order.plan, len(order.ground.network.segments))
    # Without everybody's place there are no pads, and no paths to look at.
    frame = order.ground.network.frame
    for table in order.site.vehicle:
        if table.name in facts:
            fact, dialect = facts[table.name], dialect_for(table.autopilot)
            found += vehicle_checks.check_identity(
                fact, dialect, frame.to_local_m(fact.position.lat_deg, fact.position.lon_deg)
            )
            found += vehicle_checks.check_ground_stations(fact, dialect)
            found += vehicle_checks.check_battery_failsafe_settings(fact, dialect, None)
    return found
