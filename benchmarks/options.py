"""Arguments and options shared by several benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from executor.cli.options import AutopilotName

RESULTS = Path("docs") / "results"
"""Folder of the results."""
AutopilotsOption = Annotated[
    AutopilotName | None, typer.Option(help="Autopilot that the simulated vehicles behave like; by default both.")
]
DataOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="The benchmark data; by default ../shared/data next to the project or the working directory.",
    ),
]


def make_output_option(names: str) -> object:
    """Return the option for a command's output directory, with files of these names."""
    return typer.Option("--out", "-o", metavar="DIR", help=f"Write {names} there.")
