"""The command line: `faultline --help`.

Exit codes: 0 done, 1 it ran and the answer is no, 2 bad input with a one-line reason.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from typer.exceptions import TyperException

from executor import app as flying
from executor import build, planning
from executor.adapters.rundir import new_run_directory
from executor.config import check_site, read_site
from executor.console import TerminalConsole
from executor.core.commands import Level
from executor.demo import check_faults, demo_site, happenings, simulated_fleet
from executor.errors import ExecutorError, SiteError
from executor.simulator.errors import SimulatorError
from missions import (
    MissionsError,
    PlanFile,
    check_plan,
    dialect_for,
    encode,
    flight_path,
    flight_setup,
    plan_document,
    qgc_plan,
    qgc_waypoints,
    read_plan,
    write_plan,
)
from planner import Cost, PlannerError, Progress

cli = typer.Typer(
    name="faultline",
    help="Flies a fleet of UAVs along a power line, and finishes the inspection when one of them is lost.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

OUR_ERRORS = (ExecutorError, MissionsError, PlannerError, SimulatorError)
"""What is the input's fault, or the outside's: one line, no traceback."""
INTERRUPTED = 1
INTERNAL = 70
"""EX_SOFTWARE: a mistake of ours, not of the input."""


class CostName(StrEnum):
    """What a plan is chosen by."""

    MINMAX = "minmax"
    MINSUM = "minsum"
    MINCOMB = "mincomb"


class SolverName(StrEnum):
    """Who plans."""

    SEARCH = "search"


class FormatName(StrEnum):
    """What other ground stations read."""

    QGC = "qgc"
    WAYPOINTS = "waypoints"


class AutopilotName(StrEnum):
    """Whose behaviour the simulated vehicles have."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


SiteArgument = Annotated[Path, typer.Argument(metavar="SITE", help="The site file (TOML).")]
PlanArgument = Annotated[Path, typer.Argument(metavar="PLAN", help="A plan file, as `faultline plan -o` writes it.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
CostOption = Annotated[CostName, typer.Option(help="minmax: the longest route; minsum: all routes; mincomb: both.")]
SecondsOption = Annotated[float, typer.Option(min=0.01, help="How long the solver may take.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Of all chance; the same seed gives the same result.")]
FaultOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SPEC",
        help="VEHICLE:KIND[=VALUE]@WHEN, such as uav2:silent@40% or uav3:battery-step=30@300s; may be repeated. Kinds: "
        "silent[=20s], battery-step=30, drain=3, crash, reboot, refuse-upload, half-upload, loss=0.2, delay=0.3, "
        "duplicate=0.1, reorder=0.1; 'all' names every vehicle.",
    ),
]
RunOption = Annotated[Path | None, typer.Option("--run", metavar="DIR", help="Where the record goes; new or empty.")]


@cli.command()
def demo(
    network: Annotated[Path | None, typer.Option(metavar="FILE", help="GeoJSON or a graph file.")] = None,
    radius: Annotated[float, typer.Option(min=1, metavar="M", help="Segments within M metres of the depot.")] = 700.0,
    vehicles: Annotated[int, typer.Option(min=2, max=50, help="How many vehicles fly.")] = 4,
    speedup: Annotated[float, typer.Option(min=0.1, max=100, metavar="X", help="Times real time.")] = 10.0,
    seed: SeedOption = 1,
    fault: FaultOption = None,
    autopilot: Annotated[AutopilotName, typer.Option(help="Whose behaviour is simulated.")] = AutopilotName.ARDUPILOT,
    run: RunOption = None,
    as_json: JsonOption = False,
) -> None:
    """Plan, fly four simulated vehicles, lose one, re-plan, finish; leaves a run directory with pictures."""
    content = demo_site(network=network, radius_m=radius, vehicles=vehicles, speedup=speedup, autopilot=autopilot.value)
    faults = fault if fault is not None else ["uav2:silent@40%"]
    site = check_site(content, "demo")
    ground = build.ground_of(site, Path())
    check_faults(ground, faults)
    console = TerminalConsole(quiet=as_json, yes=True)
    plan = _first_plan(ground, console, Cost.MINMAX, 3.0, seed, all_vehicles=True)
    directory = new_run_directory(run)
    order = flying.Order(site, Path(), ground, plan, directory, lambda clock: happenings(directory, clock))
    flying.keep(order)
    with simulated_fleet(directory, faults, seed):
        flown = asyncio.run(flying.fly(order, console))
    _finish_flight(order, flown, as_json=as_json)


@cli.command()
def plan(
    site: SiteArgument,
    cost: CostOption = CostName.MINCOMB,
    solver: Annotated[SolverName, typer.Option(help="Who plans.")] = SolverName.SEARCH,
    all_vehicles: Annotated[bool, typer.Option("--all-vehicles", help="Keep no vehicle on the ground.")] = False,
    seconds: SecondsOption = 5.0,
    seed: SeedOption = 1,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan there.")] = None,
    picture: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw the plan on a map.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan a route for each vehicle within its budget."""
    del solver  # there is one; the option names it for scripts that will choose
    ground = build.ground_of(read_site(site), site.parent)
    console = TerminalConsole(quiet=as_json, yes=True)
    content = _first_plan(ground, console, Cost(cost.value), seconds, seed, all_vehicles=all_vehicles)
    if output is not None:
        _writable(output, lambda: write_plan(output, content))
    if picture is not None:
        from executor.adapters.pictures import draw_plan

        _writable(picture, lambda: draw_plan(content, picture))
    _print_plan(content, as_json=as_json)


@cli.command()
def check(plan: PlanArgument, as_json: JsonOption = False) -> None:
    """Recompute every figure of a plan file from its own network, and say what is wrong."""
    wrong = check_plan(read_plan(plan))
    if as_json:
        print(json.dumps({"ok": not wrong, "wrong": wrong}))
    else:
        for line in wrong or ["every figure is right"]:
            print(line)
    if wrong:
        raise typer.Exit(1)


@cli.command()
def replan(
    plan: PlanArgument,
    lost: Annotated[str, typer.Option(metavar="NAME", help="The vehicle that is lost.")],
    at: Annotated[float, typer.Option(min=0, metavar="SECONDS", help="When, since the start of the plan.")],
    cost: CostOption = CostName.MINCOMB,
    seconds: SecondsOption = 2.0,
    seed: SeedOption = 1,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the new plan.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Say what the others would do if one vehicle were lost at a time; exit 1 if they cannot finish everything."""
    result = planning.after_loss(read_plan(plan), lost, at, cost=Cost(cost.value), seconds=seconds, seed=seed)
    if output is not None:
        _writable(output, lambda: write_plan(output, result.plan))
    _print_plan(result.plan, as_json=as_json)
    if not result.feasible:
        raise typer.Exit(1)


@cli.command()
def export(
    plan: PlanArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="A file per vehicle goes there.")],
    to: Annotated[FormatName, typer.Option("--format", help="QGroundControl's .plan, or .waypoints.")] = FormatName.QGC,
    autopilot: Annotated[AutopilotName, typer.Option(help="For whom the items are.")] = AutopilotName.ARDUPILOT,
) -> None:
    """Write a file per vehicle for other ground stations."""
    content = read_plan(plan)
    if content.inspection is None:
        raise SiteError(f"{plan}: inspection: expected heights and speeds, but the plan has none")
    setup = flight_setup(content.network(), [vehicle.name for vehicle in content.vehicles], content.inspection)
    dialect = dialect_for(autopilot.value)
    write, suffix = (qgc_plan, "plan") if to is FormatName.QGC else (qgc_waypoints, "waypoints")
    _writable(output, lambda: output.mkdir(parents=True, exist_ok=True))
    for route in content.plan.routes:
        name = content.vehicles[route.vehicle].name
        if not route.visits:
            continue
        items = encode(flight_path(setup, name, route.visits), dialect).items
        pad = setup.pad_of(name)
        home = (*setup.frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m)
        path = output / f"{name}.{suffix}"
        text = write(items, dialect, home)
        _writable(path, partial(path.write_text, text, encoding="utf-8"))
        print(path)


@cli.command()
def simulate(
    site: SiteArgument,
    speedup: Annotated[float | None, typer.Option(min=0.1, max=100, metavar="X", help="Instead of the site's.")] = None,
    fault: FaultOption = None,
    seed: SeedOption = 1,
    wind: Annotated[
        float, typer.Option(min=0.1, max=5, metavar="FACTOR", help="What the wind makes of consumption.")
    ] = 1.0,
    truth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write what really happens, a JSON line each.")
    ] = None,
    failsafe: Annotated[
        bool,
        typer.Option(
            "--failsafe",
            help="Return when the ground station falls silent; else they fly on.",
        ),
    ] = False,
) -> None:
    """Run the simulated fleet alone, on UDP, for any ground station; ends with Ctrl-C."""
    from executor.simulation import run_simulation

    content = read_site(site)
    ground = build.ground_of(content, site.parent)
    factor = content.flight.speedup if speedup is None else speedup
    run_simulation(ground, speedup=factor, faults=fault or (), seed=seed, wind=wind, truth=truth, failsafe=failsafe)


@cli.command()
def fly(
    site: SiteArgument,
    plan: Annotated[Path | None, typer.Option(metavar="PLAN", help="Fly this plan; otherwise one is made.")] = None,
    run: RunOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the take-off.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Connect, check, upload, fly and supervise; re-plan when a vehicle is lost."""
    content = read_site(site)
    ground = build.ground_of(content, site.parent)
    console = TerminalConsole(quiet=as_json, yes=yes)
    for name in ("mqtt", "web"):
        if getattr(content, name) is not None:
            console.say(Level.WARNING, f"{site}: [{name}]: this version does not serve it; the flight goes on without")
    if plan is None:
        routes = _first_plan(ground, console, Cost.MINMAX, 5.0, 1, all_vehicles=True)
    else:
        routes = read_plan(plan)
        planning.fits(routes, ground, str(plan))
    order = flying.Order(content, site.parent, ground, routes, new_run_directory(run), lambda _: ())
    flying.keep(order)
    flown = asyncio.run(flying.fly(order, console))
    _finish_flight(order, flown, as_json=as_json)


def _first_plan(
    ground: build.Ground, console: TerminalConsole, cost: Cost, seconds: float, seed: int, *, all_vehicles: bool
) -> PlanFile:
    segments, vehicles = len(ground.network.segments), len(ground.names)
    console.say(
        Level.INFO, f"planning {segments} segments for {vehicles} vehicles ({cost.value}, {seconds:g} s at most)"
    )

    def progressed(progress: Progress) -> None:
        console.progress(
            f"{progress.iterations} iterations, {cost.value} {progress.value:.2f}, left out {progress.uncovered}"
        )

    content = planning.first_plan(
        ground, cost=cost, seconds=seconds, seed=seed, all_vehicles=all_vehicles, on_progress=progressed
    )
    console.progress("")
    for line in check_plan(content):
        raise SiteError(f"the plan does not hold: {line}")
    return content


def _print_plan(content: PlanFile, *, as_json: bool) -> None:
    uncovered = planning.segment_ids(content, content.plan)
    if as_json:
        print(json.dumps(plan_document(content)))
        return
    for route in content.plan.routes:
        vehicle = content.vehicles[route.vehicle]
        minutes, energy_pct = content.durations_s[route.vehicle] / 60, content.energies_pct[route.vehicle]
        print(
            f"{vehicle.name}: {len(route.visits)} segments, {minutes:.1f} min, {energy_pct:.1f} % of its battery "
            f"(budget {vehicle.budget_pct:g} %)"
        )
    print(f"{content.cost.value} {content.cost_value:.3f}, found in {content.solved.seconds:.1f} s")
    if uncovered:
        print(f"the budgets do not cover segments {', '.join(map(str, uncovered))}")


def _finish_flight(order: flying.Order, flown: flying.Flown, *, as_json: bool) -> None:
    report = flown.report
    if as_json:
        print(json.dumps(report))
    else:
        print(f"{report['segments_inspected']} of {report['segments_total']} segments inspected; record in {order.run}")
        if report["segments_uncovered"]:
            print(f"not inspected: {report['segments_uncovered']}")
    _show_flight(order.run, report)
    if not report["finished"]:
        raise typer.Exit(1)


def _show_flight(run: Path, report: Mapping[str, object]) -> None:
    from executor.adapters.page import write_page
    from executor.adapters.pictures import draw_battery, draw_map
    from executor.record import read_run

    try:
        record = read_run(run)
        draw_map(record, run / "map.png")
        draw_battery(record, run / "battery.png")
        write_page(record, report, run / "report.html")
    except (OSError, *OUR_ERRORS) as error:
        print(f"faultline: the pictures could not be made: {error}", file=sys.stderr)


def _writable(path: Path, write: Callable[[], object]) -> None:
    try:
        write()
    except OSError as error:
        raise SiteError(f"{path}: cannot be written: {error.strerror}") from error


def _fail(text: str, code: int) -> NoReturn:
    print(f"faultline: {text}", file=sys.stderr)
    raise SystemExit(code)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; the one place where whatever is left over is caught."""
    given = list(arguments) if arguments is not None else sys.argv[1:]
    try:
        code = cli(args=given or ["--help"], standalone_mode=False)
    except OUR_ERRORS as error:
        _fail(str(error), 2)
    except BaseExceptionGroup as group:
        ours, rest = group.split(OUR_ERRORS)
        if rest is None and ours is not None:
            _fail(str(_first(ours)), 2)
        _internal(group)
    except TyperException as error:
        # What a command line can be wrong about; the base class does not promise the method that all of them have.
        said = error.format_message() if isinstance(error, typer.BadParameter) else str(error)
        _fail(f"{said} See --help.", 2)
    except (KeyboardInterrupt, typer.Abort):
        _fail("interrupted", INTERRUPTED)
    except Exception as error:  # noqa: BLE001 - the last place where it can become one line
        _internal(error)
    raise SystemExit(code or 0)


def _internal(error: BaseException) -> NoReturn:
    """Keep a mistake of ours where it can be reported, and say one line."""
    path = Path(tempfile.gettempdir()) / "faultline-error.txt"
    path.write_text("".join(traceback.format_exception(error)), encoding="utf-8")
    _fail(f"internal error: {type(error).__name__}: {error}; please report it with {path}", INTERNAL)


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
