"""Convert a planned route to the waypoints that the vehicle flies.

The first waypoints of a path never depend on later ones: every inspection starts and ends with a hold, regardless of
what follows. A re-plan in flight relies on this: it uploads a list with the same beginning, so that the autopilot's
current index stays valid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.cameras import Capture, PylonCameraTask, PylonStop, Region, Trigger
from missions.flight_model import SAME_PLACE_M
from missions.geo import FloatArray
from missions.geometry import find_nearest_on_legs
from missions.pads import Pad
from missions.setup import FlightSetup
from missions.waypoints import FlightPath, Phase, Waypoint
from planner import is_reversed, segment_of

CLIMB_M_S, DESCENT_M_S = 2.5, 1.0
"""Nominal speeds of take-offs and landings: the autopilot sets them, no item does."""


def build_flight_path(
    setup: FlightSetup, vehicle: str, visits: Sequence[int], low: Collection[int] = frozenset()
) -> FlightPath:
    """Return a whole flight from the vehicle's pad over its visits and back, or to the pad of another base.

    Args:
        setup: The network, heights and pads.
        vehicle: Its name.
        visits: Planner visits over the setup's network, ``2 * segment + reversed``; if empty the vehicle stays on the
            ground and the path has no waypoints.
        low: Segments that it inspects at the requested height, below its own layer; see `select_low_segments`.

    Raises:
        SafetyError: the fleet has no such vehicle.
        IndexError: a visit is not in the network.
    """
    if not visits:
        return FlightPath(vehicle, ())
    pad = setup.pad_of(vehicle)
    here_m = np.array([pad.east_m, pad.north_m, setup.frame.up_m(pad.alt_m)])
    flight = _PathBuilder(setup, vehicle, here_m, on_ground=True, low=low)
    return FlightPath(vehicle, tuple(flight.complete(visits, first_visit=0)))


def continue_path(
    setup: FlightSetup,
    path: FlightPath,
    keep: int,
    visits: Sequence[int],
    low: Collection[int] = frozenset(),
    turn_m: tuple[float, float] | None = None,
) -> FlightPath:
    """Return a path that begins with the first ``keep`` waypoints of another and goes on with other visits.

    The kept waypoints are not changed. Visits are numbered after the kept inspections; without new visits the vehicle
    returns from the last kept waypoint. A return leg, which may already be in progress, is replaced first by a transit,
    if only to the leg's start: its items have the same numbers. The place on that leg where the vehicle turns is not
    known: if a straight path from there may not be free, it first flies back to its last known place, and stops there.

    Args:
        setup: The network, heights and pads, as for the path itself.
        path: The path in progress.
        keep: Number of its waypoints to keep; normally to the end of the current inspection.
        visits: Planner visits over the setup's network.
        low: As for `build_flight_path`, for those visits.
        turn_m: East and north of the vehicle's last known place, if it is already returning; None for anywhere on the
            leg after the last kept waypoint.

    Raises:
        ValueError: nothing would be kept, more than there is, or a landing, which would be a new flight.
        SafetyError: the fleet has no such vehicle.
        IndexError: a visit is not in the network.
    """
    kept = path.waypoints[:keep]
    if not 1 <= keep <= len(path.waypoints) or kept[-1].phase is Phase.LAND:
        raise ValueError(f"keep is {keep}: expected 1 to {len(path.waypoints)} waypoints without the landing")
    done = sum(point.phase is Phase.INSPECT for point in kept)
    here_m = _place_m(setup, path.vehicle, kept[-1])
    flight = _PathBuilder(setup, path.vehicle, here_m, on_ground=False, low=low, below_m=kept[-1].below_m)
    if keep < len(path.waypoints) and path.waypoints[keep].phase is Phase.RETURN:
        return FlightPath(path.vehicle, (*kept, *flight.turn_back(path.waypoints[keep], turn_m, visits, done)))
    return FlightPath(path.vehicle, (*kept, *flight.complete(visits, first_visit=done)))


@dataclass(slots=True)
class _PathBuilder:
    """Builds a path; holds the vehicle's place after the last waypoint."""

    setup: FlightSetup
    vehicle: str
    here_m: FloatArray
    """(3,) float64: east, north and up over the depot's ground."""
    on_ground: bool
    """Whether it is on its pad; in the air it may be below the pad's height, over a valley."""
    low: Collection[int]
    """Segments that it inspects below its layer."""
    below_m: float = 0.0
    """Current depth below its layer."""
    turns_back: bool = False
    """Whether it may already be returning."""

    def complete(self, visits: Iterable[int], *, first_visit: int) -> Iterator[Waypoint]:
        """Yield the waypoints of all visits and of the return; those of the climb first if still on the ground."""
        if self.on_ground:
            yield self._build_waypoint(self._above_m(self.setup.pad_of(self.vehicle)), Phase.TAKEOFF, CLIMB_M_S)
        for number, visit in enumerate(visits, start=first_visit):
            yield from self._fly_visit(number, visit)
        yield from self._fly_vertical(0.0, Phase.RETURN, visit=None)
        pad = self.setup.landing_pad_of(self.vehicle)
        yield from self._fly_transit(self._above_m(pad), Phase.RETURN, visit=None, hold=False)
        ground_m = self.setup.frame.up_m(pad.alt_m)
        yield self._build_waypoint(np.array([pad.east_m, pad.north_m, ground_m]), Phase.LAND, DESCENT_M_S)

    def _above_m(self, pad: Pad) -> FloatArray:
        """Return (3,) the place in the vehicle's layer above a pad."""
        return np.array([pad.east_m, pad.north_m, self.setup.layers.height_m(self.vehicle, pad.east_m, pad.north_m)])

    def turn_back(
        self, left: Waypoint, turn_m: tuple[float, float] | None, visits: Iterable[int], first_visit: int
    ) -> Iterator[Waypoint]:
        """Yield the waypoints of all visits and of the return for a vehicle that may be on a leg which they replace.

        It turns anywhere between its last place and the end of that leg. From there autopilots fly straight to the new
        waypoint, or to the line from the leg's end to it: the whole triangle over that leg must be free.
        """
        self.turns_back, begin_m = True, self.here_m
        if self.below_m:  # it climbs from the line, and always continues from there
            yield from self.complete(visits, first_visit=first_visit)
            return
        end_m = _place_m(self.setup, self.vehicle, left)
        if turn_m is not None:
            along_m = (end_m - begin_m)[np.newaxis]
            _, share = find_nearest_on_legs(np.array([turn_m]), begin_m[np.newaxis, :2], along_m[:, :2])
            self.here_m = (begin_m + share * along_m)[0]
        turn_place_m = self.here_m
        first, *others = self.complete(visits, first_visit=first_visit)
        if not self._is_free(np.array([begin_m, end_m, _place_m(self.setup, self.vehicle, first)])):
            speed_m_s = self.setup.inspection.transit_speed_m_s
            yield self._build_waypoint(turn_place_m, first.phase, speed_m_s, hold=True, visit=first.visit)
        yield from (first, *others)

    def _is_free(self, corners_m: FloatArray) -> bool:
        """Return whether every leg within a triangle of (3, 3) corners would be valid."""
        layers = self.setup.layers
        over_m = corners_m - _up_vector_m(layers.offset_m(self.vehicle))
        return self.setup.obstacles_for(self.vehicle).is_triangle_free(corners_m[:, :2]) and layers.surface.is_near(
            over_m, layers.tolerance_m
        )

    def _fly_visit(self, number: int, visit: int) -> Iterator[Waypoint]:
        segment = segment_of(visit)
        if not 0 <= segment < len(self.setup.network.segments):
            raise IndexError(f"visit {visit}: expected a segment below {len(self.setup.network.segments)}")
        heights_m = self.setup.layers.track_heights_m[segment] + self._offset_m(segment)
        a, b = np.column_stack((self.setup.tracks_m[segment], heights_m))
        start, end = (b, a) if is_reversed(visit) else (a, b)
        turns_back, self.turns_back = self.turns_back, False
        pylon = self.setup.looks.pylons.get(segment)
        if pylon is not None:
            if turns_back:
                yield from self._fly_vertical(0.0, Phase.TRANSIT, visit=number)
                yield from self._fly_transit(start, Phase.TRANSIT, visit=number, hold=False)
            yield from self._fly_around_pylon(number, visit, pylon)
            return
        below_m = self.setup.layers.offset_m(self.vehicle) if segment in self.low else 0.0
        if turns_back or math.hypot(*(start[:2] - self.here_m[:2])) > SAME_PLACE_M:
            yield from self._fly_vertical(0.0, Phase.TRANSIT, visit=number)
            yield from self._fly_transit(start + _up_vector_m(below_m), Phase.TRANSIT, visit=number, hold=True)
        yield from self._fly_vertical(below_m, Phase.TRANSIT, visit=number)
        inspected = self._build_waypoint(end, Phase.INSPECT, self.setup.inspection.speed_m_s, hold=True, visit=number)
        yield replace(inspected, captures=tuple(self._build_captures(visit))) if self.setup.looks else inspected

    def _fly_around_pylon(self, number: int, visit: int, look: PylonCameraTask) -> Iterator[Waypoint]:
        """Yield the viewpoints of a pylon: a stop at each; the last one ends its inspection.

        A vehicle that stays in its layer views every one of them from above.
        """
        low = segment_of(visit) in self.low
        stops = look.list_stops(reverse=is_reversed(visit), low=low)
        layer_m = self.setup.layers.offset_m(self.vehicle)
        yield from self._fly_vertical(0.0, Phase.TRANSIT, visit=number)
        for index, stop in enumerate(stops):
            below_m = layer_m + stop.below_m if low else 0.0
            place_m = self._place_below_layer_m(stop.place_m, below_m)
            phase = Phase.INSPECT if index + 1 == len(stops) else Phase.TRANSIT
            if index:
                self.below_m = below_m
                ends = self._build_waypoint(place_m, phase, self.setup.inspection.speed_m_s, hold=True, visit=number)
            else:
                above_m = self._place_below_layer_m(stop.place_m, 0.0)
                *before, ends = self._fly_transit(above_m, phase, visit=number, hold=True)
                yield from before
                for down in self._fly_vertical(below_m, phase, visit=number):
                    yield ends
                    ends = down
            yield self._add_captures(ends, look, stop) if stop.points else ends

    def _place_below_layer_m(self, place_m: tuple[float, float], below_m: float) -> FloatArray:
        """Return (3,) the place at a depth below the vehicle's layer."""
        return np.array([*place_m, self.setup.layers.height_m(self.vehicle, *place_m) - below_m])

    def _build_captures(self, visit: int) -> Iterator[Capture]:
        """Yield the camera actions along a segment; it is flown to the right of the direction from a to b."""
        segment, looks, asked = segment_of(visit), self.setup.looks, self.setup.inspection
        below_deg = math.degrees(math.atan2(asked.height_m + self._offset_m(segment), asked.standoff_m))
        for look in looks.spans.get(segment, ()):
            camera, pitch_deg, yaw_deg = looks.cameras[look.camera], None, None
            if camera.gimbal:
                pitch_deg = round(-below_deg if look.pitch_deg is None else look.pitch_deg)
                yaw_deg = 0 if pitch_deg <= -90 else 90 if is_reversed(visit) else -90
            yield Capture(camera.name, camera.id, look.trigger, look.every_m, pitch_deg, yaw_deg, look.aim_deg)

    def _add_captures(self, waypoint: Waypoint, look: PylonCameraTask, stop: PylonStop) -> Waypoint:
        """Return a stop with its actions, which start once the vehicle is at rest."""
        home_up_m = self.setup.frame.up_m(self.setup.pad_of(self.vehicle).alt_m)
        east_m, north_m, up_m = look.target_m
        region = Region(*self.setup.frame.to_wgs84_deg(east_m, north_m), up_m - home_up_m) if look.roi else None
        camera = self.setup.looks.cameras[look.camera]
        pitch_deg = look.pitch_from_deg(stop.place_m, waypoint.alt_rel_m + home_up_m) if camera.gimbal else None
        yaw_deg = look.points[stop.points[0]].yaw_deg if camera.gimbal or region is not None else None
        capture = Capture(
            camera.name, camera.id, Trigger.ONCE, 0.0, pitch_deg, yaw_deg, look.aim_deg, from_north=True, region=region,
            points=stop.points,
        )  # fmt: skip
        return replace(waypoint, captures=(capture,), hover_s=look.hover_s)

    def _offset_m(self, segment: int) -> float:
        """Return the height above the requested height at which it inspects a segment."""
        return 0.0 if segment in self.low else self.setup.layers.offset_m(self.vehicle)

    def _fly_vertical(self, below_m: float, phase: Phase, *, visit: int | None) -> Iterator[Waypoint]:
        """Yield the vertical leg between the layer and the line, if there is one."""
        if below_m == self.below_m:
            return
        place_m = self.here_m + _up_vector_m(self.below_m - below_m)
        self.below_m = below_m
        yield self._build_waypoint(place_m, phase, self.setup.inspection.transit_speed_m_s, hold=True, visit=visit)

    def _fly_transit(self, goal_m: FloatArray, phase: Phase, *, visit: int | None, hold: bool) -> Iterator[Waypoint]:
        """Yield the path to a place: around columns above other vehicles' pads and around areas, along the surface."""
        layers = self.setup.layers
        corners = self.setup.obstacles_for(self.vehicle).way_m(self.here_m[:2], goal_m[:2])
        heights_m = (
            layers.surface.interpolate_m(corners) + layers.offset_m(self.vehicle) if len(corners) else np.zeros(0)
        )
        stops = [self.here_m, *np.column_stack((corners, heights_m)), goal_m]
        step = np.array([0.0, 0.0, layers.offset_m(self.vehicle)])
        speed_m_s = self.setup.inspection.transit_speed_m_s
        for start, end in itertools.pairwise(stops):
            for place in layers.surface.follow_m(start - step, end - step, layers.tolerance_m):
                yield self._build_waypoint(place + step, phase, speed_m_s, visit=visit)
            yield self._build_waypoint(end, phase, speed_m_s, visit=visit, hold=hold and end is goal_m)

    def _build_waypoint(
        self, place_m: FloatArray, phase: Phase, speed_m_s: float, *, hold: bool = False, visit: int | None = None
    ) -> Waypoint:
        self.here_m = place_m
        lat_deg, lon_deg = self.setup.frame.to_wgs84_deg(float(place_m[0]), float(place_m[1]))
        home_up_m = self.setup.frame.up_m(self.setup.pad_of(self.vehicle).alt_m)
        return Waypoint(
            phase=phase,
            lat_deg=lat_deg,
            lon_deg=lon_deg,
            alt_rel_m=float(place_m[2]) - home_up_m,
            speed_m_s=speed_m_s,
            hold=hold,
            visit=visit,
            below_m=self.below_m,
        )


def _place_m(setup: FlightSetup, vehicle: str, point: Waypoint) -> FloatArray:
    """Return (3,) east, north and up of one of a vehicle's waypoints."""
    east_m, north_m = setup.frame.to_local_m(point.lat_deg, point.lon_deg)
    return np.array([east_m, north_m, setup.up_m(vehicle, point.alt_rel_m)])


def _up_vector_m(height_m: float) -> FloatArray:
    return np.array([0.0, 0.0, height_m])
