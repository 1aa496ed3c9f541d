"""When an operator's wish is refused: it would be unsafe, or there is nothing to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from executor.core.context import Context
from executor.core.custody.causes import in_other_hands
from executor.core.homing import homeward
from executor.core.intents import BEFORE, FOR_ALL, FOR_BASE, Action, Intent, IntentReason
from executor.core.places import where
from executor.core.replan import replanning, survivors
from executor.core.roster import turnaround
from executor.core.roster.bases import base_names, is_closed
from executor.core.roster.offers import open_segments, takes_off_again
from executor.core.seeing import again, proof
from executor.core.setups import setup_now
from executor.core.state import FleetState
from executor.core.vehicle import IN_THE_AIR, Stage, VehicleState
from missions import Phase
from missions.geometry import place_distances_m
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

Why = tuple[IntentReason, str] | None
"""The code of a refusal with its words; None where nothing is refused."""


def reason(context: Context, state: FleetState, intent: Intent, now_s: float) -> Why:
    """Return why an intent is refused, as code and words; None if it is not."""
    if state.progress.finished:
        return IntentReason.OVER, "the flight is over"
    if intent.action in BEFORE:
        return _before(state, intent)
    if state.progress.launched_s is None:
        return IntentReason.NOT_BEGUN, NOT_BEGUN
    if intent.action in FOR_BASE:
        return _of_base(context, state, intent)
    if intent.action in FOR_ALL:
        return _of_all(context, state, intent, now_s)
    if intent.vehicle is None:
        return (
            IntentReason.VEHICLE_MISSING,
            f"{intent.action.value} needs a vehicle: one of {', '.join(state.vehicles)}",
        )
    vehicle = state.vehicles.get(intent.vehicle)
    if vehicle is None:
        return (
            IntentReason.VEHICLE_UNKNOWN,
            f"there is no vehicle {intent.vehicle!r}: expected one of {', '.join(state.vehicles)}",
        )
    return _VEHICLE[intent.action](context, state, vehicle, now_s)


def _of_all(context: Context, state: FleetState, intent: Intent, now_s: float) -> Why:
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for the whole fleet; expected no vehicle"
    if intent.action is Action.PROVE and intent.assets:
        return _look_again(context, state, intent, now_s)
    return _FLEET[intent.action](context, state, now_s)


def _of_base(context: Context, state: FleetState, intent: Intent) -> Why:
    known = base_names(context)
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for a base; expected no vehicle"
    if intent.base not in known:
        expected = f"expected one of {', '.join(known)}" if known else "this flight is not a day plan"
        return IntentReason.BASE_UNKNOWN, f"there is no base {intent.base!r}: {expected}"
    shut = is_closed(context, state, intent.base)
    if intent.action is Action.CLOSE and shut:
        return IntentReason.BASE_CLOSED, "it is closed already"
    return (IntentReason.BASE_OPEN, "it is not closed") if intent.action is Action.OPEN and not shut else None


def question(context: Context, state: FleetState, intent: Intent) -> str:
    """Return what has to be confirmed before an intent is carried out that is not refused; empty if nothing has."""
    vehicle = None if intent.vehicle is None else state.vehicles.get(intent.vehicle)
    if vehicle is None or intent.confirmed:
        return ""
    if intent.action is Action.DISARM:
        where_ = where(context, vehicle)
        return f"{vehicle.name} is down at {where_}: force its motors off? If it is still flying, it will fall"
    if intent.action is Action.SWAP:
        named = f"Is pack {intent.pack} installed" if intent.pack else "Is another pack installed, or its own charged"
        return f"{vehicle.name} will take off once its checks pass. {named}, and its pad clear of people?"
    if intent.action is Action.INCLUDE and vehicle.stage is not Stage.PILOT:
        return f"{vehicle.name} may take off once its mission is uploaded. Is its pad clear of people?"
    if intent.action in _COMMANDING and in_other_hands(vehicle):
        return f"{vehicle.name} is with its pilot. Take control of it? Speak to the pilot first"
    return ""


def _before(state: FleetState, intent: Intent) -> Why:
    asked = state.crew.briefing.question
    if state.progress.launched_s is not None:
        return IntentReason.BEGUN, "the flight has begun"
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for the whole fleet; expected no vehicle"
    open_ = asked is not None and asked.id == intent.action.value
    return None if open_ else (IntentReason.NOT_ASKED, "that question is not pending")


def _silent(vehicle: VehicleState, context: Context, now_s: float) -> Why:
    heard_s = vehicle.link.heard_s
    if heard_s is None:
        return IntentReason.NEVER_HEARD, "no message was ever received from it"
    if now_s - heard_s >= context.limits.link_stale_s:
        return IntentReason.LINK_STALE, f"no message from it for {now_s - heard_s:.0f} s"
    return None


def _hold(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:  # noqa: ARG001
    if vehicle.stage is not Stage.FLYING and vehicle.stage is not Stage.PILOT:
        return IntentReason.NOT_ON_MISSION, f"it is not on its mission, it is {vehicle.stage.value}"
    if vehicle.orders.held_s is not None:
        return IntentReason.ON_HOLD, "it holds already"
    if vehicle.fault is not None or vehicle.orders.excluded:
        return IntentReason.OUT_OF_PLAN, "it is out of the plan; return or land it"
    if vehicle.assignment.pending is not None:
        return IntentReason.UPLOADING, "mission upload in progress; try again in a moment"
    phase = None if vehicle.leg is None else vehicle.leg.phase
    if phase is Phase.TAKEOFF:
        return IntentReason.CLIMBING, "it is climbing from its pad; below its layer it could conflict with others"
    if phase is Phase.LAND:
        return IntentReason.LANDING, "it is landing"
    return _silent(vehicle, context, now_s)


def _resume(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:
    if vehicle.stage is Stage.PILOT:
        return IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode; then include it"
    if vehicle.stage is not Stage.FLYING or vehicle.orders.held_s is None:
        return IntentReason.NOT_ON_HOLD, f"it is not on hold, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    return _silent(vehicle, context, now_s)


def _return(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:  # noqa: ARG001
    match vehicle.stage:
        case Stage.RETURNING if homeward.comes_home(context, vehicle):
            return IntentReason.RETURNING, "it is on its way home already"
        case Stage.GROUND | Stage.LANDED | Stage.DOWN:
            return IntentReason.ON_GROUND, "it is on the ground"
        case Stage.LOST:
            return IntentReason.LINK_LOST, "no link; RTL will be commanded as soon as the link is back"
        case _:
            return None


def _land(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:
    fix = vehicle.motion.fix
    if vehicle.stage not in IN_THE_AIR or not vehicle.armed:
        return IntentReason.NOT_FLYING, f"it is not flying, it is {vehicle.stage.value}"
    if vehicle.orders.lands:
        return IntentReason.LANDING, "it is landing already"
    if fix is None or now_s - fix.at_s > context.limits.link_stale_s:
        return IntentReason.POSITION_UNKNOWN, "its position is not known"
    line_m = _from_line_m(context, fix.place_m)
    if line_m < LINE_M:
        return IntentReason.NEAR_LINE, f"it is {line_m:.0f} m from the line, too near to land safely; use return"
    for other in state.vehicles:
        pad_m = context.vehicles[other].pad_m
        if other != vehicle.name and math.dist(fix.place_m, pad_m) < PAD_M:
            return IntentReason.OTHER_PAD, f"it would land on the pad of {other}"
    return None


def _from_line_m(context: Context, place_m: tuple[float, float]) -> float:
    """Return the distance to the nearest segment, seen from above."""
    return float(place_distances_m(context.setup.network.ends_m, np.array([place_m])).min(initial=math.inf))


def _exclude(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:  # noqa: ARG001
    if vehicle.fault is not None:
        return IntentReason.OUT_OF_PLAN, f"it is out of the plan already: {vehicle.fault.reason}"
    if vehicle.orders.excluded:
        return IntentReason.OUT_OF_PLAN, "it is out of the plan already"
    return None


def _include(  # noqa: PLR0911 - one return for each reason
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> Why:
    setup, remaining = setup_now(context, vehicle), vehicle.power.battery.remaining_pct
    if vehicle.stage is Stage.PILOT:
        return _from_its_pilot(state, vehicle)
    if vehicle.stage not in _ON_GROUND or vehicle.armed:
        return IntentReason.NOT_AT_REST, f"it is not on the ground with its motors off, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    if silent := _silent(vehicle, context, now_s):
        return silent
    if stays := _stays(vehicle):
        return stays
    if vehicle.orders.cleared_s is not None or vehicle.turn.asked_s is not None:
        return IntentReason.CLEARED, "it is cleared for take-off already"
    if (
        vehicle.fault is None
        and not vehicle.orders.excluded
        and not vehicle.assignment.stubborn
        and not open_segments(context, state)
        and not takes_off_again(state, vehicle)
    ):
        return IntentReason.IN_PLAN, "it is in the plan already, and no segment is left over"
    if vehicle.motion.fix is None or math.dist(vehicle.motion.fix.place_m, setup.pad_m) > context.limits.off_pad_m:
        return IntentReason.OFF_PAD, "it is not on its pad, where its climb and landing are planned"
    if remaining is None or remaining < setup.reserve_pct + LEAST_SPARE_PCT:
        shown = "unknown" if remaining is None else f"{remaining:.0f} %"
        return (
            IntentReason.BATTERY_LOW,
            f"its battery is {shown}; expected more than its reserve of {setup.reserve_pct:g} %",
        )
    return None


def _stays(vehicle: VehicleState) -> Why:
    """Return why a vehicle may not take off from where it stands."""
    if vehicle.sensors.tilted_since_s is not None:
        return IntentReason.TILTED, "it is tilted, it may have tipped over"
    return (IntentReason.BASE_CLOSED, "its base is closed; open it first") if vehicle.orders.base_closed else None


def _swap(  # noqa: PLR0911 - one return for each reason
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> Why:
    if vehicle.stage is Stage.PILOT:
        return IntentReason.WITH_PILOT, "it is with its pilot"
    if vehicle.stage not in _ON_GROUND or vehicle.armed:
        return IntentReason.NOT_AT_REST, f"it is not on the ground with its motors off, it is {vehicle.stage.value}"
    if vehicle.link.heard_s is None:
        return IntentReason.NEVER_HEARD, "no message was ever received from it"
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    if vehicle.orders.base_closed:
        return IntentReason.BASE_CLOSED, "its base is closed; open it first"
    if vehicle.turn.asked_s is not None:
        return IntentReason.SWAPPING, "its turnaround is under way already"
    if vehicle.assignment.pending is not None or vehicle.orders.cleared_s is not None:
        return IntentReason.CLEARED, "it is cleared for take-off already"
    if not turnaround.next_visits(context, state, vehicle) and not _open_for(context, state, vehicle):
        return IntentReason.NOTHING_TO_PLAN, "no open segment for another sortie"
    if why := turnaround.out_of_hours(context, state, vehicle, now_s):
        return IntentReason.OUT_OF_HOURS, why
    return None


def _open_for(context: Context, state: FleetState, vehicle: VehicleState) -> frozenset[int]:
    if context.day is not None:
        return turnaround.unplanned(context, state) - vehicle.turn.beyond
    return open_segments(context, state)


def _from_its_pilot(state: FleetState, vehicle: VehicleState) -> Why:
    if vehicle.custody.taken is None or vehicle.custody.taken.returned_s is None:
        return IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode first"
    if vehicle.fault is not None:
        return IntentReason.OUT_OF_PLAN, f"it is out of the plan: {vehicle.fault.reason}"
    return (IntentReason.ABORTED, "the flight was aborted") if state.progress.recalled else None


def _disarm(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Why:  # noqa: ARG001
    if vehicle.stage is not Stage.DOWN:
        return IntentReason.NOT_DOWN, f"it is not down, it is {vehicle.stage.value}"
    if not vehicle.armed:
        return IntentReason.DISARMED, "its motors are off already"
    return _silent(vehicle, context, now_s)


def _replan(context: Context, state: FleetState, now_s: float) -> Why:
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    if state.replanning.replan is not None or state.replanning.ordered:
        return IntentReason.REPLANNING, "a re-plan is under way"
    offers = [offer for vehicle in state.vehicles.values() if (offer := survivors.survivor(context, vehicle, now_s))]
    if not offers:
        return IntentReason.NO_VEHICLE, "no vehicle can take a new route now"
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    left = state.coverage.given_up | replanning.left_over(state)
    if not freed and not left and not replanning.orphans(context, state):
        return IntentReason.NOTHING_TO_PLAN, "nothing is left to re-plan"
    return None


def _prove(context: Context, state: FleetState, now_s: float) -> Why:
    if not state.coverage.unproven() | proof.missed(context, state):
        return IntentReason.NOTHING_TO_PLAN, "every counted segment is already proven by positions"
    return _nobody_free(context, state, now_s)


def _look_again(context: Context, state: FleetState, intent: Intent, now_s: float) -> Why:
    found = again.to_look_at(context, state, intent.assets)
    return _nobody_free(context, state, now_s) if isinstance(found, frozenset) else found


def _nobody_free(context: Context, state: FleetState, now_s: float) -> Why:
    """Return why no re-plan can begin now; that nothing is open yet is no reason."""
    why = _replan(context, state, now_s)
    return None if why is not None and why[0] is IntentReason.NOTHING_TO_PLAN else why


def _abort(context: Context, state: FleetState, now_s: float) -> Why:
    flies = any(vehicle.stage in {Stage.STARTING, Stage.FLYING} for vehicle in state.vehicles.values())
    if not flies and state.crew.offer is None and not turnaround.awaited(context, state, now_s):
        return IntentReason.NO_VEHICLE, "no vehicle is on a mission"
    return None


_VEHICLE: Mapping[Action, Callable[[Context, FleetState, VehicleState, float], Why]] = {
    Action.HOLD: _hold,
    Action.RESUME: _resume,
    Action.RETURN: _return,
    Action.LAND: _land,
    Action.EXCLUDE: _exclude,
    Action.INCLUDE: _include,
    Action.SWAP: _swap,
    Action.DISARM: _disarm,
}
_FLEET: Mapping[Action, Callable[[Context, FleetState, float], Why]] = {
    Action.REPLAN: _replan, Action.PROVE: _prove, Action.ABORT: _abort,
}  # fmt: skip
