"""Decide whether an operator's intent is refused, because it would be unsafe or change nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from executor.core.context import Context
from executor.core.ground import turnaround
from executor.core.ground.out_of_service import list_bases
from executor.core.ground.takeoff_offers import find_open_segments, is_offered_reinspection
from executor.core.imaging import asset_status
from executor.core.inflight import homing
from executor.core.interface.intents import BEFORE_FLIGHT, FOR_ALL, FOR_BASE, Action, Intent, Reason, fill_in
from executor.core.lines import operator
from executor.core.preflight.readiness import find_obstacles
from executor.core.replanning import replan_cycle, survivors
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_position import describe_position
from executor.core.state.vehicle_state import IN_THE_AIR, Stage, VehicleState
from missions import Phase
from missions.geometry import place_distances_m

LINE_DISTANCE_M = 12.0
"""Distance to the line below which no landing is commanded: wires sag and swing, and pylons are 5 to 10 m wide."""
PAD_DISTANCE_M = 4.0
"""Distance to another vehicle's pad below which no landing is commanded."""
_COMMANDING = frozenset({Action.HOLD, Action.RESUME, Action.RETURN, Action.LAND})


@dataclass(frozen=True, slots=True)
class PendingIntent:
    """An operator's intent, and the flight it is for."""

    context: Context
    state: FleetState
    intent: Intent
    now_s: float

    @property
    def vehicle(self) -> VehicleState:
        """The vehicle of the intent."""
        if self.intent.vehicle is None:
            raise ValueError(f"{self.intent.action.value} names no vehicle")
        return self.state.vehicles[self.intent.vehicle]

    def refuse(self, reason: Reason, **values: object) -> Reason:
        """Return a reason with its text filled in from these values and from the intent."""
        known = self.state.vehicles.get(self.intent.vehicle or "")
        values |= {"action": self.intent.action.value, "vehicle": self.intent.vehicle, "base": self.intent.base}
        stage = "" if known is None else known.stage.value
        fault = "" if known is None or known.fault is None else known.fault.reason
        return fill_in(reason, **values, stage=stage, fault=fault, vehicles=", ".join(self.state.vehicles))


Reasons = Iterator[Reason | Literal[False] | None]
"""The reasons against an intent, the most important first; those that do not apply are False or None."""


def find_refusal(context: Context, state: FleetState, intent: Intent, now_s: float) -> Reason | None:
    """Return the code and text of a refusal; None if the intent is accepted."""
    return next((reason for reason in _object(PendingIntent(context, state, intent, now_s)) if reason), None)


def _object(pending: PendingIntent) -> Reasons:
    state, intent = pending.state, pending.intent
    yield state.progress.finished and operator.OVER
    if intent.action in BEFORE_FLIGHT:
        yield from _object_before_launch(pending)
        return
    yield state.progress.launched_s is None and operator.NOT_BEGUN
    if intent.action not in FOR_ALL | FOR_BASE:
        yield intent.vehicle is None and pending.refuse(operator.VEHICLE_MISSING)
        yield intent.vehicle not in state.vehicles and pending.refuse(operator.VEHICLE_UNKNOWN)
    elif intent.vehicle is not None:
        yield pending.refuse(operator.FOR_BASE if intent.action in FOR_BASE else operator.FOR_FLEET)
    yield from _OBJECTIONS[intent.action](pending)


def _object_before_launch(pending: PendingIntent) -> Reasons:
    asked, intent = pending.state.crew.briefing.question, pending.intent
    yield pending.state.progress.launched_s is not None and operator.BEGUN
    yield intent.vehicle is not None and pending.refuse(operator.FOR_FLEET)
    yield (asked is None or asked.id != intent.action.value) and operator.NOT_ASKED


def build_confirmation_question(context: Context, state: FleetState, intent: Intent) -> str:
    """Return the question to confirm before an intent is carried out; empty if there is none."""
    vehicle = None if intent.vehicle is None else state.vehicles.get(intent.vehicle)
    if vehicle is None or intent.confirmed:
        return ""
    if intent.action is Action.DISARM:
        return operator.MAY_DISARM.format(vehicle=vehicle.name, place=describe_position(context, vehicle))
    if intent.action is Action.SWAP:
        installed = operator.IS_PACK_INSTALLED if intent.pack else operator.IS_ANY_PACK_INSTALLED
        return operator.MAY_SWAP.format(vehicle=vehicle.name, installed=installed.format(pack=intent.pack))
    if intent.action is Action.INCLUDE and vehicle.stage is not Stage.PILOT:
        return operator.MAY_INCLUDE.format(vehicle=vehicle.name)
    if intent.action in _COMMANDING and vehicle.is_under_foreign_control:
        return operator.MAY_TAKE_CONTROL.format(vehicle=vehicle.name)
    return ""


def _object_to_base(pending: PendingIntent) -> Reasons:
    bases, closes = list_bases(pending.context), pending.intent.action is Action.CLOSE
    if pending.intent.base not in bases:
        yield pending.refuse(operator.BASE_UNKNOWN if bases else operator.NO_BASES, bases=", ".join(bases))
    shut = pending.intent.base in pending.state.crew.closed_bases
    yield closes and shut and operator.BASE_SHUT
    yield not closes and not shut and operator.BASE_OPEN


def _object_to_count(pending: PendingIntent) -> Reasons:
    bases, day = list_bases(pending.context), pending.context.day
    if day is None or pending.intent.base not in bases:
        yield pending.refuse(operator.BASE_UNKNOWN if bases else operator.NO_BASES, bases=", ".join(bases))
    elif pending.intent.base not in day.packs or pending.intent.charged is None:
        yield operator.PACKS_UNCOUNTED


def _object_to_silence(pending: PendingIntent) -> Reasons:
    obstacles = find_obstacles(pending.context, pending.state, pending.vehicle, pending.now_s)
    yield from map(obstacles.get, (operator.NEVER_HEARD, operator.LINK_STALE))


def _object_to_hold(pending: PendingIntent) -> Reasons:
    vehicle = pending.vehicle
    phase = None if vehicle.leg is None else vehicle.leg.phase
    yield vehicle.stage not in {Stage.FLYING, Stage.PILOT} and pending.refuse(operator.NOT_ON_MISSION)
    yield vehicle.orders.held_s is not None and operator.ON_HOLD
    yield vehicle.is_pulled_out and operator.PULLED_OUT
    yield vehicle.assignment.pending is not None and operator.UPLOADING
    yield phase is Phase.TAKEOFF and operator.CLIMBING
    yield phase is Phase.LAND and operator.IN_LANDING
    yield from _object_to_silence(pending)


def _object_to_resume(pending: PendingIntent) -> Reasons:
    vehicle = pending.vehicle
    yield vehicle.stage is Stage.PILOT and operator.PILOT_RESUMES
    on_hold = vehicle.stage is Stage.FLYING and vehicle.orders.held_s is not None
    yield not on_hold and pending.refuse(operator.NOT_ON_HOLD)
    yield pending.state.progress.recalled and operator.ABORTED
    yield from _object_to_silence(pending)


def _object_to_return(pending: PendingIntent) -> Reasons:
    vehicle = pending.vehicle
    comes_home = vehicle.stage is Stage.RETURNING and homing.is_coming_home(pending.context, vehicle)
    yield comes_home and operator.RETURNING
    yield vehicle.is_at_rest and operator.ON_GROUND
    yield vehicle.stage is Stage.LOST and operator.LINK_LOST


def _object_to_landing(pending: PendingIntent) -> Reasons:
    context, vehicle, fix = pending.context, pending.vehicle, pending.vehicle.motion.fix
    yield (vehicle.stage not in IN_THE_AIR or not vehicle.armed) and pending.refuse(operator.NOT_FLYING)
    yield vehicle.orders.lands and operator.LANDING
    if fix is None or pending.now_s - fix.at_s > context.limits.link_stale_s:
        yield operator.POSITION_UNKNOWN
        return
    line_m = _distance_to_line_m(context, fix.place_m)
    yield line_m < LINE_DISTANCE_M and pending.refuse(operator.NEAR_LINE, line_m=line_m)
    for other in pending.state.vehicles:
        near = other != vehicle.name and context.vehicles[other].pad_distance_m(fix.place_m) < PAD_DISTANCE_M
        yield near and pending.refuse(operator.OTHER_PAD, other=other)


def _distance_to_line_m(context: Context, place_m: tuple[float, float]) -> float:
    """Return the horizontal distance to the nearest segment."""
    return float(place_distances_m(context.setup.network.ends_m, np.array([place_m])).min(initial=math.inf))


def _object_to_exclusion(pending: PendingIntent) -> Reasons:
    yield pending.vehicle.fault is not None and pending.refuse(operator.AT_FAULT)
    yield pending.vehicle.orders.excluded and operator.OUT_OF_PLAN


def _object_to_inclusion(pending: PendingIntent) -> Reasons:
    context, state, vehicle = pending.context, pending.state, pending.vehicle
    if vehicle.stage is Stage.PILOT:
        yield from _object_to_inclusion_from_pilot(pending)
        return
    obstacles = find_obstacles(context, state, vehicle, pending.now_s)
    yield from map(obstacles.get, (operator.NOT_AT_REST, operator.ABORTED, operator.NEVER_HEARD, operator.LINK_STALE))
    yield from map(obstacles.get, (operator.TILTED, operator.BASE_CLOSED))
    yield (vehicle.orders.cleared_s is not None or vehicle.turn.asked_s is not None) and operator.CLEARED
    in_plan = not vehicle.is_pulled_out and not vehicle.assignment.stubborn
    wanted = not in_plan or find_open_segments(context, state) or is_offered_reinspection(state, vehicle)
    yield not wanted and operator.IN_PLAN
    yield from map(obstacles.get, (operator.OFF_PAD, operator.BATTERY_LOW))


def _object_to_inclusion_from_pilot(pending: PendingIntent) -> Reasons:
    taken = pending.vehicle.custody.taken
    yield (taken is None or taken.returned_s is None) and operator.PILOT_FLIES
    yield pending.vehicle.fault is not None and pending.refuse(operator.GIVEN_AWAY)
    yield pending.state.progress.recalled and operator.ABORTED


def _object_to_swap(pending: PendingIntent) -> Reasons:
    context, state, vehicle = pending.context, pending.state, pending.vehicle
    yield vehicle.stage is Stage.PILOT and operator.WITH_PILOT
    obstacles = find_obstacles(context, state, vehicle, pending.now_s)
    yield from map(obstacles.get, (operator.NOT_AT_REST, operator.NEVER_HEARD, operator.ABORTED))
    yield from map(obstacles.get, (operator.BASE_CLOSED, operator.SWAPPING))
    yield (vehicle.assignment.pending is not None or vehicle.orders.cleared_s is not None) and operator.CLEARED
    open_ = turnaround.find_next_visits(context, state, vehicle, pending.now_s) or (
        find_open_segments(context, state)
        if context.day is None
        else turnaround.find_unplanned_segments(context, state) - vehicle.turn.beyond
    )
    yield not open_ and operator.NO_SORTIE
    why = turnaround.describe_hours_conflict(context, state, vehicle, pending.now_s)
    yield why != "" and pending.refuse(operator.OUT_OF_HOURS, conflict=why)


def _object_to_disarm(pending: PendingIntent) -> Reasons:
    yield pending.vehicle.stage is not Stage.DOWN and pending.refuse(operator.NOT_DOWN)
    yield not pending.vehicle.armed and operator.DISARMED
    yield from _object_to_silence(pending)


def _object_to_any_replan(pending: PendingIntent) -> Reasons:
    """Yield the reasons why no re-plan can begin now, whatever segments are open."""
    yield pending.state.progress.recalled and operator.ABORTED
    yield (pending.state.replanning.replan is not None or pending.state.replanning.ordered) and operator.REPLANNING
    yield not survivors.build_survivors(pending.context, pending.state, pending.now_s) and operator.NO_SURVIVOR


def _object_to_replan(pending: PendingIntent) -> Reasons:
    yield from _object_to_any_replan(pending)
    context, state = pending.context, pending.state
    freed = any(offer.tail for offer in survivors.build_survivors(context, state, pending.now_s))
    left = state.coverage.given_up | replan_cycle.find_left_over_segments(state)
    open_ = freed or left or replan_cycle.find_orphan_segments(context, state)
    yield not open_ and operator.NOTHING_TO_REPLAN


def _object_to_proof(pending: PendingIntent) -> Reasons:
    context, state, assets = pending.context, pending.state, pending.intent.assets
    if assets:
        found = asset_status.select_segments_to_reinspect(context, state, assets)
        yield None if isinstance(found, frozenset) else found
    else:
        open_ = state.coverage.list_inferred_segments() | asset_status.find_missed_segments(context, state)
        yield not open_ and operator.ALL_PROVEN
    yield from _object_to_any_replan(pending)


def _object_to_abort(pending: PendingIntent) -> Reasons:
    context, state = pending.context, pending.state
    flies = any(vehicle.stage in {Stage.STARTING, Stage.FLYING} for vehicle in state.vehicles.values())
    waits = state.crew.offer is not None or turnaround.find_awaited_vehicles(context, state, pending.now_s)
    yield not flies and not waits and operator.NOBODY_FLIES


_OBJECTIONS: Mapping[Action, Callable[[PendingIntent], Reasons]] = {
    Action.HOLD: _object_to_hold, Action.RESUME: _object_to_resume, Action.RETURN: _object_to_return,
    Action.LAND: _object_to_landing, Action.EXCLUDE: _object_to_exclusion, Action.INCLUDE: _object_to_inclusion,
    Action.SWAP: _object_to_swap, Action.DISARM: _object_to_disarm, Action.CLOSE: _object_to_base,
    Action.COUNT: _object_to_count, Action.OPEN: _object_to_base, Action.REPLAN: _object_to_replan,
    Action.PROVE: _object_to_proof, Action.ABORT: _object_to_abort,
}  # fmt: skip
