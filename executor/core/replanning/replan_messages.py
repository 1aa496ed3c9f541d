"""What a crew reads of a re-plan: why it begins, and what it gains."""

from __future__ import annotations

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.events import Gain, SolveEnded
from executor.core.state.fleet_state import FleetState
from planner import segment_of


def format_segments(context: Context, segments: frozenset[int] | tuple[int, ...]) -> str:
    """Return segments in words, by the names of the assets where they have any."""
    names = {segment: context.segment_name(segment) for segment in sorted(segments)}
    if len(names) > 1 and all(name == f"segment {segment}" for segment, name in names.items()):
        return f"segments {', '.join(map(str, names))}"
    return ", ".join(names.values())


def find_passed_segments(state: FleetState) -> frozenset[int]:
    """Return the segments that a vehicle has flown past on its mission, proven or not."""
    past: set[int] = set()
    for vehicle in state.vehicles.values():
        past |= {segment for segment, _ in vehicle.assignment.runs_broken}
        if vehicle.assignment.board is not None:
            ahead = {segment_of(visit) for visit in vehicle.remaining_visits()}
            past |= {segment_of(visit) for visit in vehicle.assignment.board.visits} - ahead
    return frozenset(past)


def explain_orphan_segments(context: Context, state: FleetState, alone: frozenset[int]) -> str:
    """Return why segments are without a vehicle that no fault left behind."""
    past = find_passed_segments(state)
    reasons = {"inspection not proven": alone & past, "assigned to no vehicle": alone - past}
    return "; ".join(f"{why}: {format_segments(context, segments)}" for why, segments in reasons.items() if segments)


def describe_solution(event: SolveEnded, names: list[str]) -> str:
    """Return what a re-plan came to: what it is better in than what is on board, and who is given a new mission.

    Args:
        event: The solver's answer.
        names: Of those who are given one.
    """
    gained = "" if event.gain is None else f": {_describe_gain(event.gain, changed=bool(names))}"
    given = ", ".join(sorted(names)) or "no vehicle"
    return f"re-plan {event.revision} found in {event.solve_s:.2f} s{gained}; new missions for {given}"


def _describe_gain(gain: Gain, *, changed: bool) -> str:
    if not changed:
        return "no improvement over the missions on board"
    longest = f"longest route now {gain.longest_s:.0f} s"
    shorter = round(gain.longest_s) < round(gain.carried_s)
    covered = []
    if gain.segments:
        covered.append(f"{format_count(gain.segments, 'segment')} recovered")
    elif gain.length_m >= 1.0 and not shorter:
        covered.append(f"{gain.length_m:.0f} m of the line recovered")
    if gain.left_over > 0:
        covered.append(f"{format_count(gain.left_over, 'segment')} taken over from the next sortie")
    if gain.left_over < 0:
        covered.append(f"{format_count(-gain.left_over, 'segment')} moved back to the next sortie")
    if covered:
        return f"{', '.join(covered)}; {longest}"
    if gain.short:
        return f"limited by remaining battery; {longest}"
    if shorter:
        return f"{longest} instead of {gain.carried_s:.0f} s"
    return f"duplicate segments removed; {longest}"


def describe_short_budgets(gain: Gain) -> str:
    """Return who cannot go on with what is on board."""
    names = sorted(gain.short)
    if len(names) == 1:
        return f"{names[0]}: not enough battery for its whole mission"
    return f"{', '.join(names)}: not enough battery for their whole missions"
