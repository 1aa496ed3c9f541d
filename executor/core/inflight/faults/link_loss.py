"""Distinguish the silence of one vehicle from that of all, and from a pause of the ground station itself."""

from __future__ import annotations

from executor.core.context import Scene
from executor.core.lines import link
from executor.core.state.fleet_state import FleetState, GroundStationAbsence, Stepped
from executor.core.state.vehicle_state import Stage, VehicleState

HOST_PAUSE_S = 2.0
"""Gap between two ticks that counts as a pause of our own: messages may have been missed."""
LEAST_VEHICLES = 2
"""Fewest vehicles for which a log can distinguish the silence of all from the silence of one."""
REPEAT_S = 300.0
SWITCHED_OFF_S = 30.0
"""Silence after which a vehicle on the ground counts as switched off."""
REPORTED_PAUSE_S = 5.0
"""Shortest pause that is recorded and reported."""


def discount_host_pause(context: Scene, state: FleetState, now_s: float) -> Stepped:  # noqa: ARG001
    """Detect a pause of the ground station since the last tick; no vehicle's link time-out counts it."""
    paused_s = 0.0 if state.listening.tick_s is None else now_s - state.listening.tick_s
    late_s = state.listening.late_s
    state = state.with_listening(tick_s=now_s)
    if paused_s <= HOST_PAUSE_S:
        return (_excuse_silence(state, late_s, now_s) if late_s > 0.0 else state), ()
    state = _excuse_silence(state, paused_s, now_s)
    if paused_s <= REPORTED_PAUSE_S:
        return state, ()
    state = _record_absence(state, GroundStationAbsence(now_s, paused_s, restarted=False))
    return state, (link.GROUND_STATION_STALLED.say(stalled_s=paused_s),)


def check_all_links(context: Scene, state: FleetState, now_s: float, *, least: int = 1) -> Stepped:
    """Detect the silence of all vehicles, which is the ground station's own fault until proven otherwise.

    With fewer than `least` vehicles that should be received, each silence is judged alone.
    """
    if state.progress.launched_s is None or (len(state.vehicles) < least and state.listening.silent_since_s is None):
        return state, ()
    expected = _list_contact_times(state)
    if len(expected) < least:
        return (state if state.listening.silent_since_s is None else _clear_silence(state)), ()
    latest = max(expected)
    if now_s - latest < context.limits.link_stale_s:
        if state.listening.silent_since_s is None:
            return state, ()
        # One vehicle is received before the others; their time-outs start over.
        pause_s = latest - state.listening.silent_since_s
        state = _clear_silence(_excuse_silence(state, pause_s, now_s))
        if pause_s > REPORTED_PAUSE_S:
            state = _record_absence(state, GroundStationAbsence(now_s, pause_s, restarted=False, deaf=True))
        return state, (link.ALL_REGAINED.say(),)
    if not state.airborne_vehicles():
        return _clear_silence(state), ()
    if state.listening.silent_since_s is not None:
        return _repeat_silence_warning(context, state, now_s)
    lost = link.ALL_LOST if len(expected) > 1 else link.ONLY_ONE_LOST
    return state.with_listening(silent_since_s=latest), (lost.say(),)


def _record_absence(state: FleetState, absence: GroundStationAbsence) -> FleetState:
    return state.with_listening(absences=(*state.listening.absences, absence))


def _clear_silence(state: FleetState) -> FleetState:
    return state.with_listening(silent_since_s=None, silence_told_s=None)


def _repeat_silence_warning(context: Scene, state: FleetState, now_s: float) -> Stepped:
    """Repeat at intervals that all links are lost, and what that means."""
    since_s = state.listening.silent_since_s or now_s
    told_s = since_s if state.listening.silence_told_s is None else state.listening.silence_told_s
    if now_s - told_s < (context.limits.all_silent_s if state.listening.silence_told_s is None else REPEAT_S):
        return state, ()
    aloft = ", ".join(vehicle.name for vehicle in state.airborne_vehicles())
    said = link.ALL_STILL_LOST.say(age_s=now_s - since_s, airborne=aloft)
    return state.with_listening(silence_told_s=now_s), (said,)


def _list_contact_times(state: FleetState) -> list[float]:
    """Return when each vehicle that should be received now was last received."""
    away = {Stage.GROUND, Stage.LANDED, Stage.DOWN}
    heard = [
        float("-inf") if vehicle.link.heard_s is None else vehicle.link.heard_s
        for vehicle in state.vehicles.values()
        if vehicle.stage not in {*away, Stage.LOST}
    ]
    if not heard:
        return []
    since = max(heard) - SWITCHED_OFF_S
    return heard + [
        vehicle.link.heard_s
        for vehicle in state.vehicles.values()
        if vehicle.stage in away and vehicle.link.heard_s is not None and vehicle.link.heard_s > since
    ]


def check_link(context: Scene, state: FleetState, vehicle: VehicleState, now_s: float) -> Stepped:
    """Report when a link becomes stale and when it recovers, apart from the fault."""
    age_s = 0.0 if vehicle.link.heard_s is None else now_s - vehicle.link.heard_s
    stale = age_s >= context.limits.link_stale_s
    if vehicle.link.stale and vehicle.link.spoke_s is not None:
        # An excused pause is not the vehicle's silence, but does not count as contact either.
        stale = now_s - vehicle.link.spoke_s >= context.limits.link_stale_s
    if stale == vehicle.link.stale:
        return state, ()
    said = (link.STALE if stale else link.NO_LONGER_STALE).say(vehicle=vehicle.name, age_s=age_s)
    excused_s = vehicle.link.excused_s if stale else now_s
    return state.put(vehicle.with_link(stale=stale, excused_s=excused_s)), (said,)


def _excuse_silence(state: FleetState, pause_s: float, now_s: float) -> FleetState:
    """Exclude a pause in which nothing could be received from every vehicle's silence."""
    for vehicle in state.vehicles.values():
        if vehicle.link.heard_s is not None:
            state = state.put(vehicle.with_link(heard_s=min(now_s, vehicle.link.heard_s + pause_s), excused_s=now_s))
    return state
