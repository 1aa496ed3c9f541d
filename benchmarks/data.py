"""Location of the published benchmark data, and figures reported for it by others."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from benchmarks.errors import BenchError
from benchmarks.machine import ROOT

NECHRANICE = "nechranice_graph.yaml"
MTSP = "minmax_mtsp.csv"
TSPLIB = "tsplib"


def data_directory(given: Path | None) -> Path | None:
    """Return the data directory: the given one, or ../shared/data next to the project or the working directory.

    Raises:
        BenchError: the given directory does not exist.
    """
    return find_shared_folder(given, "data", f"a directory with {NECHRANICE}")


def papers_network(given: Path | None, otherwise: str = "") -> Path:
    """Return the paper's network in the data.

    Args:
        given: The directory, as for `data_directory`.
        otherwise: The alternative, appended to a message.

    Raises:
        BenchError: it is not there.
    """
    found = data_directory(given)
    if found is None or not (found / NECHRANICE).is_file():
        raise BenchError(f"--data: expected a directory with {NECHRANICE}{otherwise}")
    return found / NECHRANICE


def find_shared_folder(given: Path | None, name: str, expected: str) -> Path | None:
    """Return the folder given by the option of its name, or ../shared's next to the project or working directory.

    Raises:
        BenchError: the given folder does not exist.
    """
    if given is None:
        beside = Path("..") / "shared" / name
        return next((place for place in (ROOT / beside, beside) if place.is_dir()), None)
    if not given.is_dir():
        raise BenchError(f"--{name}: {given}: expected {expected}")
    return given


@dataclass(frozen=True, slots=True)
class CsumReference:
    """Reported c-MinSum values of 4 vehicles on the authors' matrix, in seconds."""

    radius_m: float
    segments: int
    budget_s: float
    grasp_best: float
    """The authors' solver, best of `grasp_runs`."""
    grasp_runs: int
    grasp_median: float
    """Its median single run."""
    pyvrp_1s: float
    pyvrp_10s: float


CSUM = (
    CsumReference(500, 18, 1262, 4252.9, 50, 4380.9, 4201.98, 4201.98),
    CsumReference(700, 33, 2429, 8668.6, 50, 8862.0, 8345.6, 8310.2),
    CsumReference(1000, 48, 3609, 13138.9, 50, 13515.5, 12489.9, 12460.1),
    CsumReference(1200, 56, 4523, 16309.5, 50, 16583.8, 15443.4, 15443.4),
    CsumReference(2000, 81, 7056, 25901.2, 15, 26798.5, 24335.6, 24164.1),
)
"""Measured with the built public solver and with PyVRP 0.14.1."""


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of the paper's table: re-plan windows in percent, the best of ten repeats of 50 runs each."""

    radius_m: float
    segments: int
    c_max_pct: float
    minmax: float
    minsum: float
    mincomb: float


PAPER = (
    PaperRow(500, 15, 100, 20, 58, 66),
    PaperRow(700, 28, 200, 17, 86, 96),
    PaperRow(1000, 43, 250, 14, 63, 65),
    PaperRow(1200, 51, 300, 23, 56, 59),
    PaperRow(2000, 76, 500, 28, 51, 70),
)
"""Nekovar, Faigl, Saska: Vehicle Fault-Tolerant Robust Power Transmission Line Inspection Planning, table I."""


@dataclass(frozen=True, slots=True)
class MtspReference:
    """Best known longest tour of a min-max multiple TSP."""

    instance: str
    vehicles: int
    best_known: float
    source: str


def mtsp_references(data: Path) -> tuple[MtspReference, ...]:
    """Read the best known values.

    Raises:
        BenchError: the file cannot be read, or has another format.
    """
    path = data / MTSP
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return tuple(
                MtspReference(row["instance"], int(row["m"]), float(row["best_known"]), row["source"])
                for row in csv.DictReader(file)
            )
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise BenchError(f"{path}: expected a table with instance, m, best_known and source: {error}") from error
