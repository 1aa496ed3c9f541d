"""Watching without acting: the watchpoints of the live flight over vehicles that somebody else flies.

``step(scene, state, event, now_s) -> (state, findings)``. Messages are folded and faults are judged by the very
functions that `fleet.step` uses; nothing is ordered. As nobody here starts the vehicles, one that arms is taken to fly
until it disarms, whatever was declared of it: a battery that fails hides no crash. One whose link is regained is
watched again. Who changed a mode is told with the mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from executor.core.context import Scene
from executor.core.custody.actors import changed_by, settled
from executor.core.events import Heard, Tick
from executor.core.faults import link_loss, warnings, watchpoints
from executor.core.faults.watching import View, Watchpoint, said_failed
from executor.core.hearing.fold import fold
from executor.core.messages import Actor, Heartbeat
from executor.core.state import FleetState
from executor.core.vehicle import WATCHED, Fault, FaultCode, FaultKind, Stage, VehicleState, moved_to
from missions.autopilots.modes import is_manual_mode, is_mission_mode, mode_name

WARN_S = 1.5
"""Warnings decide nothing: they are looked for less often than faults."""


@dataclass(frozen=True, slots=True)
class Declared:
    """A fault."""

    vehicle: str
    kind: FaultKind
    reason: str
    """Name of the watchpoint."""
    evidence: str
    at_s: float


@dataclass(frozen=True, slots=True)
class Degraded:
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
class Moded:
    """An armed vehicle's mode became another."""

    vehicle: str
    mode: str
    by: Actor
    why: str
    """What says so, in words; empty where nothing does."""
    at_s: float


Finding = Declared | Degraded | Moded


@dataclass(frozen=True, slots=True)
class Remembered:
    """What was told of a vehicle since it was armed."""

    declared: frozenset[str] = frozenset()
    """Groups of faults: the first reason of each stands."""
    mode_s: float = float("-inf")
    """Since when it was in the last mode that was told."""


@dataclass(frozen=True, slots=True)
class Watched:
    """What is known of all vehicles, and what is not well now."""

    fleet: FleetState
    open: Mapping[tuple[str, str], Degraded] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle and name of the warning."""
    warned_s: float = float("-inf")
    """When was looked for what is not well."""
    told: Mapping[str, Remembered] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle."""

    def of(self, name: str) -> Remembered:
        """Return what was told of a vehicle."""
        return self.told.get(name, Remembered())

    def telling(self, name: str, told: Remembered) -> Watched:
        """Return it with something told."""
        return self if told == self.of(name) else replace(self, told=MappingProxyType({**self.told, name: told}))


Stepped = tuple[Watched, tuple[Finding, ...]]


def watch_begun(names: tuple[str, ...]) -> Watched:
    """Return the state before anything was heard."""
    return Watched(FleetState(MappingProxyType({name: VehicleState(name) for name in names})))


def with_vehicle(state: Watched, name: str) -> Watched:
    """Return the state with a vehicle that was not known before."""
    return replace(state, fleet=state.fleet.put(VehicleState(name)))


def passive_step(scene: Scene, state: Watched, event: Heard | Tick, now_s: float) -> Stepped:
    """Apply one event."""
    match event:
        case Heard(name, message):
            before, found = state.fleet.vehicles[name], tuple[Finding, ...]()
            vehicle = fold(scene, before, message, now_s).state
            if isinstance(message, Heartbeat):
                state, found = _changed(scene, state, before, vehicle)
                vehicle = _followed(scene, before, vehicle, now_s)
            fleet = state.fleet.put(vehicle)
            if fleet.progress.launched_s is None and vehicle.stage is Stage.FLYING:
                fleet = replace(fleet, progress=replace(fleet.progress, launched_s=now_s))
            return Watched(
                fleet, state.open, state.warned_s, state.told
            ), found  # of every message: faster than replace
        case Tick():
            return _tick(scene, state, now_s)


def passive_heard(state: Watched, name: str, at_s: float, heartbeat_s: float | None = None) -> Watched:
    """Return the state with a vehicle that said something, whatever it was, and its HEARTBEAT without news then."""
    vehicle = state.fleet.vehicles[name]
    later = vehicle.link.heard_s is None or at_s > vehicle.link.heard_s
    if not later and heartbeat_s is None:
        return state
    told = replace(
        vehicle,
        link=replace(
            vehicle.link,
            heard_s=at_s if later else vehicle.link.heard_s,
            heartbeat_s=vehicle.link.heartbeat_s if heartbeat_s is None else heartbeat_s,
        ),
    )
    return replace(state, fleet=state.fleet.put(told))


def closed(state: Watched, now_s: float) -> tuple[Degraded, ...]:
    """Return what was not well when the log ended."""
    return tuple(replace(one, to_s=now_s) for one in state.open.values())


HEARD_BEFORE_S = 2.0
"""A HEARTBEAT shows up to so much later that it is armed: what was said meanwhile is of this flight."""


def _changed(scene: Scene, state: Watched, before: VehicleState, vehicle: VehicleState) -> Stepped:
    """Take note of a HEARTBEAT that begins a flight, or another mode in it."""
    name, told = vehicle.name, state.of(vehicle.name)
    if vehicle.armed and not before.armed:
        return state.telling(name, Remembered(mode_s=vehicle.telemetry.mode_since_s)), ()
    if not before.armed or before.telemetry.mode_since_s == vehicle.telemetry.mode_since_s:
        return state, ()
    beat = vehicle.telemetry.heartbeat
    if beat is not None and is_mission_mode(scene.vehicles[name].dialect, beat.custom_mode):
        state = state.telling(name, replace(told, declared=told.declared - {"left"}))  # it may be left again
    return _told(scene, state, before)


def _told(scene: Scene, state: Watched, vehicle: VehicleState) -> Stepped:
    """Tell the mode that a vehicle is in, and who chose it, unless that was told."""
    told, since_s, beat = state.of(vehicle.name), vehicle.telemetry.mode_since_s, vehicle.telemetry.heartbeat
    if beat is None or since_s <= told.mode_s:
        return state, ()
    setup = scene.vehicles[vehicle.name]
    who = changed_by(setup, vehicle)
    moded = Moded(vehicle.name, mode_name(setup.dialect, beat.custom_mode), who.by, who.why, since_s)
    return state.telling(vehicle.name, replace(told, mode_s=since_s)), (moded,)


def _followed(scene: Scene, before: VehicleState, vehicle: VehicleState, now_s: float) -> VehicleState:
    """Return a vehicle in the stage that its HEARTBEAT shows."""
    beat = vehicle.telemetry.heartbeat
    if beat is None:
        return vehicle
    if before.armed and before.telemetry.mode_since_s != vehicle.telemetry.mode_since_s:
        vehicle = _left_to(scene, before, vehicle)
    match vehicle.stage:
        case Stage.GROUND | Stage.LANDED if beat.armed:
            return _armed(vehicle, now_s)
        case Stage.LOST if not beat.armed:
            return moved_to(vehicle, Stage.LANDED)
        case Stage.LOST:
            # Live RTL would be commanded; here it flies on, and may be lost again.
            return replace(
                moved_to(vehicle, Stage.FLYING, besides=WATCHED),
                fault=None,
                watches=(),
                motion=replace(vehicle.motion, anchor=None),
            )
        case _:
            return vehicle


def _armed(vehicle: VehicleState, now_s: float) -> VehicleState:
    """Begin a flight: nothing that was said of the last one is of this one."""
    alarm = vehicle.telemetry.alarm
    failed = tuple(
        one
        for one in vehicle.evidence.failed
        # A crash ended the flight before this one.
        if now_s - one[1] <= HEARD_BEFORE_S and not (one[0].what == "crash" and vehicle.sortie.armed_once)
    )
    return replace(
        moved_to(vehicle, Stage.FLYING, besides=WATCHED),
        fault=None,
        watches=(),
        sortie=replace(vehicle.sortie, took_off=False, flew_mission=False, armed_once=True),
        motion=replace(vehicle.motion, anchor=None),
        telemetry=replace(
            vehicle.telemetry, alarm=alarm if now_s - alarm[1] <= HEARD_BEFORE_S else ("", float("-inf"))
        ),
        evidence=replace(vehicle.evidence, failed=failed),
    )


def _left_to(scene: Scene, before: VehicleState, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle that is on no mission any more once a person has it: what comes then interrupts none."""
    setup, old = scene.vehicles[vehicle.name], before.telemetry.heartbeat
    if old is None or is_mission_mode(setup.dialect, old.custom_mode):
        return vehicle
    persons = changed_by(setup, before).by in {Actor.PILOT, Actor.GROUND_STATION}
    if not persons and not is_manual_mode(setup.dialect, old.custom_mode):
        return vehicle
    beat = vehicle.telemetry.heartbeat
    again = beat is not None and is_mission_mode(setup.dialect, beat.custom_mode)
    return replace(vehicle, sortie=replace(vehicle.sortie, flew_mission=again and vehicle.sortie.took_off))


def _tick(scene: Scene, state: Watched, now_s: float) -> Stepped:
    fleet, _ = link_loss.own_sleep(scene, state.fleet, now_s)
    fleet, _ = link_loss.of_all(scene, fleet, now_s, least=link_loss.ALL)
    alone = (
        fleet.listening.silent_since_s is not None
        and now_s - fleet.listening.silent_since_s < scene.limits.all_silent_s
    )
    vehicles, found = dict(fleet.vehicles), list[Finding]()
    open_ = dict(state.open)
    looks = now_s - state.warned_s >= WARN_S or any(_falls_silent(scene, one, now_s) for one in vehicles.values())
    for name, vehicle in fleet.vehicles.items():
        if vehicle.stage is Stage.LOST:
            continue  # nothing begins and nothing ends in silence
        if vehicle.armed and settled(vehicle, now_s):
            state, moded = _told(scene, state, vehicle)
            found += moded
        told, (vehicle, declared) = state.of(name), _judged(scene, vehicle, state.of(name), now_s, alone=alone)
        vehicles[name] = vehicle
        state = state.telling(name, replace(told, declared=told.declared | {_group(one) for one, _ in declared}))
        found += (Declared(name, point.kind, point.name, why, now_s) for point, why in declared)
        if looks and (open_ or vehicle.stage not in _DOWN):
            found += warned(View(scene, scene.vehicles[name], vehicle, False, now_s), open_)
    fleet = replace(fleet, vehicles=MappingProxyType(vehicles))
    return replace(state, fleet=fleet, open=open_, warned_s=now_s if looks else state.warned_s), tuple(found)


_DOWN = frozenset({Stage.GROUND, Stage.LANDED})
_DOWN_REASONS = frozenset({"off-pad", "falling", "sinking", "thrust", "terminated", "crash"})


def _group(point: Watchpoint) -> str:
    """Return of what the first reason stands: a battery, a mission that was left, a fall."""
    if point.kind not in {FaultKind.INTERRUPTION, FaultKind.FENCE}:
        return str(point.kind.value)
    return "down" if point.name in _DOWN_REASONS else "left"


def _falls_silent(scene: Scene, vehicle: VehicleState, now_s: float) -> bool:
    silent = vehicle.link.heard_s is not None and now_s - vehicle.link.heard_s >= scene.limits.link_stale_s
    return silent and vehicle.stage is Stage.FLYING


Raised = tuple[Watchpoint, str]


def _judged(
    scene: Scene, vehicle: VehicleState, told: Remembered, now_s: float, *, alone: bool
) -> tuple[VehicleState, list[Raised]]:
    setup = scene.vehicles[vehicle.name]
    if vehicle.stage in _DOWN:
        # It may have disarmed before it says why.
        view = View(scene, setup, vehicle, False, now_s)
        late = said_failed(view, "crash") if now_s - vehicle.sortie.disarmed_s <= LATE_S else ""
        return vehicle, [(watchpoints.CRASH, late)] if late and "down" not in told.declared else []
    judgement = watchpoints.judge(scene, setup, vehicle, now_s)
    vehicle = watchpoints.remembered(vehicle, judgement)
    raised = list[Raised]()
    for point, why in judgement.raised:
        known = told.declared | {_group(one) for one, _ in raised}
        if point.code is FaultCode.VOLTAGE_STEP and known & _STRUGGLES and not vehicle.power.volts.known_load:
            continue  # what its motors draw to save it, nobody knows
        silent = point.kind is FaultKind.LINK  # each silence is a loss of its own
        if (silent and not alone) or (not silent and _group(point) not in known):
            raised.append((point, why))
    if raised and vehicle.fault is None:
        point, why = raised[0]
        vehicle = replace(vehicle, fault=Fault(point.kind, why, now_s, point.code))
    if not vehicle.armed:
        return replace(moved_to(vehicle, Stage.LANDED), fault=vehicle.fault if raised else None), raised
    if any(point.kind is FaultKind.LINK for point, _ in raised):
        vehicle = moved_to(vehicle, Stage.LOST)
    return vehicle, raised


_STRUGGLES = frozenset({"left", "down"})
LATE_S = 4.0
"""So long after it disarmed it may still say why."""


def warned(view: View, open_: dict[tuple[str, str], Degraded]) -> list[Finding]:
    """Begin and end what is not well; returns what ended."""
    name = view.state.name
    now = {row.name: (row.kind, words) for row, words in warnings.warnings(view)}
    for row, (kind, words) in now.items():
        if (name, row) not in open_:
            open_[name, row] = Degraded(name, kind, row, words, view.now_s)
    over = [key for key in open_ if key[0] == name and key[1] not in now]
    return [replace(open_.pop(key), to_s=view.now_s) for key in over]
