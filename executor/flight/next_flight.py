"""The next sortie: what a flight left over, planned anew for vehicles with full batteries."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport, read_report
from executor.errors import LogError
from executor.site import site_model, site_planning
from executor.site.plan_summary import describe_left_over
from executor.site.site_model import SiteModel
from missions import PlanFile, read_plan

PLAN_S = 2.0
"""Of the solver; the crew can have more with `faultline plan --after`."""


def read_segments_left(run: Path, ground: SiteModel) -> tuple[int, ...]:
    """Return the segments that a flight over a site's network left, by its report.

    Raises:
        LogError: there is no report yet, or nothing is left over.
        MissionsError: the flight's network is not the site's.
    """
    report = read_report(run)
    if not report.segments_uncovered:
        raise LogError(f"{RunDirectory(run).report}: segments_uncovered: nothing is left over")
    plan = RunDirectory(run).plan_path(0)
    site_planning.check_same_segments(read_plan(plan), ground, str(plan))
    return report.segments_uncovered


def plan_next_flight(ground: SiteModel, report: FlightReport, seed: int) -> PlanFile | None:
    """Return a plan for what a flight left over, by the vehicles that are not at fault; None if nothing, or nobody, is.

    Args:
        ground: Of the flight.
        report: Of the flight.
        seed: Of the solver.
    """
    lost = {fault.vehicle for fault in report.faults}
    never = {one.segment for one in ground.setup.unreachable}
    if not set(report.segments_uncovered) - never or lost >= set(ground.names):
        return None
    wanted = replace(site_planning.DEFAULT, seconds=PLAN_S, seed=seed)
    return site_planning.plan_site(
        ground, wanted, task=site_model.build_first_task(ground, report.segments_uncovered, lost)
    )


def describe_next_flight(plan: PlanFile, file: Path) -> str:
    """Return what the crew can do with the next sortie."""
    names = ", ".join(vehicle.name for vehicle in plan.vehicles)
    words = f"the next sortie is planned in {file} for {names} with full batteries"
    return "\n".join([words, *describe_left_over(plan)])
