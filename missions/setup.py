"""Collect everything that turns a route into a flight: network, inspection settings, layers and pads.

Heights keep any two vehicles apart in every situation; the separation check for a set of paths is here, too.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from missions.cameras import NO_LOOKS, CameraTasks
from missions.detours import DetourObstacles
from missions.errors import SafetyError
from missions.flight_model import Base
from missions.geo import FloatArray, LocalFrame
from missions.geometry import leg_distances_m
from missions.inspection_defaults import Inspection
from missions.layers_and_rtl_heights import NOWHERE, Layers, plan_layers, tracks_m
from missions.line_heights import with_heights
from missions.network import Network
from missions.no_fly_areas import Area, AreaRestriction, Unreachable
from missions.pads import Pad, column_radius_m, place_pads
from missions.shortest_ways import Obstacle, build_area_graph, build_obstacle
from missions.terrain import DETOUR_M, Terrain, around_bases_m
from missions.waypoints import FlightPath, legs_m

LOWEST_FLIGHT_M = 5.0
"""Lowest flight height over a pad; a lower one means that the lines lie far below the depot, and is refused."""


@dataclass(frozen=True, slots=True, eq=False)
class FlightSetup:
    """Data that turns routes into flights; built once before take-off and kept through every re-plan."""

    network: Network
    inspection: Inspection
    layers: Layers
    pads: tuple[Pad, ...]
    """In the order of the layers' vehicles."""
    tracks_m: FloatArray
    """(n, 2, 2) float64: east and north of both ends of every inspection leg."""
    areas: tuple[Area, ...] = ()
    """Areas that flights avoid, or stay low in."""
    kept_out: tuple[AreaRestriction, ...] = ()
    """Those areas that at least one vehicle must lead around, see `area_rules.apply_areas`."""
    unreachable: tuple[Unreachable, ...] = ()
    """Segments that no flight can inspect because of the areas."""
    alternates: tuple[str, ...] = ()
    """Names of alternate landing places for a vehicle that does not return."""
    terrain: Terrain | None = None
    """The ground, where covered by a raster."""
    closed: Mapping[str, tuple[Obstacle, ...]] = field(default_factory=dict)
    """By vehicle name: other vehicles' parts of the line that its paths avoid for now."""
    looks: CameraTasks = NO_LOOKS
    """Camera tasks, and the vehicles that have the cameras for them."""
    day_pads: tuple[Pad, ...] = ()
    """All pads of the vehicles that land at several bases in a day: one per vehicle and base, so that no two vehicles
    share a pad."""
    landings: Mapping[str, Pad] = field(default_factory=dict)
    """By vehicle name: landing pad, if it differs from the take-off pad."""

    def __post_init__(self) -> None:
        """Check that the parts are consistent.

        Raises:
            SafetyError: pads and layers name different vehicles, or a pad lies above its flight height or in an area.
        """
        if tuple(pad.vehicle for pad in self.pads) != self.layers.vehicles:
            raise SafetyError(f"pads: expected one each for {', '.join(self.layers.vehicles)}, in that order")
        for pad in (*self.pads, *self.day_pads):
            over_pad_m = self.layers.height_m(pad.vehicle, pad.east_m, pad.north_m) - self.frame.up_m(pad.alt_m)
            if over_pad_m < LOWEST_FLIGHT_M:
                raise SafetyError(
                    f"inspection.height_m: expected flight heights of {LOWEST_FLIGHT_M:g} m or more over the pad of "
                    f"{pad.vehicle}, got {over_pad_m:.1f} m: the lines lie below it, or one of the heights above sea "
                    f"level is wrong: depot.alt_m {self.frame.alt_m:g}, the pad {pad.alt_m:.0f}"
                )

        for pad in (*self.pads, *self.day_pads):
            for area in self.areas_at(pad.vehicle, (pad.east_m, pad.north_m)):
                raise SafetyError(
                    f"pad of {pad.vehicle}: expected {area.margin_m:g} m or more outside of area {area.name!r}, got a "
                    "place in it"
                )

    @property
    def frame(self) -> LocalFrame:
        """Local metres about the depot."""
        return self.network.frame

    @property
    def home_alt_m(self) -> dict[str, float]:
        """Height above mean sea level of each vehicle's home, by name."""
        return {pad.vehicle: pad.alt_m for pad in self.pads}

    def pad_of(self, vehicle: str) -> Pad:
        """Return a vehicle's take-off pad: its home, to which its heights are relative.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        for pad in self.pads:
            if pad.vehicle == vehicle:
                return pad
        raise SafetyError(f"vehicle {vehicle!r}: expected one of {', '.join(self.layers.vehicles)}")

    def landing_pad_of(self, vehicle: str) -> Pad:
        """Return the pad at the end of a vehicle's mission.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        return self.landings.get(vehicle) or self.pad_of(vehicle)

    def list_pads_of(self, vehicle: str) -> tuple[Pad, ...]:
        """Return all pads of a vehicle, the take-off pad first: its RTL may end on any of them.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        others = (pad for pad in self.day_pads if pad.vehicle == vehicle)
        return tuple(dict.fromkeys((self.pad_of(vehicle), *others)))

    @property
    def tracks_up_m(self) -> FloatArray:
        """(n, 2, 3) float64: the same with up, in the lowest layer."""
        return np.concatenate((self.tracks_m, self.layers.track_heights_m[..., np.newaxis]), axis=2)

    def base_of(self, vehicle: str) -> Base:
        """Return the base where a vehicle lands and next takes off, as used in pricing.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        return self.base_at(self.landing_pad_of(vehicle))

    def base_at(self, pad: Pad) -> Base:
        """Return one of a vehicle's pads as used in pricing.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        up_m = self.layers.surface.height_m(pad.east_m, pad.north_m)
        climb_m = up_m + self.layers.offset_m(pad.vehicle) - self.frame.up_m(pad.alt_m)
        return Base((pad.east_m, pad.north_m, up_m), climb_m)

    def up_m(self, vehicle: str, alt_rel_m: float) -> float:
        """Return a vehicle's height over the depot's ground.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        return alt_rel_m + self.frame.up_m(self.pad_of(vehicle).alt_m)

    @property
    def steps_m(self) -> dict[str, float]:
        """Descent of each vehicle from its layer to the requested inspection height, by name; may be empty."""
        if not self.inspection.same_distance:
            return {}
        return {name: self.layers.offset_m(name) for name in self.layers.vehicles}

    def return_height_m(self, vehicle: str) -> float:
        """Return the RTL height over a vehicle's own home; RTL is straight and level.

        Raises:
            SafetyError: the fleet has no vehicle of this name.
        """
        return self.layers.return_up_m(vehicle) - self.frame.up_m(self.pad_of(vehicle).alt_m)

    def obstacles_for(self, vehicle: str) -> DetourObstacles:
        """Return the obstacles that a vehicle's paths lead around.

        Raises:
            SafetyError: there are areas, and the fleet has no vehicle of this name.
        """
        pads = (pad for pad in (*self.pads, *self.day_pads) if pad.vehicle != vehicle)
        others = tuple(dict.fromkeys((pad.east_m, pad.north_m) for pad in pads))
        areas = tuple(build_obstacle(one.area) for one in self.kept_out if vehicle in one.vehicles)
        areas += self.closed.get(vehicle, ())
        return DetourObstacles(others, column_radius_m(self.layers.layer_m), areas)

    def areas_at(self, vehicle: str, place_m: tuple[float, float]) -> list[Area]:
        """Return the areas that a vehicle must avoid and whose margin contains a place, given as east and north."""
        areas, place = [one.area for one in self.kept_out if vehicle in one.vehicles], np.array([place_m])
        return [area for area in areas if build_area_graph(area).is_inside(place)[0]]


def plan_flight_setup(
    network: Network,
    vehicles: Sequence[str],
    inspection: Inspection,
    *,
    pads: Sequence[Pad] | None = None,
    stated: Sequence[Pad] = (),
    areas: Sequence[Area] = (),
    terrain: Terrain | None = None,
    bases: Mapping[str, Pad] = MappingProxyType({}),
) -> FlightSetup:
    """Choose layers for a fleet over a network, and pads unless given.

    Args:
        network: The part to inspect.
        vehicles: Names, from the lowest layer to the highest.
        inspection: Heights, speeds and distances.
        pads: Actual pads, once known; otherwise they are placed around the depot and the bases.
        stated: Fixed pads of some vehicles.
        areas: Areas without pads; `area_rules.apply_areas` keeps flights out of them.
        terrain: The ground, where covered by a raster; all pylon heights must then be known.
        bases: By vehicle name: the base of each vehicle that does not stand at the depot.

    Raises:
        ElevationError: a part of the ground between lines and pads is not known.
        NetworkError: the heights of some pylons are not known, and the ground is not declared flat.
        SafetyError: there is no room for the pads, or heights are below the depot's ground.
    """
    network = with_heights(network, flat=inspection.flat)
    tracks = tracks_m(network, inspection.standoff_m)
    turns_m = NOWHERE
    if terrain is not None:
        # Paths begin, end or turn within this box; areas farther away do not matter.
        low_m, high_m = tracks.min(axis=(0, 1)) - DETOUR_M, tracks.max(axis=(0, 1)) + DETOUR_M
        corners_m = build_area_graph(*areas).nodes_m
        near_m = corners_m[((corners_m >= low_m) & (corners_m <= high_m)).all(axis=1)]
        stands_m = np.array([(pad.east_m, pad.north_m) for pad in pads or stated], dtype=np.float64).reshape(-1, 2)
        around_m = around_bases_m({(base.east_m, base.north_m) for base in bases.values()})
        turns_m = np.concatenate((stands_m, around_m, near_m))
    layers = plan_layers(network, vehicles, inspection, terrain=terrain, turns_m=turns_m)
    if pads is None:
        pads = place_pads(
            vehicles,
            tracks,
            layer_m=inspection.layer_m,
            alt_m=network.frame.alt_m,
            stated=stated,
            areas=areas,
            bases=bases,
        )
        if terrain is not None:
            pads = put_pads_on_ground(pads, terrain)
    return FlightSetup(network, inspection, layers, tuple(pads), tracks, terrain=terrain)


def put_pads_on_ground(pads: Sequence[Pad], terrain: Terrain) -> tuple[Pad, ...]:
    """Return pads at the raster's ground height, which build_known_ground has checked."""
    ground_m = terrain.elevation.interpolate_m(np.array([(pad.east_m, pad.north_m) for pad in pads])).round(1).tolist()
    return tuple(replace(pad, alt_m=alt_m) for pad, alt_m in zip(pads, ground_m, strict=True))


def check_separation(
    paths: Sequence[FlightPath], layer_m: float, *, home_alt_m: Mapping[str, float] | None = None
) -> list[str]:
    """Return messages on paths that come nearer to each other than ``layer_m``; empty if none do.

    Args:
        paths: One per vehicle.
        layer_m: Minimum distance between any two.
        home_alt_m: Height above mean sea level of each vehicle's home, by name; all equal if not given.
    """
    violations = []
    for path_a, path_b in itertools.combinations(paths, 2):
        homes = (0.0, 0.0) if home_alt_m is None else (home_alt_m[path_a.vehicle], home_alt_m[path_b.vehicle])
        nearest = _find_nearest_legs(path_a, path_b, homes)
        # A millimetre of tolerance for rounded coordinates.
        if nearest is not None and nearest[0] < layer_m - 1e-3:
            least_m, leg_a, leg_b = nearest
            violations.append(
                f"{path_a.vehicle} on leg {leg_a} ({path_a.waypoints[leg_a].phase.value}) and {path_b.vehicle} on leg "
                f"{leg_b} ({path_b.waypoints[leg_b].phase.value}) come within {least_m:.2f} m, {layer_m:g} m expected"
            )
    return violations


def _find_nearest_legs(
    path_a: FlightPath, path_b: FlightPath, homes_m: tuple[float, float]
) -> tuple[float, int, int] | None:
    """Return the least distance and the two legs, by end waypoint index; None where a vehicle stays on the ground."""
    if not path_a.waypoints or not path_b.waypoints:
        return None
    first = path_a.waypoints[0]
    frame = LocalFrame(first.lat_deg, first.lon_deg)
    legs_a, legs_b = legs_m(path_a, frame, homes_m[0]), legs_m(path_b, frame, homes_m[1])
    distances_m = leg_distances_m(legs_a, legs_b)
    leg_a, leg_b = np.unravel_index(int(np.argmin(distances_m)), distances_m.shape)
    return float(distances_m[leg_a, leg_b]), int(leg_a), int(leg_b)
