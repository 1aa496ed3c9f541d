"""The bases of a site: where vehicles stand in the morning. Without any the depot is the only one."""

from __future__ import annotations

import math

import numpy as np

from executor.site.site_file import Site
from executor.site.tables.day_tables import BaseTable
from missions import BasePlace, LocalFrame, Network, Pad
from missions.terrain import Terrain

DEPOT = "depot"
"""The only base of a site that names none."""
AT_DEPOT_M = 50.0
"""A base nearer to the depot than this is the depot."""


def base_tables(site: Site, frame: LocalFrame) -> tuple[BaseTable, ...]:
    """Return the bases of a site; the depot where it names none."""
    everybody = tuple(one.name for one in site.vehicle)
    depot = BaseTable(
        name=DEPOT, lat_deg=frame.lat_deg, lon_deg=frame.lon_deg, alt_m=frame.alt_m, vehicles=everybody
    )  # fmt: skip
    return site.base or (depot,)


def base_place(network: Network, base: BaseTable, terrain: Terrain | None = None) -> BasePlace:
    """Return where a base is, its height taken from the raster, or the nearest pylon, where nobody says it."""
    alt_m, at_m = base.alt_m, np.array(network.frame.to_local_m(base.lat_deg, base.lon_deg))
    if terrain is not None:
        alt_m = float(terrain.elevation.interpolate_m(at_m[np.newaxis])[0].round(1))
    elif alt_m is None:
        ends_m = network.ends_m.reshape(-1, 2)
        nearest = int(np.hypot(*(ends_m - at_m).T).argmin())
        segment = network.segments[nearest // 2]
        elevation_m = network.pylons[segment.b if nearest % 2 else segment.a].elevation_m
        alt_m = network.frame.alt_m if elevation_m is None else elevation_m
    return BasePlace(base.name, base.lat_deg, base.lon_deg, alt_m)


def base_places_m(site: Site, frame: LocalFrame) -> dict[str, tuple[float, float]]:
    """Return where the base of each vehicle is, local east and north, by the vehicle's name; of none without bases."""
    return {name: frame.to_local_m(base.lat_deg, base.lon_deg) for base in site.base for name in base.vehicles}


def find_base_pads(site: Site, network: Network) -> dict[str, Pad]:
    """Return around which place those stand, by name, whose base is not the depot."""
    return {
        name: Pad(name, *at_m, base_place(network, base).alt_m)
        for base in site.base
        if math.hypot(*(at_m := network.frame.to_local_m(base.lat_deg, base.lon_deg))) > AT_DEPOT_M
        for name in base.vehicles
    }
