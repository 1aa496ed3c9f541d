"""Watching without acting: the watchpoints of the live flight over vehicles that somebody else flies.

``step(scene, state, event, now_s) -> (state, findings)``. Messages are folded and faults are judged by the very
functions that `step` uses; nothing is ordered. As nobody here starts the vehicles, one that arms is taken to fly
until it disarms, whatever was declared of it: a battery that fails hides no crash. One whose link is regained is
watched again. Who changed a mode is told with the mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from executor.core.context import Scene
from executor.core.inflight.custody.mode_causes import (
    attribute_mode_change,
    is_attribution_final,
    is_set_by_person,
)
from executor.core.inflight.faults import link_loss, warning_rules, watchpoints
from executor.core.inflight.faults.watch_view import Watchpoint, WatchView, describe_reported_failure
from executor.core.interface.events import Heard, Tick
from executor.core.interface.messages import Actor, Heartbeat
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import WATCHED, Fault, FaultCode, FaultKind, Stage, VehicleState, change_stage
from executor.core.telemetry.message_update import apply_message
from missions.autopilots.dialect import is_manual_mode, is_mission_mode, mode_name

WARN_S = 1.5
"""Warnings decide nothing: they are looked for less often than faults."""


@dataclass(frozen=True, slots=True)
class DeclaredFault:
    """A fault."""

    vehicle: str
    kind: FaultKind
    reason: str
    """Name of the watchpoint."""
    evidence: str
    at_s: float


@dataclass(frozen=True, slots=True)
class Degradation:
    """A time in which something was not well."""

    vehicle: str
    kind: FaultKind
    reason: str
    """Name of the warning."""
    evidence: str
    from_s: float
    to_s: float | None = None
    """None as long as it lasts."""


@dataclass(frozen=True, slots=True)
class ObservedModeChange:
    """An armed vehicle's mode became another."""

    vehicle: str
    mode: str
    by: Actor
    why: str
    """What says so, in words; empty where nothing does."""
    at_s: float


Finding = DeclaredFault | Degradation | ObservedModeChange


@dataclass(frozen=True, slots=True)
class VehicleReports:
    """What was told of a vehicle since it was armed."""

    declared: frozenset[str] = frozenset()
    """Groups of faults: the first reason of each stands."""
    mode_s: float = float("-inf")
    """Since when it was in the last mode that was told."""


@dataclass(frozen=True, slots=True)
class PassiveWatch:
    """What is known of all vehicles, and what is not well now."""

    fleet: FleetState = field(default_factory=lambda: FleetState(MappingProxyType({})))
    open: Mapping[tuple[str, str], Degradation] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle and name of the warning."""
    warned_s: float = float("-inf")
    """When was looked for what is not well."""
    told: Mapping[str, VehicleReports] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle."""

    def reports_of(self, name: str) -> VehicleReports:
        """Return what was told of a vehicle."""
        return self.told.get(name, VehicleReports())

    def with_reports(self, name: str, told: VehicleReports) -> PassiveWatch:
        """Return it with something told."""
        known = told == self.reports_of(name)
        return self if known else replace(self, told=MappingProxyType({**self.told, name: told}))


Stepped = tuple[PassiveWatch, tuple[Finding, ...]]


def step_watch(scene: Scene, state: PassiveWatch, event: Heard | Tick, now_s: float) -> Stepped:
    """Apply one event."""
    match event:
        case Heard(name, message):
            before, found = state.fleet.vehicles[name], tuple[Finding, ...]()
            vehicle = apply_message(scene, before, message, now_s).state
            if isinstance(message, Heartbeat):
                state, found = _apply_mode_change(scene, state, before, vehicle)
                vehicle = _follow_stage(scene, before, vehicle, now_s)
            fleet = state.fleet.put(vehicle)
            if fleet.progress.launched_s is None and vehicle.stage is Stage.FLYING:
                fleet = fleet.with_progress(launched_s=now_s)
            # Of every message: faster than replace.
            return PassiveWatch(fleet, state.open, state.warned_s, state.told), found
        case Tick():
            return _apply_tick(scene, state, now_s)


def record_contact(state: PassiveWatch, name: str, at_s: float, heartbeat_s: float | None = None) -> PassiveWatch:
    """Return the state with a vehicle that said something, whatever it was, and its HEARTBEAT without news then."""
    vehicle = state.fleet.vehicles[name]
    later = vehicle.link.heard_s is None or at_s > vehicle.link.heard_s
    if not later and heartbeat_s is None:
        return state
    told = vehicle.with_link(
        heard_s=at_s if later else vehicle.link.heard_s,
        heartbeat_s=vehicle.link.heartbeat_s if heartbeat_s is None else heartbeat_s,
    )
    return replace(state, fleet=state.fleet.put(told))


def close_degradations(state: PassiveWatch, now_s: float) -> tuple[Degradation, ...]:
    """Return what was not well when the log ended."""
    return tuple(replace(one, to_s=now_s) for one in state.open.values())


HEARD_BEFORE_S = 2.0
"""A HEARTBEAT shows up to so much later that it is armed: what was said meanwhile is of this flight."""


def _apply_mode_change(scene: Scene, state: PassiveWatch, before: VehicleState, vehicle: VehicleState) -> Stepped:
    """Take note of a HEARTBEAT that begins a flight, or another mode in it."""
    name, told = vehicle.name, state.reports_of(vehicle.name)
    if vehicle.armed and not before.armed:
        return state.with_reports(name, VehicleReports(mode_s=vehicle.telemetry.mode_since_s)), ()
    if not before.armed or before.telemetry.mode_since_s == vehicle.telemetry.mode_since_s:
        return state, ()
    if is_mission_mode(scene.vehicles[name].dialect, vehicle.mode):
        state = state.with_reports(name, replace(told, declared=told.declared - {"left"}))  # it may be left again
    return _report_mode(scene, state, before)


def _report_mode(scene: Scene, state: PassiveWatch, vehicle: VehicleState) -> Stepped:
    """Tell the mode that a vehicle is in, and who chose it, unless that was told."""
    told, since_s = state.reports_of(vehicle.name), vehicle.telemetry.mode_since_s
    if vehicle.mode is None or since_s <= told.mode_s:
        return state, ()
    setup = scene.vehicles[vehicle.name]
    who = attribute_mode_change(setup, vehicle)
    moded = ObservedModeChange(vehicle.name, mode_name(setup.dialect, vehicle.mode), who.by, who.why, since_s)
    return state.with_reports(vehicle.name, replace(told, mode_s=since_s)), (moded,)


def _follow_stage(scene: Scene, before: VehicleState, vehicle: VehicleState, now_s: float) -> VehicleState:
    if vehicle.mode is None:
        return vehicle
    if before.armed and before.telemetry.mode_since_s != vehicle.telemetry.mode_since_s:
        vehicle = _leave_mission_to_person(scene, before, vehicle)
    match vehicle.stage:
        case Stage.GROUND | Stage.LANDED if vehicle.armed:
            return _begin_flight(vehicle, now_s)
        case Stage.LOST if not vehicle.armed:
            return change_stage(vehicle, Stage.LANDED)
        case Stage.LOST:
            # Live RTL would be commanded; here it flies on, and may be lost again.
            return replace(change_stage(vehicle, Stage.FLYING, besides=WATCHED), fault=None, watches=()).with_motion(
                anchor=None
            )
        case _:
            return vehicle


def _begin_flight(vehicle: VehicleState, now_s: float) -> VehicleState:
    """Begin a flight: nothing that was said of the last one is of this one."""
    alarm = vehicle.telemetry.alarm
    failed = tuple(
        one
        for one in vehicle.evidence.failed
        # A crash ended the flight before this one.
        if now_s - one[1] <= HEARD_BEFORE_S and not (one[0].what == "crash" and vehicle.sortie.armed_once)
    )
    return replace(
        change_stage(vehicle, Stage.FLYING, besides=WATCHED),
        fault=None,
        watches=(),
        sortie=replace(vehicle.sortie, took_off=False, flew_mission=False, armed_once=True),
        motion=replace(vehicle.motion, anchor=None),
        telemetry=replace(
            vehicle.telemetry, alarm=alarm if now_s - alarm[1] <= HEARD_BEFORE_S else ("", float("-inf"))
        ),
        evidence=replace(vehicle.evidence, failed=failed),
    )


def _leave_mission_to_person(scene: Scene, before: VehicleState, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle that is on no mission any more once a person has it: what comes then interrupts none."""
    setup = scene.vehicles[vehicle.name]
    if before.mode is None or is_mission_mode(setup.dialect, before.mode):
        return vehicle
    if not is_set_by_person(scene, before) and not is_manual_mode(setup.dialect, before.mode):
        return vehicle
    again = is_mission_mode(setup.dialect, vehicle.mode)
    return vehicle.with_sortie(flew_mission=again and vehicle.sortie.took_off)


def _apply_tick(scene: Scene, state: PassiveWatch, now_s: float) -> Stepped:
    fleet, _ = link_loss.discount_host_pause(scene, state.fleet, now_s)
    fleet, _ = link_loss.check_all_links(scene, fleet, now_s, least=link_loss.ALL)
    silent_since_s = fleet.listening.silent_since_s
    alone = silent_since_s is not None and now_s - silent_since_s < scene.limits.all_silent_s
    vehicles, found = dict(fleet.vehicles), list[Finding]()
    open_ = dict(state.open)
    heard_s = [one.link.heard_s for one in vehicles.values() if one.stage is Stage.FLYING]
    silent = any(one is not None and now_s - one >= scene.limits.link_stale_s for one in heard_s)
    looks = silent or now_s - state.warned_s >= WARN_S
    for name, vehicle in fleet.vehicles.items():
        if vehicle.stage is Stage.LOST:
            continue  # nothing begins and nothing ends in silence
        if vehicle.armed and is_attribution_final(vehicle, now_s):
            state, moded = _report_mode(scene, state, vehicle)
            found += moded
        told = state.reports_of(name)
        vehicle, declared = _judge_vehicle(scene, vehicle, told, now_s, alone=alone)
        vehicles[name] = vehicle
        groups = told.declared | {_group_of(one) for one, _ in declared}
        state = state.with_reports(name, replace(told, declared=groups))
        found += (DeclaredFault(name, point.kind, point.name, why, now_s) for point, why in declared)
        if looks and (open_ or vehicle.stage not in _DOWN):
            found += update_degradations(WatchView(scene, scene.vehicles[name], vehicle, False, now_s), open_)
    fleet = replace(fleet, vehicles=MappingProxyType(vehicles))
    return replace(state, fleet=fleet, open=open_, warned_s=now_s if looks else state.warned_s), tuple(found)


_DOWN = frozenset({Stage.GROUND, Stage.LANDED})
_DOWN_REASONS = frozenset({"off-pad", "falling", "sinking", "thrust", "terminated", "crash"})


def _group_of(point: Watchpoint) -> str:
    """Return of what the first reason stands: a battery, a mission that was left, a fall."""
    if point.kind not in {FaultKind.INTERRUPTION, FaultKind.FENCE}:
        return str(point.kind.value)
    return "down" if point.name in _DOWN_REASONS else "left"


Raised = tuple[Watchpoint, str]


def _judge_vehicle(
    scene: Scene, vehicle: VehicleState, told: VehicleReports, now_s: float, *, alone: bool
) -> tuple[VehicleState, list[Raised]]:
    setup = scene.vehicles[vehicle.name]
    if vehicle.stage in _DOWN:
        # It may have disarmed before it says why.
        view = WatchView(scene, setup, vehicle, False, now_s)
        late = describe_reported_failure(view, "crash") if now_s - vehicle.sortie.disarmed_s <= LATE_S else ""
        return vehicle, [(watchpoints.CRASH, late)] if late and "down" not in told.declared else []
    vehicle, failed = watchpoints.judge_watchpoints(scene, setup, vehicle, now_s)
    raised = list[Raised]()
    for point, why in failed:
        known = told.declared | {_group_of(one) for one, _ in raised}
        if point.code is FaultCode.VOLTAGE_STEP and known & _STRUGGLES and not vehicle.power.volts.known_load:
            continue  # what its motors draw to save it, nobody knows
        silent = point.kind is FaultKind.LINK  # each silence is a loss of its own
        if (silent and not alone) or (not silent and _group_of(point) not in known):
            raised.append((point, why))
    if raised and vehicle.fault is None:
        point, why = raised[0]
        vehicle = replace(vehicle, fault=Fault(point.kind, why, now_s, point.code))
    if not vehicle.armed:
        return replace(change_stage(vehicle, Stage.LANDED), fault=vehicle.fault if raised else None), raised
    if any(point.kind is FaultKind.LINK for point, _ in raised):
        vehicle = change_stage(vehicle, Stage.LOST)
    return vehicle, raised


_STRUGGLES = frozenset({"left", "down"})
LATE_S = 4.0
"""So long after it disarmed it may still say why."""


def update_degradations(view: WatchView, open_: dict[tuple[str, str], Degradation]) -> list[Degradation]:
    """Begin and end what is not well; returns what ended."""
    name = view.state.name
    now = {row.name: (row.kind, words) for row, words in warning_rules.find_warnings(view)}
    for row, (kind, words) in now.items():
        if (name, row) not in open_:
            open_[name, row] = Degradation(name, kind, row, words, view.now_s)
    over = [key for key in open_ if key[0] == name and key[1] not in now]
    return [replace(open_.pop(key), to_s=view.now_s) for key in over]
