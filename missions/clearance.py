"""Measure the heights of a fleet's flights over the ground and over every line.

A line is modelled as a wall: from the ground up to the straight line between the tops of its two pylons, under which
the wires sag. No leg comes within ``BESIDE_M`` horizontally, or it is well above: the inspection height over the tops,
minus a third to allow for the common surface between lines of different heights.

Legs and surface are checked every ``STEP_M``, independently of how they were computed.

Where a raster covers the ground, every leg is also checked against the highest of the cells around each of its places,
and so is the level RTL from everywhere on it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missions.geo import FloatArray, IndexArray
from missions.geometry import find_nearest_on_legs, sample_leg
from missions.network import Network
from missions.setup import LOWEST_FLIGHT_M, FlightSetup
from missions.terrain import describe_ground_place, is_inside_convex
from missions.waypoints import FlightPath, Phase, legs_m

BESIDE_M = 10.0
"""Horizontal distance to a line within which no vehicle flies below its tops: half of a wide cross-arm, plus GPS
error."""
NEAR_M = 50.0
"""Distance to a line within which the ground height is that of its nearest point."""
MARGIN_SHARE = 2.0 / 3.0
"""Least height of a leg above a line's tops, as a share of the inspection height."""
GROUND, TOP = 2, 3
"""Columns of ground and top, after east and north."""
STEP_M = 2.0
SURFACE_STEP_M = 4.0
MAX_POINTS = 20_000
"""Most points checked on a path or the surface; longer ones are checked in larger steps."""
AT_ONCE = 200
"""Consecutive places on a path that are checked against the same lines."""
RETURNS = 400
"""Places on a path from which RTL is checked."""
RETURN_STEP_M = 5.0
ROUNDING_M = 0.02
"""Tolerance: items store heights and positions to 1 cm."""


@dataclass(frozen=True, slots=True)
class HeightOverGround:
    """A height over the ground, and its place."""

    height_m: float
    vehicle: str
    near: str
    """Name of the nearest segment."""


@dataclass(frozen=True, slots=True, eq=False)
class PowerLines:
    """Lines as walls, in local metres over the depot's ground."""

    network: Network
    ends_m: FloatArray
    """(n, 2, 4) float64: east, north, ground and top at each segment's a and b."""
    segments: IndexArray
    """(n,): segment ids."""

    def name_of(self, index: int) -> str:
        """Return the display name of a wall."""
        return self.network.segment_name(int(self.segments[index]))

    def select_near(self, low_m: FloatArray, high_m: FloatArray) -> PowerLines:
        """Return the walls near the box between two (2,) corners."""
        ends_m = self.ends_m[..., :2]
        apart = (ends_m.max(axis=1) < low_m - NEAR_M) | (ends_m.min(axis=1) > high_m + NEAR_M)
        return self.select(np.flatnonzero(~apart.any(axis=1)))

    def select_nearest(self, places_m: FloatArray) -> PowerLines:
        """Return the walls that include the nearest one to each of (m, 2) places, and few others."""
        middle_m = places_m.mean(axis=0)
        around_m = float(np.hypot(*(places_m - middle_m).T).max())
        away_m = self.find_nearest(middle_m[np.newaxis])[0][0]
        # No place is farther than this from the wall nearest to the middle, and so neither from its own nearest wall.
        return self.select(np.flatnonzero(away_m <= float(away_m.min()) + 2.0 * around_m + ROUNDING_M))

    def select(self, kept: IndexArray) -> PowerLines:
        """Return the walls of these indices."""
        return replace(self, ends_m=self.ends_m[kept], segments=self.segments[kept])

    def find_nearest(self, places_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (m, n) horizontal distances of (m, 2) places, and the nearest position on each wall, from 0 to 1."""
        begins_m, ends_m = self.ends_m[:, 0, :2], self.ends_m[:, 1, :2]
        return find_nearest_on_legs(places_m, begins_m, ends_m - begins_m)

    def interpolate_m(self, share: FloatArray, part: int) -> FloatArray:
        """Return (m, n) heights of the ground, or of the tops, at shares of the length of the walls."""
        begins_m, ends_m = self.ends_m[:, 0, part], self.ends_m[:, 1, part]
        return np.asarray(begins_m + share * (ends_m - begins_m), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class ClearanceShortfall:
    """A place that is too low, with its shortfall and the obstacle below."""

    short_m: float
    words: str


LOWER = "fewer vehicles, a smaller layer_m or less of the network make it lower; a higher"
"""Advice on how to reduce heights."""


def margin_m(setup: FlightSetup) -> float:
    """Return the least height of every leg over the top of a line that it crosses or follows."""
    if setup.terrain is not None and setup.terrain.line_margin_m is not None:
        return setup.terrain.line_margin_m
    return MARGIN_SHARE * setup.inspection.height_m


def check_clearance(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[str]:
    """Return messages, one per path, on legs too near to the ground or to a line; empty if there are none.

    Where neither ground nor tops are known, on a flat site, there is nothing to check against.

    Args:
        setup: The network, heights and pads.
        paths: Flights of the setup's vehicles: first missions, or those of a re-plan.
    """
    walls = lines_of(setup)
    if walls is None:
        return []
    found = []
    for path in paths:
        lows = []
        for number, (leg, phase) in enumerate(_iterate_legs(setup, path)):
            points, on_pad = sample_leg(leg, STEP_M), phase in {Phase.TAKEOFF, Phase.LAND}
            both = (
                find_line_shortfall(walls, setup, points, on_pad=on_pad),
                None if on_pad else find_terrain_shortfall(setup, points),
            )
            low = max((one for one in both if one is not None), key=lambda one: one.short_m, default=None)
            if low is not None:
                lows.append((low.short_m, number, phase.value, low.words))
        if lows:
            _, number, phase_name, words = max(lows)
            others = f"; so do {len(lows) - 1} more of its legs" if len(lows) > 1 else ""
            found.append(f"{path.vehicle} on leg {number} ({phase_name}) comes {words}{others}")
        low = _find_return_shortfall(setup, path)
        if low is not None:
            found.append(f"{path.vehicle} on its own RTL, level, comes {low.words}")
    return found


def check_network_clearance(setup: FlightSetup) -> list[str]:
    """Return messages on where any flight of any plan over the network could come too near to a line.

    The inspection legs of all segments and the surface that all other legs follow are checked in the lowest layer; a
    re-plan uses the same heights.
    """
    walls = lines_of(setup)
    if walls is None:
        return []
    network, found = setup.network, []
    legs = np.concatenate((setup.tracks_m, setup.layers.track_heights_m[..., np.newaxis]), axis=2)
    for number, leg in enumerate(legs):
        points = sample_leg(leg, STEP_M)
        lows = (find_line_shortfall(walls, setup, points), find_terrain_shortfall(setup, points))
        name = network.segment_name(number)
        found += [f"the inspection of {name} comes {low.words}" for low in lows if low is not None]
    for number, points in enumerate(_sample_over_lines(setup)):
        low = find_line_shortfall(walls, setup, points)
        if low is not None:
            found.append(f"a transit over {network.segment_name(number)} could come {low.words}")
    return [*found, *check_area(setup)]


def min_height_over_tops_m(setup: FlightSetup, paths: Iterable[FlightPath]) -> float | None:
    """Return the least height of any leg over the top of a line within ``BESIDE_M`` of it; None if there is none."""
    walls = lines_of(setup)
    if walls is None:
        return None
    least_m = math.inf
    for path in paths:
        for leg, _ in _iterate_legs(setup, path):
            points = sample_leg(leg, STEP_M)
            close = walls.select_near(points[:, :2].min(axis=0), points[:, :2].max(axis=0))
            away_m, share = close.find_nearest(points[:, :2])
            over_m = points[:, 2, np.newaxis] - close.interpolate_m(share, TOP)
            least_m = min(least_m, float(np.where(away_m < BESIDE_M, over_m, math.inf).min(initial=math.inf)))
    return None if math.isinf(least_m) else least_m


def find_height_extremes(
    setup: FlightSetup, paths: Iterable[FlightPath]
) -> tuple[HeightOverGround, HeightOverGround] | None:
    """Return the least and the greatest height over the ground of a fleet's flights; None if there are none.

    The ground is the raster's; else that of the nearest place of a line or of the nearest pad; on a flat site the
    depot's. Take-off and landing count with the height at which they end or begin.
    """
    found: list[HeightOverGround] = []
    for path in paths:
        legs = [leg for leg, phase in _iterate_legs(setup, path) if phase not in {Phase.TAKEOFF, Phase.LAND}]
        if legs:
            points = _sample_legs(legs)
            heights_m, near = measure_over_ground(setup, points)
            for index in (int(heights_m.argmin()), int(heights_m.argmax())):
                name = setup.network.segment_name(int(near[index]))
                found.append(HeightOverGround(float(heights_m[index]), path.vehicle, name))
    if not found:
        return None
    return min(found, key=lambda one: one.height_m), max(found, key=lambda one: one.height_m)


def find_max_return_height(setup: FlightSetup) -> HeightOverGround:
    """Return the greatest height of a vehicle's level RTL over the lowest known ground."""
    # Some autopilots take whole metres only: round up.
    ups_m = {
        pad.vehicle: math.ceil(setup.return_height_m(pad.vehicle)) + setup.frame.up_m(pad.alt_m) for pad in setup.pads
    }
    highest = max(ups_m, key=ups_m.__getitem__)
    ground_m, near = _find_lowest_ground(setup)
    return HeightOverGround(ups_m[highest] - ground_m, highest, near)


def max_return_height_m(setup: FlightSetup, vehicle: str) -> float:
    """Return the highest RTL height over its own home at which a vehicle stays below the ceiling."""
    ceiling_m = setup.inspection.return_ceiling_m or setup.inspection.ceiling_m
    return ceiling_m + _find_lowest_ground(setup)[0] - setup.frame.up_m(setup.pad_of(vehicle).alt_m)


def _find_lowest_ground(setup: FlightSetup) -> tuple[float, str]:
    """Return the height of the lowest known ground over the depot's, and the nearest segment."""
    walls, known = lines_of(setup), setup.layers.known
    if walls is None:
        return 0.0, ""
    if known is not None:
        up_m, place_m = known.bottom
        return up_m, walls.name_of(int(walls.find_nearest(place_m[np.newaxis])[0].argmin()))
    ground_m = walls.ends_m[..., GROUND].min(axis=1)
    return float(ground_m.min()), walls.name_of(int(ground_m.argmin()))


def check_ceiling(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[str]:
    """Return messages on missions and RTL flights higher over the ground than ``ceiling_m``."""
    found, own = check_mission_ceiling(setup, paths), find_max_return_height(setup)
    return_ceiling_m = setup.inspection.return_ceiling_m or setup.inspection.ceiling_m
    if own.height_m > return_ceiling_m:
        where = f" near {own.near}" if own.near else ""
        found.append(
            f"the RTL of {own.vehicle} is level, {own.height_m:.0f} m over the ground{where}, above "
            f"{return_ceiling_m:g}: {LOWER} inspection.return_ceiling_m needs a permit"
        )
    return found


def check_mission_ceiling(setup: FlightSetup, paths: Iterable[FlightPath]) -> list[str]:
    """Return a message on the mission highest over the ground, if that exceeds ``ceiling_m``."""
    ceiling_m, heights = setup.inspection.ceiling_m, find_height_extremes(setup, paths)
    if heights is None or heights[1].height_m <= ceiling_m:
        return []
    high = heights[1]
    text = (
        f"the mission of {high.vehicle} goes {high.height_m:.0f} m over the ground near {high.near}, above "
        f"{ceiling_m:g}: {LOWER} inspection.ceiling_m needs a permit"
    )
    return [text]


def find_terrain_shortfall(setup: FlightSetup, points: FloatArray) -> ClearanceShortfall | None:
    """Return the worst shortfall of (m, 3) places over the raster's ground; None if there is none."""
    if setup.terrain is None or not len(points):
        return None
    kept_m, elevation = setup.terrain.kept_m, setup.terrain.elevation
    over_m = points[:, 2] + setup.frame.alt_m - elevation.highest_m(points[:, :2])
    unknown = np.isnan(over_m)
    if unknown.any():
        where = describe_ground_place(points[int(unknown.argmax()), :2], setup.frame, setup.network)
        return ClearanceShortfall(math.inf, f"over ground that {elevation.source} does not cover, {where}")
    worst = int(over_m.argmin())
    short_m = kept_m - float(over_m[worst])
    if short_m <= ROUNDING_M:
        return None
    where = describe_ground_place(points[worst, :2], setup.frame, setup.network)
    least_m = float(over_m[worst])
    words = f"within {least_m:.1f} m of the ground" if least_m >= 0 else f"{-least_m:.1f} m below the ground"
    return ClearanceShortfall(short_m, f"{words} {where}, {kept_m:.0f} m over it expected")


def check_area(setup: FlightSetup) -> list[str]:
    """Return messages on where the surface that all other legs follow comes too near to the raster's ground."""
    if setup.terrain is None or setup.layers.known is None:
        return []
    corners_m, layers = setup.layers.known.corners_m, setup.layers
    low_m, high_m = corners_m.min(axis=0), corners_m.max(axis=0)
    step_m = max(SURFACE_STEP_M, math.sqrt(float((high_m - low_m).prod()) / MAX_POINTS))
    axes = (np.arange(low_m[axis] + 0.5 * step_m, high_m[axis], step_m) for axis in (0, 1))
    places_m = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    places_m = places_m[is_inside_convex(corners_m, places_m)]
    low = find_terrain_shortfall(
        setup, np.column_stack((places_m, layers.surface.interpolate_m(places_m) - layers.tolerance_m))
    )
    return [] if low is None else [f"a transit could come {low.words}"]


def _find_return_shortfall(setup: FlightSetup, path: FlightPath) -> ClearanceShortfall | None:
    """Return the worst shortfall of a vehicle's level RTL from the ends of its legs and from places between them."""
    if setup.terrain is None or not path.waypoints:
        return None
    up_m, ways = setup.layers.return_up_m(path.vehicle), list[FloatArray]()
    all_m = _sample_legs([leg for leg, _ in _iterate_legs(setup, path)])[:, :2]
    for pad in setup.list_pads_of(path.vehicle):
        home_m = np.array([pad.east_m, pad.north_m])
        away_m = np.hypot(*(all_m - home_m).T)
        # RTL paths from neighbouring places are nearly the same: keep those of the places farthest apart.
        from_m = all_m[np.argsort(-away_m)][:: max(1, len(all_m) // RETURNS)]
        ways += [sample_leg(np.array([(*place, up_m), (*home_m, up_m)]), RETURN_STEP_M) for place in from_m.tolist()]
    return find_terrain_shortfall(setup, np.concatenate(ways))


def lines_of(setup: FlightSetup, without: Collection[int] | None = None) -> PowerLines | None:
    """Return the lines of a network; None where heights are not known.

    Args:
        setup: Setup with the network.
        without: Segments that are no lines; default: the network's pylons with viewpoints.
    """
    network, without = setup.network, setup.looks.pylons if without is None else without
    if not network.has_heights:
        return None
    ground_m = np.array([pylon.elevation_m for pylon in network.pylons], dtype=np.float64) - network.frame.alt_m
    tops_m = ground_m + np.array([pylon.height_m for pylon in network.pylons], dtype=np.float64)
    ends = np.array([(segment.a, segment.b) for segment in network.segments], dtype=np.intp)
    lines = np.array([number for number in range(len(ends)) if number not in without], dtype=np.intp)
    heights_m = np.stack((ground_m, tops_m), axis=1)[ends]
    return PowerLines(network, np.concatenate((network.ends_m, heights_m), axis=2)[lines], lines)


def _iterate_legs(setup: FlightSetup, path: FlightPath) -> Iterator[tuple[FloatArray, Phase]]:
    """Yield (2, 3) start and end of every leg, and its phase."""
    if path.waypoints:
        legs = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
        yield from zip(legs, (point.phase for point in path.waypoints), strict=True)


def _sample_legs(legs: Sequence[FloatArray]) -> FloatArray:
    """Return (m, 3) places on all legs, not many more than ``MAX_POINTS``."""
    length_m = sum(float(np.linalg.norm(leg[1] - leg[0])) for leg in legs)
    return np.concatenate([sample_leg(leg, max(SURFACE_STEP_M, length_m / MAX_POINTS)) for leg in legs])


def _sample_over_lines(setup: FlightSetup) -> Iterator[FloatArray]:
    """Yield for each segment (m, 3) places over and next to it, at the lowest height of a leg there."""
    network, layers = setup.network, setup.layers
    step_m = max(SURFACE_STEP_M, 3.0 * float(network.lengths_m.sum()) / MAX_POINTS)
    for ends_m in network.ends_m:
        places = sample_leg(ends_m, step_m)
        along = (ends_m[1] - ends_m[0]) / np.linalg.norm(ends_m[1] - ends_m[0])
        aside = BESIDE_M * np.array([along[1], -along[0]])
        places = np.concatenate((places, places + 0.99 * aside, places - 0.99 * aside))
        yield np.column_stack((places, layers.surface.interpolate_m(places) - layers.tolerance_m))


def find_line_shortfall(
    walls: PowerLines, setup: FlightSetup, points: FloatArray, *, on_pad: bool = False, beside_m: float = BESIDE_M
) -> ClearanceShortfall | None:
    """Return the worst shortfall of (m, 3) places over lines and the ground at them; None if there is none.

    Args:
        walls: All lines.
        setup: Defines the required clearance.
        points: Places and heights over the depot's ground.
        on_pad: Whether they belong to a take-off or a landing.
        beside_m: Distance to a line within which no vehicle is below its top.
    """
    close = walls.select_near(points[:, :2].min(axis=0), points[:, :2].max(axis=0))
    if not len(close.segments):
        return None
    away_m, share = close.find_nearest(points[:, :2])
    for part, kept_m, within_m in ((TOP, margin_m(setup), beside_m), (GROUND, LOWEST_FLIGHT_M, NEAR_M)):
        over_m = points[:, 2, np.newaxis] - close.interpolate_m(share, part)
        short_m = np.where(away_m < within_m, kept_m - over_m, -math.inf)
        worst = np.unravel_index(int(short_m.argmax()), short_m.shape)
        if short_m[worst] > ROUNDING_M:
            words = _describe_height(part, float(over_m[worst]), close.name_of(int(worst[1])), float(away_m[worst]))
            expected = f"{kept_m:.0f}" if part == TOP else f"{kept_m:g}"
            return ClearanceShortfall(float(short_m[worst]), f"{words}, {expected} m over it expected")
        if on_pad:
            break
    return None


def _describe_height(part: int, over_m: float, name: str, away_m: float) -> str:
    if part == GROUND:
        return (f"within {over_m:.1f} m of" if over_m >= 0 else f"{-over_m:.1f} m below") + f" the ground at {name}"
    if over_m < 0:
        return f"{-over_m:.1f} m below the top of {name}, {away_m:.0f} m beside it"
    return f"within {over_m:.1f} m over the top of {name}"


def measure_over_ground(setup: FlightSetup, points: FloatArray) -> tuple[FloatArray, IndexArray]:
    """Return (m,) heights of (m, 3) places over the known ground, and the nearest segments."""
    walls = lines_of(setup)
    flat = walls is None
    if walls is None:
        level_m = np.pad(setup.network.ends_m, ((0, 0), (0, 0), (0, 2)))
        walls = PowerLines(setup.network, level_m, np.arange(len(level_m)))
    stands = (*setup.pads, *setup.day_pads)
    pads = np.array([(pad.east_m, pad.north_m, setup.frame.up_m(pad.alt_m)) for pad in stands])
    heights_m, near = [], []
    for first in range(0, len(points), AT_ONCE):
        part = points[first : first + AT_ONCE]
        close = walls.select_nearest(part[:, :2])
        away_m, share = close.find_nearest(part[:, :2])
        index = away_m.argmin(axis=1)
        every = np.arange(len(part))
        ground_m = close.interpolate_m(share, GROUND)[every, index]
        to_pads_m = np.hypot(part[:, np.newaxis, 0] - pads[:, 0], part[:, np.newaxis, 1] - pads[:, 1])
        if not flat:
            on_pad = to_pads_m.min(axis=1) < away_m[every, index]
            ground_m = np.where(on_pad, pads[to_pads_m.argmin(axis=1), 2], ground_m)
        if setup.terrain is not None:
            known_m = setup.terrain.elevation.interpolate_m(part[:, :2]) - setup.frame.alt_m
            ground_m = np.where(np.isnan(known_m), ground_m, known_m)
        heights_m.append(part[:, 2] - ground_m)
        near.append(close.segments[index])
    return np.concatenate(heights_m), np.concatenate(near)
