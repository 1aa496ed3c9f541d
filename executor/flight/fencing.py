"""Fences and rally points of a flight: read, kept on record, put on board, and given back."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.core.context import Context
from executor.core.formatting import command_line
from executor.core.interface.commands import Level, Upload
from executor.core.interface.ports import Clock, OpenLink
from executor.core.preflight import fence_checks
from executor.core.preflight.fence_checks import OnboardLists
from executor.core.preflight.vehicle_checks import Check, VehicleFacts
from executor.core.state.onboard_fence import build_rally_list, encode_fence
from executor.core.state.vehicle_parts import OnboardMission
from executor.errors import LogError, PreflightFailed
from executor.flight.concurrency import AT_ONCE, run_for_each
from executor.flight.flight_request import Console
from executor.flight.kept_lists import KeptList, ListStage, build_planned_lists, read_kept_lists, write_kept_lists
from executor.flight.parameter_changes import Links
from executor.runtime import parameter_restore, procedures, vehicle_preflight
from executor.runtime.parameter_restore import HEARD_S
from missions import MissionKind, dialect_for
from missions.fences import Fence, find_list_differences


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
    before = read_kept_lists(run)
    made = [
        one
        for name, new in lists.items()
        for one in build_planned_lists(
            before, name, (context.vehicles[name].sysid, context.vehicles[name].dialect.name), found[name], new
        )
    ]
    keys = {(one.vehicle, one.kind) for one in made}
    record = _Record(run, console, [*(one for one in before if (one.vehicle, one.kind) not in keys), *made])
    try:
        write_kept_lists(run, record.kept)
    except OSError as error:
        text = f"{RunDirectory(run).fences}: cannot be written: {error.strerror}; no fence was put on board"
        raise PreflightFailed(text) from error

    async def load(name: str) -> None:
        new = lists[name]
        await vehicle_preflight.load_lists(name, links[name], clock, context.vehicles[name].dialect, new)
        record.set_vehicle_stage(name, ListStage.SET)
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
        replace(one, new=(*one.new, items), stage=ListStage.PLANNED)
        if one.vehicle == command.vehicle and one.kind is MissionKind.FENCE and items not in one.new
        else one
        for one in read_kept_lists(run)
    ]
    write_kept_lists(run, kept)


async def restore_kept_lists(
    run: Path, links: Links, clock: Clock, console: Console, heard_s: float = HEARD_S
) -> tuple[KeptList, ...]:
    """Give back what was replaced to every vehicle that answers and is not armed; say of each what became of it.

    Args:
        run: Where the record is.
        links: To the vehicles.
        clock: The flight's.
        console: Where it is said.
        heard_s: How long a vehicle is waited for, in its time.

    Returns:
        The whole record as it is now; empty if nothing was ever replaced, or the record cannot be read.
    """
    try:
        record = _Record(run, console, list(read_kept_lists(run)))
    except LogError as error:
        console.say(Level.WARNING, str(error))
        return ()
    waiting: dict[str, list[KeptList]] = {one.vehicle: [] for one in record.kept if one.is_open}
    for one in record.kept:
        if one.is_open:
            waiting[one.vehicle].append(one)
    turn = asyncio.Semaphore(AT_ONCE)

    async def of(name: str, kept: Sequence[KeptList]) -> None:
        problems = {one.kind: "is not in the site file" for one in kept}
        if name in links:
            async with turn:
                problems = await _restore_vehicle_lists(links[name], clock, kept, record, heard_s)
        _report_restored(run, console, name, kept, problems)

    async with asyncio.TaskGroup() as tasks:
        for name, kept in waiting.items():
            tasks.create_task(of(name, kept))
    return tuple(record.kept)


def _report_restored(
    run: Path, console: Console, name: str, kept: Sequence[KeptList], problems: Mapping[MissionKind, str]
) -> None:
    """Say of one vehicle what it has again, and what stays."""
    back = [one.list_name for one in kept if one.kind not in problems]
    if back:
        console.say(Level.INFO, f"{name}: {' and '.join(back)} restored")
    for one in kept:
        if one.kind in problems:
            console.say(Level.WARNING, f"{name}: {one.list_name} not restored: {problems[one.kind]}")
    if problems:
        console.say(Level.WARNING, f"{name}: to restore: {command_line('restore', run)}")


async def _restore_vehicle_lists(
    link: OpenLink, clock: Clock, kept: Sequence[KeptList], record: _Record, heard_s: float
) -> dict[MissionKind, str]:
    """Give one vehicle its lists back; returns why it does not have one of them."""
    problems: dict[MissionKind, str] = {}
    async with parameter_restore.wait_for_rest(link, clock, kept[0].autopilot, heard_s) as rest:
        for one in kept:
            problem = rest.problem or ("" if rest.rests() else "was armed meanwhile")
            stage = None
            if not problem:
                stage, problem = await _restore_one_list(link, clock, one)
            if stage is not None:
                record.set_list_stage(one, stage)
            if problem:
                problems[one.kind] = problem
    return problems


async def _restore_one_list(link: OpenLink, clock: Clock, one: KeptList) -> tuple[ListStage | None, str]:
    """Give one list back; returns how far it has come, and why it is not back."""
    found = await procedures.read_list(link, clock, one.kind)
    if found is None:
        return None, "cannot be read"
    if not find_list_differences(one.old, found):
        return ListStage.RESTORED, ""
    if not one.is_ours(found):
        return ListStage.LEFT, "another is on board, which somebody put there since: left as it is"
    problem = await vehicle_preflight.restore_list(link, clock, dialect_for(one.autopilot), one.kind, one.old)
    return (None, problem) if problem else (ListStage.RESTORED, "")


@dataclass(slots=True)
class _Record:
    """What is on record, and where."""

    run: Path
    console: Console
    kept: list[KeptList]

    def set_vehicle_stage(self, vehicle: str, stage: ListStage) -> None:
        """Note how far a vehicle's lists have come."""
        for one in [one for one in self.kept if one.vehicle == vehicle and one.is_open]:
            self.set_list_stage(one, stage)

    def set_list_stage(self, which: KeptList, stage: ListStage) -> None:
        """Note how far one list has come; an older record gives it back as well, it only asks again."""
        self.kept = [
            replace(one, stage=stage) if (one.vehicle, one.kind) == (which.vehicle, which.kind) else one
            for one in self.kept
        ]
        try:
            write_kept_lists(self.run, self.kept)
        except OSError as error:
            self.console.say(Level.WARNING, f"{RunDirectory(self.run).fences}: cannot be written: {error.strerror}")
