"""Fold a vehicle's battery messages into its power state."""

from __future__ import annotations

from dataclasses import replace

from executor.core.battery import account, pack_condition, voltage
from executor.core.battery.account import BatteryState
from executor.core.battery.voltage import PackFacts, VoltageReport, apply_voltage_report
from executor.core.context import Scene
from executor.core.interface.messages import Battery, SystemStatus, VehicleSetting
from executor.core.state.vehicle_parts import PowerState
from executor.core.state.vehicle_state import VehicleState, current_setup_of

TAKEOFF_SAG_S = 25.0
"""Time after take-off in which a percentage that PX4 derives from the voltage sags with the load and settles."""


def apply_battery_status(context: Scene, state: VehicleState, message: Battery, now_s: float) -> PowerState:
    """Apply a BATTERY_STATUS."""
    old, packs = state.power, state.power.packs
    if message.remaining_pct is not None:
        # The emptiest of several packs ends the flight.
        packs = tuple({**dict(packs), message.battery: message.remaining_pct}.items())
    single = len(packs) <= 1  # the counters of several packs are not one account
    charge, roundings = old.battery, old.roundings
    if message.consumed_ah is not None and single and _is_seen_flying(context, state, now_s):
        charge = account.apply_consumed_report(charge, message.consumed_ah, now_s, context.limits)
    if message.remaining_pct is not None:
        percent = min(dict(packs).values())
        if single and _has_two_roundings(context, state.name, charge):
            roundings = replace(roundings, rounded=percent, rounded_s=now_s)
            percent = roundings.percent
        charge = _apply_percentage(context, state, charge, percent, message.charge_state, now_s)
        if single:
            charge = account.record_first_count(charge, message.consumed_ah)
    power = replace(
        old, packs=packs, battery=charge, roundings=roundings, battery_faults=message.faults, told_s=now_s,
        aloft_pct=charge.remaining_pct if message.remaining_pct is not None and _is_in_air(state) else old.aloft_pct,
    )  # fmt: skip
    if message.voltage_v and single:
        report = VoltageReport(message.voltage_v, message.current_a, message.cells_v)
        return _apply_voltage(context, state, power, report, now_s)
    return power


def apply_system_status(context: Scene, state: VehicleState, message: SystemStatus, now_s: float) -> PowerState:
    """Apply the battery fields of SYS_STATUS, where no better source reports."""
    old = state.power
    charge, roundings = old.battery, old.roundings
    # SYS_STATUS rounds differently from BATTERY_STATUS, and reports any one of several packs. Older firmware, and links
    # with few streams, send nothing else.
    alone = now_s - old.told_s > context.limits.battery_stale_s
    if message.remaining_pct is not None and alone:
        charge = _apply_percentage(context, state, charge, message.remaining_pct, 0, now_s)
    elif message.remaining_pct is not None and len(old.packs) == 1 and _has_two_roundings(context, state.name, charge):
        roundings = replace(roundings, ceiled=message.remaining_pct, ceiled_s=now_s)
        charge = _apply_percentage(context, state, charge, roundings.percent, charge.charge_state, now_s)
    if charge is not old.battery or roundings is not old.roundings:
        aloft_pct = charge.remaining_pct if _is_in_air(state) else old.aloft_pct
        old = replace(old, battery=charge, roundings=roundings, aloft_pct=aloft_pct)
    if message.voltage_v and alone:
        return _apply_voltage(context, state, old, VoltageReport(message.voltage_v, message.current_a), now_s)
    return old


def apply_pack_setting(state: VehicleState, message: VehicleSetting) -> PowerState:
    """Apply a parameter that may describe the pack."""
    old = state.power
    facts = voltage.apply_pack_parameter(old.pack.facts, message.name, message.value)
    if facts == old.pack.facts:
        return old
    battery = replace(old.battery, charge=replace(old.battery.charge, set_ah=facts.capacity_ah))
    return replace(old, pack=replace(old.pack, facts=facts), battery=battery)


def pack_facts_of(context: Scene, state: VehicleState) -> PackFacts:
    """Return the facts of a vehicle's pack; the site file takes precedence over its parameters."""
    facts = state.power.pack.facts
    return facts.override_with(current_setup_of(context, state).pack) if state.name in context.vehicles else facts


def _apply_voltage(
    context: Scene, state: VehicleState, power: PowerState, report: VoltageReport, now_s: float
) -> PowerState:
    flying, facts = state.armed and state.sortie.took_off, pack_facts_of(context, state)
    volts = apply_voltage_report(power.volts, report, context.limits, now_s, flying=flying, sag=power.pack.sag)
    volts = replace(volts, set_cells=facts.cells)
    claimed_pct = power.battery.remaining_pct
    current_a = report.current_a if volts.known_load or power.pack.sag is not None or not flying else None
    seen = pack_condition.apply_pack_voltage(
        power.pack, report.voltage_v, current_a, claimed_pct, now_s, idle=not flying, ohm=facts.ohm
    )  # fmt: skip
    return replace(power, volts=volts, pack=seen)


def _is_seen_flying(context: Scene, state: VehicleState, now_s: float) -> bool:
    """Return whether the model predicts a vehicle's consumption.

    It does not on the ground and without positions; for a planned flight the watchpoints wait for positions.
    """
    setup, fix = context.vehicles.get(state.name), state.motion.fix
    if setup is None or setup.planned:
        return state.armed
    return state.armed and state.sortie.took_off and fix is not None and now_s - fix.at_s <= account.GAP_S


def _is_in_air(state: VehicleState) -> bool:
    """Return whether it is in the air; it reports landed some seconds before it disarms."""
    fix = state.motion.fix
    up = state.telemetry.on_ground is False or (fix is not None and fix.alt_rel_m > GROUND_HEIGHT_M)
    return state.armed and state.sortie.took_off and up and not state.telemetry.on_ground


GROUND_HEIGHT_M = 0.5


def _has_two_roundings(context: Scene, name: str, charge: BatteryState) -> bool:
    """Return whether it rounds its percentage in two ways, and has no finer source."""
    return account.is_blind(charge) and name in context.vehicles and context.vehicles[name].dialect.rounds_twice


def _apply_percentage(
    context: Scene, state: VehicleState, known: BatteryState, remaining_pct: float, charge_state: int, now_s: float
) -> BatteryState:
    setup = context.vehicles.get(state.name)
    prior = account.NO_PRIOR if setup is None else setup.prior
    middle_pct = 0.0 if setup is None else setup.dialect.percent_middle
    if setup is not None and not setup.planned and known.remaining_pct is not None:
        if not _is_seen_flying(context, state, now_s):
            return account.rebase_account(known, remaining_pct, charge_state, now_s, prior, middle_pct)
        if setup.dialect.rounds_twice and (now_s - known.anew_s < TAKEOFF_SAG_S or remaining_pct >= account.FULL_PCT):
            return account.apply_uninformative_report(known, remaining_pct, charge_state, now_s, prior, middle_pct)
    # Both autopilots' percentages jump back to 100 at a reboot; PX4's simulated one also when it disarms.
    if known.remaining_pct is not None and remaining_pct > known.remaining_pct + 20.0:
        return account.restart_account(known, remaining_pct, charge_state, now_s, prior, middle_pct)
    return account.apply_remaining_report(known, remaining_pct, charge_state, now_s, prior, context.limits, middle_pct)
