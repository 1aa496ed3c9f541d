"""Parameters that a flight changes on board: looked at, and set with a record of what was there."""

from __future__ import annotations

import asyncio
from pathlib import Path

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.check_codes import Check, Severity
from executor.core.interface.ports import Clock
from executor.core.preflight import board_changes
from executor.core.preflight.board_changes import (
    Answers,
    ChangeStage,
    ParameterProposal,
    build_board_record,
    check_return_height,
    propose_return_changes,
)
from executor.errors import PreflightFailed
from executor.flight.board_record import open_parameter_record, read_kept_parameters
from executor.flight.concurrency import AT_ONCE, run_for_each
from executor.flight.flight_request import Console
from executor.flight.restore_vehicles import Links
from executor.runtime import board_restore


async def read_changes(context: Context, links: Links, clock: Clock) -> ParameterProposal:
    """Ask every vehicle what it has, and return what the flight would change; nothing is set."""

    async def read(name: str) -> Answers:
        beside = board_changes.list_fence_parameters(context, name)
        return await board_restore.read_present(links[name], clock, context.vehicles[name].dialect, beside)

    return board_changes.add_fence_changes(
        context, propose_return_changes(context, await run_for_each(context.vehicles, read))
    )


def describe_parameter_changes(proposal: ParameterProposal) -> list[str]:
    """Return every change with its old and new value and its reason."""
    return [f"{change.vehicle}: {change.words_set}" for change in proposal.changes]


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
    kept = build_board_record(proposal.changes, read_kept_parameters(run) or ())
    record = open_parameter_record(run, console, kept)
    record.write_first("nothing was changed on board")
    checks: list[Check] = []
    unfenced: list[str] = []
    turn = asyncio.Semaphore(AT_ONCE)

    async def one(name: str) -> None:
        async with turn:
            ends = await board_restore.set_changes(links[name], clock, proposal.changes_of(name))
        record.set_stage(name, (key for key, problem in ends.items() if not problem), ChangeStage.SET)
        own = board_changes.list_fence_parameters(context, name)
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
