"""Compute the height that a vehicle's mission prescribes at its position, and detect flight far below it.

Both autopilots fly a straight line between two waypoints, vertically too. The line comes from the mission that we
uploaded, or, for a flight planned by others, from the items in its log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.context import Scene, VehicleSetup
from executor.core.state.vehicle_parts import OwnMission, PositionFix
from executor.core.state.vehicle_state import VehicleState
from missions import Phase
from missions.autopilots.dialect import is_mission_mode
from missions.items import Frame, MissionItem

_LEVEL_PHASES = frozenset({Phase.TRANSIT, Phase.INSPECT, Phase.RETURN})
"""Phases with a prescribed height; take-off and landing have none."""
WAYPOINT, SPLINE, LAST_NAV_COMMAND = 16, 82, 95
"""MAV_CMD of items flown through, and the last navigation command."""
_STOPPING_ITEMS = frozenset({17, 18, 19})
"""MAV_CMD of items where the vehicle stops."""
GROUND_ITEMS = frozenset({20, 21, 22, 84, 85})
"""MAV_CMD of return, landing and take-off."""
_HOME_FRAMES = frozenset({Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT})
_SEA_FRAMES = frozenset({Frame.GLOBAL, Frame.GLOBAL_INT})
DEG_E7 = 1e7
ITEM_STALE_S = 5.0
"""Age at which the current item is stale; both autopilots report it at least once a second."""


@dataclass(frozen=True, slots=True)
class AskedHeight:
    """The height that a mission prescribes at one moment."""

    below_m: float
    """Distance of the vehicle below it."""
    sinks_m_s: float
    """Descent rate of the leg at the vehicle's ground speed; 0 on a level or climbing leg."""


@dataclass(frozen=True, slots=True)
class _Slope:
    """A straight line between two heights."""

    from_m: tuple[float, float]
    from_up_m: float
    to_m: tuple[float, float]
    to_up_m: float

    def share(self, place_m: tuple[float, float]) -> float:
        """Return the share of the line behind a place."""
        (east, north), (x, y) = self.from_m, self.to_m
        length2 = (x - east) ** 2 + (y - north) ** 2
        if length2 < 1.0:
            return 1.0  # vertical: its end counts
        return ((place_m[0] - east) * (x - east) + (place_m[1] - north) * (y - north)) / length2

    def height_for(self, fix: PositionFix, up_m: float) -> AskedHeight:
        """Return the prescribed height for a vehicle at `up_m`."""
        rise_m = self.to_up_m - self.from_up_m
        height_m = self.from_up_m + rise_m * min(1.0, max(0.0, self.share(fix.place_m)))
        run_m = max(1.0, math.dist(self.from_m, self.to_m))
        sinks_m_s = max(0.0, -rise_m) / run_m * math.hypot(*fix.velocity_m_s[:2])
        return AskedHeight(height_m - up_m, sinks_m_s)


def find_mission_height(context: Scene, setup: VehicleSetup, state: VehicleState) -> AskedHeight | None:
    """Return the prescribed height; None off the mission, during take-off and landing, or if it is unknown."""
    fix = state.motion.fix
    flies = state.armed and state.sortie.took_off and is_mission_mode(setup.dialect, state.mode)
    if fix is None or not flies:
        return None
    return _find_planned_height(state, fix) if setup.planned else _find_onboard_height(context, state.own, fix)


def is_stopped_below_mission(context: Scene, setup: VehicleSetup, state: VehicleState) -> bool:
    """Return whether a vehicle in mission mode has stopped far below its mission."""
    if state.motion.stood_s < context.limits.lies_s:
        return False
    asked = find_mission_height(context, setup, state)
    return asked is not None and asked.below_m >= context.limits.below_mission_m


def _find_planned_height(state: VehicleState, fix: PositionFix) -> AskedHeight | None:
    board, number = state.assignment.board, state.assignment.waypoint
    if board is None or state.assignment.carried.foreign_s is not None or number < 1:
        return None
    if fix.at_s - (state.telemetry.item_s or fix.at_s) > ITEM_STALE_S:
        return None  # the current leg is unknown
    points, asked = board.path.waypoints, list[AskedHeight]()
    for index in range(number, len(points)):
        if points[index].phase not in _LEVEL_PHASES:
            return None
        one = _Slope(
            board.places_m[index - 1], points[index - 1].alt_rel_m, board.places_m[index], points[index].alt_rel_m
        )
        asked.append(one.height_for(fix, fix.alt_rel_m))
        if one.share(fix.place_m) < 1.0 or index > number:
            break  # past its end the next leg may have begun; the index is reported once a second
    if not asked:
        return None
    return AskedHeight(min(one.below_m for one in asked), max(one.sinks_m_s for one in asked))


def _find_onboard_height(context: Scene, own: OwnMission, fix: PositionFix) -> AskedHeight | None:
    ends = item_of(own, own.leads_to)
    if (
        ends is None
        or ends.command not in {WAYPOINT, SPLINE} | _STOPPING_ITEMS
        or (up_m := _up_in(ends.frame, fix)) is None
    ):
        return None
    begins, began = item_of(own, own.came_from), own.leg_from
    if begins is not None and begins.command == WAYPOINT and begins.frame == ends.frame:
        from_m, from_up_m = _place_m(context, begins, fix), begins.z
    elif began is not None and (began_up_m := _up_in(ends.frame, began)) is not None:
        from_m, from_up_m = began.place_m, began_up_m
    else:
        return None
    return _Slope(from_m, from_up_m, _place_m(context, ends, fix), ends.z).height_for(fix, up_m)


def _up_in(frame: int, fix: PositionFix) -> float | None:
    """Return a vehicle's height in an item's frame; None for heights over terrain, which are unknown."""
    return fix.alt_rel_m if frame in _HOME_FRAMES else fix.alt_msl_m if frame in _SEA_FRAMES else None


def _place_m(context: Scene, item: MissionItem, fix: PositionFix) -> tuple[float, float]:
    if not item.x and not item.y:
        return fix.place_m  # no coordinates: the item applies in place
    return context.frame.to_local_m(item.x / DEG_E7, item.y / DEG_E7)


def item_of(own: OwnMission, number: int | None) -> MissionItem | None:
    """Return an item of a mission by its number, if it was received."""
    if number is None:
        return None
    if number < len(own.listed) and own.listed[number].seq == number:
        return own.listed[number]
    return next((one for one in own.listed if one.seq == number), None)


def add_onboard_item(own: OwnMission, item: MissionItem) -> OwnMission:
    """Return a mission with a received item added; item 0 begins a new mission."""
    others = () if item.seq == 0 else tuple(one for one in own.listed if one.seq != item.seq)
    if not others or others[-1].seq < item.seq:
        return replace(own, listed=(*others, item))
    return replace(own, listed=tuple(sorted((*others, item), key=lambda one: one.seq)))


def record_current_item(own: OwnMission, number: int, fix: PositionFix | None) -> OwnMission:
    """Return a mission with its current item updated; items that are not navigation commands are skipped."""
    item = item_of(own, number)
    if number == own.leads_to or (item is not None and item.command > LAST_NAV_COMMAND):
        return own
    return replace(own, leads_to=number, came_from=own.leads_to, leg_from=fix)


def restart_mission_here(own: OwnMission) -> OwnMission:
    """Return a mission as continued from the current position, in this mode or after another."""
    return own if own.leg_from is None and own.came_from is None else replace(own, came_from=None, leg_from=None)
