"""Plan pylons with several viewpoints: each is an asset of its own, flown like a span between viewpoints.

It therefore has its own time, energy and place in a route's order. Viewpoints lie on the common surface over the lines,
so that vehicle separation and line clearance apply as for spans; or below it, where a vehicle descends from its layer
as `inspection_height` allows. No vehicle is below the tops within ``BESIDE_M`` of a line there: a path between two
viewpoints that would be leads up to the surface, over the line and down again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions import clearance
from missions.cameras import PylonCameraTask, Viewpoint
from missions.errors import SafetyError
from missions.flight_model import Performance
from missions.geo import FloatArray
from missions.geometry import sample_leg
from missions.network import Network, Segment
from missions.setup import FlightSetup

APART_M = 1.0
"""Least distance between the first and the last viewpoint of a pylon, which is flown from one to the other."""
STEP_M = 1.0
"""Spacing of the points at which a path is checked against lines and ground."""
SPARE_M = 0.1
"""Extra clearance of viewpoints from lines and ground: item positions are rounded."""
UPRIGHT_M = 1e-6


@dataclass(frozen=True, slots=True)
class ViewpointRequest:
    """The viewpoints requested for a pylon."""

    pylon: int
    camera: str
    bearings_deg: tuple[float, ...]
    """Bearings from the pylon, clockwise from the direction of its line."""
    distance_m: float
    hover_s: float
    pitch_deg: float | None
    """Gimbal pitch; None points at the target."""
    aim_deg: float
    heights_m: tuple[float, ...] = ()
    """Heights of the viewpoints over the pylon's top, each at every bearing; if empty they lie on the common
    surface."""
    target_m: float = 0.0
    """Height of the camera target relative to the top."""
    roi: bool = False
    """Whether the autopilot gets the target as a region of interest."""


def add_viewpoints(
    network: Network, wishes: Sequence[ViewpointRequest], standoff_m: float
) -> tuple[Network, Mapping[int, ViewpointRequest]]:
    """Return the network with one more asset per request, and the request of each such asset.

    Its two ends are virtual pylons, as high as the real one, placed so that the track between them begins and ends at
    the first and the last viewpoint.

    Raises:
        SafetyError: a pylon's viewpoints begin and end at one place, or their heights refer to an unknown top.
        NetworkError: they form no valid network.
    """
    pylons, segments = list(network.pylons), list(network.segments)
    wished: dict[int, ViewpointRequest] = {}
    for wish in wishes:
        real, number = network.pylons[wish.pylon], len(segments)
        if wish.heights_m and (real.elevation_m is None or real.height_m is None):
            raise SafetyError(f"pylon {real.id!r}: expected elevation_m and height_m for viewpoints at heights_m")
        first, last = (np.array(_list_viewpoint_places(network, wish)[end]) for end in (0, -1))
        along = last - first
        length_m = float(np.hypot(*along))
        if length_m < APART_M:
            raise SafetyError(f"pylon {real.id!r}: expected viewpoints that begin and end at different places")
        left = np.array([-along[1], along[0]]) / length_m * standoff_m
        for end, place_m in (("first", first), ("last", last)):
            lat_deg, lon_deg = network.frame.to_wgs84_deg(*(place_m + left).tolist())
            pylons.append(replace(real, id=f"{real.id}/{wish.camera}/{end}", lat_deg=lat_deg, lon_deg=lon_deg))
        segments.append(Segment(number, len(pylons) - 2, len(pylons) - 1, f"pylon {real.id}"))
        wished[number] = wish
    if not wished:
        return network, wished
    return Network(tuple(pylons), tuple(segments), network.frame, network.source, network.flat), wished


def _list_viewpoint_places(network: Network, wish: ViewpointRequest) -> list[tuple[float, float]]:
    """Return east and north of the viewpoints, one per bearing."""
    east_m, north_m = network.positions_m[wish.pylon].tolist()
    turns = [math.radians(_line_deg(network, wish.pylon) + bearing_deg) for bearing_deg in wish.bearings_deg]
    return [(east_m + wish.distance_m * math.sin(turn), north_m + wish.distance_m * math.cos(turn)) for turn in turns]


def _line_deg(network: Network, pylon: int) -> float:
    """Return the direction of the line at a pylon: that of its first span."""
    for segment in network.segments:
        if pylon in {segment.a, segment.b}:
            (a_east, a_north), (b_east, b_north) = network.ends_m[segment.id].tolist()
            return math.degrees(math.atan2(b_east - a_east, b_north - a_north))
    return 0.0


def build_pylon_tasks(
    setup: FlightSetup, wished: Mapping[int, ViewpointRequest]
) -> tuple[dict[int, PylonCameraTask], list[str]]:
    """Return the camera task of each pylon by asset, and messages on viewpoints flown higher than requested.

    A viewpoint too near to a line or to the ground is raised to the lowest height that keeps the clearance.

    Args:
        setup: Heights and pads, over a network with an asset for each request.
        wished: The requests.
    """
    lines, looks, higher = clearance.lines_of(setup, wished), {}, []
    for segment, wish in wished.items():
        around = _ViewpointPlanner(setup, lines, wish)
        looks[segment] = around.build_task()
        higher += around.higher
    return looks, higher


class _ViewpointPlanner:
    """Plans the viewpoints of one pylon over lines and ground."""

    def __init__(self, setup: FlightSetup, lines: clearance.PowerLines | None, wish: ViewpointRequest) -> None:
        self._setup, self._lines, self._wish = setup, lines, wish
        self._pylon = setup.network.pylons[wish.pylon]
        self._top_m = 0.0  # on a flat site heights refer to the depot's ground
        if self._pylon.elevation_m is not None and self._pylon.height_m is not None:
            self._top_m = setup.frame.up_m(self._pylon.elevation_m + self._pylon.height_m)
        east_m, north_m = setup.network.positions_m[wish.pylon].tolist()
        self._target_m = (east_m, north_m, self._top_m + wish.target_m)
        self.higher: list[str] = []
        """Messages: what is flown higher than requested."""

    def build_task(self) -> PylonCameraTask:
        wish = self._wish
        points = list(self._iterate_viewpoints())
        for number, (one, other) in enumerate(itertools.pairwise(points)):
            if one.below_m > 0 or other.below_m > 0:
                points[number] = replace(one, crosses=self._find_shortfall(self._way_m(one, other)) is not None)
        return PylonCameraTask(
            wish.camera, tuple(points), wish.hover_s, wish.aim_deg, self._target_m, wish.pitch_deg, wish.roi
        )  # fmt: skip

    def _iterate_viewpoints(self) -> Iterator[Viewpoint]:
        wish = self._wish
        heights: Sequence[float | None] = wish.heights_m or (None,)
        for number, place_m in enumerate(_list_viewpoint_places(self._setup.network, wish)):
            to_pylon = math.degrees(math.atan2(self._target_m[0] - place_m[0], self._target_m[1] - place_m[1]))
            # Each bearing begins at the height at which the last one ended.
            for height_m in heights[:: -1 if number % 2 else 1]:
                below_m = 0.0 if height_m is None else self._below_m(place_m, height_m, wish.bearings_deg[number])
                yield Viewpoint(place_m, round(to_pylon), below_m)

    def _below_m(self, place_m: tuple[float, float], height_m: float, bearing_deg: float) -> float:
        """Return how far below the common surface a viewpoint requested at a height over the top is flown."""
        surface_m = self._setup.layers.surface.height_m(*place_m)
        wanted_m = up_m = min(surface_m, self._top_m + height_m)
        why = ""
        while up_m < surface_m and (low := self._find_shortfall(np.array([[*place_m, up_m]]))) is not None:
            up_m, why = min(surface_m, up_m + low.short_m), why or low.words
        if up_m - wanted_m > SPARE_M:
            self.higher.append(
                f"pylon {self._pylon.id}: the viewpoint at {bearing_deg:g} deg, {height_m:g} m from the top, is flown "
                f"{up_m - wanted_m:.0f} m higher: it would come {why}"
            )
        return round(max(0.0, surface_m - up_m), 2)

    def _way_m(self, one: Viewpoint, other: Viewpoint) -> FloatArray:
        """Return (m, 3) places on the path between two viewpoints."""
        surface = self._setup.layers.surface
        ends = np.array([(*end.place_m, surface.height_m(*end.place_m) - end.below_m) for end in (one, other)])
        return sample_leg(ends, STEP_M)

    def _find_shortfall(self, places_m: FloatArray) -> clearance.ClearanceShortfall | None:
        """Return the worst shortfall of (m, 3) places over lines and ground; None if there is none."""
        places_m = places_m - (0.0, 0.0, SPARE_M)
        low = clearance.find_terrain_shortfall(self._setup, places_m)
        if low is None and self._lines is not None:
            return clearance.find_line_shortfall(
                self._lines, self._setup, places_m, beside_m=clearance.BESIDE_M + SPARE_M
            )
        return low


def extra_time_s(look: PylonCameraTask, performance: Performance, speed_m_s: float, *, in_layer: bool = False) -> float:
    """Return a pylon's extra time over the straight path on the surface from its first viewpoint to its last.

    Args:
        look: Its viewpoints.
        performance: How the vehicle flies.
        speed_m_s: Speed between them.
        in_layer: Whether the vehicle views all of them from its layer.
    """
    ends = [(*look.points[end].place_m, 0.0) for end in (0, -1)]
    stops = look.list_stops(reverse=False, low=not in_layer)
    # Down from the surface to the first viewpoint, and up again from the last.
    way = [ends[0], *((*stop.place_m, -stop.below_m) for stop in stops), ends[1]]
    way_m = np.array([place for place, _ in itertools.groupby(way)])
    hover_s = max(0.0, look.hover_s - performance.hold_s) * sum(bool(stop.points) for stop in stops)
    straight_s = _flight_time_s(np.array(ends), performance, speed_m_s)
    return hover_s + _flight_time_s(way_m, performance, speed_m_s) - straight_s


def _flight_time_s(way_m: FloatArray, performance: Performance, speed_m_s: float) -> float:
    """Return the time of a path from stop to stop along (w, 3) places, consistent with `estimate`."""
    along_m = np.diff(way_m, axis=0)
    length_m = np.hypot(along_m[:, 0], along_m[:, 1])
    speeds, ends = np.full(len(length_m), speed_m_s), np.full(len(length_m), 2.0)
    legs_s = performance.legs_s(length_m, along_m[:, 2], speeds, ends)
    # A vehicle stops before it continues vertically.
    came_m = np.where(length_m[1:] < UPRIGHT_M, 0.0, length_m[:-1])
    turns_s = performance.turns_s(along_m[:-1], along_m[1:], performance.arrival_speed_m_s(came_m, speed_m_s))
    return float(legs_s.sum() + turns_s.sum() + len(length_m) * (performance.settle_s + performance.hold_s))
