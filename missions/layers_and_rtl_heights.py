"""Compute the height layers of a fleet, and each vehicle's RTL height."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from missions.errors import SafetyError
from missions.geo import FloatArray
from missions.inspection_defaults import Inspection
from missions.network import Network
from missions.surface import (
    Relief,
    Surface,
    SurfaceFit,
    build_flat_surface,
    build_relief,
    fit_overland_surface,
    fit_surface,
)
from missions.terrain import KnownGround, Terrain, build_known_ground

FLAT_M = 1.0
"""Relief below which ground is flat; autopilots hold their height to half of it."""
NOWHERE = np.zeros((0, 2))
WHOLE_METRE_M = 1.0
"""Step of RTL heights; some autopilots take whole metres only."""
HEIGHT_KEEPING_M = 1.0
"""Height error of two vehicles in level flight; PX4 and ArduPilot SITL stay within 0.5 m each."""


class HeightReference(Enum):
    """Reference of the inspection height; the value is for display."""

    PYLON_TOPS = "the pylon tops"
    DEPOT_GROUND = "the depot's ground"


@dataclass(frozen=True, slots=True, eq=False)
class Layers:
    """Heights of every vehicle over every place: a common surface, and a fixed step up for each next vehicle.

    All flight over the ground, transit, inspection and return, uses these heights, so two vehicles over the same place
    are one or more steps apart.
    """

    vehicles: tuple[str, ...]
    """Names, from the lowest layer to the highest."""
    layer_m: float
    """Least distance between any two vehicles."""
    spacing_m: float
    """Step between neighbouring layers: ``layer_m`` plus allowances for slopes, crossing lines and autopilots."""
    tolerance_m: float
    """Deviation of transits from their surface."""
    reference: HeightReference
    surface: Surface
    """Surface of the lowest layer, above the depot's ground."""
    track_heights_m: FloatArray
    """(n, 2) float64: heights of the lowest layer at each segment's a and b."""
    relief: Relief | None
    """Surface for pricing, with terrain data."""
    known: KnownGround | None
    """Ground between lines and pads, with terrain data."""
    raised_m: FloatArray
    """(p,) float64: increase of each pylon's passing height because of nearby ground; empty without terrain data."""

    def offset_m(self, vehicle: str) -> float:
        """Return a vehicle's height above the lowest layer.

        Raises:
            SafetyError: the vehicle has no layer.
        """
        if vehicle not in self.vehicles:
            raise SafetyError(f"vehicle {vehicle!r}: expected one of {', '.join(self.vehicles)}")
        return self.vehicles.index(vehicle) * self.spacing_m

    def height_m(self, vehicle: str, east_m: float, north_m: float) -> float:
        """Return a vehicle's flight height over a place, above the depot's ground."""
        return self.surface.height_m(east_m, north_m) + self.offset_m(vehicle)

    @property
    def returns_in_layers(self) -> bool:
        """Whether RTL is flown in the vehicles' own layers, and not above all of them."""
        relief_m = float(self.track_heights_m.max()) - float(self.track_heights_m.min())
        return self.surface.floor is None and relief_m <= FLAT_M

    def return_up_m(self, vehicle: str) -> float:
        """Return a vehicle's RTL height over the depot's ground; RTL is straight and level.

        Over flat ground that is its own layer. Where the layers rise and fall with the ground, a level flight would
        cross other vehicles' layers. The highest vehicle has none above it: it returns at the top of its own layer. The
        others are stacked above that, the lowest on top, at the smallest spacing allowed for level flights: any other
        order makes the stack higher, and it must stay below the ceiling.

        Raises:
            SafetyError: the vehicle has no layer.
        """
        highest_m, offset_m = float(self.track_heights_m.max()), self.offset_m(vehicle)
        if self.surface.floor is not None:
            # Above every ridge between the lines and the pads, like all other flights.
            highest_m = max(highest_m, float(self.surface.floor.heights_m.max()))
        elif self.returns_in_layers:
            return highest_m + offset_m
        above = len(self.vehicles) - 1 - self.vehicles.index(vehicle)
        step_m = self.layer_m + HEIGHT_KEEPING_M + WHOLE_METRE_M
        return highest_m + self.offset_m(self.vehicles[-1]) + above * step_m


def tracks_m(network: Network, standoff_m: float) -> FloatArray:
    """Return (n, 2, 2) float64: east and north of both ends of every inspection leg.

    The leg is parallel to its segment, ``standoff_m`` to the right of the direction from a to b, in both directions
    of flight: a segment has one track.
    """
    ends_m = network.ends_m
    along = ends_m[:, 1] - ends_m[:, 0]
    right = np.column_stack((along[:, 1], -along[:, 0])) / network.lengths_m[:, np.newaxis]
    return np.asarray(ends_m + standoff_m * right[:, np.newaxis], dtype=np.float64)


def plan_layers(
    network: Network,
    vehicles: Sequence[str],
    inspection: Inspection,
    *,
    terrain: Terrain | None = None,
    turns_m: FloatArray = NOWHERE,
) -> Layers:
    """Return the layers of a fleet over a network.

    Args:
        network: If ground and structure height of all its pylons are known, heights refer to the pylon tops, otherwise
            to the depot's ground.
        vehicles: Names, from the lowest layer to the highest.
        inspection: Heights and distances.
        terrain: The ground covered by a raster; without it only that of the pylons is known.
        turns_m: (m, 2) float64, with terrain only: places where legs begin, end or turn off the lines, at pads and at
            the corners of obstacles.

    Raises:
        ElevationError: a part of the ground is not known.
    """
    height_m, layer_m = inspection.height_m, inspection.layer_m
    tracks, known, relief = tracks_m(network, inspection.standoff_m), None, None
    tops = terrain is not None or network.has_heights
    tops_m = [(pylon.elevation_m or 0.0) + (pylon.height_m or 0.0) - network.frame.alt_m for pylon in network.pylons]
    asked_m = pylon_m = (np.array(tops_m) if tops else np.zeros(len(tops_m))) + height_m
    indices = np.array([(segment.a, segment.b) for segment in network.segments], dtype=np.intp)
    if terrain is not None:
        places_m = np.concatenate((tracks.reshape(-1, 2), turns_m))
        known = build_known_ground(terrain, places_m, network.frame, network)
        fit, pylon_m = fit_overland_surface(known, inspection, len(vehicles), tracks, asked_m, indices)
        relief = build_relief(fit.surface, known.corners_m.min(axis=0), known.corners_m.max(axis=0))
    elif tops:
        fit = fit_surface(tracks, asked_m[indices], layer_m)
    else:
        fit = SurfaceFit(build_flat_surface(height_m), 0.0, layer_m)
    return Layers(
        vehicles=tuple(vehicles),
        layer_m=layer_m,
        spacing_m=fit.spacing_m + HEIGHT_KEEPING_M,
        tolerance_m=fit.tolerance_m,
        reference=HeightReference.PYLON_TOPS if tops else HeightReference.DEPOT_GROUND,
        surface=fit.surface,
        track_heights_m=pylon_m[indices],
        relief=relief,
        known=known,
        raised_m=np.zeros(0) if known is None else pylon_m - asked_m,
    )
