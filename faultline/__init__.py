# Part of faultline.
"""Plan a fleet's inspection, compute how early a vehicle may be lost, re-plan a loss, check a plan, read a flown run.

The names in ``faultline.__all__`` are stable: they change their meaning only with the major version. The packages below
(planner, missions, executor) may change with any version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from faultline_start import find_stranger

if _wrong := find_stranger():
    raise ImportError(f"faultline: {_wrong}")

from executor import __version__
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport
from executor.analysis.flight_record import FlightRecord
from executor.analysis.flight_record import read_run as _read_record
from executor.errors import ExecutorError
from executor.simulated.simulated_fleet import LISTENING, USUAL_RADIUS_M, build_demo_site
from executor.site.site_file import check_site, read_site
from executor.site.site_model import load_site_model
from executor.site.site_planning import DEFAULT, plan_site, preview_loss
from missions import MissionsError, PlanFile, check_plan, read_plan, write_plan
from planner import (
    PRESETS,
    Cost,
    Instance,
    Iterations,
    PlannerError,
    ReplanWindow,
    Result,
    Seconds,
    Vehicle,
    build_instance,
    replan_window,
    solve,
    travel_for,
)

__all__ = [
    "ERRORS", "PRESETS", "Cost", "FlightRecord", "FlightReport", "Instance", "Iterations", "PlanFile", "ReplanWindow",
    "Result", "Run", "Seconds", "Vehicle", "__version__", "build_instance", "build_site", "check", "plan", "read_plan",
    "read_run", "replan", "replan_window", "solve", "travel_for", "window", "write_plan",
]  # fmt: skip

ERRORS = (ExecutorError, MissionsError, PlannerError)
"""Exceptions that bad input raises, to catch together; the text is one line."""


def build_site(
    network: Path | str | None = None, *, vehicles: int = 3, radius_m: float = USUAL_RADIUS_M, autopilot: str = "px4"
) -> dict[str, Any]:
    """Build the tables of a site for planning only, not for flight; edit them freely before `plan`.

    Args:
        network: The power line: GeoJSON or a graph file, by default faultline's own network.
        vehicles: Number of vehicles, named uav1, uav2 and so on.
        radius_m: Use only segments with both pylons nearer to the depot than this.
        autopilot: `px4` or `ardupilot`: how the vehicles take corners and climb.
    """
    return build_demo_site(
        network=None if network is None else Path(network), radius_m=radius_m, vehicles=vehicles, speedup=1.0,
        autopilot=autopilot, ports=LISTENING[:vehicles],
    )  # fmt: skip


def plan(
    site: Path | str | Mapping[str, Any], *, cost: Cost | None = None, seconds: float = DEFAULT.seconds,
    seed: int = DEFAULT.seed, iterations: int | None = None, starts: int = 0,
    mtbf_h: float | None = None, losses: int = 1,
) -> PlanFile:  # fmt: skip
    """Plan a site's inspection, as `faultline plan` does.

    Args:
        site: A site file, or its tables; paths in tables are relative to the working directory.
        cost: The cost function; by default the re-plan window, or MinMax if the window takes too long.
        seconds: Maximum search time.
        seed: Seed of all randomness.
        iterations: Iterations of each search; with the same number and `starts` every computer finds the same plan.
        starts: Parallel searches, 0 for one per processor.
        mtbf_h: Mean flight hours between failures of one vehicle: the plan most likely to inspect everything, instead
            of a cost; `coverage` of the result says how likely.
        losses: With 2 the re-plan window against the loss of any two vehicles; not with a cost.

    Raises:
        ERRORS: The site cannot be used, or a cost is given with `mtbf_h`: one line with the file, the key and the
            expected value.
    """
    if isinstance(site, Mapping):
        tables, base = check_site(dict(site), "site"), Path()
    else:
        tables, base = read_site(Path(site)), Path(site).parent
    wanted = replace(
        DEFAULT, cost=cost, mtbf_h=mtbf_h, usual=cost is None and mtbf_h is None and losses == 1, seconds=seconds,
        seed=seed, iterations=iterations, starts=starts, losses=losses,
    )  # fmt: skip
    return plan_site(load_site_model(tables, base), wanted)


def check(plan: PlanFile) -> list[str]:
    """Recompute every figure of a plan from its own network; describe the wrong ones in words, none if all are right.

    Raises:
        ERRORS: Its vehicles or coordinates do not form a planning problem.
    """
    return check_plan(plan)


def window(plan: PlanFile, *, seed: int = 0, losses: int = 1) -> ReplanWindow:
    """Compute the time from which the fleet can absorb the loss of any one vehicle of a plan, or of any two.

    Raises:
        ERRORS: Nobody is left after the losses, or their number is not 1 or 2.
    """
    return replan_window(plan.build_instance(), plan.plan, seed=seed, fly_again=plan.fly_again, losses=losses)


def replan(
    plan: PlanFile, lost: str, at_s: float, *, cost: Cost = Cost.MINMAX, seconds: float = 2.0, seed: int = 1
) -> tuple[PlanFile, bool]:
    """Re-plan the open segments after a loss; return the plan, and whether it inspects everything within budget.

    Args:
        plan: The plan as flown until the loss.
        lost: Name of the lost vehicle.
        at_s: Time of the loss, in seconds from the start of the plan.
        cost: The cost function.
        seconds: Maximum search time.
        seed: Seed of all randomness.

    Raises:
        ERRORS: The plan has no such vehicle, or no vehicle is left.
    """
    return preview_loss(plan, lost, at_s, cost=cost, seconds=seconds, seed=seed)


@dataclass(frozen=True, slots=True)
class Run:
    """A finished flight, as recorded in its run directory."""

    path: Path
    """The run directory."""
    report: FlightReport
    """Results of the flight: report.json as a model."""
    record: FlightRecord
    """Tracks, batteries, segments, plans and decisions; times in seconds since launch."""
    plans: tuple[PlanFile, ...]
    """The first plan, then one per re-plan."""


def read_run(path: Path | str) -> Run:
    """Read the run directory of a finished flight.

    Raises:
        ERRORS: There is no report yet, or a file cannot be used: one line with the name of the file.
    """
    run = RunDirectory(Path(path))
    report = FlightReport.read(run.report)
    numbers = (0, *(row.revision for row in report.replans))
    plans = tuple(read_plan(run.plan_path(number)) for number in numbers)
    return Run(run.path, report, _read_record(run.path), plans)
