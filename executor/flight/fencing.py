"""Fences and rally points of a flight: read, kept on record, and put on board."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from executor.core.context import Context
from executor.core.interface.check_codes import Check
from executor.core.interface.commands import Level, Upload
from executor.core.interface.ports import Clock
from executor.core.preflight import board_changes
from executor.core.preflight.board_changes import ChangeStage, KeptList, OnboardLists, build_board_record
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.onboard_fence import build_rally_list, encode_fence
from executor.core.state.vehicle_parts import OnboardMission
from executor.flight.board_record import open_list_record, read_kept_lists, write_kept_lists
from executor.flight.concurrency import run_for_each
from executor.flight.flight_request import Console
from executor.flight.restore_vehicles import Links
from executor.runtime import vehicle_preflight
from missions import MissionKind
from missions.fences import Fence


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

    def ours(name: str, kind: MissionKind, items: board_changes.Items | None) -> board_changes.Items | None:
        known = next((one for one in kept if one.vehicle == name and one.kind is kind), None)
        return items if known is not None and items is not None and known.is_ours(items) else None

    told: list[Check] = []
    for name, lists in found.items():
        known = OnboardLists(ours(name, MissionKind.FENCE, lists.fence), ours(name, MissionKind.RALLY, lists.rally))
        board = boards[name]
        told += board_changes.check_onboard_lists(
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
