"""What a crew reads of a re-plan: why it begins, and what it gains."""

from __future__ import annotations

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.interface.commands import Say
from executor.core.interface.events import Gain, SolveEnded
from executor.core.lines import replanning
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
    reasons = {replanning.NOT_PROVEN: alone & past, replanning.WITHOUT_VEHICLE: alone - past}
    found = ((why, format_segments(context, segments)) for why, segments in reasons.items() if segments)
    return "; ".join(why.format(segments=segments) for why, segments in found)


def announce_solution(event: SolveEnded, names: list[str]) -> Say:
    """Say what a re-plan came to: what it is better in than what is on board, and who is given a new mission.

    Args:
        event: The solver's answer.
        names: Of those who are given one.
    """
    gained = "" if event.gain is None else f": {_describe_gain(event.gain, changed=bool(names))}"
    given = ", ".join(sorted(names)) or replanning.NO_VEHICLE
    return replanning.FOUND.say(revision=event.revision, solve_s=event.solve_s, gained=gained, vehicles=given)


def _describe_gain(gain: Gain, *, changed: bool) -> str:
    if not changed:
        return replanning.NO_GAIN
    longest = replanning.LONGEST.format(longest_s=gain.longest_s)
    shorter = round(gain.longest_s) < round(gain.carried_s)
    covered = []
    if gain.segments:
        covered.append(replanning.RECOVERED.format(segments=format_count(gain.segments, "segment")))
    elif gain.length_m >= 1.0 and not shorter:
        covered.append(replanning.LENGTH_RECOVERED.format(length_m=gain.length_m))
    if gain.left_over:
        moved = replanning.TAKEN_OVER if gain.left_over > 0 else replanning.MOVED_BACK
        covered.append(moved.format(segments=format_count(abs(gain.left_over), "segment")))
    if covered:
        return f"{', '.join(covered)}; {longest}"
    why = replanning.LIMITED if gain.short else replanning.SHORTER if shorter else replanning.NO_DUPLICATES
    return why.format(longest=longest, carried_s=gain.carried_s)


def announce_short_budgets(gain: Gain) -> Say:
    """Say who cannot go on with what is on board."""
    line = replanning.BUDGET_SHORT if len(gain.short) == 1 else replanning.BUDGETS_SHORT
    return line.say(vehicles=", ".join(sorted(gain.short)))
