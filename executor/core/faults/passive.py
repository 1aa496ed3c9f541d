"""Watching without acting: the watchpoints of the live flight over vehicles that somebody else flies.

``step(scene, state, event, now_s) -> (state, findings)``. Messages are folded and faults are judged by the very
functions that `fleet.step` uses; nothing is ordered. As nobody here starts the vehicles, one that arms is taken to fly,
and one whose link is regained on its mission is watched again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from executor.core.context import Scene
from executor.core.events import Heard, Tick
from executor.core.faults import link_loss, warnings, watchpoints
from executor.core.faults.watching import View
from executor.core.hearing.fold import fold
from executor.core.messages import Heartbeat
from executor.core.state import FleetState
from executor.core.vehicle import WATCHED, Fault, FaultKind, Stage, VehicleState, moved_to
from missions.autopilots.modes import is_home_mode

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


Finding = Declared | Degraded


@dataclass(frozen=True, slots=True)
class Watched:
    """What is known of all vehicles, and what is not well now."""

    fleet: FleetState
    open: Mapping[tuple[str, str], Degraded] = field(default_factory=lambda: MappingProxyType({}))
    """By vehicle and name of the warning."""
    warned_s: float = float("-inf")
    """When was looked for what is not well."""


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
            vehicle = fold(scene, state.fleet.vehicles[name], message, now_s).state
            if isinstance(message, Heartbeat):
                vehicle = _followed(scene, vehicle)
            fleet = state.fleet.put(vehicle)
            if fleet.progress.launched_s is None and vehicle.stage is Stage.FLYING:
                fleet = replace(fleet, progress=replace(fleet.progress, launched_s=now_s))
            return Watched(fleet, state.open, state.warned_s), ()
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
    return Watched(state.fleet.put(told), state.open, state.warned_s)


def closed(state: Watched, now_s: float) -> tuple[Degraded, ...]:
    """Return what was not well when the log ended."""
    return tuple(replace(one, to_s=now_s) for one in state.open.values())


def _followed(scene: Scene, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle in the stage that its HEARTBEAT shows."""
    beat = vehicle.telemetry.heartbeat
    if beat is None:
        return vehicle
    match vehicle.stage:
        case Stage.GROUND | Stage.LANDED if beat.armed:
            vehicle = moved_to(vehicle, Stage.FLYING, besides=WATCHED)
            return replace(
                vehicle,
                fault=None,
                watches=(),
                sortie=replace(vehicle.sortie, took_off=False, flew_mission=False, armed_once=True),
                motion=replace(vehicle.motion, anchor=None),
                telemetry=replace(vehicle.telemetry, alarm=("", float("-inf"))),
            )
        case Stage.LOST if not beat.armed:
            return moved_to(vehicle, Stage.LANDED)
        case Stage.LOST if is_home_mode(scene.vehicles[vehicle.name].dialect, beat.custom_mode):
            return moved_to(vehicle, Stage.RETURNING)
        case Stage.LOST:
            # Live RTL would be commanded; here it flies on, and may be lost again.
            return replace(
                moved_to(vehicle, Stage.FLYING, besides=WATCHED),
                fault=None,
                watches=(),
                motion=replace(vehicle.motion, anchor=None),
            )
        case Stage.FLYING | Stage.RETURNING if not beat.armed and vehicle.fault is not None:
            return moved_to(vehicle, Stage.LANDED)
        case _:
            return vehicle


def _tick(scene: Scene, state: Watched, now_s: float) -> Stepped:
    fleet, _ = link_loss.own_sleep(state.fleet, now_s)
    fleet, _ = link_loss.of_all(scene, fleet, now_s, least=link_loss.ALL)
    alone = (
        fleet.listening.silent_since_s is not None
        and now_s - fleet.listening.silent_since_s < scene.limits.all_silent_s
    )
    vehicles, found = dict(fleet.vehicles), list[Finding]()
    open_ = dict(state.open)
    looks = now_s - state.warned_s >= WARN_S or any(_falls_silent(scene, one, now_s) for one in vehicles.values())
    for name, vehicle in fleet.vehicles.items():
        if vehicle.stage in {Stage.GROUND, Stage.LANDED} and not open_:
            continue
        if vehicle.stage is Stage.LOST:
            continue  # nothing begins and nothing ends in silence
        vehicle, declared = _judged(scene, vehicle, now_s, alone=alone)
        vehicles[name] = vehicle
        found += declared
        if looks:
            found += warned(View(scene, scene.vehicles[name], vehicle, False, now_s), open_)
    warned_s = now_s if looks else state.warned_s
    return Watched(replace(fleet, vehicles=MappingProxyType(vehicles)), open_, warned_s), tuple(found)


def _falls_silent(scene: Scene, vehicle: VehicleState, now_s: float) -> bool:
    silent = vehicle.link.heard_s is not None and now_s - vehicle.link.heard_s >= scene.limits.link_stale_s
    return silent and vehicle.stage is Stage.FLYING


def _judged(scene: Scene, vehicle: VehicleState, now_s: float, *, alone: bool) -> tuple[VehicleState, list[Declared]]:
    if vehicle.stage in {Stage.GROUND, Stage.LANDED}:
        return vehicle, []
    judgement = watchpoints.judge(scene, scene.vehicles[vehicle.name], vehicle, now_s)
    vehicle = watchpoints.remembered(vehicle, judgement)
    raised = [(point, why) for point, why in judgement.raised if not (alone and point.kind is FaultKind.LINK)]
    if not raised:
        if vehicle.stage is Stage.FLYING and not vehicle.armed:
            vehicle = replace(moved_to(vehicle, Stage.LANDED), fault=None)
        return vehicle, []
    point, why = raised[0]
    declared = Declared(vehicle.name, point.kind, point.name, why, now_s)
    stage = Stage.LOST if point.kind is FaultKind.LINK else Stage.RETURNING
    if vehicle.fault is not None:
        # One arbiter: the first reason stands. A silence is a loss of its own all the same.
        if point.kind is not FaultKind.LINK:
            return vehicle, []
        return moved_to(vehicle, stage), [declared] if vehicle.fault.kind is FaultKind.LINK else []
    if stage is Stage.RETURNING and not vehicle.armed:
        stage = Stage.LANDED
    return replace(moved_to(vehicle, stage), fault=Fault(point.kind, why, now_s, point.code)), [declared]


def warned(view: View, open_: dict[tuple[str, str], Degraded]) -> list[Finding]:
    """Begin and end what is not well; returns what ended."""
    name = view.state.name
    now = {row.name: (row.kind, words) for row, words in warnings.warnings(view)}
    for row, (kind, words) in now.items():
        if (name, row) not in open_:
            open_[name, row] = Degraded(name, kind, row, words, view.now_s)
    over = [key for key in open_ if key[0] == name and key[1] not in now]
    return [replace(open_.pop(key), to_s=view.now_s) for key in over]
