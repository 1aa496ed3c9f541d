"""The flight: ``step(context, state, event, now_s) -> (state, commands)``.

Everything that is decided about the fleet passes through here. Faults are levels, looked at on every tick; the log of
events fed to `step` again gives the same commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from executor.core import degraded, faults, operator, replanning, resuming, silence
from executor.core.commands import Command, Finish, LandNow, Level, Say, SendHome, Start
from executor.core.context import Context
from executor.core.declare import comes_home, declare, on_mission
from executor.core.degraded import Told
from executor.core.events import (
    Event,
    Heard,
    IntentReceived,
    LaunchOrdered,
    LossJudged,
    MissionsWanted,
    OrderEnded,
    Reopened,
    Resumed,
    ReturnAllOrdered,
    ReturnEnded,
    SolveEnded,
    StartEnded,
    Tick,
    UploadEnded,
)
from executor.core.faults import View
from executor.core.hearing import fold
from executor.core.messages import Heartbeat, Position
from executor.core.state import FleetState, Outlook, SaidLine, Separation
from executor.core.strangers import stranger_words
from executor.core.vehicle import FaultKind, OnBoard, Stage, VehicleState, aboard, moved_to

Stepped = tuple[FleetState, tuple[Command, ...]]

RETRIES = 3
"""How often a start that failed is tried again."""
ORDER_AGAIN_S = 5.0
"""A vehicle that was told to return and does not is told again."""
WARNING_SEVERITY = 4
"""MAV_SEVERITY_WARNING: less severe texts stay in the log."""
TEXT_AGAIN_S = 30.0
"""A text that a vehicle repeats is shown once in this time; ArduPilot says the same for every item of an upload."""
FRESH_S = 1.5
"""Two positions no older than this say how far two vehicles are apart."""
CLIMBS_MOST_M = 15.0
"""More than anybody rises or sinks in that time."""


def initial(boards: Mapping[str, OnBoard | None]) -> FleetState:
    """Return the state before the launch, with the missions that are on board."""
    return FleetState(MappingProxyType({name: VehicleState(name, board=board) for name, board in boards.items()}))


def step(context: Context, state: FleetState, event: Event, now_s: float) -> Stepped:
    """Apply one event."""
    state, commands = _step(context, state, event, now_s)
    lines = tuple(SaidLine(now_s, command.level, command.text) for command in commands if isinstance(command, Say))
    return (state.telling(lines) if lines else state), commands


def _step(  # noqa: C901, PLR0911 - one return for each kind of event
    context: Context, state: FleetState, event: Event, now_s: float
) -> Stepped:
    match event:
        case Heard():
            return _heard(context, state, event, now_s)
        case Tick():
            return _tick(context, state, now_s)
        case LaunchOrdered():
            return _launch(state, now_s)
        case StartEnded():
            return _started(context, state, event, now_s)
        case UploadEnded():
            return _uploaded(context, state, event, now_s)
        case SolveEnded():
            return replanning.solved(context, state, event, now_s)
        case MissionsWanted():
            return replanning.composed(context, state, event, now_s)
        case LossJudged():
            return _judged(state, event, now_s), ()
        case ReturnEnded() | OrderEnded() | IntentReceived() | ReturnAllOrdered():
            return operator.step(context, state, event, now_s)
        case Reopened():
            return resuming.reopened(state, event, now_s)
        case Resumed():
            return _resumed(context, state, event, now_s)


def _resumed(context: Context, state: FleetState, event: Resumed, now_s: float) -> Stepped:
    taken = resuming.resumed(context, state, event, now_s)
    state, commands = taken.state, list(taken.commands)
    for ended in taken.ended:
        state, more = _step(context, state, ended, now_s)
        commands.extend(more)
    for name, why in taken.strange:
        state, more = declare(context, state, state.vehicles[name], FaultKind.INTERRUPTION, why, now_s)
        commands.extend(more)
    return state, tuple(commands)


def _judged(state: FleetState, event: LossJudged, now_s: float) -> FleetState:
    if event.revision != state.revision:
        return state
    outlook = {**state.outlook, event.vehicle: Outlook(now_s, event.uncovered)}
    return replace(state, outlook=MappingProxyType(outlook))


def _launch(state: FleetState, now_s: float) -> Stepped:
    commands: list[Command] = []
    for vehicle in state.vehicles.values():
        if vehicle.board is None or not vehicle.board.visits:
            continue
        state, start = _start(state, vehicle, now_s)
        commands.append(start)
    return replace(state, launched_s=now_s), tuple(commands)


def _start(state: FleetState, vehicle: VehicleState, now_s: float) -> tuple[FleetState, Start]:
    vehicle = moved_to(vehicle, Stage.STARTING)
    vehicle = replace(
        vehicle, ordered_mode_s=now_s, waypoint=0, run=None, armed_once=False, took_off=False, anchor=None,
        began_pct=vehicle.battery.remaining_pct,
    )  # fmt: skip
    return state.put(vehicle), Start(vehicle.name)


def _started(context: Context, state: FleetState, event: StartEnded, now_s: float) -> Stepped:
    vehicle = state.vehicles[event.vehicle]
    if vehicle.stage is not Stage.STARTING:
        return state, ()
    if event.accepted:
        vehicle = replace(moved_to(vehicle, Stage.FLYING), failures=0, ordered_mode_s=now_s, anchor=None)
        return state.put(vehicle), (Say(Level.INFO, f"{vehicle.name}: flies its mission"),)
    if vehicle.failures + 1 < RETRIES:
        vehicle = replace(vehicle, failures=vehicle.failures + 1, ordered_mode_s=now_s)
        text = f"{vehicle.name}: did not start ({event.reason}); trying again"
        return state.put(vehicle), (Say(Level.WARNING, text), Start(vehicle.name))
    return declare(context, state, vehicle, FaultKind.INTERRUPTION, f"did not start: {event.reason}", now_s)


def _heard(context: Context, state: FleetState, event: Heard, now_s: float) -> Stepped:
    before = state.vehicles[event.vehicle]
    folded = fold(context, before, event.message, now_s)
    state = state.put(folded.state)
    commands: list[Command] = [
        Say(Level.WARNING, f"{event.vehicle}: {stranger_words(stranger)}")
        for stranger in folded.state.strangers - before.strangers
    ]
    if folded.text is not None and folded.text.severity <= WARNING_SEVERITY:
        heard = (folded.text.text, now_s)
        if heard[0] != before.last_text[0] or now_s - before.last_text[1] > TEXT_AGAIN_S:
            commands.append(Say(Level.WARNING, f"{event.vehicle} says: {heard[0]}"))
        state = state.put(replace(folded.state, last_text=heard))
    if folded.broken:
        commands.append(Say(Level.WARNING, f"{event.vehicle}: inspection does not count: {folded.broken}"))
    if folded.inspected is not None and folded.inspected not in state.inspected:
        inspected = MappingProxyType({**state.inspected, folded.inspected: event.vehicle})
        flown = {**state.flown, folded.inspected: folded.flown} if folded.flown is not None else state.flown
        state = replace(state, inspected=inspected, flown=MappingProxyType(flown))
    if isinstance(event.message, Position):
        state = _separated(context, state, folded.state, now_s)
    # Only a heartbeat says in which mode it is, and whether it is armed; its last one is from before the silence.
    if before.stage is Stage.LOST and isinstance(event.message, Heartbeat):
        state, more = _came_back(context, state, state.vehicles[event.vehicle], now_s)
        commands.extend(more)
    return state, tuple(commands)


def _came_back(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Make sure that a vehicle whose work was given away does not go on with it, in the air or on the ground."""
    heard = f"{vehicle.name}: is heard again"
    if vehicle.armed:
        vehicle = replace(moved_to(vehicle, Stage.RETURNING), ordered_mode_s=now_s)
        if comes_home(context, vehicle):
            return state.put(vehicle), (Say(Level.WARNING, f"{heard}, on its way home or down by itself"),)
        text = f"{heard}; its work was given away, so it is told to return"
        return state.put(vehicle), (Say(Level.WARNING, text), SendHome(vehicle.name))
    state = state.put(replace(moved_to(vehicle, Stage.LANDED), ordered_mode_s=now_s))
    if not on_mission(context, vehicle):
        return state, (Say(Level.INFO, f"{heard}, on the ground"),)
    # Whoever arms it in this mode would have it fly its old mission: neither autopilot takes off for a return.
    text = f"{heard}, on the ground; it is told to return, so that it does not take off with its old mission"
    return state, (Say(Level.INFO, text), SendHome(vehicle.name))


def _separated(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> FleetState:
    fix = vehicle.fix
    high = context.limits.airborne_m
    if fix is None or fix.alt_rel_m < high or not vehicle.armed:
        return state
    least = state.separation
    # Every position is held against every vehicle: the height alone settles nearly all of them.
    reach_m = math.inf if least is None else least.least_m + CLIMBS_MOST_M
    for other in state.vehicles.values():
        seen = other.fix
        if seen is None or abs(seen.alt_msl_m - fix.alt_msl_m) > reach_m:
            continue
        if other.name == vehicle.name or seen.alt_rel_m < high or not other.armed:
            continue
        age_s = now_s - seen.at_s
        if age_s > FRESH_S:
            continue
        east_m_s, north_m_s, up_m_s = seen.velocity_m_s
        higher_m = seen.alt_msl_m + up_m_s * age_s - fix.alt_msl_m
        east_m = seen.place_m[0] + east_m_s * age_s - fix.place_m[0]
        north_m = seen.place_m[1] + north_m_s * age_s - fix.place_m[1]
        apart_m = math.hypot(east_m, north_m, higher_m)
        if least is None or apart_m < least.least_m:
            least = Separation(apart_m, (vehicle.name, other.name), now_s)
    if least is state.separation:
        return state
    return replace(state, separation=least)


def _tick(context: Context, state: FleetState, now_s: float) -> Stepped:
    commands: list[Command] = []
    state, more = silence.own_sleep(state, now_s)
    commands.extend(more)
    state, more = silence.of_all(context, state, now_s)
    commands.extend(more)
    alone = state.silent_since_s is not None and now_s - state.silent_since_s < context.limits.all_silent_s
    for name in state.vehicles:
        state, more = _look_at(context, state, name, now_s, alone=alone)
        commands.extend(more)
    state, more = replanning.begin(context, state, now_s)
    commands.extend(more)
    state = operator.settled(context, state, now_s)
    state, more = _finish(context, state)
    return state, (*commands, *more)


def _look_at(context: Context, state: FleetState, name: str, now_s: float, *, alone: bool) -> Stepped:
    vehicle = state.vehicles[name]
    if vehicle.stage in {Stage.GROUND, Stage.LANDED, Stage.LOST}:
        return state, ()
    commands: list[Command] = []
    state, more = silence.of_one(context, state, vehicle, now_s)
    commands.extend(more)
    vehicle = state.vehicles[name]
    view = View(context, context.vehicles[name], vehicle, False, now_s)
    told, lines = degraded.said(view, state.told.get(name, Told()))
    if told is not state.told.get(name):
        state = replace(state, told=MappingProxyType({**state.told, name: told}))
    commands.extend(Say(Level.WARNING, line) for line in lines)
    judgement = faults.judge(context, context.vehicles[name], vehicle, now_s)
    vehicle = replace(vehicle, watches=judgement.watches)
    state = state.put(vehicle)
    raised = [(point, why) for point, why in judgement.raised if not (alone and point.kind is FaultKind.LINK)]
    if raised and raised[0][0].name == "mode" and silence.ended_its_mission(context, state, vehicle, now_s):
        state, more = _missed_us(context, state, vehicle, now_s)
        commands.extend(more)
    elif raised:
        point, why = raised[0]
        state, more = _fault(context, state, vehicle, point.kind, why, now_s)
        commands.extend(more)
    elif _has_landed(vehicle):
        state, more = _landed(state, vehicle, now_s)
        commands.extend(more)
    elif vehicle.stage is Stage.RETURNING:
        state, more = _order_again(context, state, vehicle, now_s)
        commands.extend(more)
    return state, tuple(commands)


def _missed_us(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Let a vehicle come home whose own failsafe acted because we were not there: it is well, and may fly again.

    Its mission is not taken up in the air: both autopilots forget the speed at a change of mode (measured).
    """
    state = state.put(replace(moved_to(vehicle, Stage.RETURNING), ordered_mode_s=now_s, run=None))
    trigger = f"{vehicle.name}: ended its mission while the ground station was away"
    state = replace(state, urgent=True, trigger=trigger, trigger_s=now_s)
    said = Say(Level.WARNING, f"{trigger}; it comes home, and may fly again")
    return state, (said,) if comes_home(context, vehicle) else (said, SendHome(vehicle.name))


def _has_landed(vehicle: VehicleState) -> bool:
    return vehicle.armed_once and not vehicle.armed and vehicle.stage in {Stage.FLYING, Stage.RETURNING}


def _landed(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    vehicle = replace(moved_to(vehicle, Stage.LANDED), run=None)
    state = state.put(vehicle)
    if vehicle.fault is None and not vehicle.excluded and vehicle.name not in state.considered:
        # It was on its way down when the last re-plan was made: what was left then may be for it.
        state = replace(state, considered=state.considered | {vehicle.name})
        if state.given_up:
            trigger = f"{vehicle.name}: landed with battery to spare"
            state = replace(state, given_up=frozenset(), urgent=True, trigger=trigger, trigger_s=now_s)
    left = "" if vehicle.battery.remaining_pct is None else f" with {vehicle.battery.remaining_pct:.0f} %"
    return state, (Say(Level.INFO, f"{vehicle.name}: landed{left}"),)


def _order_again(context: Context, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    if vehicle.heartbeat is None or vehicle.stale or comes_home(context, vehicle):
        return state, ()
    if now_s - vehicle.ordered_mode_s < ORDER_AGAIN_S:
        return state, ()
    again = LandNow(vehicle.name) if vehicle.lands else SendHome(vehicle.name)
    return state.put(replace(vehicle, ordered_mode_s=now_s)), (again,)


def _fault(
    context: Context, state: FleetState, vehicle: VehicleState, kind: FaultKind, why: str, now_s: float
) -> Stepped:
    """One arbiter: the first reason stands; a later one only changes where the vehicle is taken to be."""
    if vehicle.fault is None:
        return declare(context, state, vehicle, kind, why, now_s)
    if kind is FaultKind.LINK:
        return state.put(moved_to(vehicle, Stage.LOST)), (Say(Level.WARNING, f"{vehicle.name}: {why}"),)
    if _has_landed(vehicle):
        return state.put(moved_to(vehicle, Stage.LANDED)), ()
    return state, ()


def _uploaded(context: Context, state: FleetState, event: UploadEnded, now_s: float) -> Stepped:
    vehicle = state.vehicles[event.vehicle]
    plan = state.replan
    if plan is None or event.revision != plan.solve.revision or event.vehicle not in plan.pending:
        return state, ()
    mission = plan.missions[event.vehicle]
    vehicle = replace(vehicle, pending=None)
    commands: list[Command] = []
    plan = replace(plan, pending=plan.pending - {event.vehicle})
    if event.accepted:
        board = aboard(context, vehicle.name, event.revision, mission.path, mission.visits)
        state = state.put(replace(vehicle, board=board))
        to_go = len(mission.visits if mission.fresh else state.vehicles[vehicle.name].remaining_visits())
        commands.append(Say(Level.INFO, f"{vehicle.name}: new mission on board, {to_go} segments to go"))
    else:
        plan = replace(plan, failed=(*plan.failed, vehicle.name))
        state = state.put(replace(vehicle, stubborn=True))
        text = f"{vehicle.name}: could not be given its new mission ({event.reason}); planning around it"
        commands.append(Say(Level.WARNING, text))
        state = replace(state, urgent=True, trigger=f"{vehicle.name}: {event.reason}", trigger_s=now_s)
    if mission.fresh and event.accepted:
        state, start = _start(state, state.vehicles[vehicle.name], now_s)
        commands.append(start)
    elif vehicle.stage is Stage.STARTING and not event.mixed:
        state, more = _started_again(state, state.vehicles[vehicle.name], now_s)
        commands.extend(more)
    state = replace(state, replan=plan)
    if event.mixed and not event.accepted and not mission.fresh:
        state, more = declare(
            context,
            state,
            state.vehicles[vehicle.name],
            FaultKind.INTERRUPTION,
            "its mission is a mixture of two",
            now_s,
        )
        commands.extend(more)
    state, more = replanning.ended_if_done(state, now_s)
    return state, (*commands, *more)


def _started_again(state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Go on with a start that an upload broke off: whatever is being said to a vehicle gives way to an upload."""
    if vehicle.took_off:
        vehicle = replace(moved_to(vehicle, Stage.FLYING), failures=0, ordered_mode_s=now_s)
        return state.put(vehicle), (Say(Level.INFO, f"{vehicle.name}: flies its mission"),)
    state, start = _start(state, vehicle, now_s)
    return state, (start,)


def _finish(context: Context, state: FleetState) -> Stepped:
    waiting = {Stage.STARTING, Stage.FLYING, Stage.RETURNING}
    if state.finished or state.launched_s is None or state.replan is not None:
        return state, ()
    if any(vehicle.stage in waiting for vehicle in state.vehicles.values()):
        return state, ()
    if not state.recalled and replanning.orphans(context, state):
        return state, ()
    missing = context.segments - len(state.inspected)
    reason = "every segment is inspected" if missing == 0 else f"{missing} segments are not inspected"
    return replace(state, finished=True), (Finish(reason),)
