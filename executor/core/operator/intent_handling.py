"""What becomes of an operator's wish: refused with its reason, or ordered, and answered by the vehicle itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.ground import out_of_service, takeoff_offers, turnaround
from executor.core.ground.out_of_service import clear_for_takeoff, return_to_service
from executor.core.imaging import asset_status, picture_proof
from executor.core.inflight.custody.mode_causes import is_under_foreign_control
from executor.core.inflight.homing import return_home
from executor.core.inflight.homing.return_home import bring_home, is_on_mission
from executor.core.interface.commands import CancelSolve, Command, Disarm, Hold, LandNow, Level, Resume, Say, SendHome
from executor.core.interface.events import IntentReceived, OrderEnded, ReturnAllOrdered, ReturnEnded
from executor.core.interface.intents import Action, Intent, IntentReason, IntentRecord, Outcome
from executor.core.operator import intent_refusals
from executor.core.replanning import pilot_takeover, replan_cycle
from executor.core.replanning.replan_messages import format_segments
from executor.core.replanning.withdrawal import declare_fault, leave_plan, withdraw_vehicle
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.vehicle_parts import FOLLOWED_LATE_S, ModeCause
from executor.core.state.vehicle_position import describe_down_place
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState, change_stage

KEPT_INTENTS = 500
"""Older ones that have come to their end are forgotten."""
ANSWER_S = 90.0
"""A vehicle that has not answered an order by then did not hear it."""
OTHERS_MODE_S = 20.0
"""A held vehicle that flies its mission for longer than this was sent on by somebody else, or never heard the order."""
SHARED_S = 15.0
"""So long the work of one that was cleared to fly again waits for the others that were offered."""
_RETURNS = frozenset({Action.RETURN, Action.EXCLUDE, Action.ABORT})
_ON_MISSION = frozenset({Stage.FLYING, Stage.STARTING})


@dataclass(frozen=True, slots=True)
class _IntentResult:
    """What an intent leads to."""

    state: FleetState
    text: str
    commands: tuple[Command, ...] = ()
    waiting: frozenset[str] = frozenset()
    """Vehicles whose own answer decides."""
    open: bool = False
    """Whether something else than an answer decides."""
    level: Level = Level.INFO


def apply_operator_event(
    context: Context,
    state: FleetState,
    event: IntentReceived | OrderEnded | ReturnEnded | ReturnAllOrdered,
    now_s: float,
) -> Stepped:
    """Take what an operator wants, or what became of an order."""
    match event:
        case IntentReceived(intent):
            return _apply_intent(context, state, intent, now_s)
        case OrderEnded():
            return _apply_order_result(context, state, event, now_s)
        case ReturnEnded():
            return _apply_return_result(state, event, now_s)
        case ReturnAllOrdered():
            return _recall(context, state, now_s)


def _apply_intent(context: Context, state: FleetState, intent: Intent, now_s: float) -> Stepped:
    """Take an intent; one that was taken before changes nothing."""
    if intent.id in state.crew.intents:
        return state, ()
    refused = intent_refusals.find_refusal(context, state, intent, now_s)
    wish = f"{intent.source} asks: {_describe_intent(intent)}"
    if refused is not None:
        code, reason = refused
        state = _store_intent(state, IntentRecord(intent, Outcome.REFUSED, reason, now_s, ended_s=now_s, code=code))
        return state, (Say(Level.WARNING, f"{wish}; refused: {reason}"),)
    question = intent_refusals.build_confirmation_question(context, state, intent)
    if question:
        record = IntentRecord(intent, Outcome.REFUSED, "has to be confirmed", now_s, ended_s=now_s, question=question)
        record = replace(record, code=IntentReason.UNCONFIRMED)
        return _store_intent(state, record), ()
    ordered = _HANDLERS[intent.action](context, state, intent, now_s)
    under_way = bool(ordered.waiting) or ordered.open
    outcome = Outcome.ACCEPTED if under_way else Outcome.DONE
    ended_s = None if under_way else now_s
    record = IntentRecord(intent, outcome, ordered.text, now_s, ordered.waiting, ended_s)
    state = _store_intent(ordered.state, record)
    return state, (Say(ordered.level, f"{wish}; {ordered.text}"), *ordered.commands)


def _describe_intent(intent: Intent) -> str:
    whom = f" {intent.vehicle}" if intent.vehicle else f" base {intent.base}" if intent.base else ""
    which = f" of {format_count(len(intent.assets), 'asset')}" if intent.assets else ""
    return f"{intent.action.value}{whom}{which}"


def _store_intent(state: FleetState, record: IntentRecord) -> FleetState:
    intents = {**state.crew.intents, record.intent.id: record}
    if len(intents) > KEPT_INTENTS:
        over = next((name for name, one in intents.items() if one.ended_s is not None), None)
        intents.pop(over or next(iter(intents)))
    return state.with_crew(intents=MappingProxyType(intents))


def _vehicle_of(state: FleetState, intent: Intent) -> VehicleState:
    if intent.vehicle is None:
        raise ValueError(f"{intent.action.value} names no vehicle")
    return state.vehicles[intent.vehicle]


def _hold(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent)
    held = vehicle.with_orders(held_s=now_s, hold_asked_s=now_s, ordered_mode_s=now_s)
    if vehicle.stage is Stage.PILOT:
        held = change_stage(held, Stage.FLYING).with_custody(taken=None)
    hold = context.vehicles[vehicle.name].dialect.modes.hold.custom_mode
    state = state.put(held.with_orders(ordered_modes=frozenset({hold})).with_custody(cause=ModeCause.OURS))
    return _IntentResult(state, "hold commanded", (Hold(vehicle.name),), frozenset({vehicle.name}))


def _resume(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent)
    speed_m_s = vehicle.leg.speed_m_s if vehicle.leg is not None else 0.0
    mission = context.vehicles[vehicle.name].dialect.modes.mission.custom_mode
    state = state.put(vehicle.with_orders(ordered_mode_s=now_s, ordered_modes=frozenset({mission})))
    return _IntentResult(state, "resume commanded", (Resume(vehicle.name, speed_m_s),), frozenset({vehicle.name}))


def _return(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent)
    state, more = _send_vehicle_home(context, state, vehicle, now_s, force=intent.confirmed)
    state, others = withdraw_vehicle(state, vehicle.name, f"{vehicle.name}: returns by the operator's order", now_s)
    text = f"{_describe_return(more)}; it stays on the ground until included; its segments are to be reassigned"
    return _IntentResult(state, text, (*others, *more), frozenset({vehicle.name}))


def _describe_return(commands: tuple[Command, ...]) -> str:
    """Return what a return begins with: over its pad a vehicle lands, and not every one is to be commanded now."""
    kinds = {type(command) for command in commands}
    return "RTL commanded" if SendHome in kinds else "landing commanded" if LandNow in kinds else "return ordered"


def _send_vehicle_home(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, force: bool = False
) -> Stepped:
    """Send a vehicle home that flies its mission; one that has not armed yet must not take off."""
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        left = leave_plan(vehicle, Stage.LANDED, now_s)
        state = state.put(left.with_orders(excluded=True))
        return state, (SendHome(vehicle.name),)  # in place of its start
    left = leave_plan(vehicle, Stage.RETURNING, now_s).with_orders(excluded=True)
    if force:
        left = left.with_custody(taken=None, cause=ModeCause.OURS)
    return bring_home(context, state, left, now_s, force=force)


def _land(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent)
    planned = vehicle.stage in _ON_MISSION
    fault = vehicle.fault or Fault(
        FaultKind.OPERATOR, "lands where it was, by the operator's order", now_s, FaultCode.OPERATOR_LAND
    )
    left = leave_plan(vehicle, Stage.RETURNING, now_s)
    left = replace(left, fault=fault, orders=replace(left.orders, lands=True, excluded=True))
    left = left.with_custody(taken=None, cause=ModeCause.OURS) if intent.confirmed else left
    state, told = bring_home(context, state, left, now_s, land=True, force=intent.confirmed)
    others: tuple[Command, ...] = ()
    if planned:
        state, others = withdraw_vehicle(state, vehicle.name, f"{vehicle.name}: lands by the operator's order", now_s)
    text = "landing commanded where it is; its segments are to be reassigned"
    return _IntentResult(state, text, (*others, *told), frozenset({vehicle.name}), level=Level.WARNING)


def _exclude(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent).with_orders(excluded=True)
    state = state.put(vehicle)
    if vehicle.stage in {Stage.GROUND, Stage.LANDED, Stage.DOWN}:
        given = vehicle.assignment.pending is not None
        vehicle = vehicle.with_orders(cleared_s=None).with_assignment(pending=None)
        state = state.put(vehicle)
        if given:  # it would start as soon as its new mission is on board
            state, more = withdraw_vehicle(state, vehicle.name, f"{vehicle.name}: excluded on the ground", now_s)
            return _IntentResult(state, "it stays on the ground", more)
        return _IntentResult(state, "it stays on the ground")
    if vehicle.stage is Stage.PILOT:
        hold = replace(vehicle.custody.taken, given_away=True) if vehicle.custody.taken is not None else None
        state = state.put(vehicle.with_custody(taken=hold))
        state, more = withdraw_vehicle(state, vehicle.name, f"{vehicle.name}: excluded, with its pilot", now_s)
        return _IntentResult(state, "it stays with its pilot; its segments are to be reassigned", more)
    starting = vehicle.stage is Stage.STARTING and not vehicle.armed
    fault = Fault(FaultKind.OPERATOR, "excluded by the operator", now_s, FaultCode.OPERATOR_EXCLUDE)
    state, commands = declare_fault(context, state, state.vehicles[vehicle.name], fault)
    if starting:
        commands = (*commands, SendHome(vehicle.name))  # in place of its start
    told = frozenset(command.vehicle for command in commands if isinstance(command, SendHome))
    text = "taken out of the plan" + (", RTL commanded" if told else "")
    alone = replan_cycle.find_orphan_segments(context, state)
    if alone and not _has_other_vehicles(state, vehicle.name):
        text += f"; no other vehicle is left to inspect {len(alone)} segments"
    return _IntentResult(state, text, commands, told, level=Level.WARNING)


def _has_other_vehicles(state: FleetState, name: str) -> bool:
    gone = (Stage.LOST, Stage.RETURNING)
    return any(
        one.name != name and one.fault is None and not one.orders.excluded and one.stage not in gone
        for one in state.vehicles.values()
    )


def _include(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    vehicle = _vehicle_of(state, intent)
    if vehicle.stage is Stage.PILOT:
        state, more = pilot_takeover.take_back_from_pilot(context, state, vehicle, now_s)
        return _IntentResult(state, "included", more)
    left = replan_cycle.find_left_over_segments(state)
    again = takeoff_offers.is_offered_reinspection(state, vehicle)
    state, ready = return_to_service(state, vehicle)
    state = clear_for_takeoff(state, ready, now_s)
    if state.crew.offer is not None and len(state.crew.offer.vehicles) > 1:
        # The others may be cleared in a moment: the work is shared then.
        state = state.with_replanning(wait_until_s=max(state.replanning.wait_until_s, now_s + SHARED_S))
    if replan_cycle.find_orphan_segments(context, state) or left:
        return _IntentResult(state, "included; re-planning with it")
    if again:
        return _IntentResult(state, "included; re-inspecting segments at inspection height")
    return _IntentResult(state, "included. Nothing is unassigned; use re-plan to redistribute")


def _swap(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    state, text, told = turnaround.begin_turnaround(state, _vehicle_of(state, intent), intent, now_s)
    return _IntentResult(state, text, told, open=True)


def _close(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    aloft = out_of_service.find_airborne_names(out_of_service.find_vehicles_at_base(context, state, intent.base))
    state, told = out_of_service.close_base(context, state, intent.base, now_s)
    lands = f"; still to land there: {', '.join(aloft)}" if aloft else ""
    return _IntentResult(state, f"no take-off from it until it is opened{lands}", told, level=Level.WARNING)


def _open(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    return _IntentResult(
        out_of_service.open_base(context, state, intent.base), "take-offs from it are allowed again; use `swap`"
    )


def _disarm(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    vehicle = _vehicle_of(state, intent)
    told = (Disarm(vehicle.name, force=True),)
    return _IntentResult(state, "forced disarm commanded", told, frozenset({vehicle.name}), level=Level.WARNING)


def _answer(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    briefing = replace(state.crew.briefing, question=None, answered=intent.action.value)
    return _IntentResult(state.with_crew(briefing=briefing), "yes")


def _replan(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    state, text = state.with_coverage(given_up=frozenset()), "all open segments are re-planned"
    return _order_replan(state, f"requested by {intent.source}", text, now_s)


def _order_replan(state: FleetState, trigger: str, text: str, now_s: float) -> _IntentResult:
    state = state.with_replanning(ordered=True, trigger=trigger, trigger_s=now_s)
    return _IntentResult(state, text, open=True)


def _prove(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    if intent.assets:
        return _look_again(context, state, intent, now_s)
    wanted = state.coverage.list_inferred_segments() | picture_proof.find_missed_segments(context, state)
    coverage = asset_status.discard_proof(state.coverage, wanted)
    text = f"re-flying {format_segments(context, wanted)} for proof"
    return _order_replan(replace(state, coverage=coverage), f"proof requested by {intent.source}", text, now_s)


def _look_again(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:
    found = asset_status.select_segments_to_reinspect(context, state, intent.assets)
    if not isinstance(found, frozenset):
        raise TypeError(found[1])
    names = format_segments(context, found)
    trigger = f"re-inspection of {names} requested by {intent.source}"
    state = replace(state, coverage=asset_status.reopen_segments(state.coverage, found))
    return _order_replan(state, trigger, f"{names} reopened for re-inspection", now_s)


def _abort(context: Context, state: FleetState, intent: Intent, now_s: float) -> _IntentResult:  # noqa: ARG001
    state, commands = _recall(context, state, now_s)
    told = frozenset(command.vehicle for command in commands if isinstance(command, SendHome | LandNow))
    commands = commands[1:]  # the first line says what the intent's own does
    text = "all vehicles ordered to return"
    if not told and state.listening.silent_since_s is not None:
        text = "no link to any vehicle; RTL will be commanded as soon as a link is back"
    elif not told:
        text = "no vehicle is on its mission; no further take-off"
    return _IntentResult(state, text, commands, told, level=Level.WARNING)


def _recall(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Send everybody home."""
    commands: list[Command] = [Say(Level.WARNING, "flight aborted by the operator, all vehicles return")]
    if state.replanning.replan is not None and state.replanning.replan.solve_s is None:
        commands.append(CancelSolve(state.replanning.replan.solve.revision))
    for vehicle in state.vehicles.values():
        if vehicle.stage is Stage.PILOT or (vehicle.stage in _ON_MISSION and is_under_foreign_control(vehicle)):
            commands.append(Say(Level.WARNING, f"{vehicle.name}: is with its pilot; RTL not commanded"))
        elif vehicle.stage in _ON_MISSION:
            state, more = _send_vehicle_home(context, state, vehicle, now_s)
            commands.extend(more)
    state = state.with_progress(recalled=True, launched_s=state.progress.launched_s or now_s)
    return state.with_replanning(replan=None).with_crew(offer=None), tuple(commands)


_Handler = Callable[[Context, FleetState, Intent, float], _IntentResult]
_HANDLERS: Mapping[Action, _Handler] = {
    Action.HOLD: _hold,
    Action.RESUME: _resume,
    Action.RETURN: _return,
    Action.LAND: _land,
    Action.EXCLUDE: _exclude,
    Action.INCLUDE: _include,
    Action.SWAP: _swap,
    Action.REPLAN: _replan,
    Action.PROVE: _prove,
    Action.CLOSE: _close,
    Action.OPEN: _open,
    Action.ABORT: _abort,
    Action.DISARM: _disarm,
    Action.PREPARE: _answer,
    Action.TAKE_OFF: _answer,
}


def _apply_order_result(context: Context, state: FleetState, event: OrderEnded, now_s: float) -> Stepped:
    """Take a vehicle's answer to an order to hold, to go on or to land."""
    state, more = return_home.apply_homing_result(state, event, now_s) if event.action is Action.LAND else (state, ())
    vehicle = state.vehicles[event.vehicle]
    actions = frozenset({event.action}) if event.action is not Action.LAND else _RETURNS | {Action.LAND}
    state = _close_intents(state, event.vehicle, actions, event, now_s)
    if event.action is Action.HOLD and not event.accepted and vehicle.orders.held_s is not None:
        # It may still obey, or have obeyed unheard: no change of mode by itself. `settle_intents` forgets it later.
        state = state.put(vehicle.with_orders(ordered_mode_s=now_s))
    if event.action is Action.RESUME and event.accepted and vehicle.orders.held_s is not None:
        gone_on = vehicle.with_orders(held_s=None, hold_asked_s=float("-inf"), ordered_mode_s=now_s)
        state = state.put(gone_on.with_motion(anchor=None))
    if event.action is Action.DISARM and not event.accepted and vehicle.stage is Stage.RETURNING:
        # It was to be stopped on the ground and is not there any more.
        state, more = return_home.bring_home(context, state, vehicle, now_s)
    if not event.accepted:
        text = f"{event.vehicle}: did not follow the order: {event.action.value} ({event.reason})"
        return state, (Say(Level.WARNING, text), *more)
    words = {Action.HOLD: "holds", Action.RESUME: "flies on", Action.LAND: "lands", Action.DISARM: "disarmed"}
    note = f"; {event.reason}" if event.reason else ""
    if event.action is Action.DISARM and vehicle.stage is Stage.DOWN:
        note = f"; {describe_down_place(context, vehicle.with_telemetry(heartbeat=None))}"
    return state, (Say(Level.WARNING if note else Level.INFO, f"{event.vehicle}: {words[event.action]}{note}"),)


def _apply_return_result(state: FleetState, event: ReturnEnded, now_s: float) -> Stepped:
    """Take a vehicle's answer to the order to come home."""
    state = _close_intents(state, event.vehicle, _RETURNS, event, now_s)
    state, more = return_home.apply_homing_result(state, event, now_s)
    if event.accepted:
        return state, (Say(Level.INFO, f"{event.vehicle}: returns"), *more)
    said = "refused RTL" if event.refused else "did not acknowledge RTL"
    return state, (Say(Level.WARNING, f"{event.vehicle}: {said} ({event.reason})"), *more)


_DONE = {
    Action.HOLD: "it holds",
    Action.RESUME: "it flies on",
    Action.RETURN: "it returns",
    Action.LAND: "it lands",
    Action.DISARM: "its motors are off",
    Action.EXCLUDE: "it is out of the plan and returns",
    Action.ABORT: "all vehicles return",
}


def _close_intents(
    state: FleetState, vehicle: str, actions: frozenset[Action], event: OrderEnded | ReturnEnded, now_s: float
) -> FleetState:
    """Note an answer in every intent that waits for it."""
    intents = dict(state.crew.intents)
    for name, record in state.crew.intents.items():
        if record.intent.action not in actions or vehicle not in record.waiting:
            continue
        waiting = record.waiting - {vehicle}
        if not event.accepted:
            text = f"{vehicle}: {event.reason}"
            intents[name] = replace(
                record, outcome=Outcome.FAILED, text=text, waiting=waiting, ended_s=now_s, code=event.code
            )
        elif not waiting and record.outcome is Outcome.ACCEPTED:
            text = _DONE[record.intent.action] + (f"; {event.reason}" if event.reason else "")
            intents[name] = replace(record, outcome=Outcome.DONE, text=text, waiting=waiting, ended_s=now_s)
        else:
            intents[name] = replace(record, waiting=waiting)
    return state.with_crew(intents=MappingProxyType(intents))


def settle_intents(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Bring intents to their end that no answer ends, and notice who was sent on by somebody else."""
    for vehicle in state.vehicles.values():
        if vehicle.orders.held_s is not None and _is_back_on_mission(context, vehicle, now_s):
            state = state.put(vehicle.with_orders(held_s=None).with_motion(anchor=None))
        elif vehicle.orders.held_s is None and _is_holding_late(context, vehicle, now_s):
            state = state.put(vehicle.with_orders(held_s=now_s))
    ended = {
        name: replace(record, outcome=outcome, text=text, waiting=frozenset(), ended_s=now_s, code=code)
        for name, record in state.crew.intents.items()
        if record.outcome is Outcome.ACCEPTED
        for outcome, text, code in (_settle_intent(state, record, now_s),)
        if outcome is not None
    }
    if not ended:
        return state, ()
    return state.with_crew(intents=MappingProxyType({**state.crew.intents, **ended})), ()


def _is_back_on_mission(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    quiet = now_s - max(vehicle.orders.ordered_mode_s, vehicle.telemetry.mode_since_s) > OTHERS_MODE_S
    return quiet and not vehicle.link.stale and is_on_mission(context, vehicle)


def _is_holding_late(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    if (
        vehicle.stage is not Stage.FLYING
        or now_s - vehicle.orders.hold_asked_s > FOLLOWED_LATE_S
        or vehicle.telemetry.heartbeat is None
    ):
        return False
    return vehicle.telemetry.heartbeat.custom_mode == context.vehicles[vehicle.name].dialect.modes.hold.custom_mode


_Settlement = tuple[Outcome | None, str, IntentReason | None]
"""How an intent ends, in words and as a code; None while it is under way."""


def _settle_intent(state: FleetState, record: IntentRecord, now_s: float) -> _Settlement:
    if record.intent.action in {Action.REPLAN, Action.PROVE}:
        return _settle_replan_intent(state, record)
    for name in sorted(record.waiting):
        vehicle = state.vehicles[name]
        if vehicle.stage is Stage.LOST:
            return Outcome.FAILED, f"link to {name} lost", IntentReason.LINK_LOST
        if record.intent.action in {Action.HOLD, Action.RESUME} and vehicle.stage is not Stage.FLYING:
            why = f": {vehicle.fault.reason}" if vehicle.fault is not None else ""
            return Outcome.FAILED, f"superseded: {name} is {vehicle.stage.value}{why}", IntentReason.OVERTAKEN
        if now_s - record.at_s > ANSWER_S:
            return Outcome.FAILED, f"{name} did not answer", IntentReason.UNANSWERED
    return None, "", None


def _settle_replan_intent(state: FleetState, record: IntentRecord) -> _Settlement:
    last = state.replanning.records[-1] if state.replanning.records else None
    if last is not None and last.ended_s > record.at_s and state.replanning.replan is None:
        left = f", {len(last.uncovered)} segments are left over" if last.uncovered else ""
        return Outcome.DONE, f"re-plan {last.revision} is on board{left}", None
    if state.progress.recalled:
        return Outcome.FAILED, "the flight was aborted", IntentReason.ABORTED
    if state.replanning.replan is None and not state.replanning.ordered and not state.replanning.urgent:
        return Outcome.FAILED, "nothing to plan, or no vehicle available", IntentReason.NOTHING_TO_PLAN
    return None, "", None
