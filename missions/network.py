"""Model the power line: pylons, and the segments between adjacent ones, validated on construction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from missions.errors import NetworkError
from missions.geo import FloatArray, LocalFrame

MAX_DISTANCE_M = 200_000.0
"""Greatest distance of a pylon from the depot; more is an error in the file or the depot."""

CUT = "; radius_m, or --radius with --depot, cuts what is near out of a larger file"
SHORTEST_SEGMENT_M = 0.05
"""Least distance between two pylons; PX4 refuses waypoints less than 5 cm apart (FeasibilityChecker.cpp)."""


@dataclass(frozen=True, slots=True)
class Pylon:
    """One pylon."""

    id: str
    lat_deg: float
    lon_deg: float
    elevation_m: float | None = None
    """Ground at its foot above mean sea level, if known."""
    height_m: float | None = None
    """Height of the structure, if known."""
    third_m: float | None = None
    """Third coordinate in the file, whose meaning is unknown; see ``line_heights``."""


@dataclass(frozen=True, slots=True)
class Segment:
    """The span between two adjacent pylons."""

    id: int
    """Index in the network, which is also the planner's."""
    a: int
    """Index of a pylon; the forward direction is from a to b."""
    b: int
    label: str = ""
    """Name in its file; kept when part of the network is renumbered."""


@dataclass(frozen=True, slots=True)
class Network:
    """Pylons and segments about a depot."""

    pylons: tuple[Pylon, ...]
    segments: tuple[Segment, ...]
    frame: LocalFrame
    """Its origin is the depot."""
    source: str = "network"
    """Source, for messages."""
    flat: bool = False
    """Whether the ground is assumed level with the depot, by the file format or by assertion."""
    positions_m: FloatArray = field(init=False, repr=False, compare=False)
    """(p, 2) float64: east and north of every pylon."""
    ends_m: FloatArray = field(init=False, repr=False, compare=False)
    """(n, 2, 2) float64: east and north of every segment's a and b."""
    lengths_m: FloatArray = field(init=False, repr=False, compare=False)
    """(n,) float64: horizontal length of every segment."""

    def __post_init__(self) -> None:
        """Check every invariant that the rest of the program relies on.

        Raises:
            NetworkError: one line that names the source, the place in it and what was expected.
        """
        self._check_pylons()
        lat_lon_deg = np.array([(pylon.lat_deg, pylon.lon_deg) for pylon in self.pylons], dtype=np.float64)
        positions_m = self.frame.many_to_local_m(lat_lon_deg)
        object.__setattr__(self, "positions_m", positions_m)
        self._check_distances()
        self._check_segments()
        # Computed once: otherwise each access to a segment's own would compute all of them.
        indices = np.array([(segment.a, segment.b) for segment in self.segments], dtype=np.intp)
        ends_m = positions_m[indices]
        object.__setattr__(self, "ends_m", ends_m)
        object.__setattr__(self, "lengths_m", np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T))

    @property
    def depot(self) -> tuple[float, float, float]:
        """Latitude and longitude in degrees, height above mean sea level in metres."""
        return self.frame.lat_deg, self.frame.lon_deg, self.frame.alt_m

    @property
    def has_heights(self) -> bool:
        """Whether ground and structure height are known for every pylon."""
        return all(pylon.elevation_m is not None and pylon.height_m is not None for pylon in self.pylons)

    def segment_name(self, segment: int) -> str:
        """Return a segment's name in its file, or its number if it has none."""
        return self.segments[segment].label or f"segment {segment}"

    def _check_pylons(self) -> None:
        seen: set[str] = set()
        for index, pylon in enumerate(self.pylons):
            place = f"{self.source}: pylon {pylon.id!r}"
            if not pylon.id:
                raise NetworkError(f"{self.source}: pylons[{index}].id: expected a name that is not empty")
            if pylon.id in seen:
                raise NetworkError(f"{place}: id: expected a name that no other pylon has")
            seen.add(pylon.id)
            check_degrees(place, pylon.lat_deg, pylon.lon_deg, "; are latitude and longitude swapped?")
            for key, height_m in (("elevation_m", pylon.elevation_m), ("height_m", pylon.height_m)):
                if height_m is not None and not math.isfinite(height_m):
                    raise NetworkError(f"{place}: {key}: expected metres as a finite number, got {height_m}")
            if pylon.height_m is not None and pylon.height_m < 0:
                raise NetworkError(f"{place}: height_m: expected 0 or more metres, got {pylon.height_m:g}")
        if not self.pylons:
            raise NetworkError(f"{self.source}: pylons: expected at least two, found none")

    def _check_distances(self) -> None:
        distances_m = np.hypot(self.positions_m[:, 0], self.positions_m[:, 1])
        # PROJ returns inf for the antipode of the depot.
        far = np.flatnonzero(~(distances_m <= MAX_DISTANCE_M))
        if far.size == 0:
            return
        pylon = self.pylons[int(far[0])]
        hint = ""
        if abs(pylon.lon_deg) <= 90.0:
            swapped_m = math.hypot(*self.frame.to_local_m(pylon.lon_deg, pylon.lat_deg))
            if swapped_m <= MAX_DISTANCE_M:
                hint = "; latitude and longitude look swapped (GeoJSON has longitude first)"
        raise NetworkError(
            f"{self.source}: pylon {pylon.id!r}: position: expected within {MAX_DISTANCE_M / 1000:g} km of the depot "
            f"({self.frame.lat_deg:.6f}, {self.frame.lon_deg:.6f}), got ({pylon.lat_deg:.6f}, {pylon.lon_deg:.6f}), "
            f"{distances_m[far[0]] / 1000:.0f} km away{hint or CUT}"
        )

    def _check_segments(self) -> None:
        if not self.segments:
            raise NetworkError(f"{self.source}: segments: expected at least one, found none")
        pairs: dict[frozenset[int], str] = {}
        for number, segment in enumerate(self.segments):
            place = f"{self.source}: segment {segment.label or segment.id}"
            if segment.id != number:
                raise NetworkError(f"{place}: id: expected {number}, its position, got {segment.id}")
            for key, end in (("a", segment.a), ("b", segment.b)):
                if not 0 <= end < len(self.pylons):
                    raise NetworkError(f"{place}: {key}: expected a pylon index below {len(self.pylons)}, got {end}")
            names = f"{self.pylons[segment.a].id!r} and {self.pylons[segment.b].id!r}"
            offset_m = self.positions_m[segment.b] - self.positions_m[segment.a]
            if math.hypot(*offset_m) < SHORTEST_SEGMENT_M:
                raise NetworkError(f"{place}: length: expected two pylons apart, {names} are at the same place")
            pair = frozenset((segment.a, segment.b))
            if pair in pairs:
                raise NetworkError(f"{place}: pylons: expected a pair only once, {names} already are {pairs[pair]}")
            pairs[pair] = f"segment {segment.label or segment.id}"


def check_degrees(place: str, lat_deg: float, lon_deg: float, hint: str) -> None:
    """Refuse a position outside the valid range.

    Args:
        place: Owner of the position, for messages.
        lat_deg: Latitude.
        lon_deg: Longitude.
        hint: Advice if swapped coordinates would be valid.

    Raises:
        NetworkError: one line that names the place, the key and what was expected.
    """
    for key, value, bound in (("lat_deg", lat_deg, 90.0), ("lon_deg", lon_deg, 180.0)):
        if not math.isfinite(value) or abs(value) > bound:
            swapped = key == "lat_deg" and math.isfinite(value) and abs(lon_deg) <= bound
            words = hint if swapped else ""
            raise NetworkError(f"{place}: {key}: expected -{bound:g} to {bound:g}, got {value}{words}")


def part_within(
    pylons: Sequence[Pylon], segments: Sequence[Segment], frame: LocalFrame, radius_m: float
) -> tuple[tuple[Pylon, ...], tuple[Segment, ...]]:
    """Return the part whose segments have both pylons nearer than ``radius_m`` to the depot; it may be empty.

    The input may be too large for a network. Segments and pylons are renumbered from 0 in their old order; labels and
    pylon ids are kept.
    """
    places_m = frame.many_to_local_m(np.array([(one.lat_deg, one.lon_deg) for one in pylons], dtype=np.float64))
    near = np.hypot(places_m[:, 0], places_m[:, 1]) < radius_m
    kept = [segment for segment in segments if near[segment.a] and near[segment.b]]
    used = sorted({end for segment in kept for end in (segment.a, segment.b)})
    new_index = {old: new for new, old in enumerate(used)}
    return tuple(pylons[old] for old in used), tuple(
        Segment(number, new_index[segment.a], new_index[segment.b], segment.label)
        for number, segment in enumerate(kept)
    )
