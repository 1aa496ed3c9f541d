"""Apply a site's areas to a fleet: restricted vehicles, unreachable segments, and the check of flights.

A segment goes to the best vehicle, and to any survivor in a re-plan. A segment that not every vehicle may fly is
therefore excluded for all of them, and so is one in an area with a height limit below some vehicle's layer.

The check that flights stay out is independent of how their paths were computed. Legs are sampled every ``STEP_M``: the
distance of each place from every outline, and whether the outline winds around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.clearance import measure_over_ground
from missions.errors import SafetyError
from missions.geo import BoolArray, FloatArray
from missions.geometry import find_nearest_on_legs, sample_leg
from missions.no_fly_areas import UNKNOWN_GROUND, Area, AreaKind, AreaRestriction, Unreachable
from missions.pads import Pad
from missions.setup import FlightSetup
from missions.shortest_ways import VisibilityGraph, build_area_graph, build_obstacle, build_visibility_graph
from missions.terrain import is_inside_convex
from missions.waypoints import FlightPath, Phase, legs_m
from planner import segment_of

STEP_M = 3.0
ROUNDING_M = 0.1
"""Tolerance: items store positions to 1 cm, and a geodesic leg deviates from a straight one by a few."""
RETURN_STEP_M = 20.0
"""Spacing of the places from which RTL is checked."""
AT_ONCE = 2000
"""Places checked against an area in one step."""
BEYOND_M = 500.0
"""Distance around lines and pads within which flight heights are checked."""
LOOKS = 40
"""Places checked along each side of an area."""
LIMIT_ROUNDING_M = 0.05
OUTSIDE_M = 10_000.0
"""Width of the closed border around known ground; no route leads around it."""
EDGE_M = 1.0
"""Distance that routes keep from its edge."""


def apply_areas(setup: FlightSetup, areas: Sequence[Area], alternates: Sequence[str] = ()) -> FlightSetup:
    """Return a setup whose flights keep out of areas, with the segments that become unreachable.

    Raises:
        SafetyError: the depot or a pad is in an area, or no path leads from one to the other.
    """
    kept_out = tuple(_build_restrictions(setup, areas))
    for one in kept_out:
        if build_area_graph(one.area).is_inside(np.zeros((1, 2)))[0]:
            raise SafetyError(
                f"depot: expected {one.area.margin_m:g} m or more outside of area {one.area.name!r}, got a place in it"
                f"{describe_height_limit(one)}"
            )
    kept_out = (*kept_out, *_restrict_unknown_ground(setup, kept_out))
    found = replace(setup, areas=tuple(areas), kept_out=kept_out, alternates=tuple(alternates))
    return replace(found, unreachable=tuple(_find_unreachable(found)))


def _build_restrictions(setup: FlightSetup, areas: Sequence[Area]) -> Iterator[AreaRestriction]:
    everybody = setup.layers.vehicles
    for area in areas:
        if area.kind is not AreaKind.HEIGHT_LIMIT:
            yield AreaRestriction(area, everybody)
            continue
        over_m = _excess_height_over_limit_m(setup, area)
        if over_m is None:
            continue
        above = tuple(name for name in everybody if over_m + setup.layers.offset_m(name) > LIMIT_ROUNDING_M)
        if above:
            limit_m = area.max_agl_m if area.max_agl_m is not None else area.max_amsl_m
            yield AreaRestriction(area, above, (limit_m or 0.0) + over_m + setup.layers.offset_m(above[-1]))


def _restrict_unknown_ground(setup: FlightSetup, kept_out: Sequence[AreaRestriction]) -> Iterator[AreaRestriction]:
    """Yield the border of the known ground, if a path around an area would cross it.

    All paths are straight between the lines, the pads and the nodes around areas. While these lie in the area of known
    ground, which is convex, so does everything that is flown.
    """
    if setup.layers.known is None:
        return
    corners_m = setup.layers.known.corners_m
    nodes_m = build_area_graph(*(one.area for one in kept_out)).nodes_m
    if is_inside_convex(corners_m, nodes_m).all():
        return
    (east, north), (far_east, far_north) = corners_m.min(axis=0) - OUTSIDE_M, corners_m.max(axis=0) + OUTSIDE_M
    box = tuple((float(one), float(other)) for one, other in (
        (east, north), (far_east, north), (far_east, far_north), (east, far_north)
    ))  # fmt: skip
    hull = tuple((float(one), float(other)) for one, other in corners_m)
    area = Area(UNKNOWN_GROUND, AreaKind.NO_FLY, (box, hull), EDGE_M)
    yield AreaRestriction(area, setup.layers.vehicles)


def _excess_height_over_limit_m(setup: FlightSetup, area: Area) -> float | None:
    """Return the lowest layer's excess over the limit, negative where it is below; None if no flight comes near."""
    places_m = _sample_area(setup, area)
    if not len(places_m):
        return None
    up_m = setup.layers.surface.interpolate_m(places_m) + setup.layers.tolerance_m
    return float(_excess_over_limit_m(setup, area, np.column_stack((places_m, up_m))).max())


def _excess_over_limit_m(setup: FlightSetup, area: Area, places_m: FloatArray) -> FloatArray:
    """Return (m,) excess of (m, 3) places over the limit of the area that contains them; negative: below."""
    over_m = np.full(len(places_m), -math.inf)
    if area.max_agl_m is not None:
        over_m = np.maximum(over_m, measure_over_ground(setup, places_m)[0] - area.max_agl_m)
    if area.max_amsl_m is not None:
        over_m = np.maximum(over_m, places_m[:, 2] + setup.frame.alt_m - area.max_amsl_m)
    return over_m


def _sample_area(setup: FlightSetup, area: Area) -> FloatArray:
    """Return (m, 2) places in an area and its margin, as far as flights may reach."""
    known = np.concatenate((setup.tracks_m.reshape(-1, 2), [(pad.east_m, pad.north_m) for pad in setup.pads]))
    corners = area.edges_m().reshape(-1, 2)
    low = np.maximum(known.min(axis=0) - BEYOND_M, corners.min(axis=0) - area.keep_m)
    high = np.minimum(known.max(axis=0) + BEYOND_M, corners.max(axis=0) + area.keep_m)
    if (low > high).any():
        return np.zeros((0, 2))
    east, north = np.meshgrid(np.linspace(low[0], high[0], LOOKS), np.linspace(low[1], high[1], LOOKS))
    along = np.linspace(0.0, 1.0, 9)[:, np.newaxis, np.newaxis]
    on_tracks = (setup.tracks_m[:, 0] + along * (setup.tracks_m[:, 1] - setup.tracks_m[:, 0])).reshape(-1, 2)
    places = np.concatenate((np.column_stack((east.ravel(), north.ravel())), corners, on_tracks))
    places = places[((places >= low) & (places <= high)).all(axis=1)]
    return np.asarray(places[build_area_graph(area).is_inside(places)])


def describe_height_limit(one: AreaRestriction) -> str:
    """Return how high a vehicle would be in an area with a height limit; empty for other areas."""
    if one.highest_m is None:
        return ""
    reference, limit_m = "over the ground", one.area.max_agl_m
    if limit_m is None:
        reference, limit_m = "above sea level", one.area.max_amsl_m
    return f": {one.vehicles[-1]} would be {one.highest_m:.0f} m {reference}, {limit_m:g} m allowed"


def _find_unreachable(setup: FlightSetup) -> Iterator[Unreachable]:
    begins, ends = setup.tracks_m[:, 0], setup.tracks_m[:, 1]
    reasons: dict[int, str] = {}
    for one in setup.kept_out:
        within = _build_bare_graph(one.area, LIMIT_ROUNDING_M).is_met(begins, ends)
        for segment in np.flatnonzero(build_area_graph(one.area).is_met(begins, ends)).tolist():
            what = "lies in" if within[segment] else f"lies nearer than {one.area.margin_m:g} m to"
            reasons.setdefault(segment, f"{what} area {one.area.name!r}{describe_height_limit(one)}")
    areas = build_area_graph(*(one.area for one in setup.kept_out))
    others = [number for number in range(len(begins)) if number not in reasons]
    for number, away in zip(others, _find_cut_off(setup, areas, begins[others]), strict=True):
        if away:
            known = any(one.area.name == UNKNOWN_GROUND for one in setup.kept_out)
            where = ", over ground that is known" if known else ""
            reasons[number] = f"no path leads to it around the areas{where}"
    for number in sorted(reasons):
        yield Unreachable(number, reasons[number], setup.network.segment_name(number))


def _build_bare_graph(area: Area, least_m: float) -> VisibilityGraph:
    """Return the graph of paths around an area itself, without its margin."""
    return build_visibility_graph((replace(build_obstacle(area), keep_m=max(least_m, area.width_m / 2)),))


def _find_cut_off(setup: FlightSetup, areas: VisibilityGraph, places_m: FloatArray) -> BoolArray:
    """Return (n,) whether no path leads from the pads to (n, 2) places.

    Raises:
        SafetyError: no path leads from one pad to another.
    """
    pads_m = np.array([(pad.east_m, pad.north_m) for pad in setup.pads])
    for number in np.flatnonzero(areas.is_cut_off(pads_m[0], pads_m)).tolist():
        first, pad = setup.pads[0].vehicle, setup.pads[number].vehicle
        raise SafetyError(f"pad of {pad}: expected a path from the pad of {first}, got none around the areas")
    return areas.is_cut_off(pads_m[0], places_m)


@dataclass(frozen=True, slots=True)
class ReturnCrossing:
    """A vehicle's straight RTL that crosses an area, from some of its legs."""

    vehicle: str
    area: str
    segments: tuple[int, ...]
    """Segment ids in order of flight; a transit counts for its destination segment."""
    on_way_home: bool
    """Whether the return leg also violates the area."""


def check_areas(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[str]:
    """Return messages on flights inside an area or too near to it; empty if there are none.

    Args:
        setup: Areas, heights and pads.
        paths: Flights of the setup's vehicles: first missions, or those of a re-plan.
    """
    found = []
    for path in paths:
        if not path.waypoints or not setup.areas:
            continue
        legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
        parts_m = [sample_leg(leg, STEP_M) for leg in legs]
        places_m, numbers = np.concatenate(parts_m), np.repeat(np.arange(len(legs)), list(map(len, parts_m)))
        for area in setup.areas:
            short_m = np.concatenate(
                [
                    _shortfall_m(setup, area, places_m[first : first + AT_ONCE])
                    for first in range(0, len(places_m), AT_ONCE)
                ]
            )
            worst = int(short_m.argmax())
            if short_m[worst] > ROUNDING_M:
                leg = int(numbers[worst])
                found.append(
                    f"{path.vehicle} on leg {leg} ({path.waypoints[leg].phase.value}) comes "
                    f"{_describe_shortfall(area, float(short_m[worst]))}"
                )
    return found


def find_return_crossings(
    setup: FlightSetup, paths: Iterable[FlightPath], routes: Mapping[str, Sequence[int]]
) -> tuple[ReturnCrossing, ...]:
    """Return where the autopilot's straight RTL would cross an area.

    Areas count without their margins; those with a height limit only where the RTL is above it.

    Args:
        setup: Areas, heights and pads.
        paths: Flights.
        routes: Visits by vehicle name.
    """
    return tuple(crossing for path in paths for crossing in _find_path_crossings(setup, path, routes[path.vehicle]))


def find_areas_on_return(setup: FlightSetup, vehicle: str, place_m: tuple[float, float]) -> tuple[str, ...]:
    """Return the names of the areas that a straight RTL from a place crosses."""
    start_m = np.array([place_m])
    return tuple(dict.fromkeys(area.name for area in setup.areas if _is_crossing(setup, vehicle, area, start_m)[0]))


def describe_crossing(setup: FlightSetup, one: ReturnCrossing) -> str:
    """Return a description of an RTL through an area: "its own RTL from segments A, B crosses area 'airfield'"."""
    shown = [setup.network.segment_name(segment) for segment in one.segments[:6]]
    more = f" and {len(one.segments) - 6} more" if len(one.segments) > 6 else ""
    where = f"from {', '.join(shown)}{more}" if shown else ""
    where += (" and " if shown else "") + "on its way back" if one.on_way_home else ""
    return f"{one.vehicle}: its own RTL {where} crosses area {one.area!r}"


def _find_path_crossings(setup: FlightSetup, path: FlightPath, visits: Sequence[int]) -> Iterator[ReturnCrossing]:
    if not path.waypoints:
        return
    legs = legs_m(path, setup.frame)[:, :, :2]
    for area in setup.areas:
        segments: dict[int, None] = {}
        on_way_home = False
        for leg, point in zip(legs, path.waypoints, strict=True):
            if not _is_crossing(setup, path.vehicle, area, sample_leg(leg, RETURN_STEP_M)).any():
                continue
            if point.visit is not None:
                segments[segment_of(visits[point.visit])] = None
            elif point.phase is Phase.RETURN:
                on_way_home = True
        if segments or on_way_home:
            yield ReturnCrossing(path.vehicle, area.name, tuple(segments), on_way_home)


def _is_crossing(setup: FlightSetup, vehicle: str, area: Area, places_m: FloatArray) -> np.ndarray:
    """Return (n,) whether the straight RTL from (n, 2) places crosses an area, above its height limit if it has one."""
    met = np.zeros(len(places_m), dtype=np.bool_)
    for pad in setup.list_pads_of(vehicle):
        met |= _is_crossing_to(setup, pad, area, places_m)
    return met


def _is_crossing_to(setup: FlightSetup, pad: Pad, area: Area, places_m: FloatArray) -> np.ndarray:
    pad_m = np.broadcast_to(np.array([pad.east_m, pad.north_m]), places_m.shape)
    met = _build_bare_graph(area, ROUNDING_M).is_met(places_m, pad_m)
    if area.kind is not AreaKind.HEIGHT_LIMIT or not met.any():
        return met
    up_m = setup.layers.return_up_m(pad.vehicle)
    for index in np.flatnonzero(met).tolist():
        ends_m = np.column_stack((np.stack((places_m[index], pad_m[index])), np.full(2, up_m)))
        way_m = sample_leg(ends_m, RETURN_STEP_M)
        met[index] = (_shortfall_m(setup, replace(area, margin_m=ROUNDING_M), way_m) > ROUNDING_M).any()
    return met


def _shortfall_m(setup: FlightSetup, area: Area, places_m: FloatArray) -> FloatArray:
    """Return (m,) how much too near, or too high, (m, 3) places are; negative: they are clear.

    Inside the area itself, not its margin, it is at least the whole margin.
    """
    edges = area.edges_m()
    far = np.full(len(places_m), -math.inf)
    low, high = edges.min(axis=(0, 1)) - area.keep_m, edges.max(axis=(0, 1)) + area.keep_m
    near = np.flatnonzero(((places_m[:, :2] >= low) & (places_m[:, :2] <= high)).all(axis=1))
    if not len(near):
        return far
    at_m = places_m[near]
    away_m = find_nearest_on_legs(at_m[:, :2], edges[:, 0], edges[:, 1] - edges[:, 0])[0].min(axis=1)
    within = np.zeros(len(near), dtype=np.bool_) if area.is_line else _is_enclosed(area, at_m[:, :2])
    short_m = np.where(within, area.keep_m + away_m, area.keep_m - away_m)
    if area.kind is AreaKind.HEIGHT_LIMIT:
        short_m = np.where(short_m > ROUNDING_M, _excess_over_limit_m(setup, area, at_m), -math.inf)
    far[near] = short_m
    return far


def _is_enclosed(area: Area, places_m: FloatArray) -> np.ndarray:
    """Return (m,) whether outlines wind around (m, 2) places: once around the outer one, and around no hole."""
    turns = np.zeros((len(area.rings_m), len(places_m)))
    for number, ring in enumerate(area.rings_m):
        off = np.array(ring) - places_m[:, np.newaxis]
        angles = np.arctan2(off[..., 1], off[..., 0])
        steps = np.diff(np.concatenate((angles, angles[:, :1]), axis=1), axis=1)
        turns[number] = ((steps + math.pi) % (2 * math.pi) - math.pi).sum(axis=1) / (2 * math.pi)
    wound = np.abs(np.round(turns)) % 2 == 1
    return np.asarray(wound[0] & ~wound[1:].any(axis=0))


def _describe_shortfall(area: Area, short_m: float) -> str:
    if area.kind is AreaKind.HEIGHT_LIMIT:
        limit = f"{area.max_agl_m:g} m over the ground" if area.max_agl_m is not None else f"{area.max_amsl_m:g} m"
        return f"{short_m:.1f} m above the limit of area {area.name!r}, {limit}"
    if short_m >= area.margin_m:
        return f"into area {area.name!r}"
    return f"within {area.margin_m - short_m:.1f} m of area {area.name!r}, {area.margin_m:g} m expected"
