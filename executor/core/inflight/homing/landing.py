"""A vehicle on the ground again: whether it landed, or came down otherwise."""

from __future__ import annotations

from dataclasses import replace

from executor.core.battery import account
from executor.core.battery.pack_condition import is_doubtful_at_rest
from executor.core.context import Context, RelaunchPolicy
from executor.core.inflight.custody.mode_causes import is_in_manual_mode
from executor.core.interface.commands import Level, Say
from executor.core.state import leg_times, sortie_log
from executor.core.state.fleet_state import FleetState, Stepped
from executor.core.state.positioning import is_adrift
from executor.core.state.vehicle_position import (
    UNSEEN_S,
    describe_down_place,
    describe_last_position,
    describe_lean,
    has_fallen,
    has_sinking_fix,
    is_over_pad,
)
from executor.core.state.vehicle_state import Stage, VehicleState, change_stage
from executor.core.telemetry.battery_reports import pack_facts_of
from missions.autopilots.modes import mode_name

SEEN_AFTER_S = 0.5
"""A position so much later than the disarming shows where it lies."""
CRASHED_S = 10.0
"""Who fell so shortly before it disarmed did not land."""


def has_landed(vehicle: VehicleState) -> bool:
    """Return whether a vehicle that flew, or was on its way home, has disarmed."""
    return vehicle.sortie.armed_once and not vehicle.armed and vehicle.stage in {Stage.FLYING, Stage.RETURNING}


def _has_come_down(context: Context, vehicle: VehicleState, now_s: float) -> bool | None:
    """Return whether a vehicle came down outside a landing; None as long as that is not seen."""
    fix = vehicle.motion.fix
    if not vehicle.sortie.took_off or fix is None:
        return False
    if vehicle.sensors.tilted_since_s is not None:
        return True
    if fix.at_s < vehicle.sortie.disarmed_s + SEEN_AFTER_S and now_s - vehicle.sortie.disarmed_s < UNSEEN_S:
        return True if fix.alt_rel_m > context.limits.off_pad_up_m and not vehicle.orders.lands else None
    # A commanded landing may end on a hill.
    came_down = has_sinking_fix(vehicle) if vehicle.orders.lands else has_fallen(context, vehicle)
    return came_down or vehicle.sortie.disarmed_s - vehicle.motion.falls_s < CRASHED_S


def apply_touchdown(
    context: Context, state: FleetState, vehicle: VehicleState, now_s: float, *, spare: bool
) -> Stepped:
    """Take a vehicle to be on the ground, as it landed or otherwise.

    Args:
        context: Of the flight.
        state: Of the flight.
        vehicle: Who has landed.
        now_s: Now.
        spare: Whether it has budget left for another flight.
    """
    came_down = _has_come_down(context, vehicle, now_s)
    if came_down is None:
        return state, ()
    if came_down:
        leans = f"; {lean}" if (lean := describe_lean(vehicle)) else ""
        text = f"{vehicle.name}: came down outside a landing{leans}; {describe_last_position(context, vehicle, now_s)}"
        lies = replace(
            change_stage(vehicle, Stage.DOWN),
            assignment=replace(vehicle.assignment, run=None),
            orders=replace(vehicle.orders, errand=None),
            motion=replace(vehicle.motion, anchor=vehicle.motion.fix),
            sortie=replace(vehicle.sortie, place_told=False),
        )
        return state.put(lies), (Say(Level.FAULT, text),)
    vehicle = sortie_log.end_sortie(
        context, leg_times.end_landing_leg(vehicle, now_s, context.vehicles[vehicle.name].start), now_s
    )
    vehicle = change_stage(vehicle, Stage.LANDED).with_assignment(run=None).with_orders(errand=None, cleared_s=None)
    state = state.put(vehicle)
    if vehicle.fault is None and not vehicle.orders.excluded and vehicle.name not in state.replanning.considered:
        # It was on its way down when the last re-plan was made: what was left then may be for it.
        state = state.with_replanning(considered=state.replanning.considered | {vehicle.name})
        if context.fly_again is RelaunchPolicy.AUTO and state.coverage.given_up and spare:
            trigger = f"{vehicle.name}: landed with battery to spare"
            state = state.with_replanning(urgent=True, trigger=trigger, trigger_s=now_s)
            state = state.with_coverage(given_up=frozenset())
    if not vehicle.sortie.took_off:
        return state, (Say(Level.INFO, f"{vehicle.name}: disarmed; its take-off was not observed"),)
    left = _describe_remaining_charge(context, vehicle, now_s)
    if vehicle.sortie.rebooted_s is not None and is_over_pad(context, vehicle):
        text = f"{vehicle.name}: is disarmed on its pad{left}; its autopilot has rebooted"
        return state, (Say(Level.INFO, text),)
    place = "" if is_over_pad(context, vehicle) else f", {describe_down_place(context, vehicle)}"
    if place:
        place = f"{' without GPS' if is_adrift(vehicle) else ' away from its pad'}{place}"
    hand = _describe_manual_mode(context, vehicle)
    level = Level.FAULT if place else Level.WARNING if hand else Level.INFO
    return state, (Say(level, f"{vehicle.name}: landed{left}{place}{hand}"),)


def _describe_manual_mode(context: Context, vehicle: VehicleState) -> str:
    """Return what is said of a mode that only a person sets, where nobody would be asked before the next take-off."""
    beat, dialect = vehicle.telemetry.heartbeat, context.vehicles[vehicle.name].dialect
    if context.fly_again is not RelaunchPolicy.AUTO or beat is None or not is_in_manual_mode(context, vehicle):
        return ""
    return f"; mode {mode_name(dialect, beat.custom_mode)}: stays on the ground until included"


def _describe_remaining_charge(context: Context, vehicle: VehicleState, now_s: float) -> str:
    """Return what its pack holds, or what it reports where its voltage before the take-off told otherwise."""
    battery, held_pct = vehicle.power.battery, vehicle.power.landed_pct
    if held_pct is None or not sortie_log.is_charge_fresh(context, vehicle.power, now_s):
        return ""
    last = vehicle.turn.sorties[-1] if vehicle.turn.sorties else None
    blind = context.vehicles[vehicle.name].dialect.rounds_twice and account.is_blind(battery)
    if last is None or last.rest_v is None or last.began_pct is None or blind:  # blind: read off that very voltage
        return f" with {held_pct:.0f} %"
    if not is_doubtful_at_rest(last.rest_v, vehicle.power.volts.cells, pack_facts_of(context, vehicle), last.began_pct):
        return f" with {held_pct:.0f} %"
    return f", reports {held_pct:.0f} %, contradicted by its voltage before take-off"
