"""The command `faultline bench failures`."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from benchmarks.flight_commands import finish_command
from benchmarks.options import RESULTS, DataOption
from executor.cli.options import JsonOption, SecondsOption, SeedOption, require_finite
from missions.files import json_text

if TYPE_CHECKING:
    from benchmarks.failures import SolvedScenario

FamilyOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Only the scenarios whose names begin with NAME, up to the point.")
]
ProveOption = Annotated[
    float | None,
    typer.Option(
        min=0.01,
        callback=require_finite,
        metavar="S",
        help="Prove a lower bound for each scenario, in at most S seconds: no answer can be better, even if it knew "
        "all losses at the first one.",
    ),
]


def failures(
    instance: Annotated[
        Path | None, typer.Option(metavar="FILE", help="One scenario (JSON); by default all of the benchmark data.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="The solution's file; for all scenarios the directory of failures.md and failures.json, "
            "docs/results by default.",
        ),
    ] = None,
    family: FamilyOption = None,
    seconds: SecondsOption = 0.5,
    seed: SeedOption = 1,
    prove: ProveOption = None,
    data: DataOption = None,
    as_json: JsonOption = False,
) -> None:
    """Re-plan days with several depots and trips when vehicles are lost one after another; compare published figures.

    At each loss the rest of the day is re-planned, in at most --seconds, from what is known then. Exit 1 if a
    required edge is left over.
    """  # fmt: skip
    from benchmarks.data import data_directory
    from benchmarks.failures import LONG_ENOUGH, scenario_files, solve_all, solve_scenario, stop_after
    from benchmarks.failurespage import failures_document, report_failures
    from benchmarks.progress import ShownProgress
    from benchmarks.scenario import read_scenario
    from benchmarks.store import write_result

    if instance is not None:
        solved = solve_scenario(read_scenario(instance), stop_after(seconds), seed, prove)
        if out is not None:
            write_result(out, solved.solution)
        if as_json:
            print(json_text(solved.row))
        else:
            _tell(solved)
        raise typer.Exit(1 if solved.left or solved.wrong else 0)
    place = data_directory(data)
    if place is None:
        missing = "no ../shared/data next to the project or the working directory; --data DIR names it"
        print(f"faultline: the failure scenarios are left out: {missing}", file=sys.stderr)
        raise typer.Exit(0)
    with ShownProgress() as shown:
        rows = solve_all(
            scenario_files(place, family or "*"), seconds, seed, partial(shown.show_stage, "scenarios"), prove
        )
    asked = ("" if prove is None else f" --prove {prove:g}") + ("" if family is None else f" --family {family}")
    command = f"faultline bench failures --seconds {seconds:g} --seed {seed}{asked}"
    content = failures_document(rows, command, seconds, LONG_ENOUGH, seed, prove)
    failed = any(row["left"] or row["wrong"] for row in rows)
    finish_command(content, report_failures, RESULTS if out is None else out, as_json=as_json, failed=failed)


def _tell(solved: SolvedScenario) -> None:
    """Print one scenario's figures."""
    published = solved.scenario.published.after
    beside = "" if published is None else f", published {published:g}"
    print(f"{solved.scenario.name}: the last trip ends at {solved.value_s:g}{beside}")
    print(f"re-plans took {', '.join(f'{took:.2f}' for took in solved.replan_s) or 'no'} s")
    if solved.least_s is not None:
        print(f"no answer can end before {solved.least_s:g}, proven")
    if solved.left:
        print(f"{solved.left} required edges are left over")
