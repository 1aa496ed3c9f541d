"""TSPLIB city files: the subset of the format for symmetric problems in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.errors import BenchError
from missions.geo import FloatArray

EUC_2D = "EUC_2D"
SECTION = "NODE_COORD_SECTION"


@dataclass(frozen=True, slots=True, eq=False)
class Cities:
    """The cities of a file, in its order; the first is the depot."""

    name: str
    numbers: tuple[int, ...]
    """Their numbers in the file."""
    places: FloatArray
    """(n, 2) float64."""


def is_tsplib(path: Path) -> bool:
    """Return whether a file's name has TSPLIB's suffix."""
    return path.suffix.lower() == ".tsp"


def read_tsplib(path: Path) -> Cities:
    """Read a .tsp file with coordinates in the plane (EDGE_WEIGHT_TYPE EUC_2D).

    TSPLIB rounds EUC_2D distances to whole numbers; the min-max literature does not, nor do the figures derived from
    this result.

    Raises:
        BenchError: one line that names the file, the place in it and what was expected.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BenchError(f"{path}: expected a readable TSPLIB file: {error}") from error
    head, body = _parts(lines, path)
    kind = head.get("EDGE_WEIGHT_TYPE", "none")
    if kind != EUC_2D:
        raise BenchError(f"{path}: EDGE_WEIGHT_TYPE: expected {EUC_2D}, got {kind}")
    cities = [_city(line, f"{path}: line {number}") for number, line in body]
    numbers = tuple(number for number, _, _ in cities)
    if len(set(numbers)) != len(numbers):
        raise BenchError(f"{path}: {SECTION}: expected each city once")
    if head.get("DIMENSION", "") != str(len(cities)):
        raise BenchError(f"{path}: DIMENSION: expected {len(cities)}, the cities listed, got {head.get('DIMENSION')}")
    if len(cities) < 2:
        raise BenchError(f"{path}: {SECTION}: expected a depot and at least one city more")
    return Cities(head.get("NAME", path.stem), numbers, np.array([place for _, *place in cities], dtype=np.float64))


def _parts(lines: list[str], path: Path) -> tuple[dict[str, str], list[tuple[int, str]]]:
    """Return the keywords with their values, and the numbered coordinate lines."""
    head: dict[str, str] = {}
    numbered = enumerate(lines, start=1)
    for _, line in numbered:
        if line.strip() == SECTION:
            break
        key, _, value = line.partition(":")
        head[key.strip()] = value.strip()
    else:
        raise BenchError(f"{path}: {SECTION}: expected such a line, found none")
    body = []
    for number, line in numbered:
        text = line.strip()
        if text == "EOF" or text.endswith("_SECTION"):
            break
        if text:
            body.append((number, text))
    return head, body


def _city(line: str, place: str) -> tuple[int, float, float]:
    fields = line.split()
    try:
        number, x, y = int(fields[0]), float(fields[1]), float(fields[2])
    except (ValueError, IndexError):
        number, x, y = 0, math.nan, math.nan
    if len(fields) != 3 or not (math.isfinite(x) and math.isfinite(y)):
        raise BenchError(f"{place}: expected a city's number and two coordinates, got {line!r}")
    return number, x, y
