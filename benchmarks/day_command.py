"""The command `faultline bench day`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from benchmarks.flight_commands import finish_command
from benchmarks.options import DataOption, make_output_option
from executor.cli.options import JsonOption, SecondsOption, SeedOption


def day(
    seconds: SecondsOption = 290.0,
    samples: Annotated[int, typer.Option(min=1, help="How many times the days are simulated for each fleet.")] = 200,
    seed: SeedOption = 1,
    data: DataOption = None,
    out: Annotated[Path | None, make_output_option("day.md and day.json")] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan days of many sorties: small ones against proven optima, the paper's whole network, fleets with losses.

    The network of 1693 segments is planned within --seconds, everything included.
    """
    from benchmarks.data import papers_network
    from benchmarks.day import day_figures
    from benchmarks.daypage import day_document, report_day
    from benchmarks.progress import ShownProgress

    network = papers_network(data)
    with ShownProgress() as shown:
        content = day_figures(network, seconds=seconds, samples=samples, seed=seed, told=shown.show_stage)
    command = f"faultline bench day --seconds {seconds:g} --samples {samples} --seed {seed}"
    document = day_document(content, command, samples)
    whole = content["network"]
    failed = whole["uncovered"] or whole["wrong"] or not all(row["same"] for row in content["exact"])
    finish_command(document, report_day, out, as_json=as_json, failed=bool(failed))
