"""Find the faults of vehicles under another ground station's supervision, without commanding them.

``step(scene, state, event, now_s) -> (state, findings)``. Messages are folded and faults judged by the functions of the
live flight's `step`. Take-offs are not ours to see, so a vehicle counts as flying from arming until disarming, whatever
fault was declared: a failing battery must not hide a crash. After its link is regained a vehicle is watched again. Each
mode change is reported with the party that made it.
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

WARNING_INTERVAL_S = 1.5
"""Interval between evaluations of the warnings; they trigger no action and may come later than faults."""


@dataclass(frozen=True, slots=True)
class DeclaredFault:
    """A declared fault."""

    vehicle: str
    kind: FaultKind
    reason: str
    """Name of the watchpoint."""
    evidence: str
    at_s: float


@dataclass(frozen=True, slots=True)
class Degradation:
    """A period in which a warning was active."""

    vehicle: str
    kind: FaultKind
    reason: str
    """Name of the warning."""
    evidence: str
    from_s: float
    to_s: float | None = None
    """None while it lasts."""


@dataclass(frozen=True, slots=True)
class ObservedModeChange:
    """A mode change of an armed vehicle."""

    vehicle: str
    mode: str
    by: Actor
    why: str
    """The evidence in words; empty if there is none."""
    at_s: float


Finding = DeclaredFault | Degradation | ObservedModeChange


@dataclass(frozen=True, slots=True)
class VehicleReports:
    """What was reported of a vehicle since it armed."""

    declared: frozenset[str] = frozenset()
    """Groups of faults; the first reason of each stands."""
    mode_s: float = float("-inf")
    """Start of the last mode that was reported."""


@dataclass(frozen=True, slots=True)
class PassiveWatch:
    """The state of all vehicles, and the warnings active now."""

    fleet: FleetState = field(default_factory=lambda: FleetState(MappingProxyType({})))
    open: Mapping[tuple[str, str], Degradation] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle and name of the warning."""
    warned_s: float = float("-inf")
    """When the warnings were last evaluated."""
    told: Mapping[str, VehicleReports] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle."""

    def reports_of(self, name: str) -> VehicleReports:
        """Return what was reported of a vehicle."""
        return self.told.get(name, VehicleReports())

    def with_reports(self, name: str, told: VehicleReports) -> PassiveWatch:
        """Return the state with a vehicle's reports replaced."""
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
            # Runs for every message; faster than replace.
            return PassiveWatch(fleet, state.open, state.warned_s, state.told), found
        case Tick():
            return _apply_tick(scene, state, now_s)


def record_contact(state: PassiveWatch, name: str, at_s: float, heartbeat_s: float | None = None) -> PassiveWatch:
    """Return the state after any message of a vehicle, and after a HEARTBEAT that changed nothing."""
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
    """Return the warnings still active when the log ended."""
    return tuple(replace(one, to_s=now_s) for one in state.open.values())


ARMING_DELAY_S = 2.0
"""Longest delay of the HEARTBEAT that shows arming; reports within it belong to the new flight."""


def _apply_mode_change(scene: Scene, state: PassiveWatch, before: VehicleState, vehicle: VehicleState) -> Stepped:
    """Process a HEARTBEAT that starts a flight, or changes the mode during one."""
    name, told = vehicle.name, state.reports_of(vehicle.name)
    if vehicle.armed and not before.armed:
        return state.with_reports(name, VehicleReports(mode_s=vehicle.telemetry.mode_since_s)), ()
    if not before.armed or before.telemetry.mode_since_s == vehicle.telemetry.mode_since_s:
        return state, ()
    if is_mission_mode(scene.vehicles[name].dialect, vehicle.mode):
        state = state.with_reports(name, replace(told, declared=told.declared - {"left"}))  # it may leave it again
    return _report_mode(scene, state, before)


def _report_mode(scene: Scene, state: PassiveWatch, vehicle: VehicleState) -> Stepped:
    """Report the current mode and the party that chose it, once."""
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
            # A live flight would command RTL; here the vehicle flies on, and may be lost again.
            return replace(change_stage(vehicle, Stage.FLYING, besides=WATCHED), fault=None, watches=()).with_motion(
                anchor=None
            )
        case _:
            return vehicle


def _begin_flight(vehicle: VehicleState, now_s: float) -> VehicleState:
    """Begin a flight; discard the reports of the last one."""
    alarm = vehicle.telemetry.alarm
    failed = tuple(
        one
        for one in vehicle.evidence.failed
        # A crash ended the previous flight.
        if now_s - one[1] <= ARMING_DELAY_S and not (one[0].what == "crash" and vehicle.sortie.armed_once)
    )
    return replace(
        change_stage(vehicle, Stage.FLYING, besides=WATCHED),
        fault=None,
        watches=(),
        sortie=replace(vehicle.sortie, took_off=False, flew_mission=False, armed_once=True),
        motion=replace(vehicle.motion, anchor=None),
        telemetry=replace(
            vehicle.telemetry, alarm=alarm if now_s - alarm[1] <= ARMING_DELAY_S else ("", float("-inf"))
        ),
        evidence=replace(vehicle.evidence, failed=failed),
    )


def _leave_mission_to_person(scene: Scene, before: VehicleState, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle a person has taken as no longer on its mission: later mode changes interrupt none."""
    setup = scene.vehicles[vehicle.name]
    if before.mode is None or is_mission_mode(setup.dialect, before.mode):
        return vehicle
    if not is_set_by_person(scene, before) and not is_manual_mode(setup.dialect, before.mode):
        return vehicle
    again = is_mission_mode(setup.dialect, vehicle.mode)
    return vehicle.with_sortie(flew_mission=again and vehicle.sortie.took_off)


def _apply_tick(scene: Scene, state: PassiveWatch, now_s: float) -> Stepped:
    fleet, _ = link_loss.discount_host_pause(scene, state.fleet, now_s)
    fleet, _ = link_loss.check_all_links(scene, fleet, now_s, least=link_loss.LEAST_VEHICLES)
    silent_since_s = fleet.listening.silent_since_s
    alone = silent_since_s is not None and now_s - silent_since_s < scene.limits.all_silent_s
    vehicles, found = dict(fleet.vehicles), list[Finding]()
    open_ = dict(state.open)
    heard_s = [one.link.heard_s for one in vehicles.values() if one.stage is Stage.FLYING]
    silent = any(one is not None and now_s - one >= scene.limits.link_stale_s for one in heard_s)
    looks = silent or now_s - state.warned_s >= WARNING_INTERVAL_S
    for name, vehicle in fleet.vehicles.items():
        if vehicle.stage is Stage.LOST:
            continue  # no fault or warning starts or ends during silence
        if vehicle.armed and is_attribution_final(vehicle, now_s):
            state, moded = _report_mode(scene, state, vehicle)
            found += moded
        told = state.reports_of(name)
        vehicle, declared = _judge_vehicle(scene, vehicle, told, now_s, alone=alone)
        vehicles[name] = vehicle
        groups = told.declared | {_group_of(one) for one, _ in declared}
        state = state.with_reports(name, replace(told, declared=groups))
        found += (DeclaredFault(name, point.kind, point.name, why, now_s) for point, why in declared)
        if looks and (open_ or not vehicle.is_on_base):
            found += update_degradations(WatchView(scene, scene.vehicles[name], vehicle, False, now_s), open_)
    fleet = replace(fleet, vehicles=MappingProxyType(vehicles))
    return replace(state, fleet=fleet, open=open_, warned_s=now_s if looks else state.warned_s), tuple(found)


_DOWN_REASONS = frozenset({"off-pad", "falling", "sinking", "thrust", "terminated", "crash"})


def _group_of(point: Watchpoint) -> str:
    """Return the group of which the first reason stands: link, battery, payload, mission left, down."""
    if point.kind not in {FaultKind.INTERRUPTION, FaultKind.FENCE}:
        return str(point.kind.value)
    return "down" if point.name in _DOWN_REASONS else "left"


Raised = tuple[Watchpoint, str]


def _judge_vehicle(
    scene: Scene, vehicle: VehicleState, told: VehicleReports, now_s: float, *, alone: bool
) -> tuple[VehicleState, list[Raised]]:
    setup = scene.vehicles[vehicle.name]
    if vehicle.is_on_base:
        # It may disarm before it reports the reason.
        view = WatchView(scene, setup, vehicle, False, now_s)
        late = describe_reported_failure(view, "crash") if now_s - vehicle.sortie.disarmed_s <= DISARM_REASON_S else ""
        return vehicle, [(watchpoints.CRASH, late)] if late and "down" not in told.declared else []
    vehicle, failed = watchpoints.judge_watchpoints(scene, setup, vehicle, now_s)
    raised = list[Raised]()
    for point, why in failed:
        known = told.declared | {_group_of(one) for one, _ in raised}
        if point.code is FaultCode.VOLTAGE_STEP and known & _SAVING_GROUPS and not vehicle.power.volts.known_load:
            continue  # the load of motors fighting to save the vehicle is unknown
        silent = point.kind is FaultKind.LINK  # each silence is a separate loss
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


_SAVING_GROUPS = frozenset({"left", "down"})
DISARM_REASON_S = 4.0
"""Time after disarming in which the vehicle may still report the reason."""


def update_degradations(view: WatchView, open_: dict[tuple[str, str], Degradation]) -> list[Degradation]:
    """Open and close the warnings of one vehicle; return those that ended."""
    name = view.state.name
    now = {row.name: (row.kind, words) for row, words in warning_rules.find_warnings(view)}
    for row, (kind, words) in now.items():
        if (name, row) not in open_:
            open_[name, row] = Degradation(name, kind, row, words, view.now_s)
    over = [key for key in open_ if key[0] == name and key[1] not in now]
    return [replace(open_.pop(key), to_s=view.now_s) for key in over]
