"""The commands `faultline bench solvers` and `faultline bench table`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from executor.bench.errors import BenchError
from executor.bench.solvers import Solver
from executor.commands.options import CostName, JsonOption, SecondsOption, SeedOption
from planner import Cost

cli = typer.Typer(
    name="bench",
    help="Measure the planner: against published figures, other solvers, and the clock.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

RESULTS = Path("docs") / "results"

DataOption = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="The benchmark data; by default ../shared/data beside the project or from here."),
]
OutOption = Annotated[Path, typer.Option(metavar="DIR", help="Where the results go.")]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Start over; otherwise results that are there are kept.")]


@cli.command()
def solvers(
    instance: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Solve one instance: a TSPLIB file (.tsp, EUC_2D, not rounded; the first city is the depot), or a "
            "network (GeoJSON, or a graph file with the depot at 0, 0).",
        ),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(
            min=1, metavar="M", help="Of a network, only segments within M metres; without a file, of faultline's own."
        ),
    ] = None,
    dynamics: Annotated[
        bool, typer.Option("--dynamics", help="With the authors' accelerations and turns; else speeds alone.")
    ] = False,
    vehicles: Annotated[int, typer.Option(min=1, help="How many vehicles.")] = 4,
    cost: Annotated[
        CostName, typer.Option(help="minmax: the longest route; minsum: all routes; mincomb: both.")
    ] = CostName.MINMAX,
    budget: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="X",
            help="What a route may take: seconds for networks (5 m/s in transit, 1 m/s along the line), length for "
            "cities, as the value that is printed. Without it there is no limit.",
        ),
    ] = None,
    seconds: SecondsOption = 10.0,
    seed: SeedOption = 1,
    solver: Annotated[Solver, typer.Option(help="Who plans.")] = Solver.SEARCH,
    as_json: JsonOption = False,
) -> None:
    """Solve one instance (--instance or --radius)."""
    from executor.bench.problems import problem_of
    from executor.bench.single import solve_single

    if instance is None and radius is None:
        raise BenchError("expected --instance FILE or --radius M")
    problem = problem_of(instance, radius_m=radius, vehicles=vehicles, budget=budget, dynamics=dynamics)
    result = solve_single(problem, solver, cost=Cost(cost.value), seconds=seconds, seed=seed)
    if as_json:
        print(json.dumps(result))
        return
    left = f", {len(result['uncovered'])} left out" if result["uncovered"] else ""
    print(f"{result['value']:.4f} after {result['iterations']} iterations in {result['seconds']:.2f} s{left}")
    for number, route in enumerate(result["routes"], start=1):
        print(f"uav{number}: " + " ".join(_stop_name(stop) for stop in route))


def _stop_name(stop: int | dict[str, int | bool]) -> str:
    if isinstance(stop, int):
        return str(stop)
    return f"{stop['segment']}{'r' if stop['reversed'] else ''}"
