"""What the areas of a site mean for a fleet: who keeps out of which, and which segments nobody can reach.

A segment goes to the best vehicle, and to any survivor in a re-plan. One that not every vehicle may fly is therefore
left out for all of them, and so is one in an area with a height limit that some vehicle's layer is above.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from missions.areas import UNKNOWN_GROUND, Area, AreaKind, AreaRestriction, Unreachable
from missions.clearance import heights_over_ground_m
from missions.errors import SafetyError
from missions.geo import FloatArray
from missions.grids import is_inside_convex
from missions.setup import FlightSetup
from missions.shortest_ways import VisibilityGraph, build_obstacle, build_visibility_graph

BEYOND_M = 500.0
"""How far around lines and pads the heights of flights are looked at."""
LOOKS = 40
"""Places along each side of an area at which they are."""
ROUNDING_M = 0.05
OUTSIDE_M = 10_000.0
"""So far around what is known all is closed: no way leads so far to get around it."""
EDGE_M = 1.0
"""What ways keep from its edge."""


def apply_areas(setup: FlightSetup, areas: Sequence[Area], alternates: Sequence[str] = ()) -> FlightSetup:
    """Return a setup whose flights keep out of areas, and know what they cannot reach for it.

    Raises:
        SafetyError: the depot or a pad is in an area, or no way leads from one to the other.
    """
    kept_out = tuple(_build_restrictions(setup, areas))
    _check_depot(kept_out)
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
        above = tuple(name for name in everybody if over_m + setup.layers.offset_m(name) > ROUNDING_M)
        if above:
            limit_m = area.max_agl_m if area.max_agl_m is not None else area.max_amsl_m
            yield AreaRestriction(area, above, (limit_m or 0.0) + over_m + setup.layers.offset_m(above[-1]))


def _restrict_unknown_ground(setup: FlightSetup, kept_out: Sequence[AreaRestriction]) -> Iterator[AreaRestriction]:
    """Yield what lies beyond the ground that is known, if a way around an area would lead there.

    All ways are straight between the lines, the pads and the nodes around areas. As long as these lie where the ground
    is known, which is convex, so does everything that is flown.
    """
    if setup.layers.known is None:
        return
    corners_m = setup.layers.known.corners_m
    nodes_m = build_visibility_graph(tuple(build_obstacle(one.area) for one in kept_out)).nodes_m
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
    """Return how far the lowest layer is above the limit, negative where it is below; None if nobody comes near."""
    places_m = _sample_area(setup, area)
    if not len(places_m):
        return None
    up_m = setup.layers.surface.interpolate_m(places_m) + setup.layers.tolerance_m
    over_m = []
    if area.max_agl_m is not None:
        over_m.append(heights_over_ground_m(setup, np.column_stack((places_m, up_m))) - area.max_agl_m)
    if area.max_amsl_m is not None:
        over_m.append(up_m + setup.frame.alt_m - area.max_amsl_m)
    return float(np.max(over_m))


def _sample_area(setup: FlightSetup, area: Area) -> FloatArray:
    """Return (m, 2) places in an area and its margin, as far as flights may come there."""
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
    return np.asarray(places[build_visibility_graph((build_obstacle(area),)).is_inside(places)])


def _check_depot(kept_out: Sequence[AreaRestriction]) -> None:
    for one in kept_out:
        if build_visibility_graph((build_obstacle(one.area),)).is_inside(np.zeros((1, 2)))[0]:
            raise SafetyError(
                f"depot: expected {one.area.margin_m:g} m or more outside of area {one.area.name!r}, got a place in it"
                f"{describe_height_limit(one)}"
            )


def describe_height_limit(one: AreaRestriction) -> str:
    """Return how high somebody would be in an area with a height limit; nothing for another."""
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
        graph = build_visibility_graph((build_obstacle(one.area),))
        margin = np.flatnonzero(graph.is_inside(begins) | graph.is_inside(ends) | graph.is_blocked(begins, ends))
        bare = build_visibility_graph(
            (replace(build_obstacle(one.area), keep_m=max(ROUNDING_M, one.area.width_m / 2)),)
        )
        within = bare.is_inside(begins) | bare.is_inside(ends) | bare.is_blocked(begins, ends)
        for segment in margin.tolist():
            what = "lies in" if within[segment] else f"lies nearer than {one.area.margin_m:g} m to"
            reasons.setdefault(segment, f"{what} area {one.area.name!r}{describe_height_limit(one)}")
    areas = build_visibility_graph(tuple(build_obstacle(one.area) for one in setup.kept_out))
    others = [number for number in range(len(begins)) if number not in reasons]
    for number, away in zip(others, _find_cut_off(setup, areas, begins[others]), strict=True):
        if away:
            known = any(one.area.name == UNKNOWN_GROUND for one in setup.kept_out)
            where = ", over ground that is known" if known else ""
            reasons[number] = f"no way leads to it around the areas{where}"
    for number in sorted(reasons):
        yield Unreachable(number, reasons[number], setup.network.segment_name(number))


def _find_cut_off(setup: FlightSetup, areas: VisibilityGraph, places_m: FloatArray) -> list[bool]:
    """Return which (n, 2) places no way leads to from the pads.

    Raises:
        SafetyError: no way leads from one pad to another.
    """
    pads_m = np.array([(pad.east_m, pad.north_m) for pad in setup.pads])
    between_m = areas.distances_m(pads_m[0], pads_m)
    for pad, away_m in zip(setup.pads, between_m, strict=True):
        if np.isinf(away_m):
            raise SafetyError(f"pad of {pad.vehicle}: expected a way from the pad of {setup.pads[0].vehicle}, "
                              "got none around the areas")  # fmt: skip
    return [bool(cut) for cut in np.isinf(areas.distances_m(pads_m[0], places_m))]
