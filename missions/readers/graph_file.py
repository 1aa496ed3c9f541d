"""The graph files of the public Set TSP solver: libconfig with two strings, positions and neighbours.

``pylons_position`` holds "x y z;" a line, ``connections_indexes`` the 1-based neighbours of each pylon, "1 3;" a line.
Every segment is normally listed from both of its ends; a pair is taken once, from its lower to its higher pylon.
"""

from __future__ import annotations

import re

import numpy as np

from missions.errors import NetworkError
from missions.geo import LocalFrame, grid_offsets_to_wgs84_deg
from missions.network import Network, Pylon, Segment

POSITIONS, NEIGHBOURS = "pylons_position", "connections_indexes"

# name = "..." with libconfig's joining of adjacent strings; group 2 holds all of them.
_SETTING = re.compile(r'^[ \t]*([A-Za-z*][-\w*]*)[ \t]*[:=]\s*((?:"(?:[^"\\]|\\.)*"\s*)+)', re.MULTILINE)
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"')


def parse_graph(text: str, *, source: str, frame: LocalFrame, crs: str | None = None) -> Network:
    """Return the network that a graph file describes.

    z is taken as the ground's height over the depot. A file whose z are all 0 is one of flat ground, by its format.

    Raises:
        NetworkError: one line that names the file, the place in it and what was expected.
    """
    settings = {name: "".join(_STRING.findall(value)) for name, value in _SETTING.findall(text)}
    for key in (POSITIONS, NEIGHBOURS):
        if key not in settings:
            raise NetworkError(f"{key}: expected a string in quotes, found none")
    offsets_m = _parse_positions_m(settings[POSITIONS])
    segments = _parse_segments(settings[NEIGHBOURS], len(offsets_m))
    try:
        if crs is None:
            lat_lon_deg = frame.many_to_wgs84_deg(offsets_m[:, :2])
        else:
            lat_lon_deg = grid_offsets_to_wgs84_deg(frame, offsets_m[:, :2], crs)
    except ValueError as error:
        raise NetworkError(f"crs: {error}") from error
    knows_ground = bool(np.any(offsets_m[:, 2]))
    pylons = tuple(
        Pylon(
            str(index + 1), float(lat), float(lon), frame.alt_m + float(offsets_m[index, 2]) if knows_ground else None
        )
        for index, (lat, lon) in enumerate(lat_lon_deg)
    )
    return Network(pylons, segments, frame, source, flat=not knows_ground)


def _split_rows(value: str) -> list[list[str]]:
    rows = value.split(";")
    # The text behind the last semicolon is no row.
    return [row.split() for row in (rows[:-1] if not rows[-1].strip() else rows)]


def _parse_positions_m(value: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    positions: list[tuple[float, float, float]] = []
    for number, row in enumerate(_split_rows(value), start=1):
        place = f"{POSITIONS}, row {number}"
        try:
            east, north, up = (float(word) for word in row)
        except ValueError as error:
            raise NetworkError(f"{place}: expected three numbers 'x y z', got {' '.join(row)!r}") from error
        if not np.all(np.isfinite((east, north, up))):
            raise NetworkError(f"{place}: expected finite numbers, got {' '.join(row)!r}")
        positions.append((east, north, up))
    if not positions:
        raise NetworkError(f"{POSITIONS}: expected at least two rows 'x y z;', found none")
    return np.array(positions, dtype=np.float64)


def _parse_segments(value: str, pylons: int) -> tuple[Segment, ...]:
    rows = _split_rows(value)
    if len(rows) != pylons:
        raise NetworkError(f"{NEIGHBOURS}: expected {pylons} rows, one a pylon, found {len(rows)}")
    pairs: set[tuple[int, int]] = set()
    for number, row in enumerate(rows, start=1):
        place = f"{NEIGHBOURS}, row {number}"
        for word in row:
            if not word.isdecimal() or not 1 <= int(word) <= pylons:
                raise NetworkError(f"{place}: expected pylon numbers from 1 to {pylons}, got {word!r}")
            if int(word) == number:
                raise NetworkError(f"{place}: expected other pylons' numbers, got its own")
            pairs.add((min(number, int(word)) - 1, max(number, int(word)) - 1))
    return tuple(Segment(index, a, b, f"{a + 1}-{b + 1}") for index, (a, b) in enumerate(sorted(pairs)))
