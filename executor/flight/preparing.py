"""What comes before a flight: everybody is asked, the checklist is made, the first missions are put on board."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from executor.adapters.clock import SystemClock
from executor.core.commands import Level
from executor.core.context import Context
from executor.core.parts import OnBoard
from executor.core.ports import OpenLink
from executor.core.preflight import cameras, checks, terrain
from executor.core.preflight.checks import Check, Facts
from executor.core.preflight.failsafes import link_failsafe
from executor.core.vehicle import aboard
from executor.flight.checklist import checklist
from executor.flight.flight_order import Console, Order
from executor.flight.side_by_side import in_turns, together
from executor.runtime import preflight as asking
from executor.site import assembly, dayflight
from executor.site.assembly import Ground
from executor.site.config import Site
from executor.site.tables.aircraft import VehicleTable
from missions import FlightSetup, dialect_for, encode, tuned


async def interviews(
    order: Order, links: Mapping[str, OpenLink], clock: SystemClock, console: Console
) -> Mapping[str, Facts]:
    """Ask everybody.

    Raises:
        ConnectionFailed: somebody does not answer.
        PreflightFailed: somebody does not become ready.
    """
    console.say(Level.INFO, f"waiting for {len(links)} vehicles")
    everybody = order.site.vehicle
    facts = await together(
        interview_at_link(order.site, table, links[table.name], clock, console) for table in everybody
    )
    return {table.name: fact for table, fact in zip(everybody, facts, strict=True)}


async def interview_at_link(
    site: Site, table: VehicleTable, link: OpenLink, clock: SystemClock, console: Console
) -> Facts:
    """Wait for one vehicle, and ask it what it is and whether it is ready.

    Raises:
        ConnectionFailed: it does not answer.
        PreflightFailed: it does not become ready.
    """
    name, timeout_s = table.name, site.flight.connect_timeout_s
    await asking.answer(name, table.connection, table.sysid, link, timeout_s, clock)

    def waits(missing: str) -> None:
        console.say(Level.INFO, f"{name}: not ready yet: {missing}")

    dialect = dialect_for(table.autopilot)
    more = () if site.terrain is None else terrain.named_parameters(dialect)
    more += cameras.shutter_parameters(dialect) if site.look else ()
    facts = await asking.interview(name, link, clock, dialect, site.flight.ready_timeout_s, waits, more)
    console.say(Level.INFO, f"{name}: ready, {facts.words}, battery {facts.remaining_pct:.0f} %")
    return facts


def examined(order: Order, facts: Mapping[str, Facts]) -> tuple[Context, Mapping[str, OnBoard | None], list[Check]]:
    """Return the context of the flight, everybody's first mission, and the checklist."""
    ground = order.ground
    setup = _setup(ground, facts)
    task, plan = order.plan.task(), order.plan.plan
    dialects = {table.name: dialect_for(table.autopilot) for table in order.site.vehicle}
    own = {name: link_failsafe(dialects[name], fact.parameters, fact.unread) for name, fact in facts.items()}
    performances = {
        name: tuned(dialects[name].performance, dialects[name].tunings, fact.parameters) for name, fact in facts.items()
    }
    context = assembly.context_of(ground, setup, task, own, performances)
    if order.day is not None:
        context = replace(context, day=dayflight.day_rules(order.day))
    boards = _boards(context, assembly.routes_of(ground, task, plan))
    return (
        context,
        boards,
        checklist(order, context, facts, own, boards, shutil.disk_usage(order.run).free),
    )


def _setup(ground: Ground, facts: Mapping[str, Facts]) -> FlightSetup:
    frame = ground.network.frame
    pads = []
    for name in ground.names:
        position = facts[name].position
        east_m, north_m = frame.to_local_m(position.lat_deg, position.lon_deg)
        pads.append(checks.pad_from(facts[name], east_m, north_m))
    return assembly.setup_of(ground, pads)


def _boards(context: Context, routes: Mapping[str, tuple[int, ...]]) -> dict[str, OnBoard | None]:
    paths = assembly.paths_of(context.setup, routes, context.vehicles)
    return {
        name: aboard(context, name, 0, paths[name], routes[name]) if name in paths else None
        for name in context.vehicles
    }


async def load_all(
    context: Context,
    links: Mapping[str, OpenLink],
    clock: SystemClock,
    boards: Mapping[str, OnBoard | None],
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

    await in_turns(carried, load)
