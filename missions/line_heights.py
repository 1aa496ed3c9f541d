"""Check which heights of a line are known and plausible; lines with unknown heights are not flown over.

Heights are known when every pylon has both ``elevation_m``, the ground at its foot above mean sea level, and
``height_m``, the structure's own. Where no pylon has them, the ground must be asserted to be level with the depot, by
the site or by the file's format; flight heights then refer to the depot. Anything between is an error that names the
pylons: one pylon without a height would put the others' flights 15 m over the depot's ground.

Where a raster covers the ground, it supplies missing ground heights of pylons, and is checked against those in the
file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from missions.errors import NetworkError
from missions.geo import FloatArray, LocalFrame
from missions.network import Network, Pylon
from missions.terrain import Elevation, build_unknown_ground_error

FLAT_GROUND_M = 5.0
"""Largest known deviation from the depot's height of ground asserted to be flat."""
TALLEST_M = 400.0
"""Greatest structure height; the Zhoushan crossing towers have 380 m."""
TALL_M = 60.0
"""Median pylon height above which a file is in feet or above sea level, unless the site confirms it."""
SHORTEST_M = 2.0
"""Least pylon height; lower ones were not filled in."""
STEEPEST = 1.0
"""Greatest slope of the ground between pylons, or from the depot to a pylon."""
STEEP = 0.3
"""Slope from the depot to the nearest pylon above which a finding is reported."""
PIT = 0.5
"""Slope at which a pylon is implausibly below all its neighbours; the line would span such a hole."""
SLACK_M = 20.0
"""Additional tolerance: rounded elevations, and a pylon on a bank."""
DATUM_M = 110.0
"""Greatest distance of the ellipsoid from mean sea level."""
NAMED = 3
"""Most pylons that an error names."""
CLAIM = '[inspection] heights = "flat"'
GROSS = 3.0
"""Multiple of the raster's uncertainty, plus `GROSS_M`, beyond which a pylon's elevation is wrong."""
GROSS_M = 30.0
ODD = 1.5
"""Multiple of the uncertainty, plus `ODD_M`, beyond which a finding is reported."""
ODD_M = 5.0
ALL_M = 12.0
"""Mean offset of all pylons, beyond the uncertainty, that means another vertical reference."""
ALL_FROM = 3
"""Least number of pylons for this check."""


def with_heights(network: Network, *, flat: bool) -> Network:
    """Return the network with usable heights: known for all its pylons, or for none over flat ground.

    Over ground asserted to be flat, by the caller or by the network's format, a pylon's elevation is the depot's;
    structure heights are still known for all pylons or for none. The function is idempotent.

    Raises:
        NetworkError: some heights are missing, or known ones contradict the assertion.
    """
    if flat or network.flat:
        return _apply_flat_ground(network)
    lacking = [pylon for pylon in network.pylons if pylon.elevation_m is None or pylon.height_m is None]
    if lacking:
        keys = [key for key in ("elevation_m", "height_m") if any(getattr(pylon, key) is None for pylon in lacking)]
        raise NetworkError(
            f"{network.source}: heights: expected {' and '.join(keys)} of every pylon, "
            f"{_describe_lacking(lacking, network)}"
            f"{_describe_third_coordinate(lacking)}; where the ground is level with the depot's, {CLAIM} claims so"
        )
    return network


def check_line_heights(network: Network, *, tallest_m: float | None = None) -> list[str]:
    """Check that a line's heights from its file are plausible, and return findings.

    Args:
        network: As returned by ``with_heights``.
        tallest_m: Height of the tallest structure, if the site confirms very tall pylons.

    Raises:
        NetworkError: heights are in feet, zero for unknown, or above sea level instead of above ground: one line with
            the pylon's name.
    """
    _check_structures(network, tallest_m)
    found: list[str] = []
    if not network.flat and network.has_heights:
        _check_ground(network)
        found += _check_depot_height(network)
    _check_third_coordinates(network)
    if any(pylon.third_m for pylon in network.pylons):
        found.append("the third coordinates of the network's positions are not used")
    return found


def _apply_flat_ground(network: Network) -> Network:
    ground_m = network.frame.alt_m
    for pylon in network.pylons:
        if pylon.elevation_m is not None and abs(pylon.elevation_m - ground_m) > FLAT_GROUND_M:
            raise NetworkError(
                f"{network.source}: pylon {pylon.id!r}: elevation_m: expected within {FLAT_GROUND_M:g} m of the "
                f"depot's {ground_m:g} m where the ground is claimed to be flat ({CLAIM}), got {pylon.elevation_m:g}"
            )
    lacking = [pylon for pylon in network.pylons if pylon.height_m is None]
    if len(lacking) == len(network.pylons):
        return replace(network, flat=True)
    if lacking:
        raise NetworkError(
            f"{network.source}: heights: expected height_m of every pylon or of none, "
            f"{_describe_lacking(lacking, network)}"
        )
    pylons = tuple(
        pylon if pylon.elevation_m is not None else replace(pylon, elevation_m=ground_m) for pylon in network.pylons
    )
    return replace(network, pylons=pylons, flat=True)


def _describe_lacking(pylons: Sequence[Pylon], network: Network) -> str:
    count, total = len(pylons), len(network.pylons)
    names = ", ".join(repr(pylon.id) for pylon in pylons[:NAMED]) + (", ..." if count > NAMED else "")
    return f"which {count} of {total} {'lacks' if count == 1 else 'lack'}: {names}"


def _describe_third_coordinate(pylons: Sequence[Pylon]) -> str:
    known = next((pylon for pylon in pylons if pylon.third_m), None)
    if known is None:
        return ""
    return (
        f" (the third coordinate of {known.id!r}, {known.third_m:g}, is not used: the file does not state whether it "
        f"is ground, wire or top, nor above what)"
    )


def _check_structures(network: Network, tallest_m: float | None) -> None:
    limit_m = TALLEST_M if tallest_m is None else tallest_m
    heights_m = []
    for pylon in network.pylons:
        if pylon.height_m is None:
            continue
        heights_m.append(pylon.height_m)
        place = f"{network.source}: pylon {pylon.id!r}: height_m: expected the structure's own height"
        if pylon.height_m > limit_m:
            raise NetworkError(
                f"{place} over its ground, at most {limit_m:g} m, got {pylon.height_m:g}; "
                "is it above sea level, or are elevation_m and height_m swapped?"
            )
        if pylon.height_m < SHORTEST_M:
            raise NetworkError(f"{place}, at least {SHORTEST_M:g} m, got {pylon.height_m:g}; is it not known?")
    if heights_m and tallest_m is None and median(heights_m) > TALL_M:
        raise NetworkError(
            f"{network.source}: height_m: expected metres over ground, but half of the pylons are taller than "
            f"{median(heights_m):g}; are they feet, or above sea level? [network] tallest_m = {max(heights_m):g} says "
            "that they are not"
        )


def _check_ground(network: Network) -> None:
    # With known heights no elevation is None; the zero is for the type checker.
    elevations_m = [pylon.elevation_m or 0.0 for pylon in network.pylons]
    if not any(elevations_m):
        raise NetworkError(
            f"{network.source}: elevation_m: expected the ground above sea level, but it is 0 for all pylons; where "
            f"the ground is level with the depot's, leave it out and claim so with {CLAIM}"
        )
    for index, rises in _iterate_rises(network, elevations_m):
        worst_m, other = max(((abs(rise_m) - STEEPEST * away_m, other) for rise_m, away_m, other in rises))
        deepest = all(rise_m < -SLACK_M - PIT * away_m for rise_m, away_m, _ in rises) and len(rises) > 1
        # Many programs write zero for unknown.
        zero = elevations_m[index] == 0.0 and all(abs(rise_m) > SLACK_M for rise_m, _, _ in rises)
        if worst_m > SLACK_M or deepest or zero:
            raise _build_outlier_error(network, elevations_m, index, other)


def _iterate_rises(
    network: Network, elevations_m: Sequence[float]
) -> Iterator[tuple[int, list[tuple[float, float, int]]]]:
    """Yield each pylon with its neighbours on the line: its height over each, the distance, and the neighbour."""
    beside: dict[int, list[tuple[float, float, int]]] = {}
    for segment, length_m in zip(network.segments, network.lengths_m.tolist(), strict=True):
        for one, other in ((segment.a, segment.b), (segment.b, segment.a)):
            beside.setdefault(one, []).append((elevations_m[one] - elevations_m[other], length_m, other))
    # Zeros first: of a zero and its neighbours, the zero is wrong.
    yield from sorted(beside.items(), key=lambda item: (elevations_m[item[0]] != 0.0, item[0]))


def _build_outlier_error(network: Network, elevations_m: Sequence[float], index: int, other: int) -> NetworkError:
    # Of two inconsistent neighbours, the one farther from all others' median is the suspect.
    middle_m = median(elevations_m)
    named, beside = sorted((index, other), key=lambda pylon: -abs(elevations_m[pylon] - middle_m))
    return NetworkError(
        f"{network.source}: pylon {network.pylons[named].id!r}: elevation_m: expected the ground above sea level in "
        f"metres, got {elevations_m[named]:g} beside pylon {network.pylons[beside].id!r} at {elevations_m[beside]:g}"
    )


def _check_depot_height(network: Network) -> Iterator[str]:
    distances_m = [math.hypot(*place_m) for place_m in network.positions_m.tolist()]
    nearest = min(range(len(distances_m)), key=distances_m.__getitem__)
    pylon, away_m = network.pylons[nearest], distances_m[nearest]
    off_m = abs((pylon.elevation_m or 0.0) - network.frame.alt_m)
    words = (
        f"the depot is at {network.frame.alt_m:g} m, the ground of pylon {pylon.id!r}, {away_m:.0f} m away, at "
        f"{pylon.elevation_m:g} m"
    )
    if off_m > SLACK_M + STEEPEST * away_m:
        raise NetworkError(
            f"{network.source}: depot: alt_m: expected metres above sea level as elevation_m of the pylons, but {words}"
        )
    if off_m > SLACK_M + STEEP * away_m:
        yield f"{words}: are both in metres above sea level?"


def _check_third_coordinates(network: Network) -> None:
    known = [(pylon, pylon.third_m) for pylon in network.pylons if pylon.third_m]
    for pylon, third_m in known:
        if network.flat or pylon.elevation_m is None or pylon.height_m is None:
            continue
        if not -DATUM_M <= third_m - pylon.elevation_m <= pylon.height_m + DATUM_M:
            raise NetworkError(
                f"{network.source}: pylon {pylon.id!r}: elevation_m: expected the ground above sea level in metres, "
                f"got {pylon.elevation_m:g}, but the third coordinate of its position is {third_m:g}"
            )
    if network.flat and known:
        (low, low_m), (high, high_m) = min(known, key=lambda pair: pair[1]), max(known, key=lambda pair: pair[1])
        # Wires and tops differ by a structure's height; more than that is rising ground.
        if high_m - low_m > TALL_M:
            raise NetworkError(
                f"{network.source}: third coordinates: expected none that contradict {CLAIM}, got {low_m:g} at pylon "
                f"{low.id!r} and {high_m:g} at pylon {high.id!r}"
            )


def add_ground_heights(network: Network, elevation: Elevation, *, depot_known: bool) -> tuple[Network, tuple[str, ...]]:
    """Return a network with ground heights for all pylons: their file's, else the raster's; and findings.

    Args:
        network: As read.
        elevation: The raster.
        depot_known: Whether the height of its depot is known; else it is taken from the raster.

    Raises:
        ElevationError: the raster does not cover a pylon, or the depot.
        NetworkError: its heights contradict the raster's: one line with the pylon's name.
    """
    places_m = np.concatenate((network.positions_m, np.zeros((1, 2))))
    ground_m = elevation.interpolate_m(places_m)
    unknown = np.flatnonzero(np.isnan(ground_m))
    if len(unknown):
        raise build_unknown_ground_error(elevation, places_m[unknown[0]], network.frame, network)
    found = []
    frame, depot_m = network.frame, float(ground_m[-1])
    if not depot_known:
        frame = LocalFrame(frame.lat_deg, frame.lon_deg, round(depot_m, 1))
        found.append(f"the depot's height is that of {elevation.source}, {frame.alt_m:.1f} m")
    allowed_m = elevation.highest_m(places_m) - elevation.lowest_m(places_m)
    if depot_known:
        off_m = frame.alt_m - depot_m
        words = f"{frame.alt_m:g} m, where {elevation.source} has {depot_m:.1f} m"
        if abs(off_m) > _gross_error_m(elevation) + allowed_m[-1]:
            raise NetworkError(f"{network.source}: depot: alt_m: expected the ground above mean sea level, got {words}")
        if abs(off_m) > _odd_error_m(elevation) + allowed_m[-1]:
            found.append(f"the depot is given at {words}")
    found += _compare_elevations(network, elevation, ground_m[:-1], allowed_m[:-1])
    pylons = tuple(
        pylon if pylon.elevation_m is not None else replace(pylon, elevation_m=round(raster_m, 1))
        for pylon, raster_m in zip(network.pylons, ground_m[:-1].tolist(), strict=True)
    )
    filled = sum(pylon.elevation_m is None for pylon in network.pylons)
    if filled:
        found.append(f"the ground of {filled} of {len(pylons)} pylons is that of {elevation.source}")
    return replace(network, pylons=pylons, frame=frame, flat=False), tuple(found)


def add_structure_heights(network: Network, pylon_height_m: float | None) -> Network:
    """Return a network whose pylons without a height in the file get the given one."""
    if pylon_height_m is None:
        return network
    pylons = tuple(
        pylon if pylon.height_m is not None else replace(pylon, height_m=pylon_height_m) for pylon in network.pylons
    )
    return replace(network, pylons=pylons)


def _gross_error_m(elevation: Elevation) -> float:
    return GROSS * elevation.uncertainty_m + GROSS_M


def _odd_error_m(elevation: Elevation) -> float:
    return ODD * elevation.uncertainty_m + ODD_M


def _compare_elevations(
    network: Network, elevation: Elevation, ground_m: FloatArray, allowed_m: FloatArray
) -> list[str]:
    """Return messages on how known elevations and the raster differ.

    Raises:
        NetworkError: all of them differ, or one differs enough that one of the two is wrong.
    """
    known = [(index, pylon, pylon.elevation_m) for index, pylon in enumerate(network.pylons)
             if pylon.elevation_m is not None]  # fmt: skip
    if not known:
        return []
    offs_m = np.array([elevation_m - ground_m[index] for index, _, elevation_m in known])
    middle_m = median(offs_m.tolist())
    if len(known) >= ALL_FROM and abs(middle_m) > elevation.uncertainty_m + ALL_M:
        side = "above" if middle_m > 0 else "below"
        raise NetworkError(
            f"{_describe_gross_error(network, known[0][1], ground_m[known[0][0]], elevation)}: half of all pylons "
            f"are more than "
            f"{abs(middle_m):.0f} m {side} it: are they counted from something else (the ellipsoid, feet, tops), or is "
            "the raster?"
        )
    over_m = np.abs(offs_m) - allowed_m[[index for index, _, _ in known]]
    worst = int(over_m.argmax())
    if over_m[worst] > _gross_error_m(elevation):
        index, pylon, _ = known[worst]
        raise NetworkError(
            f"{_describe_gross_error(network, pylon, ground_m[index], elevation)}: {abs(offs_m[worst]):.0f} m apart"
        )
    odd = np.flatnonzero(over_m > _odd_error_m(elevation))
    if not len(odd):
        return []
    index, pylon, elevation_m = known[worst]
    more = f", and {len(odd) - 1} more pylons are as far off" if len(odd) > 1 else ""
    by_raster = f"{elevation.source} has {ground_m[index]:.1f} m"
    return [f"pylon {pylon.id!r} stands at {elevation_m:g} m by its file, {by_raster}{more}"]


def _describe_gross_error(network: Network, pylon: Pylon, ground_m: float, elevation: Elevation) -> str:
    return (
        f"{network.source}: pylon {pylon.id!r}: elevation_m: expected the ground above mean sea level, "
        f"{ground_m:.0f} m by {elevation.source}, got {pylon.elevation_m:g}"
    )
