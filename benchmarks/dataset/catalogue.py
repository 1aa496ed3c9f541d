"""What the data package holds: its own instances, those by reference, and the best known solutions of both.

An instance by reference is not in the package: it is made from a public file of known checksum that the user has.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.dataset.checker import (
    BadFileError,
    Instance,
    Solution,
    read_instance,
    read_json,
    read_solution,
)
from benchmarks.dataset.generator import generate_instance
from benchmarks.errors import BenchError
from benchmarks.problems import network_of
from benchmarks.tsplib import is_tsplib, read_tsplib
from planner import PRESETS, pct_per_s

PACKAGE = Path(__file__).parent
"""The folder that can be taken away."""
DRONE = "mavic2"
"""Drone of the paper's network: its rates come from the pen-and-paper model."""
PAPER_SPEEDS_M_S = (5.0, 1.0)
OBJECTIVES = ("minmax", "minsum", "window")
"""Objectives with best known values."""


@dataclass(frozen=True, slots=True)
class Generated:
    """One of the package's own instances."""

    shape: str
    segments: int
    vehicles: int
    budget_pct: float
    """The best minmax found when it was made, over a tightness of 0.86, rounded."""
    longest_s: float | None
    """For the window: a tenth above the longest route of that plan, rounded; None where it is not asked."""

    @property
    def source(self) -> str:
        """The command that makes it again."""
        return describe_source(self.shape, self.build(), seed=1)

    def build(self) -> Instance:
        """Return the instance."""
        return generate_instance(
            self.shape, self.segments, self.vehicles, seed=1, budget_pct=self.budget_pct, longest_s=self.longest_s
        )


def describe_source(shape: str, instance: Instance, *, seed: int) -> str:
    """Return the command that makes a generated instance."""
    longest = "" if instance.longest_s is None else f" --longest {instance.longest_s:g}"
    return (
        f"faultline bench instance {shape} --segments {len(instance.segments_m)} --vehicles {instance.vehicles} "
        f"--budget {instance.budget_pct:g}{longest} --seed {seed}"
    )


GENERATED: tuple[Generated, ...] = (
    Generated("line", 18, 3, 151.6, 2498),
    Generated("ring", 18, 3, 136.5, 2250),
    Generated("tree", 18, 3, 128.4, 2081),
    Generated("grid", 18, 3, 131.2, 2121),
    Generated("line", 33, 4, 227.8, 3858),
    Generated("ring", 33, 4, 204.6, 3367),
    Generated("tree", 33, 4, 183.4, 2988),
    Generated("grid", 33, 4, 177.7, 2869),
    Generated("line", 56, 4, 378.5, 6431),
    Generated("ring", 56, 4, 342.4, 5673),
    Generated("tree", 56, 4, 305.9, 4922),
    Generated("grid", 56, 4, 289.6, 4647),
    Generated("line", 81, 4, 537.1, 9121),
    Generated("ring", 81, 4, 502.1, 8352),
    Generated("tree", 81, 4, 438.9, 7062),
    Generated("grid", 81, 4, 422.3, 6741),
    Generated("line", 300, 15, 1065.7, None),
    Generated("ring", 300, 15, 852.5, None),
    Generated("tree", 300, 15, 459.5, None),
    Generated("grid", 300, 15, 450.9, None),
    Generated("line", 800, 40, 2557.1, None),
    Generated("ring", 800, 40, 1833.7, None),
    Generated("tree", 800, 40, 509.7, None),
    Generated("grid", 800, 40, 499.8, None),
)


@dataclass(frozen=True, slots=True)
class Reference:
    """An instance that is made from a public file."""

    name: str
    file: str
    """Name of the file in a directory of benchmark data."""
    sha256: str
    vehicles: int
    radius_m: float | None = None
    """For a network: its segments nearer than this to the depot."""
    budget_pct: float | None = None
    """None: without a limit."""
    longest_s: float | None = None

    def build(self, data: Path) -> Instance:
        """Return the instance.

        Raises:
            BenchError: the file is not there, or not the one that is meant.
            missions.MissionsError: it cannot be read.
        """
        path = data / self.file
        try:
            found = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise BenchError(f"{path}: expected the file behind {self.name}: {error.strerror}") from error
        if found != self.sha256:
            raise BenchError(f"{path}: expected the file with sha256 {self.sha256}, got {found}")
        return build_from_file(
            path, self.name, vehicles=self.vehicles, radius_m=self.radius_m, budget_pct=self.budget_pct,
            longest_s=self.longest_s,
        )  # fmt: skip


def read_references() -> tuple[Reference, ...]:
    """Return the instances by reference."""
    content: dict[str, Any] = json.loads((PACKAGE / "references.json").read_text(encoding="utf-8"))
    files = content["files"]
    return tuple(Reference(**one, sha256=files[one["file"]]["sha256"]) for one in content["instances"])


def build_from_file(
    path: Path,
    name: str,
    *,
    vehicles: int,
    radius_m: float | None = None,
    budget_pct: float | None = None,
    longest_s: float | None = None,
) -> Instance:
    """Return the instance of a network, or of a city file: cities are segments of no length.

    A network has the paper's speeds and the energy of the pen-and-paper model; of cities a length is a second and a
    percent.

    Raises:
        BenchError: the city file cannot be used.
        missions.MissionsError: the network cannot be used.
    """
    if is_tsplib(path):
        places = read_tsplib(path).places.tolist()
        depot_m, segments_m = places[0], [(place, place) for place in places[1:]]
        speeds, rates = (1.0, 1.0), (1.0, 1.0)
    else:
        depot_m, segments_m = [0.0, 0.0], np.asarray(network_of(path, radius_m).ends_m).tolist()
        speeds = PAPER_SPEEDS_M_S
        rates = (pct_per_s(PRESETS[DRONE], speeds[0]), pct_per_s(PRESETS[DRONE], speeds[1]))
    made = Instance(
        name=name,
        segments_m=tuple((_place(first), _place(last)) for first, last in segments_m),
        depot_m=_place(depot_m),
        vehicles=vehicles,
        budget_pct=1.0 if budget_pct is None else budget_pct,
        transit_m_s=speeds[0],
        inspection_m_s=speeds[1],
        transit_pct_per_s=rates[0],
        inspection_pct_per_s=rates[1],
        longest_s=longest_s,
    )
    return made if budget_pct is not None else with_ample_budget(made)


def with_ample_budget(instance: Instance) -> Instance:
    """Return the instance with a budget that no good route comes near: every segment flown to and back one by one."""
    home = instance.depot_m
    there_and_back_m = sum(math.dist(home, first) + math.dist(last, home) for first, last in instance.segments_m)
    along_m = sum(math.dist(first, last) for first, last in instance.segments_m)
    pct = there_and_back_m / instance.transit_m_s * instance.transit_pct_per_s
    pct += along_m / instance.inspection_m_s * instance.inspection_pct_per_s
    return replace(instance, budget_pct=float(math.ceil(2.0 * pct)))


def _place(place: list[float]) -> tuple[float, float]:
    return place[0], place[1]


@dataclass(frozen=True, slots=True)
class Entry:
    """One best known solution."""

    path: Path
    solution: Solution
    found: dict[str, Any]
    """Who found it, when, by which program, and its proof."""


def instance_path(name: str, folder: Path = PACKAGE) -> Path:
    """Return the place of one of the package's own instances."""
    return folder / "instances" / f"{name}.json"


def solution_path(name: str, objective: str, folder: Path = PACKAGE) -> Path:
    """Return the place of a best known solution."""
    return folder / "solutions" / f"{name}.{objective}.json"


def load_instance(path: Path) -> Instance:
    """Read an instance's file.

    Raises:
        BenchError: it is none.
    """
    try:
        return read_instance(read_json(path))
    except BadFileError as error:
        raise BenchError(f"{path}: {error}") from error


def load_entry(path: Path) -> Entry:
    """Read a best known solution.

    Raises:
        BenchError: it is none.
    """
    try:
        content = read_json(path)
        solution = read_solution(content)
    except BadFileError as error:
        raise BenchError(f"{path}: {error}") from error
    return Entry(path, solution, dict(content) if isinstance(content, dict) else {})


def find_entries(folder: Path = PACKAGE) -> Iterator[Path]:
    """Yield the places of all best known solutions, in the order of their names."""
    yield from sorted((folder / "solutions").glob("*.json"))


def find_instances(named: Sequence[str], data: Path | None) -> list[Instance]:
    """Return instances by their names in the package or by their files; all that can be made without a name.

    Args:
        named: names or paths.
        data: the directory with the public files behind instances by reference; None leaves these out.

    Raises:
        BenchError: a name is unknown, or a file cannot be read.
        missions.MissionsError: a network cannot be read.
    """
    references = {one.name: one for one in read_references()}
    names = named or [one.build().name for one in GENERATED] + ([] if data is None else list(references))
    found = []
    for name in names:
        if Path(name).is_file():
            found.append(load_instance(Path(name)))
        elif name in references:
            if data is None:
                raise BenchError(f"{name}: expected --data DIR with {references[name].file}")
            found.append(references[name].build(data))
        elif instance_path(name).is_file():
            found.append(load_instance(instance_path(name)))
        else:
            raise BenchError(f"{name}: expected a file, or the name of an instance in {PACKAGE / 'instances'}")
    return found
