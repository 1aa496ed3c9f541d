"""A plan in words, for the crew to confirm: which vehicle flies what for how long, and what is left over and why."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from executor.core.formatting import describe_unreachable, format_count, join_first_names
from executor.core.interface.check_codes import Check, CheckCode, Severity
from executor.core.preflight import mission_checks
from missions import DayPlanFile, PlanFile
from missions.geo import FloatArray
from planner import segment_of

NAMED = 50
"""Segments that a line names; of more it says how many, and `--json` names all."""
NAMED_IN_CHECKLIST = 12
OUT_OF_REACH = "out of range of every vehicle's budget"
USED_UP = "reachable, but no battery left after the other segments"
OUT_OF_REACH_BY_DAY = "out of reach of every base on one pack"
OUT_OF_TIME = "within reach, but no time is left"
FULL = 1e-9


@dataclass(frozen=True, slots=True)
class LeftOver:
    """A segment that a plan does not inspect."""

    segment: int
    """Its number in the site's network."""
    name: str
    alone_pct: float
    """What a vehicle needs that flies there, along it and home, and nothing else; of the one that could do it best."""
    budget_pct: float
    """Of that vehicle."""
    why: str


def find_left_over(plan: PlanFile | DayPlanFile, later: Collection[int] = ()) -> tuple[LeftOver, ...]:
    """Return what a plan does not inspect, and why; without those that later sorties have."""
    left = [number for number in plan.plan.uncovered if plan.segments[number].id not in later]
    if not left:
        return ()
    is_day = isinstance(plan, DayPlanFile)
    out_of_reach, used_up = (OUT_OF_REACH_BY_DAY, OUT_OF_TIME) if is_day else (OUT_OF_REACH, USED_UP)
    budgets = np.array([vehicle.budget_pct for vehicle in plan.vehicles])
    alone_pct = _list_alone_pct(plan).reshape(len(budgets), -1, 2).min(axis=2)
    nearest = np.argmin(alone_pct - budgets[:, np.newaxis], axis=0)
    found = []
    for number in left:
        needed, budget = float(alone_pct[nearest[number], number]), float(budgets[nearest[number]])
        segment, why = plan.segments[number], out_of_reach if needed > budget + FULL else used_up
        found.append(LeftOver(segment.id, segment.display_name, needed, budget, why))
    return tuple(found)


def _list_alone_pct(plan: PlanFile | DayPlanFile) -> FloatArray:
    """Return (k, 2n) what each vehicle needs for the way to a visit, along it and home, and nothing else."""
    if isinstance(plan, PlanFile):
        instance = plan.build_instance()
        return instance.start_pct + instance.home_pct
    sorties = plan.build_instance()
    return np.array([
        sorties.out_pct[row, own.lands].min(axis=0) + sorties.home_pct[row][:, own.lands].min(axis=1)
        for row, own in enumerate(sorties.vehicles)
    ])  # fmt: skip


def describe_routes(plan: PlanFile) -> Iterator[str]:
    """Yield what each vehicle does."""
    for route in plan.plan.routes:
        vehicle = plan.vehicles[route.vehicle]
        minutes, energy_pct = plan.durations_s[route.vehicle] / 60, plan.energies_pct[route.vehicle]
        if not route.visits:
            yield f"{vehicle.name}: no segments, stays where it is"
            continue
        segments = "1 segment" if len(route.visits) == 1 else f"{len(route.visits)} segments"
        yield (
            f"{vehicle.name}: {segments}, {minutes:.1f} min, {energy_pct:.1f} % of its battery "
            f"(budget {vehicle.budget_pct:g} %)"
        )


def summarise_plan(plan: PlanFile) -> str:
    """Return a plan in one line: what it inspects, how long it takes, by what it was chosen."""
    flown = sum(len(route.visits) for route in plan.plan.routes)
    if not flown:
        return f"none of {len(plan.segments) + len(plan.unreachable)} segments, nobody flies"
    longest_s = max(plan.durations_s)
    who = plan.vehicles[plan.durations_s.index(longest_s)].name
    asked = len(plan.segments) + len(plan.unreachable)
    return f"{flown} of {asked} segments, longest route {longest_s / 60:.1f} min ({who}), chosen by {plan.cost_name}"


def describe_window(plan: PlanFile) -> list[str]:
    """Return in a line from when on the fleet can absorb any one loss, and the worst case before; none known."""
    window = plan.window
    if window is None:
        return []
    breaking = window.breaking
    before = "" if breaking is None else (
        f"; worst case before: {breaking.vehicle} at {breaking.from_s:.0f} to {breaking.to_s:.0f} s"
    )  # fmt: skip
    share = f"re-plan window {window.window_pct:.0f} %"
    absorbs = f"from {window.earliest_s:.0f} s the fleet can absorb the loss of any one vehicle"
    return [f"{share}: {absorbs}{but_left_over(plan)}{before}"]


def but_left_over(plan: PlanFile) -> str:
    """Return in words what is left over in any case; empty where the plan inspects everything."""
    left = len(plan.plan.uncovered)
    return f", with no more left over than the plan's {format_count(left, 'segment')}" if left else ""


def describe_distances(plan: PlanFile) -> list[str]:
    """Return in a line at which distance segments are inspected; none where everybody inspects in its layer."""
    if plan.inspection is None or not plan.inspection.same_distance:
        return []
    rows = []
    for route in plan.plan.routes:
        name = plan.vehicles[route.vehicle].name
        for visit in route.visits:
            at_m = plan.inspection_height_m(name, segment_of(visit))
            if at_m is not None:
                rows.append((plan.segments[segment_of(visit)].display_name, name, at_m))
    return [mission_checks.describe_inspection_distances(plan.inspection.height_m, rows)] if rows else []


def describe_left_over(plan: PlanFile | DayPlanFile, most: int = NAMED, later: Collection[int] = ()) -> list[str]:
    """Return what is left over, a line for each reason, each with the names of `most` segments at most.

    Args:
        plan: The plan.
        most: So many are named.
        later: Ids of the segments that later sorties of a day have.
    """
    reasons: dict[str, list[str]] = {}
    for one in find_left_over(plan, later):
        figure = f" ({one.alone_pct:.2f} % of {one.budget_pct:g} %)" if one.alone_pct > one.budget_pct + FULL else ""
        reasons.setdefault(one.why, []).append(one.name + figure)
    never = ((one.name, one.why) for one in plan.unreachable)
    lines = [f"left over, {why}: {join_first_names(names, most)}" for why, names in reasons.items()]
    return [*lines, *describe_unreachable(never, most)]


def build_plan_checks(plan: PlanFile, segments: int, later: Collection[int] = ()) -> list[Check]:
    """Return a plan as lines of the checklist, so that it is looked at before the question.

    Args:
        plan: What is to be flown.
        segments: Of the whole site.
        later: Ids of the segments that later sorties of a day have.
    """
    lines = (*describe_routes(plan), summarise_plan(plan), *describe_window(plan))
    found = [Check(Severity.OK, "plan", line, CheckCode.PLAN) for line in lines]
    found += [
        Check(Severity.WARNING, "plan", line, CheckCode.LEFT_OVER)
        for line in describe_left_over(plan, NAMED_IN_CHECKLIST, later)
    ]
    if later:
        text = f"{format_count(len(later), 'segment')} of {len(plan.segments)} in later sorties of the day"
        found.append(Check(Severity.OK, "plan", text, CheckCode.PLAN))
    about = len(plan.segments) + len(plan.unreachable)
    if about < segments:
        text = f"it is about {about} of the site's {segments} segments; the others are not flown"
        found.append(Check(Severity.WARNING, "plan", text, CheckCode.LEFT_OVER))
    return found
