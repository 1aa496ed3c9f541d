"""The check that flights keep out of areas, which has nothing to do with how their ways were found.

Legs are looked at every ``STEP_M``: how far each place is from every outline, and whether the outline winds around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.areas import Area, AreaKind
from missions.clearance import heights_over_ground_m
from missions.geo import FloatArray
from missions.geometry import find_nearest_on_legs
from missions.safety import legs_m
from missions.setup import FlightSetup
from missions.shortest_ways import build_obstacle, build_visibility_graph
from missions.waypoints import FlightPath, Phase
from planner import segment_of

STEP_M = 3.0
ROUNDING_M = 0.1
"""Items have places to a centimetre; a straight leg over the curved earth is as straight here to a few."""
RETURN_STEP_M = 20.0
"""How far apart places are from which a vehicle's own way home is looked at."""
AT_ONCE = 2000
"""Places that are held against an area in one step."""


@dataclass(frozen=True, slots=True)
class ReturnCrossing:
    """That a vehicle's own straight way home leads through an area, from some of its legs."""

    vehicle: str
    area: str
    segments: tuple[int, ...]
    """The network's numbers, in the order of flight; legs between segments count for the one that they lead to."""
    on_way_home: bool
    """Whether that is so on the way back as well."""


def check_areas(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[str]:
    """Return in words which flights come into an area, or nearer to it than they should; empty if none do.

    Args:
        setup: Areas, heights and pads.
        paths: Flights of the setup's vehicles: first missions, or those of a re-plan.
    """
    found = []
    for path in paths:
        if not path.waypoints or not setup.areas:
            continue
        legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
        steps = [max(1, math.ceil(math.dist(*leg[:, :2]) / STEP_M)) for leg in legs]
        shares = [np.linspace(0.0, 1.0, count + 1)[:, np.newaxis] for count in steps]
        places_m = np.concatenate([leg[0] + share * (leg[1] - leg[0]) for leg, share in zip(legs, shares, strict=True)])
        numbers = np.repeat(np.arange(len(legs)), [count + 1 for count in steps])
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
    """Return where the straight way home that an autopilot flies by itself would lead through an area.

    The areas themselves count, without their margins; those with a height limit where the way home is above it.

    Args:
        setup: Areas, heights and pads.
        paths: Flights.
        routes: Each vehicle's visits, by its name.
    """
    return tuple(crossing for path in paths for crossing in _find_path_crossings(setup, path, routes[path.vehicle]))


def find_areas_on_return(setup: FlightSetup, vehicle: str, place_m: tuple[float, float]) -> tuple[str, ...]:
    """Return the names of the areas that a straight way home from a place leads through."""
    start_m = np.array([place_m])
    return tuple(dict.fromkeys(area.name for area in setup.areas if _is_crossing(setup, vehicle, area, start_m)[0]))


def describe_crossing(setup: FlightSetup, one: ReturnCrossing) -> str:
    """Return that an own return leads through an area: "its own RTL from segments A, B crosses area 'airfield'"."""
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
            count = max(1, math.ceil(math.dist(*leg) / RETURN_STEP_M))
            places_m = leg[0] + np.linspace(0.0, 1.0, count + 1)[:, np.newaxis] * (leg[1] - leg[0])
            if not _is_crossing(setup, path.vehicle, area, places_m).any():
                continue
            if point.visit is not None:
                segments[segment_of(visits[point.visit])] = None
            elif point.phase is Phase.RETURN:
                on_way_home = True
        if segments or on_way_home:
            yield ReturnCrossing(path.vehicle, area.name, tuple(segments), on_way_home)


def _is_crossing(setup: FlightSetup, vehicle: str, area: Area, places_m: FloatArray) -> np.ndarray:
    """Return (n,) whether the straight ways home from (n, 2) places lead through an area, too high where it matters."""
    pad = setup.pad_of(vehicle)
    pad_m = np.broadcast_to(np.array([pad.east_m, pad.north_m]), places_m.shape)
    bare = build_visibility_graph((replace(build_obstacle(area), keep_m=max(ROUNDING_M, area.width_m / 2)),))
    met = bare.is_blocked(places_m, pad_m) | bare.is_inside(places_m) | bare.is_inside(pad_m)
    if area.kind is not AreaKind.HEIGHT_LIMIT or not met.any():
        return met
    up_m = setup.layers.return_up_m(vehicle)
    for index in np.flatnonzero(met).tolist():
        steps = max(1, math.ceil(math.dist(places_m[index], pad_m[index]) / RETURN_STEP_M))
        share = np.linspace(0.0, 1.0, steps + 1)[:, np.newaxis]
        way_m = np.column_stack((places_m[index] + share * (pad_m[index] - places_m[index]), np.full(steps + 1, up_m)))
        met[index] = (_shortfall_m(setup, replace(area, margin_m=ROUNDING_M), way_m) > ROUNDING_M).any()
    return met


def _shortfall_m(setup: FlightSetup, area: Area, places_m: FloatArray) -> FloatArray:
    """Return (m,) how much nearer (m, 3) places are than they should be, or how much too high; negative: they are not.

    Of an area itself, not its margin, it is at least the whole margin.
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
        over_m = np.full(len(near), -math.inf)
        if area.max_agl_m is not None:
            over_m = np.maximum(over_m, heights_over_ground_m(setup, at_m) - area.max_agl_m)
        if area.max_amsl_m is not None:
            over_m = np.maximum(over_m, at_m[:, 2] + setup.frame.alt_m - area.max_amsl_m)
        short_m = np.where(short_m > ROUNDING_M, over_m, -math.inf)
    far[near] = short_m
    return far


def _is_enclosed(area: Area, places_m: FloatArray) -> np.ndarray:
    """Return (m,) whether the outlines wind around (m, 2) places: once around the outer one, and around no hole."""
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
