"""The command `faultline bench day`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from executor.cli.options import JsonOption, SecondsOption, SeedOption


def day(
    seconds: SecondsOption = 290.0,
    samples: Annotated[int, typer.Option(min=1, help="Times that the days are flown for each fleet.")] = 200,
    seed: SeedOption = 1,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The benchmark data; by default ../shared/data beside the project or from here."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Write day.md and day.json there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan days of many sorties: small ones beside proven optima, the paper's whole network, fleets that lose vehicles.

    The network of 1693 segments is planned within --seconds, everything included.
    """
    from executor.bench.data import NECHRANICE, data_directory
    from executor.bench.day import day_figures
    from executor.bench.daypage import day_document, day_page, keep_day
    from executor.bench.errors import BenchError
    from executor.bench.progress import ShownProgress

    place = data_directory(data)
    if place is None or not (place / NECHRANICE).is_file():
        raise BenchError(f"--data: expected a directory with {NECHRANICE}")
    with ShownProgress() as shown:
        content = day_figures(place / NECHRANICE, seconds=seconds, samples=samples, seed=seed, told=shown.told)
    command = f"faultline bench day --seconds {seconds:g} --samples {samples} --seed {seed}"
    document = day_document(content, command, samples)
    if out is not None:
        keep_day(document, out)
    print(json.dumps(document) if as_json else day_page(document))
    whole = content["network"]
    raise typer.Exit(
        1 if whole["uncovered"] or whole["wrong"] or not all(row["same"] for row in content["exact"]) else 0
    )
