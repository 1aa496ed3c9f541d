"""Build the fence of each vehicle, and decide when a new mission needs a wider one.

A vehicle's fence encloses its mission and its RTL path. A mission that would leave it is uploaded only after a fence
that covers the old and the new path, so that fence and mission fit at any moment in between.
"""

from __future__ import annotations

from collections.abc import Mapping

from executor.core.context import Context
from executor.core.lines import position
from executor.core.state.vehicle_parts import OnboardMission
from executor.core.state.vehicle_state import VehicleState
from missions import FlightPath
from missions.fences import Fence, build_fence, build_rally_items, flown_places
from missions.items import MissionItem


def fence_for(context: Context, name: str, path: FlightPath | None) -> Fence | None:
    """Return the fence around a mission, or around the pad without one; None if the site wants no fences."""
    rule = context.fencing
    if rule is None or not rule.enabled:
        return None
    setup = context.vehicles[name]
    places_m = [*flown_places(setup.pad_m, path, context.frame), *setup.day_pads_m]
    return build_fence(places_m, rule.margin_m, fence_top_m(context, name))


def build_first_fences(context: Context, boards: Mapping[str, OnboardMission | None]) -> dict[str, Fence]:
    """Return the fence of every vehicle before the flight."""
    found = {name: fence_for(context, name, None if board is None else board.path) for name, board in boards.items()}
    return {name: fence for name, fence in found.items() if fence is not None}


def widen_fence(context: Context, name: str, known: Fence | None, path: FlightPath) -> Fence | None:
    """Return the fence that a new mission needs; None if the present one covers it, or none is wanted."""
    needed = fence_for(context, name, path)
    if needed is None or (known is not None and known.is_covering(needed)):
        return None
    return needed if known is None else known.merge_with(needed)


def fence_top_m(context: Context, name: str) -> float:
    """Return the top of a vehicle's fence over its home: above any plan of this flight, and above its RTL.

    No later plan of the flight needs another.
    """
    setup = context.setup
    home_up_m = setup.frame.up_m(min(pad.alt_m for pad in setup.list_pads_of(name)))  # home may be any of them
    over_home_m = setup.layers.offset_m(name) - home_up_m
    highest_m = max(float(setup.layers.track_heights_m.max()) + over_home_m, setup.layers.return_up_m(name) - home_up_m)
    return highest_m + (0.0 if context.fencing is None else context.fencing.height_margin_m)


def height_over_fence_m(context: Context, name: str, path: FlightPath) -> float:
    """Return how far a mission exceeds the fence's top, which is a parameter and stays in flight; 0 inside."""
    if context.fencing is None or not context.fencing.enabled:
        return 0.0
    return max(0.0, max((point.alt_rel_m for point in path.waypoints), default=0.0) - fence_top_m(context, name))


FENCE_ERROR_M = 3.0
"""Position error allowed at the fence; the fence keeps more distance from the vehicle's paths."""


def describe_fence_departure(vehicle: VehicleState, now_s: float, stale_s: float) -> str:
    """Return in words how far a vehicle is outside its fence; empty inside, or if unknown."""
    fence, fix = vehicle.assignment.fence, vehicle.motion.fix
    if fence is None or fix is None or fix.reckoned or now_s - fix.at_s > stale_s:
        return ""
    out_m, over_m = fence.distance_outside_m(fix.place_m), fix.alt_rel_m - fence.top_m
    if max(out_m, over_m) <= FENCE_ERROR_M:
        return ""
    line = position.OUTSIDE_FENCE if out_m >= over_m else position.ABOVE_FENCE
    return line.format(out_m=out_m, over_m=over_m)


def build_rally_list(context: Context, name: str) -> tuple[MissionItem, ...] | None:
    """Return the rally points to upload to a vehicle; None if its own are kept."""
    rule = context.fencing
    if rule is None or not rule.enabled or rule.rally == "keep":
        return None
    setup = context.vehicles[name]
    return build_rally_items(dict.fromkeys((setup.pad_m, *setup.day_pads_m)), context.frame)
