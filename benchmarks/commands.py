"""The commands of `faultline bench`; those that fly in virtual time are in `bench_flights`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from benchmarks import dataset_commands as bench_dataset
from benchmarks import day_command as bench_day
from benchmarks import failures_command as bench_failures
from benchmarks import flight_commands as bench_flights
from benchmarks.options import RESULTS, DataOption
from benchmarks.parts.names import PartName
from executor.adapters.extras import Extra, require_extra
from executor.cli.options import (
    FaultOption,
    JsonOption,
    SecondsOption,
    SeedOption,
    require_finite,
)
from executor.cli.replay import LogsArgument, find_logs
from executor.replay.log_replay import build_replay_rules
from executor.site.site_file import read_site
from executor.site.site_planning import PlanSolver
from missions.files import json_text
from planner import Cost

cli = typer.Typer(
    name="bench",
    help="Run the benchmarks: the planner against published figures, other solvers and the clock; uploads against "
    "MAVSDK; the load of a fleet; the time to resume a flight; the faults that the watchpoints detect; planned against "
    "flown.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)


OutOption = Annotated[Path, typer.Option(metavar="DIR", help="Directory for the results.")]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Start over; without it existing results are kept.")]
InstanceOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Solve one instance: a TSPLIB file (.tsp, EUC_2D, not rounded; the first city is the depot), or a network "
        "(GeoJSON, or a graph file with the depot at 0, 0).",
    ),
]
BudgetOption = Annotated[
    float | None,
    typer.Option(
        min=0,
        callback=require_finite,
        metavar="X",
        help="Budget of a route, in the unit of the printed value: seconds for networks (5 m/s in transit, 1 m/s along "
        "the line), length for cities. Without it there is no limit.",
    ),
]


@cli.command()
def solvers(
    instance: InstanceOption = None,
    radius: Annotated[
        float | None,
        typer.Option(
            min=1,
            callback=require_finite,
            metavar="M",
            help="Only the network's segments within M metres; without --instance, of faultline's own network.",
        ),
    ] = None,
    dynamics: Annotated[
        bool,
        typer.Option("--dynamics", help="Model accelerations and turns as the authors do; without it, speeds alone."),
    ] = False,
    vehicles: Annotated[int, typer.Option(min=1, help="Number of vehicles.")] = 4,
    cost: Annotated[
        Cost,
        typer.Option(help="What to minimise: minmax, the longest route; minsum, all routes together; mincomb, both."),
    ] = Cost.MINMAX,
    budget: BudgetOption = None,
    seconds: SecondsOption = 10.0,
    seed: SeedOption = 1,
    solver: Annotated[PlanSolver, typer.Option(help="The solver.")] = PlanSolver.SEARCH,
    starts: Annotated[int | None, typer.Option(min=1, help="Parallel searches; by default one per core.")] = None,
    as_json: JsonOption = False,
    part: Annotated[
        list[PartName] | None, typer.Option(help="Without an instance: measure this part alone; may be repeated.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Trial run: a tenth of every time limit.")] = False,
    data: DataOption = None,
    out: OutOption = RESULTS,
    fresh: FreshOption = False,
) -> None:
    """Solve one instance (--instance or --radius); without one, measure the solvers, part by part.

    The parts: csum (c-MinSum against PyVRP and the paper's solver), mtsp (min-max multiple TSP), exact (against proven
    optima), bounds (what is proven of up to 81 segments), replan (times of re-plans), scale (up to 10,000 segments),
    start (start times), onboard (small re-plans against a learned replanner). An interrupted part resumes where it
    stopped.
    """
    if instance is None and radius is None:
        _measure(part, data, out, seed=seed, quick=quick, fresh=fresh)
        return
    from benchmarks.machine import cores
    from benchmarks.problems import read_problem
    from benchmarks.single import solve_single

    problem = read_problem(instance, radius_m=radius, vehicles=vehicles, budget=budget, dynamics=dynamics)
    result = solve_single(problem, solver, cost=cost, seconds=seconds, seed=seed, starts=starts or cores())
    if as_json:
        print(json_text(result))
        return
    left = f", {len(result['uncovered'])} left out" if result["uncovered"] else ""
    print(f"{result['value']:.4f} after {result['iterations']} iterations in {result['seconds']:.2f} s{left}")
    for number, route in enumerate(result["routes"], start=1):
        print(f"uav{number}: " + " ".join(_stop_name(stop) for stop in route))


def _measure(
    parts: list[PartName] | None, data: Path | None, out: Path, *, seed: int, quick: bool, fresh: bool
) -> None:
    from benchmarks.all_parts import make_parts
    from benchmarks.data import data_directory

    make_parts(parts or list(PartName), data_directory(data), out, seed=seed, quick=quick, fresh=fresh)


@cli.command()
def table(
    network: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Instead of the paper's network in the data directory; 'default' is faultline's own."
        ),
    ] = None,
    radius: Annotated[
        list[float] | None, typer.Option(min=1, metavar="M", help="Radius to measure, in metres; may be repeated.")
    ] = None,
    tightness: Annotated[
        list[float] | None,
        typer.Option(
            min=0.01, max=1, metavar="SHARE", help="Tightness to measure: best MinMax over the budget; may be repeated."
        ),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Plans per solver and cost function.")] = 10,
    seconds: Annotated[float, typer.Option(min=0.01, callback=require_finite, help="Seconds per plan.")] = 2.0,
    window_seconds: Annotated[
        float, typer.Option(min=0.01, callback=require_finite, help="Seconds per plan that is chosen for its window.")
    ] = 30.0,
    iterations: Annotated[
        int | None, typer.Option(min=1, help="Iterations instead of seconds: the same table on every machine.")
    ] = None,
    losses: Annotated[
        int, typer.Option(min=1, max=2, help="With 2 another table: plans against any two losses, and their price.")
    ] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; by default one per core.")] = None,
    data: DataOption = None,
    out: OutOption = RESULTS,
    fresh: FreshOption = False,
) -> None:
    """Make the paper's table: re-plan windows by cost function, radius and tightness (about 40 minutes on 2 cores).

    An interrupted run resumes where it stopped. With two losses: smaller radii and larger budgets, by default.
    """
    from benchmarks.machine import cores
    from benchmarks.table.command import make_table
    from benchmarks.table.settings import PAIR_RADII_M, PAIR_TIGHTNESS, RADII_M, TIGHTNESS, TableSettings

    settings = TableSettings(
        network=_network_path(network, data),
        radii_m=tuple(radius or (RADII_M if losses == 1 else PAIR_RADII_M)),
        tightness=tuple(tightness or (TIGHTNESS if losses == 1 else PAIR_TIGHTNESS)),
        seeds=seeds,
        seconds=seconds,
        window_seconds=window_seconds,
        iterations=iterations,
    )
    if losses == 2:
        from benchmarks.table.pairs import make_pairs

        make_pairs(settings, out, jobs=jobs or cores(), fresh=fresh)
        print(out / "pairs.md")
        return
    require_extra(Extra.PICTURES, "bench table")
    for summary in make_table(settings, out, jobs=jobs or cores(), fresh=fresh):
        print(f"{summary.dominates} of {summary.cells} windows dominate those of MinComb by {summary.solver}")
    print(out / "table.md")


@cli.command()
def upload(
    items: Annotated[
        list[int] | None, typer.Option(min=4, max=500, help="Mission items; may be repeated. By default 10, 40, 200.")
    ] = None,
    loss: Annotated[
        list[float] | None,
        typer.Option(
            min=0, max=0.9, help="Share of datagrams lost, each way; may be repeated. By default 0, 0.05, 0.2."
        ),
    ] = None,
    delay: Annotated[
        list[float] | None,
        typer.Option(
            min=0, max=5, metavar="S", help="Delay of datagrams, each way; may be repeated. By default 0, 0.05, 0.3."
        ),
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="Uploads per program and case.")] = 5,
    seed: SeedOption = 1,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write upload.md and upload.json there.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Upload missions over bad links with faultline and with MAVSDK, to simulated vehicles of both autopilots."""
    from benchmarks.store import keep_result
    from benchmarks.upload import DELAYS_S, ITEMS, LOSSES, measure_uploads

    require_extra(Extra.MAVSDK, "bench upload")
    content, text = measure_uploads(items or ITEMS, loss or LOSSES, delay or DELAYS_S, repeats=repeats, seed=seed)
    if out is not None:
        keep_result("upload", content, text, out)
    print(json_text(content) if as_json else text)


@cli.command()
def coverage(
    radius: Annotated[
        list[float] | None, typer.Option(min=1, metavar="M", help="Radius to measure, in metres; may be repeated.")
    ] = None,
    tightness: Annotated[
        list[float] | None,
        typer.Option(min=0.01, max=1, metavar="SHARE", help="Best MinMax over the budget; may be repeated."),
    ] = None,
    iterations: Annotated[int, typer.Option(min=5, help="Iterations of the searches for window and coverage.")] = (
        200_000
    ),
    seeds: Annotated[int, typer.Option(min=1, help="MinComb plans, of which the best by its window counts.")] = 10,
    flights: Annotated[int, typer.Option(min=1, help="New flights for the estimate of each plan.")] = 4000,
    seed: SeedOption = 1,
    data: DataOption = None,
    out: OutOption = RESULTS,
    fresh: FreshOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compare plans chosen for the probability of coverage with MinComb and window plans, cell by cell of the table."""
    from functools import partial

    from benchmarks.coverage import measure_coverage, report_coverage
    from benchmarks.data import papers_network
    from benchmarks.progress import ShownProgress
    from benchmarks.table.settings import RADII_M, TIGHTNESS

    radii, tight = radius or RADII_M, tightness or TIGHTNESS
    asked = [f"--radius {one:g}" for one in radius or ()] + [f"--tightness {one:g}" for one in tightness or ()]
    asked += [f"--iterations {iterations}", f"--seeds {seeds}", f"--flights {flights}", f"--seed {seed}"]
    with ShownProgress() as shown:
        content = measure_coverage(
            papers_network(data), out, [(one, other) for one in radii for other in tight], iterations=iterations,
            seeds=seeds, flights=flights, seed=seed, fresh=fresh, told=partial(shown.show_stage, "cells"),
            command=" ".join(["faultline bench coverage", *asked]),
        )  # fmt: skip
    bench_flights.finish_command(content, report_coverage, out, as_json=as_json, failed=False)


def _network_path(network: str | None, data: Path | None) -> Path | None:
    from benchmarks.data import papers_network

    if network is not None:
        return None if network == "default" else Path(network)
    return papers_network(data, "; --network default needs none")


def _stop_name(stop: int | dict[str, int | bool]) -> str:
    if isinstance(stop, int):
        return str(stop)
    return f"{stop['segment']}{'r' if stop['reversed'] else ''}"


@cli.command()
def fleet(
    vehicles: Annotated[
        list[int] | None,
        typer.Option(min=1, max=200, help="Number of vehicles; may be repeated. By default 1, 10, 20, 50, 100."),
    ] = None,
    minutes: Annotated[
        float,
        typer.Option(min=0.1, max=600, callback=require_finite, help="Minutes of flight for each number of vehicles."),
    ] = 5.0,
    speedup: Annotated[
        float,
        typer.Option(min=0.1, max=100, callback=require_finite, metavar="X", help="Speed in multiples of real time."),
    ] = 2.0,
    fault: FaultOption = None,
    garbage: Annotated[
        float,
        typer.Option(
            min=0,
            max=100,
            callback=require_finite,
            metavar="RATIO",
            help="Datagrams with noise, damaged or foreign frames to the vehicles' ports, for each datagram of the "
            "vehicles.",
        ),
    ] = 0.0,
    browsers: Annotated[int, typer.Option(min=0, max=20, help="Browsers that follow the page.")] = 0,
    seed: SeedOption = 1,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write fleet.md, fleet.json and fleet.png there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Fly simulated fleets and measure the ground station: processor time per vehicle, blocked time, memory.

    The executor is limited to one core. `--vehicles 50 --minutes 60` flies fifty vehicles for an hour, `--fault
    uav7:silent@10%` adds a re-plan, `--garbage 10 --browsers 1` a flood of foreign datagrams with the page open.
    """
    from benchmarks.fleet import COUNTS, Burden, make_fleet

    if out is not None:
        require_extra(Extra.PICTURES, "bench fleet --out")
    burden = Burden(tuple(fault or ()), garbage, browsers)
    content, text = make_fleet(vehicles or COUNTS, out, minutes=minutes, speedup=speedup, seed=seed, burden=burden)
    print(json_text(content) if as_json else text)


@cli.command()
def resume(
    vehicles: Annotated[
        list[int] | None, typer.Option(min=1, max=200, help="Number of vehicles; may be repeated. By default 6.")
    ] = None,
    hours: Annotated[
        float, typer.Option(min=0.1, max=100, callback=require_finite, help="Hours of log before the flight.")
    ] = 10.0,
    minutes: Annotated[
        float, typer.Option(min=0.5, max=60, callback=require_finite, help="Minutes of flight until the kill.")
    ] = 2.0,
    speedup: Annotated[
        float,
        typer.Option(min=0.1, max=6, callback=require_finite, metavar="X", help="Speed in multiples of real time."),
    ] = 4.0,
    seed: SeedOption = 1,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write resume.md and resume.json there.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Kill the ground station of a simulated fleet after hours of log; measure how soon `resume` supervises again."""
    from benchmarks.resume import make_resume

    content, text = make_resume(vehicles or [6], out, minutes=minutes, hours=hours, speedup=speedup, seed=seed)
    print(json_text(content) if as_json else text)


@cli.command()
def terrain(
    spans: Annotated[int, typer.Option(min=40, max=20_000, help="Spans of the network.")] = 10_000,
    megacells: Annotated[
        float, typer.Option(min=1, max=400, callback=require_finite, help="Millions of cells of the raster.")
    ] = 100.0,
    seconds: SecondsOption = 10.0,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write terrain.md and terrain.json there.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Read a large network over a large raster, and plan it: seconds and memory of each step."""
    from benchmarks.terrain import make_terrain

    content, text = make_terrain(out, spans=spans, megacells=megacells, seconds=seconds)
    print(json_text(content) if as_json else text)


@cli.command()
def detection(
    healthy: Annotated[
        int | None, typer.Option(min=1, help="Healthy flights, with wind, ageing, noise and losses (720).")
    ] = None,
    faulty: Annotated[int | None, typer.Option(min=1, help="Flights per kind of fault (120).")] = None,
    seed: SeedOption = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; by default one per processor.")] = None,
    logs: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Recorded flights, with or without truth files; by default ../shared/logs, if it exists. With this "
            "option only they are judged, unless --healthy or --faulty request modelled flights too.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write detection.md, real-logs.md and their .json there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the watchpoints on modelled flights: how many faults they find, how late, and how many false alarms.

    Healthy flights have wind, gusts, worn packs, noisy sensors, rounded and re-estimated percentages and lossy links;
    faulty ones have steps, drains of 1.3 to 4 times the normal, failing cells and silent links of 2 to 200 s. A
    baseline detector of a few lines is measured on the same flights, and both on recorded ones. The same seed gives the
    same figures for any number of processes.

    A recorded flight with a truth file is compared with it; an independent judge compares every other log under the
    folder, from real aircraft, with the log's own statements.
    """
    from benchmarks.detectionbench import make_detection, print_detection
    from benchmarks.machine import cores

    modelled = (healthy or 720, faulty or 120) if logs is None or healthy or faulty else None
    content = make_detection(modelled, seed, jobs or cores(), logs, out)
    if as_json:
        print(json_text(content))
    else:
        print_detection(content)


cli.command()(bench_flights.prediction)
cli.command()(bench_flights.window)
cli.command()(bench_flights.distance)
cli.command()(bench_flights.pictures)
cli.command()(bench_flights.sorties)
cli.command()(bench_flights.radio)
cli.command()(bench_failures.failures)
cli.command()(bench_day.day)
cli.command()(bench_dataset.instance)
cli.command()(bench_dataset.compare)
cli.command()(bench_dataset.verify)


@cli.command()
def tune(
    logs: LogsArgument,
    site: Annotated[
        Path | None, typer.Option(metavar="SITE", help="Judge by the vehicles, reserves and thresholds of this site.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Directory for the picture.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Sweep the thresholds over recorded flights, judged by their truth files or by the logs' own statements."""
    from benchmarks.tuning import print_tuning

    if output is not None:
        require_extra(Extra.PICTURES, "--output")
    rules = build_replay_rules(None if site is None else read_site(site))
    print_tuning([path for given in logs for path in find_logs(given)], rules, output, as_json=as_json)
