"""The commands of the data package: `faultline bench instance`, `bench compare` and `bench verify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.errors import BenchError
from benchmarks.flight_commands import finish_command
from benchmarks.options import DataOption
from executor.cli.options import JsonOption, SecondsOption, SeedOption, require_finite

FILE_OR_SHAPE = "line, ring, tree or grid; or a file: a network, or a TSPLIB file (.tsp)."


def instance(
    source: Annotated[str, typer.Argument(metavar="SHAPE|FILE", help=FILE_OR_SHAPE)],
    vehicles: Annotated[int, typer.Option(min=1, max=1000, help="Number of vehicles.")] = 4,
    segments: Annotated[int, typer.Option(min=1, max=10_000, help="Of a shape: number of segments.")] = 56,
    radius: Annotated[
        float | None,
        typer.Option(min=1, callback=require_finite, metavar="M", help="Of a network: its segments within M metres."),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            min=0.001, callback=require_finite, metavar="PCT", help="Energy limit of each vehicle; by default ample."
        ),
    ] = None,
    longest: Annotated[
        float | None,
        typer.Option(
            min=0.001, callback=require_finite, metavar="S", help="Limit of the longest route of a solution's window."
        ),
    ] = None,
    seed: SeedOption = 1,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write the instance there.")
    ] = None,
) -> None:
    """Make an instance of the benchmark: of a shape, by its seed alone, or from a public file that you have."""
    from benchmarks.dataset.catalogue import build_from_file, describe_source, with_ample_budget
    from benchmarks.dataset.generator import SHAPES, format_instance, generate_instance
    from benchmarks.store import write_text

    if source == "ring" and segments < 3:
        raise BenchError(f"--segments: expected 3 or more for a ring, got {segments}")
    if source in SHAPES:
        made = generate_instance(
            source, segments, vehicles, seed=seed, budget_pct=1.0 if budget is None else budget, longest_s=longest
        )
        made = with_ample_budget(made) if budget is None else made
        said = describe_source(source, made, seed=seed)
    else:
        path = Path(source)
        if not path.is_file():
            raise BenchError(f"{source}: expected a file, or one of {', '.join(SHAPES)}")
        name = "-".join([path.stem, *([] if radius is None else [f"{radius:g}"]), str(vehicles)])
        made = build_from_file(path, name, vehicles=vehicles, radius_m=radius, budget_pct=budget, longest_s=longest)
        said = f"made from {path.name}, which has its own licence"
    text = format_instance(made, said)
    if output is None:
        print(text, end="")
    else:
        write_text(output, text)


def compare(
    instances: Annotated[
        list[str] | None,
        typer.Argument(metavar="[INSTANCE]...", help="Files, or names in the package; by default all of the package."),
    ] = None,
    objective: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="minmax, minsum or window; may be repeated. By default all three."),
    ] = None,
    seconds: SecondsOption = 10.0,
    iterations: Annotated[
        int | None,
        typer.Option(min=1, help="Iterations of faultline's search instead: the same answer on every machine."),
    ] = None,
    seed: SeedOption = 1,
    lkh: Annotated[Path | None, typer.Option(envvar="FAULTLINE_LKH", metavar="FILE", help="LKH-3's program.")] = None,
    hgs: Annotated[
        Path | None, typer.Option(envvar="FAULTLINE_HGS_CARP", metavar="FILE", help="HGS-CARP's program, gencarp.")
    ] = None,
    peers: Annotated[
        bool, typer.Option("--peers/--no-peers", help="Ask the other programs too; without, faultline alone.")
    ] = True,
    data: DataOption = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Write what is better than the best known into the package.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Write benchmark.md and benchmark.json there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Solve the benchmark's instances with every program that is here, each answer checked.

    faultline's search always; PyVRP where it is installed (minsum); LKH-3 (minmax, minsum) and HGS-CARP (minmax) where
    their programs are named. Seconds are those of the processor.
    """
    from benchmarks.data import data_directory
    from benchmarks.dataset.catalogue import OBJECTIVES, PACKAGE, find_instances
    from benchmarks.dataset.compare import Effort, compare_programs, report_comparison
    from benchmarks.progress import ShownProgress
    from planner import warm_up

    for name in objective or ():
        if name not in OBJECTIVES:
            raise BenchError(f"--objective: {name}: expected one of {', '.join(OBJECTIVES)}")
    chosen = find_instances(instances or (), data_directory(data))
    warm_up()
    effort = Effort(seconds, iterations, seed, peers=peers, lkh=lkh, hgs=hgs)
    with ShownProgress() as shown:
        content = compare_programs(
            chosen, objective or OBJECTIVES, effort, shown.show_stage, keep=PACKAGE if keep else None
        )
    finish_command(content, report_comparison, out, as_json=as_json, failed=False)


def verify(
    data: DataOption = None,
    proofs: Annotated[
        bool, typer.Option("--proofs/--no-proofs", help="Make proofs and windows again; without, seconds in all.")
    ] = True,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="DIR", help="Write benchmark-verified.md and .json there."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check every best known solution of the benchmark again; exit 1 if one does not hold.

    Each by the checker, by the planner's own definition, and by its proof. Solutions of instances by reference need the
    public files behind them (--data).
    """
    from benchmarks.data import data_directory
    from benchmarks.dataset.verify import has_failed, report_verification, verify_package
    from benchmarks.progress import ShownProgress

    with ShownProgress() as shown:
        content = verify_package(data_directory(data), shown.show_stage, proofs=proofs)
    finish_command(content, report_verification, out, as_json=as_json, failed=has_failed(content))
