"""Solvers of others, run as programs of their own: LKH-3 and HGS-CARP, where a binary is named.

Each gets the instance in its own format and whole numbers, and its tours are read back as routes; the checker then says
what they are worth. LKH-3 solves both objectives as a multiple TSP: a segment is two cities with a fixed edge between
them. HGS-CARP solves minmax as the min-max windy rural postman problem on the complete graph of all pylons.
"""

from __future__ import annotations

import math
import re
import resource
import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from benchmarks.dataset.checker import Instance, Place, Routes
from benchmarks.errors import BenchError

HGS_UP_TO = 300
"""Segments up to which HGS-CARP is asked: it computes shortest paths between all pylons, cubic in their number."""
GRACE = 3.0
"""A program may take this many times its processor time, and a minute, before it is ended."""
LARGEST = 10_000_000
"""Largest whole number of a distance: LKH-3 multiplies them by 100."""


def solve_lkh(binary: Path, instance: Instance, objective: str, *, seconds: float, seed: int) -> Routes | None:
    """Return LKH-3's routes for minmax or minsum; None if it found none.

    Raises:
        BenchError: the binary cannot be run.
    """
    cities, unit = _Cities(instance), _choose_unit(instance)
    limit = int(instance.budget_pct * unit) if objective == "minsum" else None
    tours = run_lkh(
        binary, list(_tsp_lines(instance, cities, unit, limit)), salesmen=instance.vehicles, objective=objective,
        seconds=seconds, seed=seed,
    )  # fmt: skip
    return None if tours is None else cities.read_routes(tours, instance.vehicles)


def run_lkh(
    binary: Path,
    problem: Sequence[str],
    *,
    salesmen: int,
    objective: str,
    seconds: float,
    seed: int,
    trials: int | None = 1_000_000,
) -> list[list[int]] | None:
    """Return LKH-3's tours of a multiple TSP with city 1 as the depot, which begins and ends each; None if it has none.

    Args:
        binary: the program.
        problem: the lines of the problem's file.
        salesmen: number of tours; some may be empty.
        objective: minmax or minsum.
        seconds: of the processor.
        seed: of its random numbers.
        trials: its limit of trials, in one run; None leaves both to it, for small problems.

    Raises:
        BenchError: the binary cannot be run.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "problem.tsp").write_text("\n".join(problem) + "\n", encoding="ascii")
        parameters = [
            "PROBLEM_FILE = problem.tsp", f"SALESMEN = {salesmen}", "DEPOT = 1", "MTSP_MIN_SIZE = 0",
            f"MTSP_OBJECTIVE = {objective.upper()}", "MTSP_SOLUTION_FILE = routes.txt",
            f"TIME_LIMIT = {max(1, round(seconds))}", f"SEED = {seed}", "TRACE_LEVEL = 0",
            *([] if trials is None else ["RUNS = 1", f"MAX_TRIALS = {trials}"]),
        ]  # fmt: skip
        (place / "problem.par").write_text("\n".join(parameters) + "\n", encoding="ascii")
        _run([str(binary.absolute()), "problem.par"], place, seconds)
        return _read(place / "routes.txt", _read_tours)


def solve_hgs(binary: Path, instance: Instance, *, seconds: float, seed: int) -> Routes | None:
    """Return HGS-CARP's routes for minmax; None if it found none, or the instance is not for it.

    Raises:
        BenchError: the binary cannot be run.
    """
    if len(instance.segments_m) > HGS_UP_TO or any(first == last for first, last in instance.segments_m):
        return None
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "problem").write_text("\n".join(_postman_lines(instance, _choose_unit(instance))) + "\n", "ascii")
        command = [
            str(binary.absolute()), "problem", "-type", "35", "-sol", "routes.txt", "-bks", "best.txt",
            "-t", str(max(1, round(seconds))), "-seed", str(seed), "-veh", str(instance.vehicles),
        ]  # fmt: skip
        _run(command, place, seconds)
        return _read(place / "routes.txt", lambda text: _read_services(text, instance.vehicles))


Read = TypeVar("Read")


class _Cities:
    """The cities of an instance for LKH-3: the depot is 1; a segment has two, or one if it has no length."""

    def __init__(self, instance: Instance) -> None:
        self.places: list[Place] = [instance.depot_m]
        self.fixed: list[tuple[int, int]] = []
        """The two cities of each segment, numbered from 1."""
        self.half_pct: list[float] = [0.0]
        """For each city half the energy of its segment's inspection: LKH-3 counts a fixed edge as nothing."""
        self.visit_from: dict[int, int] = {}
        """For each city but the depot the visit that begins there."""
        self.single: set[int] = set()
        for segment, (first, last) in enumerate(instance.segments_m, start=1):
            half_pct = math.dist(first, last) / instance.inspection_m_s * instance.inspection_pct_per_s / 2
            self.places.append(first)
            self.half_pct.append(half_pct)
            self.visit_from[len(self.places)] = segment
            if first == last:
                self.single.add(len(self.places))
                continue
            self.places.append(last)
            self.half_pct.append(half_pct)
            self.visit_from[len(self.places)] = -segment
            self.fixed.append((len(self.places) - 1, len(self.places)))

    def read_routes(self, tours: Sequence[Sequence[int]], vehicles: int) -> Routes:
        """Return the routes of tours: of a segment's two cities the first tells the direction."""
        routes = []
        for tour in tours:
            cities, visits, place = [city for city in tour if city > 1], list[int](), 0
            while place < len(cities):
                visits.append(self.visit_from[cities[place]])
                place += 1 if cities[place] in self.single else 2
            routes.append(tuple(visits))
        return _fill(routes, vehicles)


def _choose_unit(instance: Instance) -> float:
    """Return how many whole numbers a percent is: hundredths of one, fewer where the line is long."""
    corners = [instance.depot_m, *(place for segment in instance.segments_m for place in segment)]
    across = max(max(of) - min(of) for of in zip(*corners, strict=True)) * math.sqrt(2)
    longest = max(math.dist(first, last) for first, last in instance.segments_m)
    most = max(
        across / instance.transit_m_s * instance.transit_pct_per_s,
        longest / instance.inspection_m_s * instance.inspection_pct_per_s,
    )
    return float(min(100.0, LARGEST / max(most, 1e-9)))


def _transit_pct(instance: Instance, here: Place, there: Place) -> float:
    return math.dist(here, there) / instance.transit_m_s * instance.transit_pct_per_s


def _tsp_lines(instance: Instance, cities: _Cities, unit: float, limit: int | None) -> Iterator[str]:
    yield from [f"DISTANCE : {limit}"] if limit is not None else []
    yield from ("NAME : problem", "TYPE : TSP", f"DIMENSION : {len(cities.places)}", "EDGE_WEIGHT_TYPE : EXPLICIT",
                "EDGE_WEIGHT_FORMAT : FULL_MATRIX", "EDGE_WEIGHT_SECTION")  # fmt: skip
    for here, mine_pct in zip(cities.places, cities.half_pct, strict=True):
        costs = (
            _transit_pct(instance, here, there) + mine_pct + theirs_pct
            for there, theirs_pct in zip(cities.places, cities.half_pct, strict=True)
        )
        yield " ".join(str(round(cost * unit)) for cost in costs)
    if cities.fixed:
        yield "FIXED_EDGES_SECTION"
        yield from (f"{first} {last}" for first, last in cities.fixed)
        yield "-1"
    yield "EOF"


def _postman_lines(instance: Instance, unit: float) -> Iterator[str]:
    """Yield the windy rural postman's file: the depot is vertex 1; every segment has two vertices of its own."""
    places = [instance.depot_m, *(place for segment in instance.segments_m for place in segment)]
    pairs = list(combinations(range(1, len(places) + 1), 2))
    yield from (" NOMBRE : problem", " COMENTARIO : ", f" VERTICES : {len(places)}",
                f" ARISTAS_REQ : {len(instance.segments_m)}", f" ARISTAS_NOREQ : {len(pairs)}",
                " LISTA_ARISTAS_REQ :")  # fmt: skip
    for segment, (first, last) in enumerate(instance.segments_m):
        cost = math.dist(first, last) / instance.inspection_m_s * instance.inspection_pct_per_s
        whole = round(cost * unit)
        yield f" ( {2 * segment + 2}, {2 * segment + 3})   coste    {whole}     {whole}"
    yield " LISTA_ARISTAS_NOREQ :"
    for here, there in pairs:
        whole = round(_transit_pct(instance, places[here - 1], places[there - 1]) * unit)
        yield f" ( {here}, {there})   coste    {whole}     {whole}"


def _read_services(text: str, vehicles: int) -> Routes:
    """Return the routes of HGS-CARP's solution file: `(S 3,6,7)` is segment 3 from vertex 6 to vertex 7."""
    routes = []
    for line in text.splitlines()[4:]:
        services = re.findall(r"\(S (\d+),(\d+),(\d+)\)", line)
        routes.append(tuple(int(number) * (1 if int(first) < int(last) else -1) for number, first, last in services))
    return _fill([route for route in routes if route], vehicles)


def _read_tours(text: str) -> list[list[int]]:
    """Return the tours of a solution file: after two lines of head, a line of cities for each salesman."""
    return [[int(word) for word in line.partition("(")[0].split()] for line in text.splitlines()[2:]]


def _fill(routes: Sequence[tuple[int, ...]], vehicles: int) -> Routes:
    return (*routes, *[()] * (vehicles - len(routes)))


def _read(path: Path, read: Callable[[str], Read]) -> Read | None:
    if not path.is_file():
        return None
    try:
        return read(path.read_text(encoding="ascii", errors="replace"))
    except (ValueError, KeyError, IndexError):
        return None


def _run(command: Sequence[str], folder: Path, seconds: float) -> None:
    """Run a program in a folder. The system ends it when it takes far too much processor time.

    Raises:
        BenchError: it cannot be run.
    """
    most_s = math.ceil(GRACE * seconds + 60.0)
    try:
        subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            check=False, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (most_s, most_s)),
        )  # fmt: skip
    except OSError as error:
        raise BenchError(f"{command[0]}: expected a program that can be run: {error.strerror}") from error
