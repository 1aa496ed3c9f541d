"""What a flight changes on board: looked at, set with a record of what was there, and given back."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.core.context import Context
from executor.core.formatting import command_line, format_count
from executor.core.interface.commands import Level
from executor.core.interface.ports import Clock, OpenLink
from executor.core.preflight import fence_checks as fences
from executor.core.preflight.parameter_proposals import (
    Answers,
    ChangeStage,
    KeptParameter,
    ParameterProposal,
    build_parameter_record,
    check_return_height,
    format_number,
    propose_return_changes,
)
from executor.core.preflight.vehicle_checks import Check, Severity
from executor.errors import LogError, PreflightFailed
from executor.flight.concurrency import AT_ONCE, run_for_each
from executor.flight.flight_request import Console
from executor.flight.kept_parameters import read_kept_parameters, write_kept_parameters
from executor.runtime import parameter_restore
from executor.runtime.parameter_restore import HEARD_S, RestoreResult
from executor.site.site_file import Site

Links = Mapping[str, OpenLink]


async def read_changes(context: Context, links: Links, clock: Clock) -> ParameterProposal:
    """Ask every vehicle what it has, and return what the flight would change; nothing is set."""

    async def read(name: str) -> Answers:
        beside = fences.list_fence_parameters(context, name)
        return await parameter_restore.read_present(links[name], clock, context.vehicles[name].dialect, beside)

    return fences.add_fence_changes(
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
    record = _Record(run, console, build_parameter_record(proposal.changes, about, read_kept_parameters(run) or ()))
    try:
        record.write()
    except OSError as error:
        text = f"{RunDirectory(run).parameters}: cannot be written: {error.strerror}; nothing was changed on board"
        raise PreflightFailed(text) from error
    checks: list[Check] = []
    unfenced: list[str] = []
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str) -> None:
        async with turn:
            ends = await parameter_restore.set_changes(links[name], clock, proposal.changes_of(name))
        for parameter, problem in ends.items():
            if not problem:
                record.set_change_stage(name, parameter, ChangeStage.SET)
        record.try_write()
        own = fences.list_fence_parameters(context, name)
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


@dataclass(slots=True)
class _Record:
    """What is on record, and where."""

    run: Path
    console: Console
    kept: list[KeptParameter]
    told: bool = False

    def set_change_stage(self, vehicle: str, name: str, stage: ChangeStage) -> None:
        """Note how far a change has come."""
        self.add_changes([replace(one, stage=stage) for one in self.kept if one.key == (vehicle, name)])

    def add_changes(self, changed: Sequence[KeptParameter]) -> None:
        """Take over what has changed."""
        known = {one.key: one for one in changed}
        self.kept = [known.get(one.key, one) for one in self.kept]

    def write(self) -> None:
        """Write it down.

        Raises:
            OSError: it cannot be written.
        """
        write_kept_parameters(self.run, self.kept)

    def try_write(self) -> None:
        """Write it down where there is room: an older record gives everything back as well, it only asks again."""
        try:
            self.write()
        except OSError as error:
            if not self.told:
                self.told = True
                self.console.say(
                    Level.WARNING, f"{RunDirectory(self.run).parameters}: cannot be written: {error.strerror}"
                )


async def restore_kept_parameters(
    run: Path, links: Links, clock: Clock, console: Console, heard_s: float = HEARD_S
) -> tuple[KeptParameter, ...]:
    """Give back what was changed to every vehicle that answers and is not armed; say of each what became of it.

    Args:
        run: Where the record is.
        links: To the vehicles.
        clock: The flight's.
        console: Where it is said.
        heard_s: How long a vehicle is waited for, in its time.

    Returns:
        The whole record as it is now; empty if nothing was ever changed, or the record cannot be read.
    """
    try:
        record = _Record(run, console, list(read_kept_parameters(run) or ()))
    except LogError as error:
        console.say(Level.WARNING, str(error))
        return ()
    waiting = _group_open(record.kept)
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str, kept: Sequence[KeptParameter]) -> None:
        if name not in links:
            given = RestoreResult(tuple(kept), ("is not in the site file",))
        else:
            async with turn:
                given = await parameter_restore.restore_vehicle_parameters(links[name], clock, kept, heard_s)
        record.add_changes(given.kept)
        record.try_write()
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


def _group_open(kept: Sequence[KeptParameter]) -> dict[str, list[KeptParameter]]:
    """Return by vehicle what has still to be given back."""
    waiting: dict[str, list[KeptParameter]] = defaultdict(list)
    for one in kept:
        if one.open:
            waiting[one.vehicle].append(one)
    return waiting


def _report_restored(run: Path, console: Console, name: str, given: RestoreResult) -> None:
    """Say of one vehicle what it has again, and what stays."""
    back = [f"{one.name} {format_number(one.old)}" for one in given.kept if not one.open]
    if back:
        console.say(Level.INFO, f"{name}: {', '.join(back)} restored")
    stays = [f"{one.name} (was {format_number(one.old)})" for one in given.kept if one.open]
    if stays:
        console.say(Level.WARNING, f"{name}: {', '.join(stays)} not restored: {'; '.join(given.problems)}")
        console.say(Level.WARNING, f"{name}: to restore them: {command_line('restore', run)}")


def find_open_changes(run: Path) -> list[KeptParameter]:
    """Return what a run directory's record says is not given back; what cannot be read is left to `restore` to say."""
    with suppress(LogError):
        return [one for one in read_kept_parameters(run) or () if one.open]
    return []


def check_run(run: Path, site: Site) -> None:
    """Refuse to fly from a directory whose record is of vehicles that the site file does not have: it would be lost.

    Raises:
        LogError: it is so, or the record cannot be read.
    """
    systems = {table.name: table.sysid for table in site.vehicle}
    for one in read_kept_parameters(run) or ():
        if one.open and systems.get(one.vehicle) != one.sysid:
            record = RunDirectory(run).parameters
            raise LogError(
                f"{record}: {one.vehicle} (system {one.sysid}) has not got its {one.name} back, and is not in the "
                f"site file; expected a new directory, or {command_line('restore', run)} before"
            )
