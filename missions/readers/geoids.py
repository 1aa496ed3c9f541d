"""Heights over the ellipsoid to heights above mean sea level, where PROJ has a geoid on this computer."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
from pyproj.exceptions import ProjError

from missions.errors import ElevationError
from missions.geo import FloatArray, LocalFrame
from missions.terrain import Heights, Tile

GRIDS = ("us_nga_egm96_15.tif", "egm96_15.gtx", "us_nga_egm08_25.tif", "egm08_25.gtx")
"""The geoids that heights are converted by; the first that is there."""


def convert_to_sea_level(path: Path, tile: Tile, frame: LocalFrame) -> tuple[Tile, float]:
    """Return a tile whose heights were counted from the ellipsoid, and by how much it may be off for it.

    The geoid is even over kilometres: between the lattice's nodes it is a curved plane, whose largest error is told.

    Raises:
        ElevationError: there is no geoid here, and nothing is fetched.
    """
    easts, norths = (tile.low_m[axis] + tile.step_m * np.arange(tile.lattice.shape[axis]) for axis in (0, 1))
    nodes_m = np.stack(np.meshgrid(easts, norths, indexing="ij"), axis=-1).reshape(-1, 2)
    geoid_m = _undulations_m(path, frame.many_to_wgs84_deg(nodes_m))
    at = tile.lattice.reshape(-1, 2)
    rows, columns = tile.heights_m.shape
    design = np.column_stack((np.ones(len(at)), at, at**2, at.prod(axis=1)))
    scale = np.abs(design).max(axis=0)
    terms = np.linalg.lstsq(design / scale, geoid_m, rcond=None)[0] / scale
    off_m = float(np.abs(design @ terms - geoid_m).max())
    r, c = np.arange(rows)[:, np.newaxis], np.arange(columns)[np.newaxis]
    over_m = terms[0] + terms[1] * r + terms[2] * c + terms[3] * r**2 + terms[4] * c**2 + terms[5] * r * c
    same = tile.highest_m is tile.heights_m
    heights_m = _subtract_geoid(tile.heights_m, over_m)
    highest_m = heights_m if same else _subtract_geoid(tile.highest_m, over_m)
    return replace(tile, heights_m=heights_m, highest_m=highest_m), off_m


def _subtract_geoid(heights_m: Heights, over_m: FloatArray) -> Heights:
    return np.asarray(np.ceil((heights_m - over_m) * 10.0) / 10.0, dtype=np.float32)


def _undulations_m(path: Path, places_deg: FloatArray) -> FloatArray:
    """Return (m,) heights of the geoid over the ellipsoid at (m, 2) latitudes and longitudes."""
    for grid in GRIDS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                shift = pyproj.Transformer.from_pipeline(
                    "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
                    f"+step +proj=vgridshift +grids={grid} +multiplier=1"
                )
                up_m = shift.transform(places_deg[:, 1], places_deg[:, 0], np.zeros(len(places_deg)))[2]
        except ProjError:
            continue
        if np.isfinite(up_m).all():
            return np.asarray(up_m, dtype=np.float64)
    raise ElevationError(
        f"{path}: vertical: expected heights above mean sea level, but these are over the ellipsoid, and no geoid to "
        f"convert them by is installed: `pyproj sync --file {GRIDS[0]}` brings it where there is a network"
    )
