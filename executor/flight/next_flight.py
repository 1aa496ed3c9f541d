"""Plan the next flight: the segments that a flight left over, for vehicles with full batteries."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport, read_earlier_flights
from executor.core.formatting import command_line, format_count
from executor.errors import LogError
from executor.site import site_model, site_planning
from executor.site.day_plans import select_day
from executor.site.plan_summary import describe_left_over
from executor.site.site_model import SiteModel
from missions import DayPlanFile, PlanFile, PlanFileError, read_plan

PLAN_S = 2.0
"""Solver time; for longer runs the crew uses `faultline plan --after`."""


def read_segments_left(run: Path, ground: SiteModel) -> tuple[int, ...]:
    """Return the segments that a flight over a site's network left over, from its report.

    Raises:
        LogError: there is no report yet, or nothing is left over.
        MissionsError: the flight's network is not the site's.
    """
    report = FlightReport.read(RunDirectory(run).report)
    if not set(report.segments_uncovered) - ground.left_out:
        but = " but what the site leaves out" if report.segments_uncovered else ""
        raise LogError(f"{RunDirectory(run).report}: segments_uncovered: nothing is left over{but}")
    plan = RunDirectory(run).plan_path(0)
    site_planning.check_same_segments(read_plan(plan), ground, str(plan))
    return report.segments_uncovered


def select_next_day(content: DayPlanFile, after: Path, ground: SiteModel, site: Path) -> DayPlanFile | None:
    """Return the rest of a plan's next day, after the flights recorded in a run directory and its predecessors.

    Args:
        content: The plan.
        after: Run directory of the last flight.
        ground: The site; it may lack a vehicle of the plan.
        site: Site file, for messages.

    Returns:
        The day as a plan of that day alone, or None if no reachable segment is open.

    Raises:
        LogError: there is no report yet.
        PlanFileError: no day of the plan is left, or the flight's network is not the site's.
    """
    earlier, plan = read_earlier_flights(after), RunDirectory(after).plan_path(0)
    site_planning.check_same_segments(read_plan(plan), ground, str(plan))
    inspected = {segment for row in earlier for segment in row.segments}
    flown = max((row.day for row in earlier if row.day_plan == content.schedule_id), default=0)
    open_ = {segment.id for segment in content.segments} - inspected
    if not open_:
        return None
    for number in range(flown, len(content.days)):
        day = select_day(content, number, inspected, ground.names)
        if day.routes:
            return day
    command = command_line("plan", site, "--day", "--after", after, "-o", "FILE")
    left = f"no day of it is left for {format_count(len(open_), 'open segment')}"
    raise PlanFileError(f"{content.source}: {left}; plan the rest: {command}")


def plan_next_flight(ground: SiteModel, report: FlightReport, seed: int) -> PlanFile | None:
    """Return a plan for the left-over segments and the vehicles not at fault; None if either is missing.

    Args:
        ground: Site of the flight.
        report: Report of the flight.
        seed: Random seed of the solver.
    """
    lost = {fault.vehicle for fault in report.faults}
    never = {one.segment for one in ground.setup.unreachable} | ground.left_out
    if not set(report.segments_uncovered) - never or lost >= set(ground.names):
        return None
    wanted = replace(site_planning.DEFAULT, seconds=PLAN_S, seed=seed)
    return site_planning.plan_site(
        ground, wanted, task=site_model.build_first_task(ground, report.segments_uncovered, lost)
    )


def describe_next_flight(plan: PlanFile, file: Path) -> str:
    """Return the crew's options for the next flight."""
    names = ", ".join(vehicle.name for vehicle in plan.vehicles)
    words = f"the next flight is planned in {file} for {names} with full batteries"
    return "\n".join([words, *describe_left_over(plan)])
