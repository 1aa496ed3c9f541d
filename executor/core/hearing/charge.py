"""What a vehicle says of its batteries into what is made of it."""

from __future__ import annotations

from dataclasses import replace

from executor.core.battery import account
from executor.core.battery.account import BatteryState
from executor.core.battery.voltage import Report, Thresholds, VoltageState, measured
from executor.core.context import Scene
from executor.core.messages import Battery, SystemStatus
from executor.core.parts import Power
from executor.core.vehicle import VehicleState


def powered(context: Scene, state: VehicleState, message: Battery, now_s: float) -> Power:
    """Take a BATTERY_STATUS."""
    old, packs = state.power, state.power.packs
    if message.remaining_pct is not None:
        # Of several packs the emptiest one ends the flight.
        packs = tuple({**dict(packs), message.battery: message.remaining_pct}.items())
    single = len(packs) <= 1  # the counters of several packs are not one account
    charge, roundings, volts = old.battery, old.roundings, old.volts
    if message.consumed_ah is not None and single and state.armed:
        charge = account.with_consumed(charge, message.consumed_ah, now_s, context.limits)
    if message.remaining_pct is not None:
        percent = min(dict(packs).values())
        if single and _rounds_twice(context, state.name, charge):
            roundings = replace(roundings, rounded=percent, rounded_s=now_s)
            percent = roundings.percent
        charge = _charged(context, state.name, charge, percent, message.charge_state, now_s)
        if single:
            charge = account.with_first_count(charge, message.consumed_ah)
    if message.voltage_v and single:
        volts = _measured(context, state, Report(message.voltage_v, message.current_a, message.cells_v), now_s)
    return replace(old, packs=packs, battery=charge, roundings=roundings, volts=volts, battery_faults=message.faults)


def status_told(context: Scene, state: VehicleState, message: SystemStatus, now_s: float) -> Power:
    """Take what SYS_STATUS says of a battery, where nothing better says it."""
    old = state.power
    charge, roundings, volts = old.battery, old.roundings, old.volts
    # SYS_STATUS rounds in another way than BATTERY_STATUS, and stands for any one of several packs.
    unreported = now_s - charge.reported_s > context.limits.battery_stale_s
    if message.remaining_pct is not None and unreported:
        charge = _charged(context, state.name, charge, message.remaining_pct, 0, now_s)
    elif message.remaining_pct is not None and len(old.packs) == 1 and _rounds_twice(context, state.name, charge):
        roundings = replace(roundings, ceiled=message.remaining_pct, ceiled_s=now_s)
        charge = _charged(context, state.name, charge, roundings.percent, charge.charge_state, now_s)
    if message.voltage_v and now_s - volts.reported_s > context.limits.battery_stale_s:
        volts = _measured(context, state, Report(message.voltage_v), now_s)
    if charge is old.battery and roundings is old.roundings and volts is old.volts:
        return old
    return replace(old, battery=charge, roundings=roundings, volts=volts)


def _measured(context: Scene, state: VehicleState, report: Report, now_s: float) -> VoltageState:
    limits = context.limits
    known = report.current_a is not None and report.current_a > 0
    step = limits.voltage_step if known else limits.voltage_step_blind
    thresholds = Thresholds(step, limits.cell_low_v, limits.cell_spread_v)
    return measured(state.power.volts, report, thresholds, now_s, flying=state.armed and state.sortie.took_off)


def _rounds_twice(context: Scene, name: str, charge: BatteryState) -> bool:
    """Return whether it rounds its percentage in two ways, and has nothing finer than that."""
    return account.is_blind(charge) and name in context.vehicles and context.vehicles[name].dialect.rounds_twice


def _charged(
    context: Scene, name: str, known: BatteryState, remaining_pct: float, charge_state: int, now_s: float
) -> BatteryState:
    prior = context.vehicles[name].prior if name in context.vehicles else account.NO_PRIOR
    # Both autopilots' percentages jump back to 100 at a restart; PX4's simulated one also when it disarms.
    if known.remaining_pct is not None and remaining_pct > known.remaining_pct + 20.0:
        return account.swapped(known, remaining_pct, charge_state, now_s, prior)
    return account.with_remaining(known, remaining_pct, charge_state, now_s, prior, context.limits)
