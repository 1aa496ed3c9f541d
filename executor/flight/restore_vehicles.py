"""Vehicles are given back what a flight changed on them, from its run directory, whatever became of the flight."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.mavlink import endpoints
from executor.adapters.run_directory import RunDirectory, lock_run_directory
from executor.core.formatting import command_line
from executor.core.interface.commands import Level
from executor.core.interface.ports import Clock, Keyring, Link, LinkRequest, OpenLink
from executor.core.preflight.board_changes import Change, KeptList, KeptParameter
from executor.errors import LogError
from executor.flight.board_record import (
    BoardRecord,
    open_list_record,
    open_parameter_record,
    read_kept_lists,
    read_kept_parameters,
)
from executor.flight.concurrency import AT_ONCE
from executor.flight.flight_request import Console
from executor.flight.simulation_clock import follow_fleet_time
from executor.runtime.board_restore import (
    HEARD_S,
    RestingVehicle,
    RestoreResult,
    restore_lists,
    restore_parameters,
    wait_for_rest,
)
from executor.site.site_file import Site, read_signing_key, read_site

Links = Mapping[str, OpenLink]
Restore = Callable[[Link, Clock, Sequence[Change], RestingVehicle], Coroutine[None, None, RestoreResult[Change]]]


def read_open_changes(run: Path) -> tuple[Site, list[KeptParameter], list[KeptList]]:
    """Return the site of a flight, and which parameters, fences and rally points have still to be given back.

    Raises:
        LogError: the directory holds no record, or one that cannot be read.
        SiteError: site.toml cannot be used.
    """
    kept, lists = read_kept_parameters(run), read_kept_lists(run)
    if kept is None and not lists:
        raise LogError(f"{run}: expected a run directory with parameters.json; no parameter was changed from here")
    still = [one for one in kept or () if one.is_open]
    return read_site(RunDirectory(run).site), still, [one for one in lists if one.is_open]


def find_open_parameters(run: Path) -> list[KeptParameter]:
    """Return which parameters are not given back; a record that cannot be read is left to `restore` to say."""
    with suppress(LogError):
        return [one for one in read_kept_parameters(run) or () if one.is_open]
    return []


def check_run(run: Path, site: Site) -> None:
    """Refuse to fly from a directory whose record is of vehicles that the site file does not have: it would be lost.

    Raises:
        LogError: it is so, or the record cannot be read.
    """
    systems = {table.name: table.sysid for table in site.vehicle}
    for one in read_kept_parameters(run) or ():
        if one.is_open and systems.get(one.vehicle) != one.sysid:
            record = RunDirectory(run).parameters
            raise LogError(
                f"{record}: {one.vehicle} (system {one.sysid}) has not got its {one.name} back, and is not in the "
                f"site file; expected a new directory, or {command_line('restore', run)} before"
            )


async def restore_from_run(run: Path, console: Console) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Give back what is on record; returns both records as they are then.

    Nobody hears a heartbeat from here: a vehicle that somebody flies would take its end for a lost ground station.

    Raises:
        LogError: another process flies from this directory, or it holds no record.
        SiteError: site.toml cannot be used, or the signing key is missing.
        ConnectionFailed: a connection cannot be opened.
    """
    with lock_run_directory(run):
        site, waiting, lists = read_open_changes(run)  # now that nobody else writes to it
        names = {one.vehicle for one in waiting} | {one.vehicle for one in lists}
        async with follow_fleet_time(site, console) as found:
            clock = SystemClock.start_on(site.flight.speedup, found.steady)
            key = read_signing_key(site, run)
            keyring = None if key is None else Keyring(key, clock.steady_unix_s)
            # One way for all: it is the same connection, whichever software spoke to the vehicle in flight.
            wanted = {table.name: LinkRequest(table.link, table.sysid) for table in site.vehicle if table.name in names}
            async with endpoints.open_mavlink_links(wanted, keyring) as links:
                return await restore_board(run, links, clock, console, site.flight.connect_timeout_s * clock.speedup)


async def restore_board(
    run: Path, links: Links, clock: Clock, console: Console, heard_s: float = HEARD_S
) -> tuple[tuple[KeptParameter, ...], tuple[KeptList, ...]]:
    """Give back what was changed to every vehicle that answers and is not armed; say of each what became of it.

    Fences go before the parameters that say how they are kept to.

    Args:
        run: Where the record is.
        links: To the vehicles.
        clock: The flight's.
        console: Where it is said.
        heard_s: How long a vehicle is waited for, in its time.

    Returns:
        The records of parameters and of lists as they are now; empty if nothing was ever changed, or one cannot be
        read.
    """
    about = (run, links, clock, console, heard_s)
    lists = await _restore_record(lambda: open_list_record(run, console, read_kept_lists(run)), restore_lists, *about)
    parameters = await _restore_record(
        lambda: open_parameter_record(run, console, read_kept_parameters(run) or ()), restore_parameters, *about
    )
    return parameters, lists


async def _restore_record(
    open_record: Callable[[], BoardRecord[Change]],
    restore: Restore[Change],
    run: Path,
    links: Links,
    clock: Clock,
    console: Console,
    heard_s: float,
) -> tuple[Change, ...]:
    """Give back all that is open on one record."""
    try:
        record = open_record()
    except LogError as error:
        console.say(Level.WARNING, str(error))
        return ()
    waiting = _group_open(record.kept)
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str, kept: Sequence[Change]) -> None:
        if name not in links:
            given = RestoreResult(tuple(kept), ("is not in the site file",))
        else:
            async with turn, wait_for_rest(links[name], clock, kept[0].autopilot, heard_s) as rest:
                given = RestoreResult(tuple(kept), (rest.problem,))
                if not rest.problem:
                    given = await restore(links[name], clock, kept, rest)
        record.update(given.kept)
        waiting.pop(name)
        _report_restored(run, console, name, given)

    try:
        async with asyncio.TaskGroup() as tasks:
            for name, kept in tuple(waiting.items()):
                tasks.create_task(one(name, kept))
    except asyncio.CancelledError:
        for name, kept in waiting.items():
            _report_restored(run, console, name, RestoreResult(tuple(kept), ("interrupted",)))
        raise
    return tuple(record.kept)


def _group_open(kept: Iterable[Change]) -> dict[str, list[Change]]:
    """Return by vehicle what has still to be given back."""
    waiting: dict[str, list[Change]] = defaultdict(list)
    for one in kept:
        if one.is_open:
            waiting[one.vehicle].append(one)
    return waiting


def _report_restored(run: Path, console: Console, name: str, given: RestoreResult[Change]) -> None:
    """Say of one vehicle what it has again, and what stays."""
    back = [one.words_back for one in given.kept if not one.is_open]
    if back:
        console.say(Level.INFO, f"{name}: {', '.join(back)} restored")
    stays = [one.words_open for one in given.kept if one.is_open]
    if stays:
        console.say(Level.WARNING, f"{name}: {', '.join(stays)} not restored: {'; '.join(given.problems)}")
        console.say(Level.WARNING, f"{name}: to restore them: {command_line('restore', run)}")
