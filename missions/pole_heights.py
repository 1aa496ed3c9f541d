"""Poles on ground that a raster knows: what the network's file does not say of their heights, and what contradicts."""

from __future__ import annotations

from dataclasses import replace
from statistics import median

import numpy as np

from missions.elevation import Elevation
from missions.errors import NetworkError
from missions.geo import FloatArray, LocalFrame
from missions.network import Network, Pylon
from missions.terrain import build_unknown_ground_error

GROSS = 3.0
"""Times the raster's uncertainty, and `GROSS_M`: a pylon farther than this from the raster's ground is wrong."""
GROSS_M = 30.0
ODD = 1.5
"""Times its uncertainty, and `ODD_M`: more than this is worth a look."""
ODD_M = 5.0
ALL_M = 12.0
"""Beside its uncertainty: all pylons together farther than this over or under it are counted from something else."""
ALL_FROM = 3
"""Pylons from which on this is looked for."""


def add_ground_heights(network: Network, elevation: Elevation, *, depot_known: bool) -> tuple[Network, tuple[str, ...]]:
    """Return a network whose pylons all have a ground: their file's, else the raster's; and what is worth a look.

    Args:
        network: As it was read.
        elevation: The raster.
        depot_known: Whether the height of its depot is known; else it is the raster's.

    Raises:
        ElevationError: the raster does not know the ground of a pylon, or of the depot.
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
            found.append(f"the depot is said to be at {words}")
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
    """Return a network whose pylons have the height that somebody says of all that have none in the file."""
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
    """Return in words how known elevations and the raster differ.

    Raises:
        NetworkError: all of them do, or one by so much that one of the two is wrong.
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
