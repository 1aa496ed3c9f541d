"""The common surface over ground that a raster knows, and the lines that are flown higher for what stands beside them.

The steeper the surface may be, the less a slope beside a line lifts the line's inspection, and the farther apart the
layers must be. Chosen is the slope at which vehicles are the least above what was asked, in the mean of all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from missions.geo import FloatArray, IndexArray
from missions.grids import Grid
from missions.network import Network
from missions.surface import CHECK_OVER_M, CHECK_STEP_M, MAX_CHECKS, SurfaceFit, iterate_surfaces, sample_tracks
from missions.terrain import KnownGround

FOLLOW_OVER_M = 2.0
"""Legs over uneven ground keep this near to the surface: nearer ones need more waypoints than autopilots hold."""
SLOPES_OVER = (0.12, 0.2, 0.3, 0.45, 0.7, 1.0)
STEEPER = 1.42
"""Between the nodes of a grid, where two cones meet, it is steeper than they are by up to this."""
TRIES = 4
SLACK_M = 1.0
"""Below the ceiling."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceRequirements:
    """What flights over the ground must hold."""

    kept_m: float
    """Over the ground."""
    ceiling_m: float
    """Over the ground, of the highest layer."""
    layer_m: float
    vehicles: int


@dataclass(frozen=True, slots=True, eq=False)
class OverlandSurface:
    """A surface over lines and ground."""

    fit: SurfaceFit
    pylon_m: FloatArray
    """(p,) float64: the heights over the depot at which the lowest vehicle passes each pylon."""
    tolerance_m: float
    """Legs off the lines keep this near to the surface."""


def fit_overland_surface(
    known: KnownGround, wishes: SurfaceRequirements, network: Network, tracks_m: FloatArray, pylon_m: FloatArray
) -> OverlandSurface:
    """Return the surface over lines and ground.

    Args:
        known: The ground.
        wishes: What must be held.
        network: The lines.
        tracks_m: (n, 2, 2) both ends of every inspection leg.
        pylon_m: (p,) heights over the depot that are asked for at the pylons.
    """
    ends = np.array([(segment.a, segment.b) for segment in network.segments], dtype=np.intp)
    errors_m = {surface.slope: error_m for surface, error_m in iterate_surfaces(tracks_m, pylon_m[ends], SLOPES_OVER)}
    lengths_m = np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T)
    best: tuple[float, float] | None = None
    for slope in SLOPES_OVER:
        off_m = _floor_error_m(errors_m[slope], slope)
        lifts_m = _lifts_m(known.build_floor(wishes.kept_m + off_m, slope), tracks_m, pylon_m, ends)
        lifted_m = float((lifts_m[ends].mean(axis=1) * lengths_m).sum() / lengths_m.sum())
        over_m = lifted_m + 0.5 * wishes.vehicles * _spacing_m(wishes.layer_m, STEEPER * slope, off_m)
        if best is None or over_m < best[0]:
            best = over_m, slope
    slope = best[1] if best is not None else SLOPES_OVER[0]
    return _fit_slope(known, wishes, tracks_m, pylon_m, ends, slope, errors_m[slope])


def _fit_slope(
    known: KnownGround, wishes: SurfaceRequirements, tracks_m: FloatArray, asked_m: FloatArray, ends: IndexArray,
    slope: float,
    error_m: float,
) -> OverlandSurface:  # fmt: skip
    """Return the surface of a slope; lifted lines may fit it worse than they did, which the floor must know."""
    lengths_m = np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T)
    step_m = max(CHECK_STEP_M, float(lengths_m.sum()) / MAX_CHECKS)
    for _ in range(TRIES):
        off_m = _floor_error_m(error_m, slope)
        floor = known.build_floor(wishes.kept_m + off_m, slope)
        pylon_m = asked_m + _lifts_m(floor, tracks_m, asked_m, ends)
        stack_m = (wishes.vehicles - 1) * _spacing_m(wishes.layer_m, STEEPER * slope, off_m)
        roof = known.build_roof(max(wishes.kept_m + off_m, wishes.ceiling_m - stack_m - off_m - SLACK_M), slope)
        surface = replace(next(iterate_surfaces(tracks_m, pylon_m[ends], (slope,)))[0], floor=floor, roof=roof)
        places = sample_tracks(tracks_m, pylon_m[ends], step_m)
        fitted_m = float(np.abs(surface.interpolate_m(places[:, :2]) - places[:, 2]).max())
        if fitted_m <= max(error_m, FOLLOW_OVER_M):
            break
        error_m = fitted_m
    steepest = max(slope, floor.slope, roof.slope)
    tolerance_m = max(FOLLOW_OVER_M, fitted_m)
    spacing_m = _spacing_m(wishes.layer_m, steepest, tolerance_m + steepest * CHECK_OVER_M)
    return OverlandSurface(SurfaceFit(surface, fitted_m, spacing_m), pylon_m, tolerance_m)


def _floor_error_m(error_m: float, slope: float) -> float:
    return max(FOLLOW_OVER_M, error_m) + STEEPER * slope * CHECK_OVER_M


def _spacing_m(layer_m: float, slope: float, off_m: float) -> float:
    """Return how far apart layers must be, as `surface.fit` has it."""
    return layer_m * math.hypot(1.0, slope) + 2.0 * off_m


def _lifts_m(floor: Grid, tracks_m: FloatArray, pylon_m: FloatArray, ends: IndexArray) -> FloatArray:
    """Return (p,) how much higher pylons must be passed so that no inspection is below the floor."""
    lifts_m = np.zeros(len(pylon_m))
    # The ends first: a slope beside the line's end then lifts that end alone.
    for shares in (np.array([0.0, 1.0]), None):
        shorts_m = _shortfalls_m(floor, tracks_m, (pylon_m + lifts_m)[ends], shares)
        more_m = np.zeros(len(pylon_m))
        for side in (0, 1):
            own_m = shorts_m[:, side] if shares is not None else shorts_m.max(axis=1)
            np.maximum.at(more_m, ends[:, side], own_m)
        lifts_m += more_m
    return lifts_m


def _shortfalls_m(floor: Grid, tracks_m: FloatArray, heights_m: FloatArray, shares: FloatArray | None) -> FloatArray:
    """Return (n, k) by how much inspections are below the floor, 0 where they are not."""
    if shares is None:
        longest_m = float(np.hypot(*(tracks_m[:, 1] - tracks_m[:, 0]).T).max())
        step_m = max(CHECK_STEP_M, longest_m * len(tracks_m) / (25 * MAX_CHECKS))
        shares = np.linspace(0.0, 1.0, math.ceil(longest_m / step_m) + 1)
    places_m = tracks_m[:, :1] + shares[:, np.newaxis] * (tracks_m[:, 1:] - tracks_m[:, :1])
    flown_m = heights_m[:, :1] + shares * (heights_m[:, 1:] - heights_m[:, :1])
    under_m = floor.interpolate_m(places_m.reshape(-1, 2)).reshape(flown_m.shape) - flown_m
    return np.asarray(np.maximum(under_m, 0.0), dtype=np.float64)
