"""Prepare a flight: query every vehicle, build the checklist, and upload first missions.

First missions, parameters, fences and rally points are uploaded; the previous values are recorded first.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from executor import supervised
from executor.adapters.clock import SystemClock
from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.codes import Check, CheckCode, Severity
from executor.core.interface.commands import Level, Upload
from executor.core.interface.ports import Clock, OpenLink
from executor.core.lines import checklist
from executor.core.preflight import fence_changes, mission_checks, vehicle_checks
from executor.core.preflight.fence_changes import OnboardLists, WantedLists
from executor.core.preflight.onboard_failsafes import read_link_failsafe
from executor.core.preflight.parameter_changes import (
    LIST_WORDS,
    UNASKED,
    ChangeStage,
    KeptList,
    ParameterProposal,
    add_other_homes,
    check_return_height,
    propose_stream_changes,
)
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.radio_budget import check_radio
from executor.core.state.onboard_fence import build_rally_list
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import ExecutorError, PreflightFailed
from executor.flight import open_links
from executor.flight.open_links import follow_fleet_time, run_concurrently, run_for_each
from executor.flight.restore_vehicles import LISTS, PARAMETERS, BoardRecord, Links
from executor.flight.run_start import Console, FlightRequest, build_context_and_boards
from executor.runtime import procedures
from executor.runtime import vehicle_preflight as asking
from executor.runtime.channel import channel_of
from executor.site import day_plans
from executor.site.plan_summary import build_plan_checks, describe_site_choices
from executor.site.site_file import Site
from executor.site.site_keys import VehicleTable
from executor.site.site_model import radio_share_of
from executor.site.site_parts import base_places_m, build_places
from missions import MissionKind, Pad, dialect_for, encode
from missions.fences import Fence, build_fence_items


async def interview_vehicles(
    request: FlightRequest, links: Mapping[str, OpenLink], clock: SystemClock, console: Console
) -> Mapping[str, VehicleFacts]:
    """Query every vehicle.

    Raises:
        ConnectionFailed: a vehicle does not answer.
        PreflightFailed: a vehicle does not become ready.
    """
    console.say(Level.INFO, f"waiting for {len(links)} vehicles")
    everybody = request.site.vehicle
    facts = await run_concurrently(
        connect_and_interview(request.site, table, links[table.name], clock, console) for table in everybody
    )
    return {table.name: fact for table, fact in zip(everybody, facts, strict=True)}


async def connect_and_interview(
    site: Site, table: VehicleTable, link: OpenLink, clock: SystemClock, console: Console
) -> VehicleFacts:
    """Wait for one vehicle, and query its type and readiness.

    Raises:
        ConnectionFailed: it does not answer.
        PreflightFailed: it does not become ready.
    """
    name, timeout_s = table.name, site.flight.connect_timeout_s
    where = " or ".join(map(str, table.links))
    await asking.wait_for_vehicle(name, where, table.sysid, link, timeout_s, clock)

    def waits(missing: str) -> None:
        console.say(Level.INFO, f"{name}: not ready yet: {missing}")

    dialect = dialect_for(table.autopilot)
    more = [] if site.terrain is None else [rule.parameter for rule in dialect.terrain]
    more += [dialect.shutter.parameter] if site.look else []
    share = radio_share_of(site, name)
    facts = await asking.interview_vehicle(name, link, clock, dialect, site.flight.ready_timeout_s, waits, more, share)
    console.say(Level.INFO, f"{name}: ready, {facts.words}, battery {facts.remaining_pct:.0f} %")
    return facts


def build_context_and_checklist(
    request: FlightRequest, facts: Mapping[str, VehicleFacts]
) -> tuple[Context, Mapping[str, OnboardMission | None], list[Check]]:
    """Return the context of the flight, each vehicle's first mission, and the checklist.

    Pads are at the vehicles' reported positions, where they will land.
    """
    ground, site = request.ground, request.site
    frame, pads = ground.network.frame, []
    for name in ground.names:
        here = facts[name].position
        pads.append(Pad(name, *frame.to_local_m(here.lat_deg, here.lon_deg), here.alt_msl_m - here.alt_rel_m))
    dialects = {table.name: dialect_for(table.autopilot) for table in site.vehicle}
    own = {name: read_link_failsafe(dialects[name], fact.parameters, fact.unread) for name, fact in facts.items()}
    parameters = {name: fact.parameters for name, fact in facts.items()}
    setup_now = replace(ground.setup, pads=tuple(pads))
    context, boards = build_context_and_boards(ground, setup_now, request.plan, request.day, own, parameters)
    paths = {name: board.path for name, board in boards.items() if board is not None}
    found = mission_checks.check_flight_heights(context.setup, list(paths.values()), ground.worth_a_look)
    stated_m = {pad.vehicle: (pad.east_m, pad.north_m) for pad in build_places(site, context.frame)[0]}
    pads_m = {**base_places_m(site, context.frame), **stated_m}
    visits = {name: board.visits for name, board in boards.items() if board is not None}
    found += mission_checks.check_missions_and_areas(context.setup, list(paths.values()), visits, stated_m)
    found += _list_day_pads(context)
    found += _check_links(site, context, facts)
    found.append(vehicle_checks.check_disk_space(shutil.disk_usage(request.run).free, paths, context))
    found += vehicle_checks.check_layer_separation(
        list(paths.values()), site.inspection.layer_m, context.setup.home_alt_m
    )
    found += mission_checks.check_inspection_distances(context.setup, list(paths.values()), visits)
    for name, fact in facts.items():
        setup, board = context.vehicles[name], boards[name]
        path = board.path if board is not None else None
        place_m = context.frame.to_local_m(fact.position.lat_deg, fact.position.lon_deg)
        found += vehicle_checks.check_identity(fact, setup.dialect, place_m, pads_m.get(name))
        found += vehicle_checks.check_pad_height(context, fact)
        found.append(
            vehicle_checks.check_link_failsafe(
                fact, own[name], waited_s=setup.link_timeout_s, wanted_s=site.faults.link_timeout_s
            )
        )
        found += vehicle_checks.check_links(fact)
        found += vehicle_checks.check_ground_stations(fact, setup.dialect, site.link.station_sysid)
        needs_pct = None if path is None else vehicle_checks.estimate_flight(context, path).energy_pct
        left_pct = None if needs_pct is None else fact.remaining_pct - needs_pct
        found += vehicle_checks.check_battery_failsafe_settings(fact, setup.dialect, left_pct)
        if site.terrain is not None:
            found += vehicle_checks.check_terrain_following(fact, setup.dialect)
            found += vehicle_checks.check_pad_ground(context, fact)
        found += vehicle_checks.check_shutter(fact, setup.dialect, path)
        found += vehicle_checks.check_own_geofence(context, fact, path)
        found += vehicle_checks.check_pack(context, fact)
        found += vehicle_checks.flight_times(fact, setup.dialect)
        found.append(vehicle_checks.check_energy(context, name, path, fact.remaining_pct))
    # Last, next to the question that follows: the crew confirms what it sees.
    later = frozenset[int]() if request.day is None else day_plans.find_later_segments(request.day)
    found += _check_plan(request, later)
    return context, boards, found


def _check_plan(request: FlightRequest, later: frozenset[int] = frozenset()) -> list[Check]:
    ground = request.ground
    asked = len(ground.network.segments) - len(ground.left_out)
    return build_plan_checks(request.plan, asked, later, describe_site_choices(ground))


async def upload_first_missions(
    context: Context,
    links: Mapping[str, OpenLink],
    clock: SystemClock,
    boards: Mapping[str, OnboardMission | None],
    console: Console,
) -> None:
    """Upload each vehicle's first mission.

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


def _check_links(site: Site, context: Context, facts: Mapping[str, VehicleFacts]) -> list[Check]:
    """Check which stations may send on the links, which others are present, and the load of the radios."""
    links, signed = {table.name: table.links for table in site.vehicle}, site.signing is not None
    found = [vehicle_checks.check_signing(links, signed=signed)]
    found += vehicle_checks.check_forwarding(
        facts.values(), site.forward.ports, allow_orders=site.forward.allow_orders, signed=signed
    )
    for channel in dict.fromkeys(None if site.link.one_radio else first for first, *_ in links.values()):
        behind = [name for name in facts if channel is None or links[name][0] == channel]
        setup, measured = context.vehicles[behind[0]], tuple(facts[name].link for name in behind)
        found += check_radio(setup.radio, setup.dialect, measured)
    return found


def _list_day_pads(context: Context) -> list[Check]:
    """Return checks for landings at bases other than a vehicle's own: people keep clear there too."""
    if context.day is None:
        return []
    checks = []
    for name, own in context.day.pads.items():
        for base, pad in own.items():
            if base != context.day.bases[name]:
                lat_deg, lon_deg = context.frame.to_wgs84_deg(pad.east_m, pad.north_m)
                checks.append(checklist.LANDS_THERE.say(name, base=base, lat_deg=lat_deg, lon_deg=lon_deg))
    return checks


async def run_checklist_only(request: FlightRequest, console: Console) -> list[Check]:
    """Query every vehicle, and return the checklist that a flight would show before its take-off.

    A vehicle that does not answer, or is not ready, is a STOP; the others are checked all the same.

    Raises:
        ConnectionFailed: a connection cannot be opened.
    """
    site = request.site

    async def one(table: VehicleTable, link: OpenLink, clock: SystemClock) -> VehicleFacts | Check:
        try:
            return await connect_and_interview(site, table, link, clock, console)
        except ExecutorError as error:
            return Check(Severity.STOP, table.name, str(error).removeprefix(f"{table.name}: "), CheckCode.NOT_READY)

    with supervised.watch_internal_errors(lambda text: console.say(Level.FAULT, text), None):
        async with follow_fleet_time(site, console) as fleet:
            clock = SystemClock.start_on(site.flight.speedup, fleet.steady_s)
            async with open_links.open_links(request, clock, recorded=False) as links:
                answers = await asyncio.gather(*(one(table, links[table.name], clock) for table in site.vehicle))
                facts = {answer.name: answer for answer in answers if isinstance(answer, VehicleFacts)}
                found = [answer for answer in answers if isinstance(answer, Check)]
                if not found:
                    context, boards, found = build_context_and_checklist(request, facts)
                    found += check_fences_on_board(context, facts, boards, await read_fences(context, links, clock))
                    return [*found, *(await read_changes(context, links, clock)).checks]
    found += _check_plan(request)
    # Without every vehicle's position there are no pads, and no paths to check.
    frame = request.ground.network.frame
    for table in site.vehicle:
        if table.name in facts:
            fact, dialect = facts[table.name], dialect_for(table.autopilot)
            found += vehicle_checks.check_identity(
                fact, dialect, frame.to_local_m(fact.position.lat_deg, fact.position.lon_deg)
            )
            found += vehicle_checks.check_ground_stations(fact, dialect, site.link.station_sysid)
            found += vehicle_checks.check_battery_failsafe_settings(fact, dialect, None)
    return found


async def read_changes(context: Context, links: Links, clock: Clock) -> ParameterProposal:
    """Read every vehicle's parameters, and return the changes that the flight would make; nothing is set."""
    answers = await run_for_each(context.vehicles, lambda name: asking.read_present(context, name, links[name], clock))
    proposal = add_other_homes(context, fence_changes.propose_changes(context, answers))
    return propose_stream_changes(context, proposal, [name for name in links if channel_of(links[name]).radio])


def compose_changes_question(proposal: ParameterProposal, *, fences: int = 0) -> str:
    """Return the question before anything is set.

    Args:
        proposal: Parameters to change.
        fences: Number of vehicles whose fence changes.
    """
    counted = ((len(proposal.changes), "parameter"), (fences, "fence"))
    what = " and ".join(format_count(count, name) for count, name in counted if count)
    return f"Change {what} on board until the flight is over?"


async def apply_changes(
    run: Path, proposal: ParameterProposal, context: Context, links: Links, clock: Clock, console: Console
) -> list[Check]:
    """Set the parameters that the flight needs, and return how every changed vehicle does RTL now.

    The previous values are recorded in the run directory, and synced to disk, before anything is sent.

    Raises:
        PreflightFailed: the record cannot be written, and nothing was set; or a vehicle does not take what keeps it
            clear of the others, or what its fence needs.
        LogError: there is a record of an earlier attempt, and it cannot be read.
    """
    record = BoardRecord.open(PARAMETERS, run, console, proposal.changes)
    record.write_first("nothing was changed on board")
    checks: list[Check] = []
    unfenced: list[str] = []

    async def one(name: str) -> None:
        ends = await asking.set_changes(links[name], clock, proposal.changes_of(name))
        record.set_stage(name, (key for key, problem in ends.items() if not problem), ChangeStage.SET)
        own = fence_changes.list_fence_parameters(context, name)
        unfenced.extend(f"{name}: {ends[one]}; without it there is no fence" for one in own if ends.get(one))
        rest = {key: problem for key, problem in ends.items() if key not in (*own, UNASKED)}
        if ends.get(UNASKED):
            console.say(Level.WARNING, f"{name}: {UNASKED}: {ends[UNASKED]}")
        if rest:
            checks.append(check_return_height(context, name, proposal, rest))
            console.show_checks(checks[-1:])

    await run_for_each(dict.fromkeys(change.vehicle for change in proposal.changes), one)
    refused = unfenced + [f"{check.subject}: {check.text}" for check in checks if check.severity is Severity.STOP]
    if refused:
        raise PreflightFailed(refused[0])
    return checks


async def read_fences(context: Context, links: Links, clock: Clock) -> dict[str, OnboardLists]:
    """Read every vehicle's fence and rally points; empty if the site has no fence table."""
    if context.fencing is None:
        return {}

    async def read(name: str) -> OnboardLists:
        return {kind: await procedures.read_list(links[name], clock, kind) for kind in LIST_WORDS}

    return await run_for_each(context.vehicles, read)


def check_fences_on_board(
    context: Context,
    facts: Mapping[str, VehicleFacts],
    boards: Mapping[str, OnboardMission | None],
    found: Mapping[str, OnboardLists],
    run: Path | None = None,
) -> list[Check]:
    """Check fences on board against the flight.

    Args:
        context: Context of the flight.
        facts: Answers of the vehicles.
        boards: First missions.
        found: Fence and rally lists on board.
        run: A directory with the record of an earlier attempt.

    Raises:
        LogError: that record cannot be read.
    """
    kept = {} if run is None else {one.key: one for one in LISTS.read(run) if one.is_open}
    told: list[Check] = []
    for name, lists in found.items():
        ours = {
            kind: items
            for kind, items in lists.items()
            if items is not None and (known := kept.get((name, kind.name.lower()))) is not None and known.is_ours(items)
        }
        board = boards[name]
        told += fence_changes.check_onboard_lists(
            context, facts[name], None if board is None else board.path, lists, ours
        )
    return told


def build_wanted_lists(context: Context, first: Mapping[str, Fence]) -> dict[str, WantedLists]:
    """Return the fence and rally points to upload, by vehicle; empty if the site wants none."""
    fences = {name: {MissionKind.FENCE: build_fence_items(fence, context.frame)} for name, fence in first.items()}
    rally = {name: build_rally_list(context, name) for name in first}
    return {
        name: fence if (points := rally[name]) is None else {**fence, MissionKind.RALLY: points}
        for name, fence in fences.items()
    }


def describe_fence_changes(
    context: Context, first: Mapping[str, Fence], found: Mapping[str, OnboardLists]
) -> list[str]:
    """Return what an upload replaces on board, for the crew to confirm."""
    told = []
    for name, lists in build_wanted_lists(context, first).items():
        had = {kind: len(items or ()) or "none" for kind, items in found.get(name, {}).items()}
        fence = f"fence of {len(lists[MissionKind.FENCE])} corners (had {had.get(MissionKind.FENCE, 'none')})"
        rally = f", {_name_rally(lists)} (had {had.get(MissionKind.RALLY, 'none')})"
        told.append(f"{name}: {fence}{rally if MissionKind.RALLY in lists else ''}")
    return told


def _name_rally(lists: OnboardLists) -> str:
    points = len(lists.get(MissionKind.RALLY) or ())
    return "its pad as rally point" if points == 1 else f"its {points} pads as rally points"


async def upload_wanted_lists(
    run: Path,
    context: Context,
    links: Links,
    clock: Clock,
    first: Mapping[str, Fence],
    found: Mapping[str, OnboardLists],
    console: Console,
) -> None:
    """Upload every vehicle's fence and rally points; the previous ones are recorded, and synced to disk, first.

    Raises:
        PreflightFailed: the record cannot be written; nothing was sent.
        VehicleRefused: a vehicle did not take them.
        LogError: there is a record of an earlier attempt, and it cannot be read.
    """
    lists = build_wanted_lists(context, first)
    if not lists:
        return
    planned = [
        KeptList(name, setup.sysid, setup.dialect.name, kind.name.lower(), old, new)
        for name, wanted in lists.items()
        for setup in (context.vehicles[name],)
        for kind, new in wanted.items()
        if (old := found[name][kind]) is not None
    ]
    record = BoardRecord.open(LISTS, run, console, planned)
    record.write_first("no fence was put on board")

    async def load(name: str) -> None:
        new = lists[name]
        await asking.load_lists(name, links[name], clock, context.vehicles[name].dialect, new)
        record.set_stage(name, ("fence", "rally"), ChangeStage.SET)
        rally = f", and {_name_rally(new)}" if MissionKind.RALLY in new else ""
        corners = len(new[MissionKind.FENCE])
        console.say(Level.INFO, f"{name}: fence of {corners} corners on board{rally}, verified by read-back")

    await run_for_each(lists, load)


def record_wider_fence(run: Path, context: Context, command: Upload) -> None:
    """Record a wider fence that is about to be uploaded in flight.

    Raises:
        OSError: it cannot be written.
        LogError: the record cannot be read.
    """
    if command.fence is None:
        return
    items = build_fence_items(command.fence, context.frame)
    kept = [
        replace(one, new=items, earlier=(*one.earlier, one.new), stage=ChangeStage.PLANNED)
        if one.vehicle == command.vehicle and one.kind is MissionKind.FENCE and items not in (*one.earlier, one.new)
        else one
        for one in LISTS.read(run)
    ]
    LISTS.write(run, kept)
