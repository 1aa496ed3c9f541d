"""One vehicle on its base, looked at before its next sortie: others fly meanwhile."""

from __future__ import annotations

from executor.core.context import Context
from executor.core.interface.check_codes import Severity
from executor.core.interface.events import Examined
from executor.core.interface.messages import Heartbeat
from executor.core.interface.ports import Clock, Link
from executor.core.preflight import board_changes
from executor.core.preflight.board_changes import ParameterProposal, propose_return_changes
from executor.core.preflight.failsafe_parameters import describe_unread_parameters
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.errors import PreflightFailed
from executor.runtime import procedures, vehicle_preflight
from executor.runtime.board_restore import read_present, set_changes


async def examine_vehicle(
    context: Context, name: str, link: Link, clock: Clock, within_s: float, *, sets: bool = False
) -> Examined:
    """Wait until a vehicle is ready, and read what it says of its battery and its parameters.

    It may just be booting: nothing that it said before this counts.

    Args:
        context: Of the flight.
        name: Of the vehicle.
        link: To it.
        clock: The flight's.
        within_s: How long it may take to be ready, in its time.
        sets: Whether what is not as the flight had set it is set again.
    """
    dialect, began_s = context.vehicles[name].dialect, clock.now_s()
    seen = await procedures.wait_for(link, clock, lambda message: isinstance(message, Heartbeat), within_s)
    if not seen:
        return Examined(name, ready=False, reason=f"no HEARTBEAT for {within_s:g} s")
    left_s = within_s - (clock.now_s() - began_s)
    try:
        facts = await vehicle_preflight.interview_vehicle(name, link, clock, dialect, left_s, lambda _: None)
        proposal = await _build_proposal(context, name, link, clock)
        if sets and (lacks := proposal.changes_of(name)):
            await set_changes(link, clock, lacks)
            proposal = await _build_proposal(context, name, link, clock)
    except PreflightFailed as error:
        return Examined(name, ready=False, reason=str(error).removeprefix(f"{name}: "))
    if reason := _find_mismatch(context, facts) or _unknown(facts, proposal):
        return Examined(name, ready=False, reason=reason)
    return Examined(
        name,
        ready=True,
        reason="",
        remaining_pct=facts.remaining_pct,
        voltage_v=facts.voltage_v,
        cells=facts.cells,
        parameters=tuple(sorted(facts.parameters.items())),
        changed=tuple(change.words_set for change in proposal.changes_of(name)),
        sets=sets,
    )


async def _build_proposal(context: Context, name: str, link: Link, clock: Clock) -> ParameterProposal:
    """Return what would have to be set on it: nothing, where it is as the flight has set it."""
    beside = board_changes.list_fence_parameters(context, name)
    present = await read_present(link, clock, context.vehicles[name].dialect, beside)
    return board_changes.add_fence_changes(context, propose_return_changes(context, {name: present}))


def _unknown(facts: VehicleFacts, proposal: ParameterProposal) -> str:
    """Return what cannot be known of its parameters; empty if everything is."""
    if facts.unread:
        return describe_unread_parameters(facts.unread)
    return next((check.text for check in proposal.checks if check.severity is Severity.STOP), "")


def _find_mismatch(context: Context, facts: VehicleFacts) -> str:
    """Return why it is not the vehicle that it was, or not at rest; empty if it is."""
    dialect = context.vehicles[facts.name].dialect
    if facts.heartbeat.autopilot != dialect.number:
        return f"HEARTBEAT autopilot is {facts.heartbeat.autopilot}, expected {dialect.name} ({dialect.number})"
    return "it is armed" if facts.heartbeat.armed else ""
