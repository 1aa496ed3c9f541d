"""Pylons to be seen from several sides: each is an asset of its own, flown like a span, from viewpoint to viewpoint.

So it has its own time, energy and place in the order of a route. Viewpoints lie on the common surface over the line, so
that whatever keeps vehicles apart, and off the line, holds for them as it does for spans.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.cameras import PylonLook, Viewpoint
from missions.errors import SafetyError
from missions.network import Network, Pylon, Segment
from missions.performance import Performance

APART_M = 1.0
"""The first and the last viewpoint of a pylon are farther apart than this: it is flown from one to the other."""


@dataclass(frozen=True, slots=True)
class PylonWish:
    """From where a pylon is to be seen."""

    pylon: int
    camera: str
    bearings_deg: tuple[float, ...]
    """From the pylon, clockwise from the direction of its line."""
    distance_m: float
    hover_s: float
    pitch_deg: float | None
    """None looks at the top."""
    aim_deg: float
    height_m: float
    """Of the lowest flight over the top."""


def with_viewpoints(
    network: Network, wishes: Sequence[PylonWish], standoff_m: float
) -> tuple[Network, Mapping[int, PylonLook]]:
    """Return the network with an asset more for each wish, and what each of them is.

    Its two ends are pylons that are not there, as high as the real one, placed so that the track between them begins
    and ends at the first and the last viewpoint.

    Raises:
        SafetyError: a pylon's viewpoints begin and end at one place.
        NetworkError: they make no network.
    """
    pylons, segments = list(network.pylons), list(network.segments)
    looks: dict[int, PylonLook] = {}
    for wish in wishes:
        look = _look(network, wish)
        first, last = (np.array(look.points[end].place_m) for end in (0, -1))
        along = last - first
        length_m = float(np.hypot(*along))
        if length_m < APART_M:
            name = network.pylons[wish.pylon].id
            raise SafetyError(f"pylon {name!r}: expected viewpoints that begin and end at different places")
        left = np.array([-along[1], along[0]]) / length_m * standoff_m
        real, number = network.pylons[wish.pylon], len(segments)
        for end, place_m in (("first", first), ("last", last)):
            pylons.append(_stand_in(network, real, f"{real.id}/{wish.camera}/{end}", place_m + left))
        segments.append(Segment(number, len(pylons) - 2, len(pylons) - 1, f"pylon {real.id}"))
        looks[number] = look
    if not looks:
        return network, looks
    return Network(tuple(pylons), tuple(segments), network.frame, network.source, network.flat), looks


def _look(network: Network, wish: PylonWish) -> PylonLook:
    east_m, north_m = network.positions_m[wish.pylon].tolist()
    line_deg = _line_deg(network, wish.pylon)
    below_deg = math.degrees(math.atan2(wish.height_m, wish.distance_m))
    pitch_deg = round(-below_deg if wish.pitch_deg is None else wish.pitch_deg)
    points = []
    for bearing_deg in wish.bearings_deg:
        away = math.radians(line_deg + bearing_deg)
        place_m = (east_m + wish.distance_m * math.sin(away), north_m + wish.distance_m * math.cos(away))
        look_deg = round(line_deg + bearing_deg + 180.0) % 360
        points.append(Viewpoint(place_m, pitch_deg, look_deg if look_deg <= 180 else look_deg - 360))
    return PylonLook(wish.camera, tuple(points), wish.hover_s, wish.aim_deg)


def _line_deg(network: Network, pylon: int) -> float:
    """Return the direction of the line at a pylon: that of the first span that it carries."""
    for segment in network.segments:
        if pylon in {segment.a, segment.b}:
            (a_east, a_north), (b_east, b_north) = network.ends_m[segment.id].tolist()
            return math.degrees(math.atan2(b_east - a_east, b_north - a_north))
    return 0.0


def _stand_in(network: Network, real: Pylon, name: str, place_m: np.ndarray) -> Pylon:
    lat_deg, lon_deg = network.frame.to_wgs84_deg(float(place_m[0]), float(place_m[1]))
    return replace(real, id=name, lat_deg=lat_deg, lon_deg=lon_deg)


def besides_s(look: PylonLook, performance: Performance, speed_m_s: float) -> float:
    """Return what a pylon takes longer than the straight way from its first viewpoint to its last.

    Args:
        look: Its viewpoints.
        performance: How the vehicle flies.
        speed_m_s: Between them.
    """
    places_m = np.array([point.place_m for point in look.points])
    along_m = np.diff(places_m, axis=0)
    straight_m = places_m[-1:] - places_m[:1]
    hover_s = max(0.0, look.hover_s - performance.hold_s) * len(look.points)
    return hover_s + _flown_s(along_m, performance, speed_m_s) - _flown_s(straight_m, performance, speed_m_s)


def _flown_s(along_m: np.ndarray, performance: Performance, speed_m_s: float) -> float:
    length_m = np.hypot(along_m[:, 0], along_m[:, 1])
    speeds, ends = np.full(len(length_m), speed_m_s), np.full(len(length_m), 2.0)
    legs_s = performance.legs_s(length_m, np.zeros(len(length_m)), speeds, ends)
    arrives_m_s = performance.arrives_m_s(length_m[:-1], speed_m_s)
    turns = performance.turns_s(along_m[:-1], along_m[1:], arrives_m_s) if len(along_m) > 1 else np.zeros(0)
    return float(legs_s.sum() + turns.sum() + len(length_m) * (performance.settle_s + performance.hold_s))
