"""What commands that plan have in common."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import typer

from executor.adapters.extras import Extra, require_extra
from executor.adapters.run_directory import RunDirectory
from executor.analysis.learned_document import describe_learned, read_learned
from executor.cli.console import TerminalConsole
from executor.cli.options import PlanCostName
from executor.core.interface.commands import Level
from executor.errors import SiteError
from executor.flight.next_flight import read_segments_left
from executor.site import day_flight, site_model, site_planning
from executor.site.site_file import Site
from executor.site.site_planning import DEFAULT, PlanRequest, PlanSolver
from missions import DayPlanFile, PlanFile, check_plan, is_day_plan, read_day_plan, read_plan
from planner import Cost, Progress


def parse_plan_request(
    cost: PlanCostName | None,
    solver: PlanSolver,
    stretch_pct: float,
    all_vehicles: bool,
    seconds: float,
    seed: int,
    starts: int,
) -> PlanRequest:
    """Return what the options that `plan`, `preflight` and `fly` share ask for.

    Raises:
        PlanFileError: the solver cannot do it.
    """
    return replace(
        plan_request_for(cost),
        seconds=seconds,
        seed=seed,
        solver=solver,
        all_vehicles=all_vehicles,
        stretch=stretch_pct / 100,
        starts=starts,
    )


def plan_request_for(cost: PlanCostName | None) -> PlanRequest:
    """Return what is asked for by a cost, or by none."""
    chosen = None if cost is None or cost is PlanCostName.WINDOW else Cost(cost.value)
    return replace(DEFAULT, cost=chosen, usual=cost is None)


def load_site_with_learned(
    site: Site, base: Path, learned: Path | None, console: TerminalConsole
) -> site_model.SiteModel:
    """Return what is known before any vehicle answers, with what was learned of the site's vehicles before.

    Args:
        site: The site file's tables.
        base: Its folder.
        learned: The run directory of an earlier flight.
        console: Where it is said who starts from what.

    Raises:
        LogError: its learned.json is missing or cannot be used.
        MissionsError: the network cannot be used.
    """
    if learned is None:
        return site_model.load_site_model(site, base)
    path = RunDirectory(learned).learned
    document, drone = read_learned(path), site_model.drone_of(site).name
    rows, known = {row.name: row for row in document.vehicles}, {}
    for vehicle in site.vehicle:
        row = rows.get(vehicle.name)
        if row is None:
            console.say(Level.INFO, f"{vehicle.name}: nothing learned in {path}; using the defaults")
        elif (row.autopilot, row.drone) != (vehicle.autopilot, drone):
            was = f"{row.autopilot} on a {row.drone}"
            console.say(Level.WARNING, f"{vehicle.name}: was {was} in {path}; using the defaults")
        else:
            known[vehicle.name] = document.known_by_name[vehicle.name]
            console.say(Level.INFO, f"{describe_learned(row)} ({document.date})")
    return site_model.load_site_model(site, base, known)


PLANNING = ("cost", "solver", "stretch", "all_vehicles", "seconds", "seed", "starts", "after")


def select_flown_plan(
    ground: site_model.SiteModel,
    console: TerminalConsole,
    asked: typer.Context,
    wanted: PlanRequest,
    *,
    plan: Path | None,
    after: Path | None = None,
) -> tuple[DayPlanFile | None, PlanFile]:
    """Return the plan of a flight: the file that was looked at, or else what `plan` makes with the same options.

    Args:
        ground: The site.
        console: Where it is said.
        asked: The command, with what was given to it.
        wanted: What to plan without a file.
        plan: The file; of a plan of days its first sorties are flown first.
        after: The run directory whose rest is planned.

    Raises:
        PlanFileError: the file is not what the site asks for.
        SiteError: options of a new plan beside the file of another.
    """
    if plan is None:
        left = None if after is None else read_segments_left(after, ground)
        return None, plan_and_report(ground, console, wanted, left)
    for name in PLANNING:
        if is_option_given(asked, name):
            raise SiteError(f"--{name.replace('_', '-')}: expected none beside --plan, which is flown as it is")
    day = read_day_plan(plan) if is_day_plan(plan) else None
    if day is None:
        content = read_plan(plan)
        site_planning.check_plan_fits(content, ground, str(plan))
    else:
        content = day_flight.build_first_sorties_plan(day, ground)
    console.say(Level.INFO, f"the {'plan' if day is None else 'day'} is that of {plan}")
    return day, content


def is_option_given(asked: typer.Context, name: str) -> bool:
    """Return whether an option of a command was given, and is not its default."""
    source = asked.get_parameter_source(name)
    return source is not None and source.name != "DEFAULT"


def plan_and_report(
    ground: site_model.SiteModel, console: TerminalConsole, wanted: PlanRequest, segments: Sequence[int] | None = None
) -> PlanFile:
    """Plan a site, or some of its segments, and say how it goes.

    Raises:
        SiteError: the plan does not hold what it must.
        planner.PlannerError: the solver cannot take this problem.
    """
    task = site_model.build_first_task(ground, segments)
    wanted = wanted.adapt_to_task(task)
    progressed = announce_plan(ground, console, wanted, len(task.segment_ids))
    content = site_planning.plan_site(ground, wanted, progressed, task)
    console.show_progress("")
    for line in check_plan(content, search_window=False):
        raise SiteError(f"the plan of --solver {wanted.solver.value} is invalid: {line}")
    return content


def announce_plan(
    ground: site_model.SiteModel, console: TerminalConsole, wanted: PlanRequest, segments: int
) -> Callable[[Progress], None]:
    """Say what is planned for one flight, and return how to say how far it is."""
    name, unit = ("window", "earliest s") if wanted.cost is None else (wanted.cost.value, wanted.cost.value)
    return announce_planning(console, (segments, len(ground.names)), name, unit, wanted.length)


def announce_planning(
    console: TerminalConsole, sizes: tuple[int, int], name: str, unit: str, length: str, where: str = ""
) -> Callable[[Progress], None]:
    """Say what is planned, and return how to say how far it is.

    Args:
        console: Where.
        sizes: How many segments, and how many vehicles.
        name: What the plan is chosen by.
        unit: What its value is called.
        length: How long it is searched.
        where: From where and when.
    """
    console.say(Level.INFO, f"planning {sizes[0]} segments for {sizes[1]} vehicles {where}({name}, {length})")

    def progressed(progress: Progress) -> None:
        console.show_progress(
            f"{progress.iterations} iterations, {unit} {progress.value:.2f}, {progress.uncovered} left out"
        )

    return progressed


def write_named_file(path: Path, write: Callable[[], object]) -> None:
    """Write a file that the user named.

    Raises:
        SiteError: it cannot be written.
    """
    try:
        write()
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error


def check_can_draw(option: str, path: Path | None) -> None:
    """Check before the work that a picture will have a place, and that it can be drawn; None if nobody asked for one.

    Raises:
        ExtraMissing: nothing is installed to draw with.
        SiteError: as `check_can_write`.
    """
    if path is not None:
        require_extra(Extra.PICTURES, option)
        check_can_write(path)


def check_can_write(*paths: Path | None) -> None:
    """Check before the work that its results will have a place; None for what nobody asked for.

    Raises:
        SiteError: one is a directory, or its folder is missing or cannot be written to.
    """
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise SiteError(f"{path}: cannot be written: expected a file's name, it is a directory")
        if not path.parent.is_dir():
            raise SiteError(f"{path}: cannot be written: there is no directory {path.parent}")
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise SiteError(f"{path}: cannot be written: permission denied")
