"""The commands that fly: demo, simulate, fly."""

from __future__ import annotations

import errno
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TextIO

import typer

from executor.adapters.extras import Extra, describe_missing_extra, require_extra
from executor.adapters.interrupts import discard_output
from executor.adapters.run_directory import RunDirectory, create_run_directory
from executor.analysis.documents import CheckRow, FlightReport
from executor.analysis.earlier_flights import describe_total_inspected, read_earlier_flights
from executor.analysis.flight_record import FlightRecord
from executor.cli.console import TerminalConsole
from executor.cli.day import DAY_SECONDS, ObjectiveOption, plan_day_and_report
from executor.cli.errors import OUR_ERRORS
from executor.cli.options import (
    DEFAULT_STRETCH_PCT,
    FIRST_AUTOPILOT,
    AfterOption,
    AutopilotOption,
    EverybodyOption,
    FaultOption,
    FlownPlanOption,
    JsonOption,
    LearnedOption,
    NetworkOption,
    PlanCostOption,
    QuietOption,
    RunOption,
    SecondsOption,
    SeedOption,
    SiteArgument,
    SolverOption,
    StartsOption,
    StretchOption,
    require_finite,
)
from executor.cli.plan_inputs import (
    check_can_write,
    load_site_with_learned,
    parse_plan_request,
    plan_and_report,
    plan_request_for,
    select_flown_plan,
)
from executor.core.formatting import command_line
from executor.core.interface.check_codes import Severity
from executor.core.interface.commands import Level
from executor.errors import LogError, PreflightFailed, SiteError
from executor.flight import run_flight as flying
from executor.flight.flight_request import FlightRequest, write_run_start
from executor.flight.mqtt_settings import read_mqtt_settings
from executor.flight.next_flight import describe_next_flight, plan_next_flight, read_segments_left
from executor.flight.open_links import check_backends
from executor.flight.restore_vehicles import check_run, find_open_parameters
from executor.runtime import fair_event_loop
from executor.simulated.demo_site import (
    OTHER_LOSS,
    USUAL_LOSS,
    USUAL_RADIUS_M,
    USUAL_VEHICLES,
    build_demo_site,
    check_faults,
    is_default_demo,
    run_simulated_fleet,
)
from executor.simulated.injected_faults import read_injected_faults
from executor.site import day_flight, site_model
from executor.site.day_summary import describe_day
from executor.site.ground_files import read_ground
from executor.site.ground_view import GroundView, view_for
from executor.site.site_file import check_site, read_signing_key, read_site
from executor.site.site_planning import DEFAULT, PlanSolver
from missions import DayPlanFile, PlanFile, is_day_plan, write_plan
from missions.files import json_text
from planner.sorties import Objective

DEMO_PLAN_S = 3.0
DEMO_ITERATIONS = 300_000
"""Of the usual demo, whose budgets ask for them: some ten seconds of one processor."""
DEMO_MOST_S = 300.0
DEMO_SEARCHES = 2
"""Side by side, however many processors there are: their number is a part of what decides the plan."""
"""Of the solver."""


def demo(
    network: NetworkOption = None,
    radius: Annotated[
        float,
        typer.Option(min=1, callback=require_finite, metavar="M", help="Only segments within M metres of the depot."),
    ] = USUAL_RADIUS_M,
    vehicles: Annotated[int, typer.Option(min=2, max=50, help="Number of vehicles.")] = USUAL_VEHICLES,
    speedup: Annotated[
        float,
        typer.Option(
            min=0.1,
            max=100,
            callback=require_finite,
            metavar="X",
            help="Speed of the simulation, in multiples of real time.",
        ),
    ] = 10.0,
    seed: SeedOption = 1,
    fault: FaultOption = None,
    autopilot: AutopilotOption = FIRST_AUTOPILOT,
    cost: PlanCostOption = None,
    flat: Annotated[bool, typer.Option("--flat", help="Assume flat ground for a network without heights.")] = False,
    run: RunOption = None,
    as_json: JsonOption = False,
) -> None:
    """Plan, fly four simulated vehicles, lose one, re-plan, finish; leaves a run directory with pictures."""
    content = build_demo_site(
        network=network, radius_m=radius, vehicles=vehicles, speedup=speedup, autopilot=autopilot.value, flat=flat
    )
    usual = is_default_demo(network, radius, vehicles)
    faults = fault if fault is not None else [USUAL_LOSS if usual else OTHER_LOSS]
    site = check_site(content, "demo")
    ground = site_model.load_site_model(site, Path())
    check_faults(ground, faults)
    console = TerminalConsole(quiet=as_json, yes=True)
    # Nobody has looked at a plan before, and the vehicle of the story must fly.
    wanted = replace(plan_request_for(cost), seconds=DEMO_PLAN_S, seed=seed, all_vehicles=True)
    if usual:
        wanted = replace(wanted, seconds=DEMO_MOST_S, iterations=DEMO_ITERATIONS, starts=DEMO_SEARCHES)
    plan = plan_and_report(ground, console, wanted)
    directory = create_run_directory(run)
    order = FlightRequest(site, Path(), ground, plan, directory, lambda clock: read_injected_faults(directory, clock))
    write_run_start(order)
    with run_simulated_fleet(directory, faults, seed):
        flown = fair_event_loop.run_on_fair_loop(flying.run_flight(order, console))
    _finish_flight(order, flown, as_json=as_json)


def simulate(
    site: SiteArgument,
    speedup: Annotated[
        float | None,
        typer.Option(
            min=0.1,
            max=100,
            callback=require_finite,
            metavar="X",
            help="Speed in multiples of real time, instead of the site's.",
        ),
    ] = None,
    fault: FaultOption = None,
    seed: SeedOption = 1,
    wind: Annotated[
        float,
        typer.Option(
            min=0.1, max=5, callback=require_finite, metavar="FACTOR", help="Factor on energy consumption, for wind."
        ),
    ] = 1.0,
    truth: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the ground truth of the simulation there, one JSON object a line."),
    ] = None,
    failsafe: Annotated[
        bool,
        typer.Option(
            "--failsafe",
            help="GCS failsafe on the vehicles: RTL when GCS heartbeats stop. Without it they continue.",
        ),
    ] = False,
    cards: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write what the site's cameras take there, as JPEGs with EXIF."),
    ] = None,
) -> None:
    """Run the simulated fleet alone, on UDP, for any ground station; ends with Ctrl-C."""
    from executor.simulated.simulated_fleet import SimulationOutputs, run_simulation

    check_can_write(truth)
    if cards is not None:
        require_extra(Extra.IMAGES, "--cards")
    content = read_site(site)
    ground = site_model.load_site_model(content, site.parent)
    factor = content.flight.speedup if speedup is None else speedup
    run_simulation(
        ground, speedup=factor, faults=fault or (), seed=seed, wind=wind, outputs=SimulationOutputs(truth, cards),
        failsafe=failsafe, key=read_signing_key(content, site.parent),
    )  # fmt: skip


def fly(
    asked: typer.Context,
    site: Annotated[Path, typer.Argument(metavar="SITE", help="The site file (TOML), or a day plan beside --site.")],
    of: Annotated[
        Path | None, typer.Option("--site", metavar="SITE", help="The site file, where a day plan is named first.")
    ] = None,
    plan: FlownPlanOption = None,
    after: AfterOption = None,
    learned: LearnedOption = None,
    cost: PlanCostOption = None,
    solver: SolverOption = PlanSolver.SEARCH,
    stretch: StretchOption = DEFAULT_STRETCH_PCT,
    all_vehicles: EverybodyOption = False,
    seconds: SecondsOption = DEFAULT.seconds,
    seed: SeedOption = DEFAULT.seed,
    starts: StartsOption = 0,
    run: RunOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the take-off.")] = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Connect, check, upload, fly and supervise; re-plan when a vehicle is lost.

    Without --plan it plans as `plan` does with the same options; the checklist shows the options in force. A day plan,
    as `plan --day` writes it, is flown sortie by sortie: each after the first by the crew's word, when its pack is
    changed.
    """
    site, plan = _select_site_and_plan(site, of, plan)
    wanted = parse_plan_request(cost, solver, stretch, all_vehicles, seconds, seed, starts)
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    made = _PreparedSite(site, learned, after, console)
    day, routes = select_flown_plan(made.ground, console, asked, wanted, plan=plan, after=after)
    _fly_and_finish(made.build_flight_request(routes, run, day), console, as_json=as_json)


def fly_day(
    site: SiteArgument,
    after: AfterOption = None,
    learned: LearnedOption = None,
    objective: ObjectiveOption = Objective.FINISH,
    seconds: Annotated[
        float, typer.Option(min=0.1, callback=require_finite, metavar="S", help="Time for the planning.")
    ] = DAY_SECONDS,
    seed: SeedOption = DEFAULT.seed,
    starts: StartsOption = 0,
    run: RunOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the take-off.")] = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Plan a working day of sorties from the bases of the site, and fly it.

    With --after it goes on with what an earlier day left, and its report covers the days before it too. `plan --day`
    makes the same plan to look at first; `fly` flies that.
    """
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    made = _PreparedSite(site, learned, after, console)
    left = None if after is None else read_segments_left(after, made.ground)
    wanted = replace(DEFAULT, seconds=seconds, seed=seed, starts=starts, objective=objective)
    planned = plan_day_and_report(made.ground, console, wanted, left)
    console.show_progress("")
    for line in describe_day(planned):
        console.say(Level.INFO, line)
    routes = day_flight.build_first_sorties_plan(planned, made.ground)
    _fly_and_finish(made.build_flight_request(routes, run, planned), console, as_json=as_json)


class _PreparedSite:
    """What is made of a site before anything is planned: what cannot be used is said by then."""

    def __init__(self, site: Path, learned: Path | None, after: Path | None, console: TerminalConsole) -> None:
        self._base, self._content = site.parent, read_site(site)
        check_backends(self._content)
        self.ground = load_site_with_learned(self._content, self._base, learned, console)
        self._mqtt = read_mqtt_settings(self._content.mqtt, self._base, str(site))
        self._below = view_for(self.ground, self._base)
        self._after = after

    def build_flight_request(self, routes: PlanFile, run: Path | None, day: DayPlanFile | None) -> FlightRequest:
        """Return the order to fly a plan."""
        return FlightRequest(
            self._content, self._base, self.ground, routes, create_run_directory(run), lambda _: (), self._mqtt,
            self._below, day, () if self._after is None else read_earlier_flights(self._after),
        )  # fmt: skip


def _fly_and_finish(order: FlightRequest, console: TerminalConsole, *, as_json: bool) -> None:
    check_run(order.run, order.site)
    write_run_start(order)
    flown = fair_event_loop.run_on_fair_loop(flying.run_flight(order, console))
    _finish_flight(order, flown, as_json=as_json)


def _select_site_and_plan(first: Path, of: Path | None, plan: Path | None) -> tuple[Path, Path | None]:
    """Return the site file and the plan, whichever of them is named first.

    Raises:
        SiteError: a day plan without its site, or two plans.
    """
    if of is None:
        if is_day_plan(first):
            raise SiteError(f"{first}: --site: expected the site file of this day plan")
        return first, plan
    if plan is not None or not is_day_plan(first):
        raise SiteError(f"{first}: expected a day plan, and no --plan, beside --site {of}")
    return of, first


def preflight(
    asked: typer.Context,
    site: SiteArgument,
    plan: FlownPlanOption = None,
    after: AfterOption = None,
    learned: LearnedOption = None,
    cost: PlanCostOption = None,
    solver: SolverOption = PlanSolver.SEARCH,
    stretch: StretchOption = DEFAULT_STRETCH_PCT,
    all_vehicles: EverybodyOption = False,
    seconds: SecondsOption = DEFAULT.seconds,
    seed: SeedOption = DEFAULT.seed,
    starts: StartsOption = 0,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Read every vehicle's state and parameters and run the checklist; nothing is uploaded, nothing moves."""
    from executor.flight.checklist_only import run_checklist_only

    wanted = parse_plan_request(cost, solver, stretch, all_vehicles, seconds, seed, starts)
    content = read_site(site)
    check_backends(content)
    console = TerminalConsole(quiet=as_json or quiet, yes=True)
    ground = load_site_with_learned(content, site.parent, learned, console)
    day, routes = select_flown_plan(ground, console, asked, wanted, plan=plan, after=after)
    order = FlightRequest(content, site.parent, ground, routes, Path(), lambda _: (), day=day)
    found = fair_event_loop.run_on_fair_loop(run_checklist_only(order, console))
    console.show_checks(found)
    stops = [check for check in found if check.severity is Severity.STOP]
    if as_json:
        print(json_text({"ready": not stops, "checks": [CheckRow.build_from(check).to_plain() for check in found]}))
    elif not quiet:
        print("ready" if not stops else f"not ready: {stops[0].subject}: {stops[0].text}")
    if stops:
        raise typer.Exit(1)


def resume(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The run directory of the flight.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the flight is resumed.")] = False,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Resume a flight from its run directory after its ground station died; on another computer too."""
    from executor.flight import resume_flight as resuming

    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    known = resuming.read_resume_plan(directory)
    if isinstance(known, resuming.UnlaunchedRun):
        order = resuming.build_resumed_request(directory, known.ground, known.plan)
        _finish_flight(
            order,
            fair_event_loop.run_on_fair_loop(resuming.start_unlaunched_run(directory, known, console)),
            as_json=as_json,
        )
        return
    left = resuming.read_finished_run(directory)
    report = None if left is None else resuming.finish_report(directory, left)
    if left is None or report is None:
        # A heartbeat that begins and ends is a lost ground station to a vehicle: it begins after the yes.
        told = [] if yes else resuming.describe_before_resume(directory, known)
        for line in told:
            console.say(Level.INFO, line)
        if not console.confirm("Resume this flight?"):
            raise PreflightFailed("not confirmed; nothing was sent to any vehicle")
        _finish_flight(
            known.order,
            fair_event_loop.run_on_fair_loop(resuming.resume_flight(directory, console, told)),
            as_json=as_json,
        )
        return
    console.say(Level.INFO, f"{directory}: this flight is over")
    for one in find_open_parameters(directory):
        restore = command_line("restore", directory)
        text = f"{one.vehicle}: {one.words_open} not restored: {restore}"
        console.say(Level.WARNING, text)
    _finish_flight(known.order, flying.FlightResult(report, left.begun.context, left=False), as_json=as_json)


def _finish_flight(order: FlightRequest, flown: flying.FlightResult, *, as_json: bool) -> None:
    report = flown.report
    if as_json:
        _print_line(json_text(report.to_plain()))
    else:
        _print_line(f"{report.segments_inspected} of {report.segments_total} segments inspected; record in {order.run}")
        if together := describe_total_inspected(report):
            _print_line(together)
        if report.segments_uncovered:
            _print_line(f"not inspected: {', '.join(report.uncovered_names)}")
        if report.left_over:
            names = (report.segment_names[str(segment)] for segment in report.left_over)
            _print_line(f"of these, planned for the next sortie: {', '.join(names)}")
    _write_next_flight(order, report, quiet=as_json)
    _show_flight(order.run, report)
    if not report.finished:
        raise typer.Exit(1)


def _print_line(text: str, *, to: TextIO | None = None) -> None:
    """Print a line; nobody may read it any more, and what is left to do is done all the same."""
    stream = sys.stdout if to is None else to
    try:
        print(text, file=stream, flush=True)
    except OSError as error:
        if error.errno not in {errno.EPIPE, errno.EIO}:
            raise
        discard_output(stream)


def _write_next_flight(order: FlightRequest, report: FlightReport, *, quiet: bool) -> None:
    path = RunDirectory(order.run).next_sortie
    try:
        plan = plan_next_flight(order.ground, report, order.plan.solved.seed)
        if plan is None:
            return
        write_plan(path, plan)
    except (OSError, *OUR_ERRORS) as error:
        _print_line(f"faultline: the next sortie could not be planned: {error}", to=sys.stderr)
        return
    if not quiet:
        _print_line(describe_next_flight(plan, path))


def _show_flight(run: Path, report: FlightReport) -> None:
    from executor.analysis.read_run import read_run
    from executor.analysis.report_page import write_report_page

    try:
        record = read_run(run)
        if line := describe_missing_extra(Extra.PICTURES, "a picture of the flight"):
            _print_line(f"faultline: {line}", to=sys.stderr)
        else:
            _draw_flight(run, record)
        write_report_page(record, report, RunDirectory(run).page)
    except (OSError, *OUR_ERRORS) as error:
        _print_line(f"faultline: the pictures could not be made: {error}", to=sys.stderr)


def _draw_flight(run: Path, record: FlightRecord) -> None:
    from executor.analysis.height_profile import build_profiles
    from executor.analysis.pictures import draw_battery_figure, draw_flight_figure, draw_profile_figure, save_figure
    from executor.flight.run_start import read_run_start

    save_figure(draw_flight_figure(record, _read_kept_ground(run)), RunDirectory(run).map)
    save_figure(draw_battery_figure(record), RunDirectory(run).battery)
    if RunDirectory(run).terrain.exists():
        begun = read_run_start(run)
        setup, routes = (
            begun.context.setup,
            site_model.name_routes(begun.ground, begun.plan.build_task(), begun.plan.plan),
        )
        save_figure(
            draw_profile_figure(build_profiles(setup, site_model.build_paths(setup, routes).values())),
            RunDirectory(run).profile,
        )


def _read_kept_ground(run: Path) -> GroundView | None:
    """Return the ground below a flight's map; without it where what was kept of it is damaged."""
    try:
        return read_ground(run)
    except LogError as error:
        _print_line(f"faultline: {error}: the map is drawn without the ground", to=sys.stderr)
        return None
