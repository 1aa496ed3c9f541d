"""Which file is which picture: by time, with the offset of a camera's clock found from the times themselves, and place.

A card's files and a camera's pictures are two rows of times that differ by one offset: by minutes where a clock is
wrong, by hours where it stands in another zone. At the right offset most of them fall together, for the pauses between
spans are as irregular as the line. Where files know their place, only pairs that are near each other count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from missions.geo import FloatArray, LocalFrame

TOLERANCE_S = 1.0
"""A camera's clock may show whole seconds, and writes after it has taken."""
NEAR_M = 30.0
"""Of two fixes, each by its own receiver."""
FARTHEST_S = 14 * 3600.0 + 600.0
"""The farthest time zones, and a clock that is ten minutes wrong."""
ZONE_S, WRONG_S, ZONE_DOUBT = 900.0, 450.0, 0.1
"""Zones differ by quarters of an hour; the farther a clock is from one, by so much less it is believed."""
BIN_S = 0.5
MOST_PAIRS = 4_000_000
"""More are thinned out before an offset is looked for."""


@dataclass(frozen=True, slots=True)
class PlacedTimes:
    """Times in ascending order, with places where they are known."""

    times_s: FloatArray
    places_m: FloatArray
    """(n, 2) float64, NaN where it is not known."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """How a card's clock differs."""

    ahead_s: float
    """By how much it is ahead."""
    pairs: int
    """How many of its files fall together with pictures then."""
    score: float
    """How well they do: two cameras that fly alike have as many pairs, but not as near ones."""


def build_placed_times(frame: LocalFrame, rows: list[tuple[float, float | None, float | None]]) -> PlacedTimes:
    """Return times with their places, from times, latitudes and longitudes."""
    places = [
        (np.nan, np.nan) if lat_deg is None or lon_deg is None else frame.to_local_m(lat_deg, lon_deg)
        for _, lat_deg, lon_deg in rows
    ]
    times = np.array([row[0] for row in rows], dtype=np.float64)
    return PlacedTimes(times, np.array(places, dtype=np.float64).reshape(-1, 2))


def find_clock_offset(card: PlacedTimes, pictures: PlacedTimes) -> ClockOffset | None:
    """Return the offset at which most files fall together with pictures; None where none do."""
    apart_s = _compute_differences_s(card, pictures)
    apart_s = apart_s[np.abs(apart_s) <= FARTHEST_S]
    if not len(apart_s):
        return None
    low_s = float(apart_s.min())
    counts = np.bincount(((apart_s - low_s) / BIN_S).astype(np.int64))
    pairs = counts + np.append(counts[1:], 0)
    middle_s = low_s + (int(pairs.argmax()) + 1) * BIN_S
    near = apart_s[np.abs(apart_s - middle_s) <= BIN_S]
    ahead_s = float(np.median(near))
    together = match_times(card, pictures, ahead_s)
    apart_s = np.array([card.times_s[file] - ahead_s - pictures.times_s[picture] for file, picture in together])
    wrong = ZONE_DOUBT * min(1.0, abs((ahead_s + ZONE_S / 2) % ZONE_S - ZONE_S / 2) / WRONG_S)
    return ClockOffset(ahead_s, len(together), float((1.0 - np.abs(apart_s) / TOLERANCE_S).sum()) * (1.0 - wrong))


def _compute_differences_s(card: PlacedTimes, pictures: PlacedTimes) -> FloatArray:
    """Return by how much the time of each file is after that of each picture, of pairs that may be the same."""
    thin = max(1, int(np.ceil(len(card.times_s) * len(pictures.times_s) / MOST_PAIRS)))
    times_s, places_m = card.times_s[::thin], card.places_m[::thin]
    apart_s = times_s[:, np.newaxis] - pictures.times_s
    apart_m = np.hypot(*np.moveaxis(places_m[:, np.newaxis] - pictures.places_m, 2, 0))
    return np.asarray(apart_s[~(apart_m > NEAR_M)])


def match_times(card: PlacedTimes, pictures: PlacedTimes, ahead_s: float) -> list[tuple[int, int]]:
    """Return (file, picture) of all that fall together, each at most once, the nearest in time first."""
    times_s = card.times_s - ahead_s
    candidates: list[tuple[float, int, int]] = []
    for file, at_s in enumerate(times_s):
        first = int(np.searchsorted(pictures.times_s, at_s - TOLERANCE_S))
        last = int(np.searchsorted(pictures.times_s, at_s + TOLERANCE_S))
        for picture in range(first, last):
            apart_m = float(np.hypot(*(card.places_m[file] - pictures.places_m[picture])))
            if not apart_m > NEAR_M:
                candidates.append((abs(float(pictures.times_s[picture] - at_s)), file, picture))
    taken_files: set[int] = set()
    taken_pictures: set[int] = set()
    pairs = []
    for _, file, picture in sorted(candidates):
        if file not in taken_files and picture not in taken_pictures:
            taken_files.add(file)
            taken_pictures.add(picture)
            pairs.append((file, picture))
    return sorted(pairs)
