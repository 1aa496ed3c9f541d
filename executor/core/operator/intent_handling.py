"""Handle an operator's intent: refuse it with its reason, or order it and track the vehicle's own answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from executor.core.context import Context
from executor.core.formatting import format_count
from executor.core.ground import out_of_service, pack_count, takeoff_offers, turnaround
from executor.core.ground.out_of_service import clear_for_takeoff, return_to_service
from executor.core.imaging import asset_status
from executor.core.inflight import homing
from executor.core.inflight.custody.mode_causes import is_holding
from executor.core.inflight.homing import bring_home, is_on_mission
from executor.core.interface.commands import CancelSolve, Command, Disarm, Hold, LandNow, Level, Resume, SendHome
from executor.core.interface.events import OrderEnded, ReturnEnded
from executor.core.interface.intents import Action, Intent, IntentReason, IntentRecord, Outcome, fill_in
from executor.core.lines import operator, sorties
from executor.core.operator import intent_refusals
from executor.core.operator.intent_refusals import PendingIntent
from executor.core.replanning import replan_cycle, withdrawal
from executor.core.replanning.replan_cycle import format_segments
from executor.core.replanning.withdrawal import declare_fault, leave_plan, withdraw_vehicle
from executor.core.state.fleet_state import CountedPacks, FleetState, Stepped
from executor.core.state.vehicle_parts import FOLLOWED_LATE_S, ModeCause
from executor.core.state.vehicle_position import describe_down_place
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState, change_stage

KEPT_INTENTS = 500
"""Number of intents kept; older ended ones are dropped."""
ANSWER_S = 90.0
"""Time without an answer after which a vehicle did not receive a command."""
OTHERS_MODE_S = 20.0
"""Time on its mission after which a held vehicle was resumed by another party, or never received the command."""
SHARED_S = 15.0
"""Wait of a cleared vehicle's segments for the other vehicles of the offer."""
_RETURNS = frozenset({Action.RETURN, Action.EXCLUDE, Action.ABORT})
_ON_MISSION = frozenset({Stage.FLYING, Stage.STARTING})


@dataclass(frozen=True, slots=True)
class _IntentResult:
    """The result of an intent."""

    state: FleetState
    text: str
    commands: tuple[Command, ...] = ()
    waiting: frozenset[str] = frozenset()
    """Vehicles whose own answer decides."""
    open: bool = False
    """Whether another condition decides."""
    level: Level = Level.INFO


def apply_intent(context: Context, state: FleetState, intent: Intent, now_s: float) -> Stepped:
    """Apply an intent; a repeated one changes nothing."""
    if intent.id in state.crew.intents:
        return state, ()
    source, asked = intent.source, _describe_intent(intent)
    refused = intent_refusals.find_refusal(context, state, intent, now_s)
    if refused is not None:
        code, reason = refused
        record = IntentRecord(intent, Outcome.REFUSED, reason, now_s, ended_s=now_s, code=code)
        return _store_intent(state, record), (operator.REFUSED.say(source=source, asked=asked, reason=reason),)
    if question := intent_refusals.build_confirmation_question(context, state, intent):
        record = IntentRecord(intent, Outcome.REFUSED, operator.UNCONFIRMED, now_s, ended_s=now_s, question=question)
        return _store_intent(state, replace(record, code=IntentReason.UNCONFIRMED)), ()
    ordered = _ORDERS[intent.action].order(PendingIntent(context, state, intent, now_s))
    record = IntentRecord(intent, Outcome.DONE, ordered.text, now_s, ordered.waiting, now_s)
    if ordered.waiting or ordered.open:
        record = replace(record, outcome=Outcome.ACCEPTED, ended_s=None)
    said = operator.ORDERED.with_level(ordered.level).say(source=source, asked=asked, text=ordered.text)
    return _store_intent(ordered.state, record), (said, *ordered.commands)


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


def _hold(pending: PendingIntent) -> _IntentResult:
    vehicle = pending.vehicle
    held = vehicle.with_orders(held_s=pending.now_s, hold_asked_s=pending.now_s, ordered_mode_s=pending.now_s)
    if vehicle.stage is Stage.PILOT:
        held = change_stage(held, Stage.FLYING).with_custody(taken=None)
    hold = pending.context.vehicles[vehicle.name].dialect.modes.hold.custom_mode
    state = pending.state.put(held.with_orders(ordered_modes=frozenset({hold})).with_custody(cause=ModeCause.OURS))
    return _IntentResult(state, operator.HOLD, (Hold(vehicle.name),), frozenset({vehicle.name}))


def _resume(pending: PendingIntent) -> _IntentResult:
    vehicle = pending.vehicle
    speed_m_s = vehicle.leg.speed_m_s if vehicle.leg is not None else 0.0
    mission = pending.context.vehicles[vehicle.name].dialect.modes.mission.custom_mode
    state = pending.state.put(vehicle.with_orders(ordered_mode_s=pending.now_s, ordered_modes=frozenset({mission})))
    return _IntentResult(state, operator.RESUME, (Resume(vehicle.name, speed_m_s),), frozenset({vehicle.name}))


def _return(pending: PendingIntent) -> _IntentResult:
    vehicle, now_s = pending.vehicle, pending.now_s
    state, more = _send_vehicle_home(pending.context, pending.state, vehicle, now_s, force=pending.intent.confirmed)
    state, others = withdraw_vehicle(state, vehicle.name, operator.RETURNS.format(vehicle=vehicle.name), now_s)
    # Over its pad a vehicle lands, and not every one may be commanded now.
    kinds, begins = {type(command) for command in more}, operator.RETURN_ORDERED
    if kinds & {SendHome, LandNow}:
        begins = operator.RETURN_BEGINS if SendHome in kinds else operator.LANDING_BEGINS
    return _IntentResult(state, operator.RETURN.format(begins=begins), (*others, *more), frozenset({vehicle.name}))


def _send_vehicle_home(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, force: bool = False
) -> Stepped:
    """Return a vehicle from its mission; one not armed yet must not take off."""
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        left = leave_plan(vehicle, Stage.LANDED, now_s)
        return state.put(left.with_orders(excluded=True)), (SendHome(vehicle.name),)  # instead of its start
    left = leave_plan(vehicle, Stage.RETURNING, now_s).with_orders(excluded=True)
    if force:
        left = left.with_custody(taken=None, cause=ModeCause.OURS)
    return bring_home(context, state, left, now_s, force=force)


def _land(pending: PendingIntent) -> _IntentResult:
    vehicle, now_s, forced = pending.vehicle, pending.now_s, pending.intent.confirmed
    fault = Fault(FaultKind.OPERATOR, operator.LANDS_WHERE_IT_WAS, now_s, FaultCode.OPERATOR_LAND)
    left = replace(leave_plan(vehicle, Stage.RETURNING, now_s), fault=vehicle.fault or fault)
    left = left.with_orders(lands=True, excluded=True)
    left = left.with_custody(taken=None, cause=ModeCause.OURS) if forced else left
    state, told = bring_home(pending.context, pending.state, left, now_s, land=True, force=forced)
    others: tuple[Command, ...] = ()
    if vehicle.stage in _ON_MISSION:
        state, others = withdraw_vehicle(state, vehicle.name, operator.LANDS.format(vehicle=vehicle.name), now_s)
    return _IntentResult(state, operator.LAND, (*others, *told), frozenset({vehicle.name}), level=Level.WARNING)


def _exclude(pending: PendingIntent) -> _IntentResult:
    vehicle = pending.vehicle.with_orders(excluded=True)
    if vehicle.is_at_rest:
        given = vehicle.assignment.pending is not None
        state = pending.state.put(vehicle.with_orders(cleared_s=None).with_assignment(pending=None))
        if not given:
            return _IntentResult(state, operator.STAYS_ON_GROUND)
        # It would start once its new mission is on board.
        return _withdraw(pending, state, operator.EXCLUDED_ON_GROUND, operator.STAYS_ON_GROUND)
    if vehicle.stage is Stage.PILOT:
        hold = replace(vehicle.custody.taken, given_away=True) if vehicle.custody.taken is not None else None
        state = pending.state.put(vehicle.with_custody(taken=hold))
        return _withdraw(pending, state, operator.EXCLUDED_WITH_PILOT, operator.STAYS_WITH_PILOT)
    fault = Fault(FaultKind.OPERATOR, operator.EXCLUDED, pending.now_s, FaultCode.OPERATOR_EXCLUDE)
    state, commands = declare_fault(pending.context, pending.state.put(vehicle), vehicle, fault)
    if vehicle.stage is Stage.STARTING and not vehicle.armed:
        commands = (*commands, SendHome(vehicle.name))  # instead of its start
    told = frozenset(command.vehicle for command in commands if isinstance(command, SendHome))
    text = operator.TAKEN_OUT_RETURNS if told else operator.TAKEN_OUT
    alone, gone = replan_cycle.find_orphan_segments(pending.context, state), {Stage.LOST, Stage.RETURNING}
    others = [one for one in state.vehicles.values() if not one.is_pulled_out]
    if alone and all(one.name == vehicle.name or one.stage in gone for one in others):
        text += operator.NOBODY_IS_LEFT.format(count=len(alone))
    return _IntentResult(state, text, commands, told, level=Level.WARNING)


def _withdraw(pending: PendingIntent, state: FleetState, trigger: str, text: str) -> _IntentResult:
    """Plan around a vehicle without a command to it."""
    name = pending.vehicle.name
    state, more = withdraw_vehicle(state, name, trigger.format(vehicle=name), pending.now_s)
    return _IntentResult(state, text, more)


def _include(pending: PendingIntent) -> _IntentResult:
    context, state, vehicle = pending.context, pending.state, pending.vehicle
    if vehicle.stage is Stage.PILOT:
        state, more = withdrawal.take_back_from_pilot(context, state, vehicle, pending.now_s)
        return _IntentResult(state, operator.INCLUDED, more)
    left = replan_cycle.find_left_over_segments(state)
    again = takeoff_offers.is_offered_reinspection(state, vehicle)
    state, ready = return_to_service(state, vehicle)
    state = clear_for_takeoff(state, ready, pending.now_s)
    if state.crew.offer is not None and len(state.crew.offer.vehicles) > 1:
        # The others may be cleared in a moment, to share the segments.
        state = state.with_replanning(wait_until_s=max(state.replanning.wait_until_s, pending.now_s + SHARED_S))
    if replan_cycle.find_orphan_segments(context, state) or left:
        return _IntentResult(state, operator.INCLUDED_REPLANNING)
    return _IntentResult(state, operator.INCLUDED_AGAIN if again else operator.INCLUDED_IDLE)


def _swap(pending: PendingIntent) -> _IntentResult:
    state, told = turnaround.begin_turnaround(
        pending.context, pending.state, pending.vehicle, pending.intent, pending.now_s
    )
    installed = operator.PACK_INSTALLED if pending.intent.pack else operator.ANY_PACK_INSTALLED
    text = installed.format(pack=pending.intent.pack)
    before, after = (
        pack_count.count_packs(pending.context, one, pending.vehicle.name, pending.now_s)
        for one in (pending.state, state)
    )
    if before is not None and before.charged:
        text = sorties.WITH_PACKS.format(waits=text, packs=pack_count.describe_packs(after))
    elif before is not None:  # the crew knows its packs
        packs = pack_count.describe_packs(before)
        told = (sorties.SWAP_WITHOUT_PACK.say(vehicle=pending.vehicle.name, packs=packs), *told)
    return _IntentResult(state, text, told, open=True)


def _close(pending: PendingIntent) -> _IntentResult:
    base = pending.intent.base
    vehicles = out_of_service.find_vehicles_at_base(pending.context, pending.state, base)
    aloft = ", ".join(one.name for one in vehicles if not one.is_at_rest and one.stage is not Stage.LOST)
    state, told = out_of_service.close_base(pending.context, pending.state, base, pending.now_s)
    text = operator.BASE_IS_CLOSED + (operator.STILL_TO_LAND.format(vehicles=aloft) if aloft else "")
    return _IntentResult(state, text, told, level=Level.WARNING)


def _open(pending: PendingIntent) -> _IntentResult:
    shut = pending.state.crew.closed_bases - {pending.intent.base}
    return _IntentResult(pending.state.with_crew(closed_bases=shut), operator.BASE_IS_OPENED)


def _count(pending: PendingIntent) -> _IntentResult:
    base, charged = pending.intent.base, pending.intent.charged or 0
    vehicles = pending.state.vehicles.values()
    turned = frozenset(vehicle.name for vehicle in vehicles if vehicle.turn.asked_s is not None)
    counted = {**pending.state.crew.counted_packs, base: CountedPacks(charged, pending.now_s, turned)}
    state = pending.state.with_crew(counted_packs=MappingProxyType(counted))
    return _IntentResult(state, operator.PACKS_COUNTED.format(packs=format_count(charged, "charged pack"), base=base))


def _disarm(pending: PendingIntent) -> _IntentResult:
    name = pending.vehicle.name
    told = (Disarm(name, force=True),)
    return _IntentResult(pending.state, operator.DISARM, told, frozenset({name}), level=Level.WARNING)


def _answer(pending: PendingIntent) -> _IntentResult:
    briefing = replace(pending.state.crew.briefing, question=None, answered=pending.intent.action.value)
    return _IntentResult(pending.state.with_crew(briefing=briefing), operator.YES)


def _replan(pending: PendingIntent) -> _IntentResult:
    state = pending.state.with_coverage(given_up=frozenset())
    return _order_replan(pending, state, operator.REPLAN_REQUESTED, operator.REPLAN)


def _order_replan(
    pending: PendingIntent, state: FleetState, trigger: str, text: str, segments: str = ""
) -> _IntentResult:
    trigger = trigger.format(source=pending.intent.source, segments=segments)
    state = state.with_replanning(ordered=True, trigger=trigger, trigger_s=pending.now_s)
    return _IntentResult(state, text.format(segments=segments), open=True)


def _prove(pending: PendingIntent) -> _IntentResult:
    context, state, coverage = pending.context, pending.state, pending.state.coverage
    if not pending.intent.assets:
        wanted = coverage.list_inferred_segments() | asset_status.find_missed_segments(context, state)
        state = replace(state, coverage=asset_status.discard_proof(coverage, wanted))
        names = format_segments(context, wanted)
        return _order_replan(pending, state, operator.PROOF_REQUESTED, operator.PROVE, names)
    found = asset_status.select_segments_to_reinspect(context, state, pending.intent.assets)
    if not isinstance(found, frozenset):
        raise TypeError(found[1])
    state = replace(state, coverage=asset_status.reopen_segments(coverage, found))
    names = format_segments(context, found)
    return _order_replan(pending, state, operator.REINSPECTION_REQUESTED, operator.REINSPECT, names)


def _abort(pending: PendingIntent) -> _IntentResult:
    state, commands = recall_fleet(pending.context, pending.state, pending.now_s)
    told = frozenset(command.vehicle for command in commands if isinstance(command, SendHome | LandNow))
    commands = commands[1:]  # the first line repeats the intent's own
    text = operator.ABORT
    if not told:
        text = operator.ABORT_IDLE if state.listening.silent_since_s is None else operator.ABORT_UNHEARD
    return _IntentResult(state, text, commands, told, level=Level.WARNING)


def recall_fleet(context: Context, state: FleetState, now_s: float) -> Stepped:
    """Return all vehicles."""
    commands: list[Command] = [operator.RECALLED.say()]
    if state.replanning.replan is not None and state.replanning.replan.solve_s is None:
        commands.append(CancelSolve(state.replanning.replan.solve.revision))
    for vehicle in state.vehicles.values():
        if vehicle.stage is Stage.PILOT or (vehicle.stage in _ON_MISSION and vehicle.is_under_foreign_control):
            commands.append(operator.PILOT_NOT_RECALLED.say(vehicle=vehicle.name))
        elif vehicle.stage in _ON_MISSION:
            state, more = _send_vehicle_home(context, state, vehicle, now_s)
            commands.extend(more)
    state = state.with_progress(recalled=True, launched_s=state.progress.launched_s or now_s)
    return state.with_replanning(replan=None).with_crew(offer=None), tuple(commands)


@dataclass(frozen=True, slots=True)
class _Order:
    """The action of an intent, and its lines."""

    order: Callable[[PendingIntent], _IntentResult]
    done: str = ""
    """Of the intent, once every vehicle has answered."""
    does: str = ""
    """Of the vehicle that has complied."""


_ORDERS: Mapping[Action, _Order] = {
    Action.HOLD: _Order(_hold, "it holds", "holds"),
    Action.RESUME: _Order(_resume, "it flies on", "flies on"),
    Action.RETURN: _Order(_return, "it returns"),
    Action.LAND: _Order(_land, "it lands", "lands"),
    Action.EXCLUDE: _Order(_exclude, "it is out of the plan and returns"),
    Action.INCLUDE: _Order(_include),
    Action.SWAP: _Order(_swap),
    Action.REPLAN: _Order(_replan),
    Action.PROVE: _Order(_prove),
    Action.CLOSE: _Order(_close),
    Action.OPEN: _Order(_open),
    Action.COUNT: _Order(_count),
    Action.ABORT: _Order(_abort, "all vehicles return"),
    Action.DISARM: _Order(_disarm, "its motors are off", "disarmed"),
    Action.PREPARE: _Order(_answer),
    Action.TAKE_OFF: _Order(_answer),
}


def apply_order_result(context: Context, state: FleetState, event: OrderEnded | ReturnEnded, now_s: float) -> Stepped:
    """Apply a vehicle's answer to a command."""
    name, action = event.vehicle, event.action
    actions = {Action.RETURN: _RETURNS, Action.LAND: _RETURNS | {Action.LAND}}.get(action, frozenset({action}))
    state, more = homing.apply_homing_result(state, event, now_s) if Action.RETURN in actions else (state, ())
    vehicle, state = state.vehicles[name], _close_intents(state, name, actions, event, now_s)
    if action is Action.RETURN:
        line = operator.RTL_REFUSED if event.refused else operator.RTL_UNANSWERED
        return state, ((operator.COMES_HOME if event.accepted else line).say(vehicle=name, reason=event.reason), *more)
    if action is Action.HOLD and not event.accepted and vehicle.orders.held_s is not None:
        # It may still comply, or have done so unnoticed: that is no mode change by itself. `settle_intents` clears this
        # later.
        state = state.put(vehicle.with_orders(ordered_mode_s=now_s))
    if action is Action.RESUME and event.accepted and vehicle.orders.held_s is not None:
        gone_on = vehicle.with_orders(held_s=None, hold_asked_s=float("-inf"), ordered_mode_s=now_s)
        state = state.put(gone_on.with_motion(anchor=None))
    if action is Action.DISARM and not event.accepted and vehicle.stage is Stage.RETURNING:
        # It was to disarm on the ground, and is no longer there.
        state, more = homing.bring_home(context, state, vehicle, now_s)
    if not event.accepted:
        return state, (operator.NOT_FOLLOWED.say(vehicle=name, action=action.value, reason=event.reason), *more)
    note = f"; {event.reason}" if event.reason else ""
    if action is Action.DISARM and vehicle.stage is Stage.DOWN:
        note = f"; {describe_down_place(context, vehicle.with_telemetry(heartbeat=None))}"
    line = operator.FOLLOWED.with_level(Level.WARNING) if note else operator.FOLLOWED
    return state, (line.say(vehicle=name, does=_ORDERS[action].does, note=note),)


def _close_intents(
    state: FleetState, vehicle: str, actions: Collection[Action], event: OrderEnded | ReturnEnded, now_s: float
) -> FleetState:
    """Record an answer in every intent that waits for it."""
    intents = dict(state.crew.intents)
    for name, record in state.crew.intents.items():
        if record.intent.action not in actions or vehicle not in record.waiting:
            continue
        heard = replace(record, waiting=record.waiting - {vehicle})
        if not event.accepted:
            heard = heard.end(Outcome.FAILED, f"{vehicle}: {event.reason}", now_s, event.code)
        elif not heard.waiting and record.outcome is Outcome.ACCEPTED:
            note = f"; {event.reason}" if event.reason else ""
            heard = heard.end(Outcome.DONE, _ORDERS[record.intent.action].done + note, now_s)
        intents[name] = heard
    return state.with_crew(intents=MappingProxyType(intents))


def settle_intents(context: Context, state: FleetState, now_s: float) -> Stepped:
    """End intents that no answer ends, and detect held vehicles that other parties have resumed."""
    for vehicle in state.vehicles.values():
        orders = vehicle.orders
        quiet = now_s - max(orders.ordered_mode_s, vehicle.telemetry.mode_since_s) > OTHERS_MODE_S
        asked = vehicle.stage is Stage.FLYING and now_s - orders.hold_asked_s <= FOLLOWED_LATE_S
        if orders.held_s is not None and quiet and not vehicle.link.stale and is_on_mission(context, vehicle):
            state = state.put(vehicle.with_orders(held_s=None).with_motion(anchor=None))
        elif orders.held_s is None and asked and is_holding(context, vehicle):
            state = state.put(vehicle.with_orders(held_s=now_s))
    ended = {
        name: replace(record, waiting=frozenset()).end(outcome, text, now_s, code)
        for name, record in state.crew.intents.items()
        if record.outcome is Outcome.ACCEPTED
        for outcome, (code, text) in _find_ends(state, record, now_s)
    }
    if not ended:
        return state, ()
    return state.with_crew(intents=MappingProxyType({**state.crew.intents, **ended})), ()


_End = tuple[Outcome, tuple[IntentReason | None, str]]
"""The end of an intent, as a code and in words."""


def _find_ends(state: FleetState, record: IntentRecord, now_s: float) -> tuple[_End, ...]:
    """Return how an intent ends; empty while it is under way."""
    if record.intent.action in {Action.REPLAN, Action.PROVE}:
        return _find_replan_ends(state, record)
    for name in sorted(record.waiting):
        vehicle = state.vehicles[name]
        if vehicle.stage is Stage.LOST:
            return ((Outcome.FAILED, fill_in(operator.VEHICLE_LOST, vehicle=name)),)
        if record.intent.action in {Action.HOLD, Action.RESUME} and vehicle.stage is not Stage.FLYING:
            why = f": {vehicle.fault.reason}" if vehicle.fault is not None else ""
            over = fill_in(operator.SUPERSEDED, vehicle=name, stage=vehicle.stage.value, why=why)
            return ((Outcome.FAILED, over),)
        if now_s - record.at_s > ANSWER_S:
            return ((Outcome.FAILED, fill_in(operator.UNANSWERED, vehicle=name)),)
    return ()


def _find_replan_ends(state: FleetState, record: IntentRecord) -> tuple[_End, ...]:
    known = state.replanning
    last = known.records[-1] if known.records else None
    if last is not None and last.ended_s > record.at_s and known.replan is None:
        left = operator.LEFT_OVER.format(count=len(last.uncovered)) if last.uncovered else ""
        return ((Outcome.DONE, (None, operator.REPLAN_ON_BOARD.format(revision=last.revision) + left)),)
    if state.progress.recalled:
        return ((Outcome.FAILED, operator.ABORTED),)
    idle = known.replan is None and not known.ordered and not known.urgent
    return ((Outcome.FAILED, operator.NO_REPLAN),) if idle else ()
