"""When an operator's wish is refused: it would be unsafe, or there is nothing to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from executor.core.context import Context
from executor.core.custody.causes import in_other_hands
from executor.core.homing import homeward
from executor.core.intents import BEFORE, FOR_ALL, Action, Intent
from executor.core.places import where
from executor.core.replan import replanning
from executor.core.roster.offers import open_segments
from executor.core.state import FleetState
from executor.core.vehicle import IN_THE_AIR, Stage, VehicleState
from missions import Phase
from planner import segment_of

LINE_M = 12.0
"""Nearer to the line than this nobody lands: wires sag and swing, and pylons are 5 to 10 m wide."""
PAD_M = 4.0
"""Nearer to somebody else's pad than this nobody lands."""
LEAST_SPARE_PCT = 5.0
"""A battery with less than this over the reserve brings nobody back into the plan."""
NOT_BEGUN = "the flight has not begun"
_ON_GROUND = frozenset({Stage.GROUND, Stage.LANDED, Stage.DOWN})
_COMMANDING = frozenset({Action.HOLD, Action.RESUME, Action.RETURN, Action.LAND})


def reason(context: Context, state: FleetState, intent: Intent, now_s: float) -> str:
    """Return why an intent is refused; empty if it is not."""
    if state.progress.finished:
        return "the flight is over"
    if intent.action in BEFORE:
        return _before(state, intent)
    if state.progress.launched_s is None:
        return NOT_BEGUN
    if intent.action in FOR_ALL:
        if intent.vehicle is not None:
            return f"{intent.action.value} concerns everybody; expected no vehicle"
        return _FLEET[intent.action](context, state, now_s)
    if intent.vehicle is None:
        return f"{intent.action.value} needs a vehicle: one of {', '.join(state.vehicles)}"
    vehicle = state.vehicles.get(intent.vehicle)
    if vehicle is None:
        return f"there is no vehicle {intent.vehicle!r}: expected one of {', '.join(state.vehicles)}"
    return _VEHICLE[intent.action](context, state, vehicle, now_s)


def question(context: Context, state: FleetState, intent: Intent) -> str:
    """Return what has to be confirmed before an intent is carried out that is not refused; empty if nothing has."""
    vehicle = None if intent.vehicle is None else state.vehicles.get(intent.vehicle)
    if vehicle is None or intent.confirmed:
        return ""
    if intent.action is Action.DISARM:
        where_ = where(context, vehicle)
        return f"{vehicle.name} is down at {where_}: stop its motors by force? If it flies after all, it falls"
    if intent.action is Action.INCLUDE and vehicle.stage is not Stage.PILOT:
        return f"{vehicle.name} may take off as soon as its mission is on board: is its pad clear of people?"
    if intent.action in _COMMANDING and in_other_hands(vehicle):
        return f"{vehicle.name} is with its pilot: take it out of the pilot's hands? Speak to the pilot first"
    return ""


def _before(state: FleetState, intent: Intent) -> str:
    asked = state.crew.briefing.question
    if state.progress.launched_s is not None:
        return "the flight has begun"
    if intent.vehicle is not None:
        return f"{intent.action.value} concerns everybody; expected no vehicle"
    return "" if asked is not None and asked.id == intent.action.value else "nobody asks for that now"


def _silent(vehicle: VehicleState, context: Context, now_s: float) -> str:
    heard_s = vehicle.link.heard_s
    if heard_s is None:
        return "it was never heard"
    if now_s - heard_s >= context.limits.link_stale_s:
        return f"nothing was heard from it for {now_s - heard_s:.0f} s"
    return ""


def _hold(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:  # noqa: ARG001
    if vehicle.stage is not Stage.FLYING and vehicle.stage is not Stage.PILOT:
        return f"it does not fly its mission, it is {vehicle.stage.value}"
    if vehicle.orders.held_s is not None:
        return "it holds already"
    if vehicle.fault is not None or vehicle.orders.excluded:
        return "it is out of the plan; it can be told to return or to land"
    if vehicle.assignment.pending is not None:
        return "its new mission is being put on board; ask again in a moment"
    phase = None if vehicle.leg is None else vehicle.leg.phase
    if phase is Phase.TAKEOFF:
        return "it climbs from its pad; below its layer it would be in the way of others"
    if phase is Phase.LAND:
        return "it is landing"
    return _silent(vehicle, context, now_s)


def _resume(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:
    if vehicle.stage is Stage.PILOT:
        return "its pilot has it, and must put it back on its mission; then it can be included"
    if vehicle.stage is not Stage.FLYING or vehicle.orders.held_s is None:
        return f"it does not hold by an order, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return "everybody was sent home"
    return _silent(vehicle, context, now_s)


def _return(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:  # noqa: ARG001
    match vehicle.stage:
        case Stage.RETURNING if homeward.comes_home(context, vehicle):
            return "it is on its way home already"
        case Stage.GROUND | Stage.LANDED | Stage.DOWN:
            return "it is on the ground"
        case Stage.LOST:
            return "its link is lost; when it is regained, it is told to return"
        case _:
            return ""


def _land(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:
    fix = vehicle.motion.fix
    if vehicle.stage not in IN_THE_AIR or not vehicle.armed:
        return f"it does not fly, it is {vehicle.stage.value}"
    if vehicle.orders.lands:
        return "it is landing already"
    if fix is None or now_s - fix.at_s > context.limits.link_stale_s:
        return "nobody knows where it is now"
    line_m = _from_line_m(context, fix.place_m)
    if line_m < LINE_M:
        return f"it is {line_m:.0f} m from the line, where nobody can land safely; let it return"
    for other in state.vehicles:
        pad_m = context.vehicles[other].pad_m
        if other != vehicle.name and math.dist(fix.place_m, pad_m) < PAD_M:
            return f"it would land on the pad of {other}"
    return ""


def _from_line_m(context: Context, place_m: tuple[float, float]) -> float:
    """Return the distance to the nearest segment, seen from above."""
    least_m = math.inf
    for (ax, ay), (bx, by) in context.setup.network.ends_m.tolist():
        along_x, along_y = bx - ax, by - ay
        share = ((place_m[0] - ax) * along_x + (place_m[1] - ay) * along_y) / (along_x**2 + along_y**2)
        share = min(1.0, max(0.0, share))
        least_m = min(least_m, math.dist(place_m, (ax + share * along_x, ay + share * along_y)))
    return least_m


def _exclude(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:  # noqa: ARG001
    if vehicle.fault is not None:
        return f"it is out of the plan already: {vehicle.fault.reason}"
    if vehicle.orders.excluded:
        return "it is out of the plan already"
    return ""


def _include(  # noqa: PLR0911 - one return for each reason
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> str:
    setup, remaining = context.vehicles[vehicle.name], vehicle.power.battery.remaining_pct
    if vehicle.stage is Stage.PILOT:
        return _from_its_pilot(state, vehicle)
    if vehicle.stage not in _ON_GROUND or vehicle.armed:
        return f"it is not on the ground with its motors off, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return "everybody was sent home"
    if silent := _silent(vehicle, context, now_s):
        return silent
    if vehicle.sensors.tilted_since_s is not None:
        return "it leans as no vehicle stands"
    if vehicle.orders.cleared_s is not None:
        return "it is cleared for take-off already"
    if (
        vehicle.fault is None
        and not vehicle.orders.excluded
        and not vehicle.assignment.stubborn
        and not open_segments(context, state)
    ):
        return "it is in the plan, and nothing is left over for it"
    if vehicle.motion.fix is None or math.dist(vehicle.motion.fix.place_m, setup.pad_m) > context.limits.off_pad_m:
        return "it does not stand on its pad; its way up and down is planned from there"
    if remaining is None or remaining < setup.reserve_pct + LEAST_SPARE_PCT:
        shown = "unknown" if remaining is None else f"{remaining:.0f} %"
        return f"its battery is {shown}; expected more than its reserve of {setup.reserve_pct:g} %"
    return ""


def _from_its_pilot(state: FleetState, vehicle: VehicleState) -> str:
    if vehicle.custody.taken is None or vehicle.custody.taken.returned_s is None:
        return "its pilot has it, and must put it back on its mission first"
    if vehicle.fault is not None:
        return f"it is out of the plan: {vehicle.fault.reason}"
    return "everybody was sent home" if state.progress.recalled else ""


def _disarm(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> str:  # noqa: ARG001
    if vehicle.stage is not Stage.DOWN:
        return f"it is not down, it is {vehicle.stage.value}"
    if not vehicle.armed:
        return "its motors are off already"
    return _silent(vehicle, context, now_s)


def _replan(context: Context, state: FleetState, now_s: float) -> str:
    if state.progress.recalled:
        return "everybody was sent home"
    if state.replanning.replan is not None or state.replanning.ordered:
        return "a re-plan is under way"
    offers = [offer for vehicle in state.vehicles.values() if (offer := replanning.survivor(context, vehicle, now_s))]
    if not offers:
        return "nobody can be given anything now"
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    if not freed and not state.coverage.given_up and not replanning.orphans(context, state):
        return "nothing is left to plan anew"
    return ""


def _abort(context: Context, state: FleetState, now_s: float) -> str:  # noqa: ARG001
    flies = any(vehicle.stage in {Stage.STARTING, Stage.FLYING} for vehicle in state.vehicles.values())
    if not flies and state.crew.offer is None:
        return "nobody flies a mission"
    return ""


_VEHICLE: Mapping[Action, Callable[[Context, FleetState, VehicleState, float], str]] = {
    Action.HOLD: _hold,
    Action.RESUME: _resume,
    Action.RETURN: _return,
    Action.LAND: _land,
    Action.EXCLUDE: _exclude,
    Action.INCLUDE: _include,
    Action.DISARM: _disarm,
}
_FLEET: Mapping[Action, Callable[[Context, FleetState, float], str]] = {Action.REPLAN: _replan, Action.ABORT: _abort}
