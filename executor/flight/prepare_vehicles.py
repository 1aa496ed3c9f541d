"""What a flight changes on board, parameters, fences and rally points: looked at, and set.

What was there before is on record first.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.commands import Level, Upload
from executor.core.interface.ports import Clock
from executor.core.preflight import fence_checks
from executor.core.preflight.board_changes import ChangeStage, KeptList, KeptParameter, build_board_record
from executor.core.preflight.fence_checks import OnboardLists
from executor.core.preflight.parameter_proposals import (
    Answers,
    ParameterProposal,
    check_return_height,
    propose_return_changes,
)
from executor.core.preflight.vehicle_checks import Check, Severity, VehicleFacts
from executor.core.state.onboard_fence import build_rally_list, encode_fence
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import PreflightFailed
from executor.flight.open_links import AT_ONCE, run_for_each
from executor.flight.restore_vehicles import (
    Links,
    open_list_record,
    open_parameter_record,
    read_kept_lists,
    read_kept_parameters,
    write_kept_lists,
)
from executor.flight.run_start import Console
from executor.runtime import board_restore, vehicle_preflight
from missions import MissionKind
from missions.fences import Fence


async def read_changes(context: Context, links: Links, clock: Clock) -> ParameterProposal:
    """Ask every vehicle what it has, and return what the flight would change; nothing is set."""

    async def read(name: str) -> Answers:
        beside = fence_checks.list_fence_parameters(context, name)
        return await board_restore.read_present(links[name], clock, context.vehicles[name].dialect, beside)

    return fence_checks.add_fence_changes(
        context, propose_return_changes(context, await run_for_each(context.vehicles, read))
    )


def describe_parameter_changes(proposal: ParameterProposal) -> list[str]:
    """Return every change with its old and new value and its reason."""
    return [f"{change.vehicle}: {change.words}" for change in proposal.changes]


def compose_changes_question(proposal: ParameterProposal, *, fences: int = 0) -> str:
    """Return what is asked before anything is set.

    Args:
        proposal: Which parameters.
        fences: Of how many vehicles the fence.
    """
    counted = ((len(proposal.changes), "parameter"), (fences, "fence"))
    what = " and ".join(format_count(count, name) for count, name in counted if count)
    return f"Change {what} on board until the flight is over?"


async def apply_changes(
    run: Path, proposal: ParameterProposal, context: Context, links: Links, clock: Clock, console: Console
) -> list[Check]:
    """Set what the flight needs, and return how every changed vehicle comes home now.

    What was there before is on record in the run directory, and on its disk, before anything is sent.

    Raises:
        PreflightFailed: the record cannot be written, and nothing was set; or a vehicle does not take what keeps it
            clear of the others, or what its fence needs.
        LogError: there is a record of an earlier attempt, and it cannot be read.
    """
    about = {name: (setup.sysid, setup.dialect.name) for name, setup in context.vehicles.items()}
    planned = [
        KeptParameter(one.vehicle, *about[one.vehicle], one.name, one.old, one.new, one.kind, one.unit, one.why)
        for one in proposal.changes
    ]
    record = open_parameter_record(run, console, build_board_record(planned, read_kept_parameters(run) or ()))
    record.write_first("nothing was changed on board")
    checks: list[Check] = []
    unfenced: list[str] = []
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str) -> None:
        async with turn:
            ends = await board_restore.set_changes(links[name], clock, proposal.changes_of(name))
        record.set_stage(name, (key for key, problem in ends.items() if not problem), ChangeStage.SET)
        own = fence_checks.list_fence_parameters(context, name)
        unfenced.extend(f"{name}: {ends[one]}; without it there is no fence" for one in own if ends.get(one))
        rest = {key: problem for key, problem in ends.items() if key not in own}
        if rest:
            checks.append(check_return_height(context, name, proposal, rest))
            console.show_checks(checks[-1:])

    async with asyncio.TaskGroup() as tasks:
        for name in dict.fromkeys(change.vehicle for change in proposal.changes):
            tasks.create_task(one(name))
    refused = unfenced + [f"{check.subject}: {check.text}" for check in checks if check.severity is Severity.STOP]
    if refused:
        raise PreflightFailed(refused[0])
    return checks


async def read_fences(context: Context, links: Links, clock: Clock) -> dict[str, OnboardLists]:
    """Read what everybody carries beside its mission; nothing where the site says nothing of fences."""
    if context.fencing is None:
        return {}
    return await run_for_each(context.vehicles, lambda name: vehicle_preflight.read_lists(links[name], clock))


def check_fences_on_board(
    context: Context,
    facts: Mapping[str, VehicleFacts],
    boards: Mapping[str, OnboardMission | None],
    found: Mapping[str, OnboardLists],
    run: Path | None = None,
) -> list[Check]:
    """Hold what is on board against the flight.

    Args:
        context: Of the flight.
        facts: What every vehicle said.
        boards: The first missions.
        found: What every vehicle carries beside.
        run: A directory with the record of an earlier attempt.

    Raises:
        LogError: that record cannot be read.
    """
    kept = [] if run is None else [one for one in read_kept_lists(run) if one.is_open]

    def ours(name: str, kind: MissionKind, items: fence_checks.Items | None) -> fence_checks.Items | None:
        known = next((one for one in kept if one.vehicle == name and one.kind is kind), None)
        return items if known is not None and items is not None and known.is_ours(items) else None

    told: list[Check] = []
    for name, lists in found.items():
        known = OnboardLists(ours(name, MissionKind.FENCE, lists.fence), ours(name, MissionKind.RALLY, lists.rally))
        board = boards[name]
        told += fence_checks.check_onboard_lists(
            context, facts[name], None if board is None else board.path, lists, known
        )
    return told


def build_wanted_lists(context: Context, first: Mapping[str, Fence]) -> dict[str, OnboardLists]:
    """Return what is put on board, by vehicle; nothing where the site wants none."""
    return {
        name: OnboardLists(encode_fence(context, fence), build_rally_list(context, name))
        for name, fence in first.items()
    }


def describe_fence_changes(
    context: Context, first: Mapping[str, Fence], found: Mapping[str, OnboardLists]
) -> list[str]:
    """Return what is replaced on board, for the crew to confirm."""
    told = []
    for name, lists in build_wanted_lists(context, first).items():
        had = found.get(name, OnboardLists())
        fence = f"fence of {len(lists.fence or ())} corners (had {len(had.fence or ()) or 'none'})"
        rally = "" if lists.rally is None else f", its pad as rally point (had {len(had.rally or ()) or 'none'})"
        told.append(f"{name}: {fence}{rally}")
    return told


async def upload_wanted_lists(
    run: Path,
    context: Context,
    links: Links,
    clock: Clock,
    first: Mapping[str, Fence],
    found: Mapping[str, OnboardLists],
    console: Console,
) -> None:
    """Put everybody's fence and rally points on board; what was there is on record, and on its disk, before.

    Raises:
        PreflightFailed: the record cannot be written; nothing was sent.
        VehicleRefused: a vehicle did not take them.
        LogError: there is a record of an earlier attempt, and it cannot be read.
    """
    lists = build_wanted_lists(context, first)
    if not lists:
        return
    planned = [
        KeptList(name, setup.sysid, setup.dialect.name, what, old, new)
        for name, wanted in lists.items()
        for setup in (context.vehicles[name],)
        for what, old, new in (("fence", found[name].fence, wanted.fence), ("rally", found[name].rally, wanted.rally))
        if old is not None and new is not None
    ]
    record = open_list_record(run, console, build_board_record(planned, read_kept_lists(run)))
    record.write_first("no fence was put on board")

    async def load(name: str) -> None:
        new = lists[name]
        await vehicle_preflight.load_lists(name, links[name], clock, context.vehicles[name].dialect, new)
        record.set_stage(name, ("fence", "rally"), ChangeStage.SET)
        rally = "" if new.rally is None else ", and its pad as rally point"
        console.say(
            Level.INFO, f"{name}: fence of {len(new.fence or ())} corners on board{rally}, verified by read-back"
        )

    await run_for_each(lists, load)


def record_wider_fence(run: Path, context: Context, command: Upload) -> None:
    """Put a wider fence on record that is about to go on board in flight.

    Raises:
        OSError: it cannot be written.
        LogError: the record cannot be read.
    """
    if command.fence is None:
        return
    items = encode_fence(context, command.fence)
    kept = [
        replace(one, new=items, earlier=(*one.earlier, one.new), stage=ChangeStage.PLANNED)
        if one.vehicle == command.vehicle and one.kind is MissionKind.FENCE and items not in (*one.earlier, one.new)
        else one
        for one in read_kept_lists(run)
    ]
    write_kept_lists(run, kept)
