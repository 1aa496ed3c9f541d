"""Networks over ground that is known here, written with the mistakes that files have.

What is true stays with the file: `tests.executor.height_judge` holds the flights against it.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace

FEET = 1 / 0.3048
LAT_DEG, LON_DEG = 49.6, 15.6
METRES_PER_DEG = 111_132.0
Feature = dict[str, object]


@dataclass(frozen=True)
class TruePylon:
    """One pylon as it really is."""

    id: str
    lat_deg: float
    lon_deg: float
    ground_m: float
    height_m: float


@dataclass(frozen=True)
class Written:
    """One pylon as the file has it."""

    pylon: TruePylon
    elevation_m: float | None
    height_m: float | None
    third_m: float | None = None

    def feature(self) -> Feature:
        place = [self.pylon.lon_deg, self.pylon.lat_deg, *([] if self.third_m is None else [self.third_m])]
        known = {"elevation_m": self.elevation_m, "height_m": self.height_m}
        properties = {"id": self.pylon.id, **{key: value for key, value in known.items() if value is not None}}
        return {"type": "Feature", "geometry": {"type": "Point", "coordinates": place}, "properties": properties}


@dataclass(frozen=True)
class HeightFile:
    """A network file, and what is true."""

    kind: str
    pylons: tuple[TruePylon, ...]
    lines: tuple[tuple[TruePylon, ...], ...]
    depot_ground_m: float
    written: tuple[Written, ...]
    depot_m: float | None
    """What the file says of the depot's height."""
    points: bool = True
    """Whether the pylons have Points of their own."""
    heights: str = "known"
    """What the site says."""
    must: str = "either"
    """refused, flown or either."""

    def geojson(self) -> str:
        """Return the file's content."""
        by_id = {one.pylon.id: one for one in self.written}
        depot: dict[str, object] = {"role": "depot"}
        if self.depot_m is not None:
            depot["elevation_m"] = self.depot_m
        features: list[Feature] = [
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": [LON_DEG, LAT_DEG]}, "properties": depot}
        ]
        if self.points:
            features += [one.feature() for one in self.written]
        for number, line in enumerate(self.lines, start=1):
            places = []
            for pylon in line:
                third_m = by_id[pylon.id].third_m
                places.append([pylon.lon_deg, pylon.lat_deg, *([] if third_m is None else [third_m])])
            geometry = {"type": "LineString", "coordinates": places}
            features.append({"type": "Feature", "geometry": geometry, "properties": {"id": f"L{number}"}})
        return json.dumps({"type": "FeatureCollection", "features": features})


def _ground(rng: random.Random, base_m: float, relief_m: float) -> Callable[[float, float], float]:
    """Return the ground over east and north: hills about 3 km apart, so that no slope is more than a line takes."""
    east, north, phase = (rng.uniform(0.0, 2 * math.pi) for _ in range(3))

    def at(east_m: float, north_m: float) -> float:
        waves = math.sin(east_m / 520.0 + east) + math.sin(north_m / 610.0 + north)
        return base_m + relief_m * (0.25 * waves + 0.25 * math.sin((east_m + north_m) / 900.0 + phase))

    return at


def true_file(kind: str, seed: int, *, base_m: float, relief_m: float) -> HeightFile:
    """Return a good file: two or three lines that lead away from the depot."""
    rng = random.Random(f"{kind} {seed}")
    ground = _ground(rng, base_m, relief_m)
    lines: list[tuple[TruePylon, ...]] = []
    first = rng.uniform(0.0, 360.0)
    count = rng.choice((2, 3))
    for number in range(count):
        course = math.radians(first + 360.0 * number / count + rng.uniform(-20.0, 20.0))
        east_m, north_m = 120.0 * math.sin(course), 120.0 * math.cos(course)
        line = []
        for step in range(rng.randint(4, 7)):
            pylon = TruePylon(
                f"{number + 1}-{step + 1}",
                LAT_DEG + north_m / METRES_PER_DEG,
                LON_DEG + east_m / (METRES_PER_DEG * math.cos(math.radians(LAT_DEG))),
                round(ground(east_m, north_m), 1),
                round(rng.uniform(25.0, 42.0), 1),
            )
            line.append(pylon)
            course += rng.uniform(-0.25, 0.25)
            span_m = rng.uniform(150.0, 320.0)
            east_m, north_m = east_m + span_m * math.sin(course), north_m + span_m * math.cos(course)
        lines.append(tuple(line))
    pylons = tuple(pylon for line in lines for pylon in line)
    depot_m = round(ground(0.0, 0.0), 1)
    written = tuple(Written(pylon, pylon.ground_m, pylon.height_m) for pylon in pylons)
    return HeightFile(kind, pylons, tuple(lines), depot_m, written, depot_m)


Change = Callable[[HeightFile, random.Random], HeightFile]


def _each(change: Callable[[Written], Written]) -> Change:
    return lambda file, _: replace(file, written=tuple(map(change, file.written)))


def _some(change: Callable[[Written], Written], share: float = 0.0) -> Change:
    """Change one pylon, or a share of them."""

    def changed(file: HeightFile, rng: random.Random) -> HeightFile:
        chosen = set(rng.sample(range(len(file.written)), max(1, round(share * len(file.written)))))
        written = tuple(change(one) if index in chosen else one for index, one in enumerate(file.written))
        return replace(file, written=written)

    return changed


def _both(one: Change, other: Change) -> Change:
    return lambda file, rng: other(one(file, rng), rng)


def _depot_in_feet(file: HeightFile, _: random.Random) -> HeightFile:
    return replace(file, depot_m=FEET * file.depot_ground_m)


def _without(one: Written) -> Written:
    return replace(one, elevation_m=None, height_m=None)


def _in_feet(one: Written) -> Written:
    return replace(one, elevation_m=FEET * one.pylon.ground_m, height_m=FEET * one.pylon.height_m)


KINDS: dict[str, tuple[float, float, str, Change]] = {
    # kind: ground at the middle, relief, what must come of it, what is wrong with the file
    "good": (460.0, 120.0, "flown", lambda file, _: file),
    "good, low, level": (40.0, 6.0, "flown", lambda file, _: file),
    "one height missing": (460.0, 200.0, "refused", _some(lambda one: replace(one, height_m=None))),
    "mixed elevations": (460.0, 200.0, "refused", _some(lambda one: replace(one, elevation_m=None), 0.4)),
    "mixed, claimed flat": (
        300.0, 2.0, "refused",
        lambda file, rng: replace(_some(_without, 0.3)(file, rng), heights="flat"),
    ),
    "lines only": (460.0, 250.0, "refused", lambda file, _: replace(file, points=False)),
    "level, claimed flat, structures known": (
        300.0, 2.0, "flown",
        lambda file, _: replace(
            file, heights="flat", written=tuple(replace(one, elevation_m=None) for one in file.written)
        ),
    ),
    "hills, claimed flat": (460.0, 250.0, "refused", lambda file, _: replace(file, heights="flat")),
    "structures in feet": (460.0, 150.0, "either", _each(lambda one: replace(one, height_m=FEET * one.pylon.height_m))),
    "elevations in feet": (
        460.0, 150.0, "refused", _each(lambda one: replace(one, elevation_m=FEET * one.pylon.ground_m)),
    ),
    "one elevation in feet": (
        460.0, 150.0, "refused", _some(lambda one: replace(one, elevation_m=FEET * one.pylon.ground_m)),
    ),
    "all in feet": (90.0, 60.0, "refused", _both(_each(_in_feet), _depot_in_feet)),
    "structures above sea level": (
        460.0, 150.0, "refused", _each(lambda one: replace(one, height_m=one.pylon.ground_m + one.pylon.height_m)),
    ),
    "structures above sea level, low": (
        40.0, 20.0, "either", _each(lambda one: replace(one, height_m=one.pylon.ground_m + one.pylon.height_m)),
    ),
    "swapped": (
        460.0, 60.0, "refused",
        _each(lambda one: replace(one, elevation_m=one.pylon.height_m, height_m=one.pylon.ground_m)),
    ),
    "swapped, low": (
        35.0, 10.0, "either",
        _each(lambda one: replace(one, elevation_m=one.pylon.height_m, height_m=one.pylon.ground_m)),
    ),
    "elevations over the depot": (
        460.0, 150.0, "refused",
        lambda file, _: replace(
            file,
            written=tuple(replace(one, elevation_m=one.pylon.ground_m - file.depot_ground_m) for one in file.written),
        ),
    ),
    "elevations of the tops": (
        460.0, 150.0, "either",
        _each(lambda one: replace(one, elevation_m=one.pylon.ground_m + one.pylon.height_m)),
    ),
    "three coordinates, lines only": (
        460.0, 200.0, "refused",
        _both(
            _each(lambda one: replace(_without(one), third_m=one.pylon.ground_m + 46.0)),
            lambda file, _: replace(file, points=False),
        ),
    ),
    "three coordinates, claimed flat": (
        460.0, 400.0, "refused",
        lambda file, _: replace(
            file, heights="flat", points=False,
            written=tuple(replace(_without(one), third_m=one.pylon.ground_m + 46.0) for one in file.written),
        ),
    ),
    "three coordinates and heights": (
        460.0, 100.0, "flown", _each(lambda one: replace(one, third_m=one.pylon.ground_m + 46.0)),
    ),
    "three coordinates that contradict": (
        460.0, 100.0, "refused",
        _each(lambda one: replace(one, elevation_m=one.pylon.ground_m - 200.0, third_m=one.pylon.ground_m + 46.0)),
    ),
    "one zero at 700 m": (700.0, 150.0, "refused", _some(lambda one: replace(one, elevation_m=0.0))),
    "some zeros": (90.0, 30.0, "refused", _some(lambda one: replace(one, elevation_m=0.0), 0.3)),
    "all zeros": (
        120.0, 40.0, "refused",
        _both(_each(lambda one: replace(one, elevation_m=0.0)), lambda file, _: replace(file, depot_m=0.0)),
    ),
    "one structure of zero": (460.0, 100.0, "refused", _some(lambda one: replace(one, height_m=0.0))),
    "depot without a height": (460.0, 100.0, "refused", lambda file, _: replace(file, depot_m=None)),
    "depot in feet": (460.0, 100.0, "refused", _depot_in_feet),
    "one pylon 150 m too deep": (
        460.0, 40.0, "either",
        lambda file, _: replace(
            file,
            written=tuple(
                replace(one, elevation_m=one.pylon.ground_m - 250.0) if index == 2 else one
                for index, one in enumerate(file.written)
            ),
        ),
    ),
    "deep valleys": (900.0, 420.0, "either", lambda file, _: file),
}  # fmt: skip


def height_file(kind: str, seed: int) -> HeightFile:
    """Return a file of a kind."""
    base_m, relief_m, must, change = KINDS[kind]
    file = true_file(kind, seed, base_m=base_m, relief_m=relief_m)
    return replace(change(file, random.Random(seed)), must=must)
