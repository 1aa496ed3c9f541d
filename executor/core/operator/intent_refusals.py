"""When an operator's wish is refused: it would be unsafe, or there is nothing to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from executor.core.context import Context
from executor.core.ground import turnaround
from executor.core.ground.out_of_service import is_base_closed, list_bases
from executor.core.ground.takeoff_offers import find_open_segments, is_offered_reinspection
from executor.core.imaging import asset_status, picture_proof
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
from executor.core.inflight.homing import return_home
from executor.core.interface.intents import BEFORE, FOR_ALL, FOR_BASE, Action, Intent, IntentReason
from executor.core.replanning import replan_cycle, survivors
from executor.core.state.current_setup import current_setup_of
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import LEAST_SPARE_PCT
from executor.core.state.vehicle_position import describe_position
from executor.core.state.vehicle_state import IN_THE_AIR, Stage, VehicleState
from missions import Phase
from missions.geometry import place_distances_m
from planner import segment_of

LINE_M = 12.0
"""Nearer to the line than this nobody lands: wires sag and swing, and pylons are 5 to 10 m wide."""
PAD_M = 4.0
"""Nearer to somebody else's pad than this nobody lands."""
NOT_BEGUN = "the flight has not begun"
_ON_GROUND = frozenset({Stage.GROUND, Stage.LANDED, Stage.DOWN})
_COMMANDING = frozenset({Action.HOLD, Action.RESUME, Action.RETURN, Action.LAND})

Refusal = tuple[IntentReason, str] | None
"""The code of a refusal with its words; None where nothing is refused."""


def find_refusal(context: Context, state: FleetState, intent: Intent, now_s: float) -> Refusal:
    """Return why an intent is refused, as code and words; None if it is not."""
    if state.progress.finished:
        return IntentReason.OVER, "the flight is over"
    if intent.action in BEFORE:
        return _refuse_before_launch(state, intent)
    if state.progress.launched_s is None:
        return IntentReason.NOT_BEGUN, NOT_BEGUN
    if intent.action in FOR_BASE:
        return _refuse_for_base(context, state, intent)
    if intent.action in FOR_ALL:
        return _refuse_for_fleet(context, state, intent, now_s)
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


def _refuse_for_fleet(context: Context, state: FleetState, intent: Intent, now_s: float) -> Refusal:
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for the whole fleet; expected no vehicle"
    if intent.action is Action.PROVE and intent.assets:
        return _refuse_reinspection(context, state, intent, now_s)
    return _FLEET[intent.action](context, state, now_s)


def _refuse_for_base(context: Context, state: FleetState, intent: Intent) -> Refusal:
    known = list_bases(context)
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for a base; expected no vehicle"
    if intent.base not in known:
        expected = f"expected one of {', '.join(known)}" if known else "this flight is not a day plan"
        return IntentReason.BASE_UNKNOWN, f"there is no base {intent.base!r}: {expected}"
    shut = is_base_closed(context, state, intent.base)
    if intent.action is Action.CLOSE and shut:
        return IntentReason.BASE_CLOSED, "it is closed already"
    return (IntentReason.BASE_OPEN, "it is not closed") if intent.action is Action.OPEN and not shut else None


def build_confirmation_question(context: Context, state: FleetState, intent: Intent) -> str:
    """Return what has to be confirmed before an intent is carried out that is not refused; empty if nothing has."""
    vehicle = None if intent.vehicle is None else state.vehicles.get(intent.vehicle)
    if vehicle is None or intent.confirmed:
        return ""
    if intent.action is Action.DISARM:
        where_ = describe_position(context, vehicle)
        return f"{vehicle.name} is down at {where_}: force its motors off? If it is still flying, it will fall"
    if intent.action is Action.SWAP:
        named = f"Is pack {intent.pack} installed" if intent.pack else "Is another pack installed, or its own charged"
        return f"{vehicle.name} will take off once its checks pass. {named}, and its pad clear of people?"
    if intent.action is Action.INCLUDE and vehicle.stage is not Stage.PILOT:
        return f"{vehicle.name} may take off once its mission is uploaded. Is its pad clear of people?"
    if intent.action in _COMMANDING and is_under_foreign_control(vehicle):
        return f"{vehicle.name} is with its pilot. Take control of it? Speak to the pilot first"
    return ""


def _refuse_before_launch(state: FleetState, intent: Intent) -> Refusal:
    asked = state.crew.briefing.question
    if state.progress.launched_s is not None:
        return IntentReason.BEGUN, "the flight has begun"
    if intent.vehicle is not None:
        return IntentReason.VEHICLE_UNEXPECTED, f"{intent.action.value} is for the whole fleet; expected no vehicle"
    open_ = asked is not None and asked.id == intent.action.value
    return None if open_ else (IntentReason.NOT_ASKED, "that question is not pending")


def _refuse_if_silent(vehicle: VehicleState, context: Context, now_s: float) -> Refusal:
    heard_s = vehicle.link.heard_s
    if heard_s is None:
        return IntentReason.NEVER_HEARD, "no message was ever received from it"
    if now_s - heard_s >= context.limits.link_stale_s:
        return IntentReason.LINK_STALE, f"no message from it for {now_s - heard_s:.0f} s"
    return None


def _refuse_hold(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:  # noqa: ARG001
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
    return _refuse_if_silent(vehicle, context, now_s)


def _refuse_resume(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:
    if vehicle.stage is Stage.PILOT:
        return IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode; then include it"
    if vehicle.stage is not Stage.FLYING or vehicle.orders.held_s is None:
        return IntentReason.NOT_ON_HOLD, f"it is not on hold, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    return _refuse_if_silent(vehicle, context, now_s)


def _refuse_return(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:  # noqa: ARG001
    match vehicle.stage:
        case Stage.RETURNING if return_home.is_coming_home(context, vehicle):
            return IntentReason.RETURNING, "it is on its way home already"
        case Stage.GROUND | Stage.LANDED | Stage.DOWN:
            return IntentReason.ON_GROUND, "it is on the ground"
        case Stage.LOST:
            return IntentReason.LINK_LOST, "no link; RTL will be commanded as soon as the link is back"
        case _:
            return None


def _refuse_landing(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:
    fix = vehicle.motion.fix
    if vehicle.stage not in IN_THE_AIR or not vehicle.armed:
        return IntentReason.NOT_FLYING, f"it is not flying, it is {vehicle.stage.value}"
    if vehicle.orders.lands:
        return IntentReason.LANDING, "it is landing already"
    if fix is None or now_s - fix.at_s > context.limits.link_stale_s:
        return IntentReason.POSITION_UNKNOWN, "its position is not known"
    line_m = _distance_to_line_m(context, fix.place_m)
    if line_m < LINE_M:
        return IntentReason.NEAR_LINE, f"it is {line_m:.0f} m from the line, too near to land safely; use return"
    for other in state.vehicles:
        pad_m = context.vehicles[other].pad_m
        if other != vehicle.name and math.dist(fix.place_m, pad_m) < PAD_M:
            return IntentReason.OTHER_PAD, f"it would land on the pad of {other}"
    return None


def _distance_to_line_m(context: Context, place_m: tuple[float, float]) -> float:
    """Return the distance to the nearest segment, seen from above."""
    return float(place_distances_m(context.setup.network.ends_m, np.array([place_m])).min(initial=math.inf))


def _refuse_exclusion(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:  # noqa: ARG001
    if vehicle.fault is not None:
        return IntentReason.OUT_OF_PLAN, f"it is out of the plan already: {vehicle.fault.reason}"
    if vehicle.orders.excluded:
        return IntentReason.OUT_OF_PLAN, "it is out of the plan already"
    return None


def _refuse_inclusion(  # noqa: PLR0911 - one return for each reason
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> Refusal:
    setup, remaining = current_setup_of(context, vehicle), vehicle.power.battery.remaining_pct
    if vehicle.stage is Stage.PILOT:
        return _refuse_inclusion_from_pilot(state, vehicle)
    if vehicle.stage not in _ON_GROUND or vehicle.armed:
        return IntentReason.NOT_AT_REST, f"it is not on the ground with its motors off, it is {vehicle.stage.value}"
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    if silent := _refuse_if_silent(vehicle, context, now_s):
        return silent
    if stays := _refuse_takeoff(vehicle):
        return stays
    if vehicle.orders.cleared_s is not None or vehicle.turn.asked_s is not None:
        return IntentReason.CLEARED, "it is cleared for take-off already"
    if (
        vehicle.fault is None
        and not vehicle.orders.excluded
        and not vehicle.assignment.stubborn
        and not find_open_segments(context, state)
        and not is_offered_reinspection(state, vehicle)
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


def _refuse_takeoff(vehicle: VehicleState) -> Refusal:
    """Return why a vehicle may not take off from where it stands."""
    if vehicle.sensors.tilted_since_s is not None:
        return IntentReason.TILTED, "it is tilted, it may have tipped over"
    return (IntentReason.BASE_CLOSED, "its base is closed; open it first") if vehicle.orders.base_closed else None


def _refuse_swap(  # noqa: PLR0911 - one return for each reason
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float
) -> Refusal:
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
    if not turnaround.find_next_visits(context, state, vehicle) and not _find_open_segments_for(
        context, state, vehicle
    ):
        return IntentReason.NOTHING_TO_PLAN, "no open segment for another sortie"
    if why := turnaround.describe_hours_conflict(context, state, vehicle, now_s):
        return IntentReason.OUT_OF_HOURS, why
    return None


def _find_open_segments_for(context: Context, state: FleetState, vehicle: VehicleState) -> frozenset[int]:
    if context.day is not None:
        return turnaround.find_unplanned_segments(context, state) - vehicle.turn.beyond
    return find_open_segments(context, state)


def _refuse_inclusion_from_pilot(state: FleetState, vehicle: VehicleState) -> Refusal:
    if vehicle.custody.taken is None or vehicle.custody.taken.returned_s is None:
        return IntentReason.WITH_PILOT, "it is with its pilot: the pilot must set mission mode first"
    if vehicle.fault is not None:
        return IntentReason.OUT_OF_PLAN, f"it is out of the plan: {vehicle.fault.reason}"
    return (IntentReason.ABORTED, "the flight was aborted") if state.progress.recalled else None


def _refuse_disarm(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Refusal:  # noqa: ARG001
    if vehicle.stage is not Stage.DOWN:
        return IntentReason.NOT_DOWN, f"it is not down, it is {vehicle.stage.value}"
    if not vehicle.armed:
        return IntentReason.DISARMED, "its motors are off already"
    return _refuse_if_silent(vehicle, context, now_s)


def _refuse_replan(context: Context, state: FleetState, now_s: float) -> Refusal:
    if state.progress.recalled:
        return IntentReason.ABORTED, "the flight was aborted"
    if state.replanning.replan is not None or state.replanning.ordered:
        return IntentReason.REPLANNING, "a re-plan is under way"
    offers = [
        offer for vehicle in state.vehicles.values() if (offer := survivors.build_survivor(context, vehicle, now_s))
    ]
    if not offers:
        return IntentReason.NO_VEHICLE, "no vehicle can take a new route now"
    freed = {segment_of(visit) for offer in offers for visit in offer.tail}
    left = state.coverage.given_up | replan_cycle.find_left_over_segments(state)
    if not freed and not left and not replan_cycle.find_orphan_segments(context, state):
        return IntentReason.NOTHING_TO_PLAN, "nothing is left to re-plan"
    return None


def _refuse_proof(context: Context, state: FleetState, now_s: float) -> Refusal:
    if not state.coverage.list_inferred_segments() | picture_proof.find_missed_segments(context, state):
        return IntentReason.NOTHING_TO_PLAN, "every counted segment is already proven by positions"
    return _refuse_without_vehicle(context, state, now_s)


def _refuse_reinspection(context: Context, state: FleetState, intent: Intent, now_s: float) -> Refusal:
    found = asset_status.select_segments_to_reinspect(context, state, intent.assets)
    return _refuse_without_vehicle(context, state, now_s) if isinstance(found, frozenset) else found


def _refuse_without_vehicle(context: Context, state: FleetState, now_s: float) -> Refusal:
    """Return why no re-plan can begin now; that nothing is open yet is no reason."""
    why = _refuse_replan(context, state, now_s)
    return None if why is not None and why[0] is IntentReason.NOTHING_TO_PLAN else why


def _refuse_abort(context: Context, state: FleetState, now_s: float) -> Refusal:
    flies = any(vehicle.stage in {Stage.STARTING, Stage.FLYING} for vehicle in state.vehicles.values())
    if not flies and state.crew.offer is None and not turnaround.find_awaited_vehicles(context, state, now_s):
        return IntentReason.NO_VEHICLE, "no vehicle is on a mission"
    return None


_VEHICLE: Mapping[Action, Callable[[Context, FleetState, VehicleState, float], Refusal]] = {
    Action.HOLD: _refuse_hold,
    Action.RESUME: _refuse_resume,
    Action.RETURN: _refuse_return,
    Action.LAND: _refuse_landing,
    Action.EXCLUDE: _refuse_exclusion,
    Action.INCLUDE: _refuse_inclusion,
    Action.SWAP: _refuse_swap,
    Action.DISARM: _refuse_disarm,
}
_FLEET: Mapping[Action, Callable[[Context, FleetState, float], Refusal]] = {
    Action.REPLAN: _refuse_replan, Action.PROVE: _refuse_proof, Action.ABORT: _refuse_abort,
}  # fmt: skip
