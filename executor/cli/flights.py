"""Define the commands that fly or simulate: demo, simulate, fly, day, preflight, resume, restore."""

from __future__ import annotations

import errno
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TextIO

import typer

from executor.adapters import clock
from executor.adapters.extras import Extra, describe_missing_extra, require_extra
from executor.adapters.interrupts import discard_output
from executor.adapters.run_directory import (
    RunDirectory,
    check_can_fly,
    check_run_directory,
    create_run_directory,
    lock_run_directory,
)
from executor.analysis.documents import CheckRow, FlightReport, describe_total_inspected, read_earlier_flights
from executor.analysis.flight_record import FlightRecord
from executor.cli import options, plan_inputs
from executor.cli.console import TerminalConsole
from executor.cli.errors import OUR_ERRORS
from executor.cli.exit_codes import ANSWER_IS_NO
from executor.core.formatting import command_line, format_count
from executor.core.interface.codes import Severity
from executor.core.interface.commands import Level
from executor.core.preflight.parameter_changes import KeptList, KeptParameter
from executor.errors import LogError, PreflightFailed, SiteError
from executor.flight import run_flight as flying
from executor.flight.next_flight import describe_next_flight, plan_next_flight, read_segments_left
from executor.flight.open_links import check_backends
from executor.flight.restore_vehicles import LISTS, PARAMETERS, build_parameter_rows, check_run, find_open_parameters
from executor.flight.run_start import FlightRequest, read_mqtt_settings, write_run_start
from executor.simulated import simulated_fleet
from executor.simulated.fault_truths import read_injected_faults
from executor.site import day_plans, site_model
from executor.site.ground_view import read_ground_files, view_for
from executor.site.plan_summary import describe_day
from executor.site.site_file import check_site, read_signing_key, read_site
from executor.site.site_planning import DEFAULT
from missions import DayPlanFile, PlanFile, is_day_plan, write_plan
from missions.files import json_text
from planner.sorties import Objective

DEMO_PLAN_S = 3.0
DEMO_ITERATIONS = 300_000
"""Search iterations of the default demo: about ten seconds on one processor."""
DEMO_MOST_S = 300.0
DEMO_SEARCHES = 2
"""Parallel searches of the demo, whatever the number of processors: it determines the plan found."""


def demo(
    network: options.NetworkOption = None,
    radius: Annotated[
        float, options.number_option("Only segments within M metres of the depot.", 1, metavar="M")
    ] = simulated_fleet.USUAL_RADIUS_M,
    vehicles: Annotated[int, typer.Option(min=2, max=50, help="Number of vehicles.")] = simulated_fleet.USUAL_VEHICLES,
    speedup: Annotated[
        float, options.number_option("Speed of the simulation, in multiples of real time.", 0.1, 100, metavar="X")
    ] = 10.0,
    seed: options.SeedOption = 1,
    fault: options.FaultOption = None,
    autopilot: options.AutopilotOption = options.FIRST_AUTOPILOT,
    cost: options.PlanCostOption = None,
    mtbf: options.PlanMtbfOption = None,
    flat: Annotated[bool, typer.Option("--flat", help="Assume flat ground for a network without heights.")] = False,
    run: options.RunOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Plan, fly four simulated vehicles, lose one, re-plan, finish; leaves a run directory with pictures."""
    check_run_directory(run)
    content = simulated_fleet.build_demo_site(
        network=network, radius_m=radius, vehicles=vehicles, speedup=speedup, autopilot=autopilot.value, flat=flat
    )
    usual = simulated_fleet.is_default_demo(network, radius, vehicles)
    faults = fault if fault is not None else [simulated_fleet.USUAL_LOSS if usual else simulated_fleet.OTHER_LOSS]
    site = check_site(content, "demo")
    ground = site_model.load_site_model(site, Path())
    # Errors in a fault are reported before anything is started.
    simulated_fleet.fleet_of(ground, speedup=speedup, faults=faults, seed=seed, wind=1.0, failsafe=True)
    console = TerminalConsole(quiet=as_json, yes=True)
    # There is no earlier plan to keep to, and the vehicle of the story must fly.
    wanted = replace(options.build_plan_request(cost, mtbf), seconds=DEMO_PLAN_S, seed=seed, all_vehicles=True)
    if usual:
        wanted = replace(wanted, seconds=DEMO_MOST_S, iterations=DEMO_ITERATIONS, starts=DEMO_SEARCHES)
    plan = plan_inputs.plan_and_report(ground, console, wanted)
    directory = create_run_directory(run)
    request = FlightRequest(site, Path(), ground, plan, directory, lambda clock: read_injected_faults(directory, clock))
    with lock_run_directory(directory):
        write_run_start(request)
    with simulated_fleet.run_simulated_fleet(directory, faults, seed):
        report = clock.run_on_fair_loop(flying.run_flight(request, console))
    _finish_flight(request, report, as_json=as_json)


def simulate(
    site: options.SiteArgument,
    speedup: Annotated[
        float | None,
        options.number_option("Speed in multiples of real time, instead of the site's.", 0.1, 100, metavar="X"),
    ] = None,
    fault: options.FaultOption = None,
    seed: options.SeedOption = 1,
    wind: Annotated[
        float, options.number_option("Factor on energy consumption, for wind.", 0.1, 5, metavar="FACTOR")
    ] = 1.0,
    truth: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the ground truth of the simulation there, one JSON object a line."),
    ] = None,
    failsafe: Annotated[
        bool,
        typer.Option(
            "--failsafe", help="GCS failsafe on the vehicles: RTL when GCS heartbeats stop. Without it they continue."
        ),
    ] = False,
    cards: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the pictures of the site's cameras there, as JPEGs with EXIF."),
    ] = None,
    radio: options.RadioOption = "",
) -> None:
    """Run the simulated fleet alone, on UDP, for any ground station; ends with Ctrl-C."""
    plan_inputs.check_can_write(truth)
    if cards is not None:
        require_extra(Extra.IMAGES, "--cards")
    content = read_site(site)
    ground = site_model.load_site_model(content, site.parent)
    factor = content.flight.speedup if speedup is None else speedup
    simulated_fleet.run_simulation(
        ground, speedup=factor, faults=fault or (), seed=seed, wind=wind, truth=truth, cards=cards, failsafe=failsafe,
        key=read_signing_key(content, site.parent), radio=radio,
    )  # fmt: skip


@options.flatten_options
def fly(
    asked: typer.Context,
    site: Annotated[
        Path, typer.Argument(metavar="SITE", help="The site file (TOML), or a day plan together with --site.")
    ],
    *,
    of: Annotated[
        Path | None, typer.Option("--site", metavar="SITE", help="The site file, if the argument is a day plan.")
    ] = None,
    plan: options.FlownPlanOption = None,
    after: options.FlownAfterOption = None,
    learned: options.LearnedOption = None,
    planning: options.PlanOptions,
    run: options.RunOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the take-off.")] = False,
    on_page: Annotated[bool, typer.Option("--on-page", help="Ask only on the page, not on a terminal.")] = False,
    quiet: options.QuietOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Connect, check, upload, fly and supervise; re-plan when a vehicle is lost.

    Without --plan it plans as `plan` does with the same options; the checklist shows the options in force. A day plan,
    as `plan --day` writes it, is flown sortie by sortie: each after the first starts when the crew confirms the pack
    change. With --after the next day of that plan is flown, without the segments already inspected.
    """
    site, plan = _select_site_and_plan(site, of, plan)
    wanted = planning.build_request()
    console = TerminalConsole(quiet=as_json or quiet, yes=yes, on_page=on_page)
    made = _PreparedSite(site, learned, after, run, console)
    if on_page and not made.content.web.enabled:
        raise SiteError(f"--on-page: expected [web] enabled in {site}, where the page is switched off")
    day, routes = plan_inputs.select_flown_plan(made.ground, console, asked, wanted, plan=plan, after=after)
    _fly_and_finish(made.build_flight_request(routes, run, day), console, as_json=as_json)


def fly_day(
    site: options.SiteArgument,
    after: options.AfterOption = None,
    learned: options.LearnedOption = None,
    objective: plan_inputs.ObjectiveOption = Objective.FINISH,
    seconds: Annotated[
        float, options.number_option("Time for the planning.", 0.1, metavar="S")
    ] = plan_inputs.DAY_SECONDS,
    seed: options.SeedOption = DEFAULT.seed,
    starts: options.StartsOption = 0,
    run: options.RunOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the take-off.")] = False,
    quiet: options.QuietOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a working day of sorties from the bases of the site, and fly it.

    With --after it continues with the segments that an earlier day left over, and its report covers the earlier days
    too. `plan --day` makes the same plan for a check beforehand; `fly` flies that plan.
    """
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    made = _PreparedSite(site, learned, after, run, console)
    left = None if after is None else read_segments_left(after, made.ground)
    wanted = replace(DEFAULT, seconds=seconds, seed=seed, starts=starts, objective=objective)
    planned = plan_inputs.plan_day_and_report(made.ground, console, wanted, left)
    console.show_progress("")
    for line in describe_day(planned):
        console.say(Level.INFO, line)
    routes = day_plans.build_first_sorties_plan(planned, made.ground)
    _fly_and_finish(made.build_flight_request(routes, run, planned), console, as_json=as_json)


class _PreparedSite:
    """Models of a site before planning: unusable input is reported by then."""

    def __init__(
        self, site: Path, learned: Path | None, after: Path | None, run: Path | None, console: TerminalConsole
    ) -> None:
        check_can_fly(site)
        check_run_directory(run)
        self._base, self.content = site.parent, read_site(site)
        check_backends(self.content)
        self.ground = plan_inputs.load_site_with_learned(self.content, self._base, learned, console)
        self._mqtt = read_mqtt_settings(self.content.mqtt, self._base, str(site))
        self._below = view_for(self.ground, self._base)
        self._after = after

    def build_flight_request(self, routes: PlanFile, run: Path | None, day: DayPlanFile | None) -> FlightRequest:
        return FlightRequest(
            self.content, self._base, self.ground, routes, create_run_directory(run), lambda _: (), self._mqtt,
            self._below, day, () if self._after is None else read_earlier_flights(self._after),
        )  # fmt: skip


def _fly_and_finish(request: FlightRequest, console: TerminalConsole, *, as_json: bool) -> None:
    with lock_run_directory(request.run):  # another process may be asking its crew, with nothing in its log yet
        check_run(request.run, request.site)
        write_run_start(request)
    report = clock.run_on_fair_loop(flying.run_flight(request, console))
    _finish_flight(request, report, as_json=as_json)


def _select_site_and_plan(first: Path, of: Path | None, plan: Path | None) -> tuple[Path, Path | None]:
    """Return the site file and the plan, in either order of arguments.

    Raises:
        SiteError: a day plan without its site, or two plans.
    """
    if of is None:
        if is_day_plan(first):
            raise SiteError(f"{first}: --site: expected the site file of this day plan")
        return first, plan
    if plan is not None or not is_day_plan(first):
        raise SiteError(f"{first}: expected a day plan, and no --plan, together with --site {of}")
    return of, first


@options.flatten_options
def preflight(
    asked: typer.Context,
    site: options.SiteArgument,
    *,
    plan: options.FlownPlanOption = None,
    after: options.FlownAfterOption = None,
    learned: options.LearnedOption = None,
    planning: options.PlanOptions,
    quiet: options.QuietOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Read every vehicle's state and parameters and run the checklist; nothing is uploaded, nothing moves."""
    from executor.flight.preparation import run_checklist_only

    wanted = planning.build_request()
    content = read_site(site)
    check_backends(content)
    console = TerminalConsole(quiet=as_json or quiet, yes=True)
    ground = plan_inputs.load_site_with_learned(content, site.parent, learned, console)
    day, routes = plan_inputs.select_flown_plan(ground, console, asked, wanted, plan=plan, after=after)
    request = FlightRequest(content, site.parent, ground, routes, Path(), lambda _: (), day=day)
    found = clock.run_on_fair_loop(run_checklist_only(request, console))
    console.show_checks(found)
    stops = [check for check in found if check.severity is Severity.STOP]
    lines = ["ready" if not stops else f"not ready: {stops[0].subject}: {stops[0].text}"]
    document = {"ready": not stops, "checks": [CheckRow.build_from(check).to_plain() for check in found]}
    plan_inputs.print_result(lambda: document, () if quiet else lines, as_json=as_json, answer_is_no=bool(stops))


def resume(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The run directory of the flight.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the flight is resumed.")] = False,
    quiet: options.QuietOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Resume a flight from its run directory after its ground station died; on another computer too."""
    from executor.flight import resume_flight as resuming

    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    known = resuming.read_resume_plan(directory)
    if not isinstance(known, resuming.ResumePlan):
        report = clock.run_on_fair_loop(resuming.start_unlaunched_run(known, console))
        _finish_flight(known, report, as_json=as_json)
        return
    left = resuming.read_finished_run(directory)
    over = None if left is None else resuming.finish_report(directory, left)
    if over is None:
        # To a vehicle, a heartbeat that begins and ends is a lost ground station: it begins after the crew's yes.
        with lock_run_directory(directory):  # a flight that goes on is not to be asked about
            told = [] if yes else resuming.describe_before_resume(directory, known)
        for line in told:
            console.say(Level.INFO, line)
        if not console.confirm("Resume this flight?"):
            raise PreflightFailed("not confirmed; nothing was sent to any vehicle")
        report = clock.run_on_fair_loop(resuming.resume_flight(directory, console, told))
    else:
        report = over
        console.say(Level.INFO, f"{directory}: this flight is over")
        for one in find_open_parameters(directory):
            restore = command_line("restore", directory)
            console.say(Level.WARNING, f"{one.vehicle}: {one.words_open} not restored: {restore}")
    _finish_flight(known.request, report, as_json=as_json)


def _finish_flight(request: FlightRequest, report: FlightReport, *, as_json: bool) -> None:
    if as_json:
        _print_line(json_text(report.to_plain()))
    else:
        _print_line(
            f"{report.segments_inspected} of {report.segments_total} segments inspected; record in {request.run}"
        )
        if together := describe_total_inspected(report):
            _print_line(together)
        if report.segments_uncovered:
            _print_line(f"not inspected: {', '.join(report.uncovered_names)}")
        if report.left_over:
            names = (report.segment_names[str(segment)] for segment in report.left_over)
            _print_line(f"of these, planned for the next flight: {', '.join(names)}")
    _write_next_flight(request, report, quiet=as_json)
    _show_flight(request, report)
    if not report.finished:
        raise typer.Exit(ANSWER_IS_NO)


def _print_line(text: str, *, to: TextIO | None = None) -> None:
    """Print a line; if the reader is gone, the remaining work is done all the same."""
    stream = sys.stdout if to is None else to
    try:
        print(text, file=stream, flush=True)
    except OSError as error:
        if error.errno not in {errno.EPIPE, errno.EIO}:
            raise
        discard_output(stream)


def _write_next_flight(request: FlightRequest, report: FlightReport, *, quiet: bool) -> None:
    path = RunDirectory(request.run).next_sortie
    try:
        plan = plan_next_flight(request.ground, report, request.plan.solved.seed)
        if plan is None:
            return
        write_plan(path, plan)
    except (OSError, *OUR_ERRORS) as error:
        _print_line(f"faultline: the next flight could not be planned: {error}", to=sys.stderr)
        return
    if not quiet:
        _print_line(describe_next_flight(plan, path))


def _show_flight(request: FlightRequest, report: FlightReport) -> None:
    from executor.analysis.flight_record import read_run
    from executor.analysis.report_page import write_report_page

    run = request.run
    try:
        record = read_run(run)
        if line := describe_missing_extra(Extra.PICTURES, "a picture of the flight"):
            _print_line(f"faultline: {line}", to=sys.stderr)
        else:
            _draw_flight(run, record)
        write_report_page(record, report, RunDirectory(run).page, request.ground, _read_kept_ground(run))
    except (OSError, *OUR_ERRORS) as error:
        _print_line(f"faultline: the pictures could not be made: {error}", to=sys.stderr)


def _draw_flight(run: Path, record: FlightRecord) -> None:
    from executor.analysis.pictures import draw_battery_figure, draw_profile_figure, save_figure
    from executor.flight.run_start import read_run_start

    save_figure(draw_battery_figure(record), RunDirectory(run).battery)
    if RunDirectory(run).terrain.exists():
        begun = read_run_start(run)
        save_figure(draw_profile_figure(begun.context.setup, begun.plan.network_routes), RunDirectory(run).profile)


def _read_kept_ground(run: Path) -> Mapping[str, bytes]:
    """Return the background of a flight's map; empty if the stored one is damaged."""
    try:
        return read_ground_files(run)
    except LogError as error:
        _print_line(f"faultline: {error}: the map is drawn without the ground", to=sys.stderr)
        return {}


def restore(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The run directory of the flight.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before parameters are set.")] = False,
    quiet: options.QuietOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Restore the parameters, fences and rally points that the flight of a run directory changed on its vehicles."""
    from executor.flight import restore_vehicles as restoring

    _, waiting, lists = restoring.read_open_changes(directory)
    if not waiting and not lists:
        _finish(directory, PARAMETERS.read(directory), LISTS.read(directory), as_json=as_json, quiet=quiet)
        return
    console = TerminalConsole(quiet=as_json or quiet, yes=yes)
    with lock_run_directory(directory):  # what a flight has changed is not to be shown while it goes on
        for words in (*(one.words for one in waiting), *(one.words for one in lists)):
            console.say(Level.INFO, words)
    counted = [format_count(len(waiting), "parameter")] if waiting else []
    counted += list(dict.fromkeys(one.words_open for one in lists))
    asked = " and ".join(counted)
    if not console.confirm(f"Restore {asked}?"):
        console.say(Level.WARNING, "not confirmed; nothing was sent to any vehicle")
        raise typer.Exit(ANSWER_IS_NO)
    kept, fences = clock.run_on_fair_loop(restoring.restore_from_run(directory, console))
    _finish(directory, kept, fences, as_json=as_json, quiet=quiet)


def _finish(
    directory: Path, kept: Sequence[KeptParameter], lists: Sequence[KeptList], *, as_json: bool, quiet: bool
) -> None:
    stay = sum(one.is_open for one in kept) + sum(one.is_open for one in lists)
    rows = {"parameters": [row.to_plain() for row in build_parameter_rows(kept)]}
    if lists:
        rows["fences"] = [
            {"vehicle": one.vehicle, "list": one.kind.name.lower(), "restored": not one.is_open} for one in lists
        ]
    what = "all parameters, fences and rally points are restored" if lists else "all parameters are restored"
    line = f"{directory}: {what}" if not stay else f"{directory}: {stay} of {len(kept) + len(lists)} not restored"
    lines = [] if quiet else [line]
    plan_inputs.print_result(lambda: {"restored": not stay, **rows}, lines, as_json=as_json, answer_is_no=stay > 0)
