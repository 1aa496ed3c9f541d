"""Compute a flight's height profile: height over distance flown, and the ground below where a raster covers it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from missions import FlightPath, FlightSetup, Phase
from missions.geo import FloatArray
from missions.geometry import sample_leg
from missions.terrain import Terrain
from missions.waypoints import legs_m

STEP_M = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class HeightProfile:
    """Heights above mean sea level along the flown path."""

    vehicle: str
    along_m: FloatArray
    """(m,) float64: distance flown over the ground, ascending."""
    flown_m: FloatArray
    """(m,) float64: height flown."""
    inspecting: FloatArray
    """(m,) float64: 1 on inspections, 0 elsewhere."""
    ground_m: FloatArray
    """(m,) float64: ground height from the raster; NaN where unknown."""
    most_m: FloatArray
    """(m,) float64: highest cells nearby, plus the raster's uncertainty."""
    least_m: FloatArray
    """(m,) float64: least height of a leg: that plus the margin."""
    return_m: float
    """RTL height."""
    waypoints_m: FloatArray
    """(w, 2) float64: distance flown, and height."""

    @property
    def lowest_point(self) -> tuple[float, float, float]:
        """Distance flown, height and clearance at the point of least clearance, between take-off and landing."""
        level = np.flatnonzero((self.along_m > 0) & (self.along_m < self.along_m[-1]))
        over_m = (self.flown_m - self.ground_m)[level]
        if not len(level) or np.isnan(over_m).all():
            return 0.0, float(self.flown_m[0]), math.nan
        index = int(level[np.nanargmin(over_m)])
        return float(self.along_m[index]), float(self.flown_m[index]), float(self.flown_m[index] - self.ground_m[index])


def build_profiles(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[HeightProfile]:
    """Return the height profile of each flight over a raster's ground; none without a raster."""
    if setup.terrain is None:
        return []
    return [_build_profile(setup, setup.terrain, path) for path in paths if path.waypoints]


def _build_profile(setup: FlightSetup, terrain: Terrain, path: FlightPath) -> HeightProfile:
    pad = setup.pad_of(path.vehicle)
    pieces, phases, along, stops = [], [], [np.zeros(1)], []
    legs = legs_m(path, setup.frame, setup.frame.up_m(pad.alt_m))
    for leg, point in zip(legs, path.waypoints, strict=True):
        piece = sample_leg(leg, STEP_M)
        pieces.append(piece)
        phases.append(np.full(len(piece), float(point.phase is Phase.INSPECT)))
        along.append(along[-1][-1] + np.hypot(*(piece - piece[0]).T[:2]))
        stops.append((along[-1][-1], float(leg[1, 2]) + setup.frame.alt_m))
    places = np.concatenate(pieces)
    known = terrain.elevation
    return HeightProfile(
        vehicle=path.vehicle,
        along_m=np.concatenate(along[1:]),
        flown_m=places[:, 2] + setup.frame.alt_m,
        inspecting=np.concatenate(phases),
        ground_m=known.interpolate_m(places[:, :2]),
        most_m=known.highest_m(places[:, :2]) + known.uncertainty_m,
        least_m=known.highest_m(places[:, :2]) + terrain.kept_m,
        return_m=setup.return_height_m(path.vehicle) + pad.alt_m,
        waypoints_m=np.array(stops),
    )
