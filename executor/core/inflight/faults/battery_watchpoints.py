"""What may be wrong with a vehicle's battery: the watchpoints of its percentage, its charge, its voltage, its words."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from executor.core.battery import account, cusum
from executor.core.battery.pack_condition import PackCondition, assess_pack
from executor.core.inflight.faults.watchpoint_types import (
    OK,
    STALE,
    Finding,
    WatchView,
    describe_reported_failure,
    is_in_mission_mode,
)
from executor.core.limits import Limits
from executor.core.state import landing_projection
from executor.core.telemetry.battery_reports import pack_facts_of
from missions import Phase

_BATTERY_FAULTS = {1: "deep discharge", 4: "a failed cell", 8: "over-current", 16: "over-temperature", 64: "a voltage "
                   "that does not fit", 256: "cells that are not the set ones"}  # fmt: skip
"""MAV_BATTERY_FAULT; spikes (2), cold (32) and firmware (128) take no battery out of the air."""
LOW = 2
"""MAV_BATTERY_CHARGE_STATE_LOW."""
BATTERY_SENSOR = 0x2000000
"""MAV_SYS_STATUS_SENSOR_BATTERY."""
NEAR_PCT = 15.0
"""So near to its reserve a battery may well be low by its voltage."""
PLUNGE = 1.7
"""Times the threshold of a drain."""


def check_battery_step(view: WatchView) -> Finding:
    """Much was lost at once."""
    limits, power, known = view.context.limits, view.state.power, view.state.power.battery
    # A percentage that does not follow its counter is no use where the voltage did not fall with it.
    refuted = account.is_blind(known) and account.has_running_counter(known) and power.volts.dropped_s is None
    if not _is_battery_fresh(view) or refuted:
        return STALE
    window_s = limits.battery_step_window_s
    long_s = 4 * window_s
    # While it fails the window moves on; and nobody may have looked while a step was in it.
    fell = known.drift.jumped_pct >= limits.battery_step_pct and view.now_s - known.drift.jumped_s <= long_s
    excess, expected = account.excess_pct(known, long_s if view.failing or fell else window_s)
    if excess < limits.battery_step_pct:
        return OK
    return f"lost {excess + expected:.0f} % at once where the flight costs {expected:.1f} %"


def _check_drain(view: WatchView, *, hurried: bool) -> Finding:
    if not _is_battery_fresh(view):
        return STALE
    limits, known, fix = view.context.limits, view.state.power.battery, view.state.motion.fix
    climbs = fix is not None and fix.velocity_m_s[2] > limits.climbs_m_s
    eased = (2.0 if climbs else 1.0) * (0.8 if view.failing else 1.0)
    for found, threshold, which in _iterate_excesses(known, limits, hurried=hurried):
        if cusum.is_drain(found, eased * threshold, limits.battery_step_pct):
            return (
                f"used {found.used_pct:.1f} % in {found.duration_s(view.now_s):.0f} s where "
                f"{found.expected_pct:.1f} % is usual{which}"
            )
    return OK


check_battery_drain = partial(_check_drain, hurried=False)
"""More is used than the flight should cost, by more than a climb or a gust explains."""
check_battery_plunge = partial(_check_drain, hurried=True)
"""So much more is used that there is no time to wait for one more report."""


def _iterate_excesses(
    known: account.BatteryState, limits: Limits, *, hurried: bool
) -> Iterator[tuple[cusum.Drift, float, str]]:
    """Yield what was used beyond the usual, in each way of counting, with its threshold and how it was counted."""
    share = PLUNGE if hurried else 1.0
    yield known.charge.drift, share * limits.charge_excess_pct, " by its counter of charge"
    if account.is_blind(known) and account.has_running_counter(known):
        return  # what the percentage says is something else than what the counter counts
    if not account.is_blind(known):
        yield known.drift, share * (limits.battery_excess_pct + known.roughness_pct), ""
    else:
        yield known.drift, limits.blind_excess_pct, ""
    if not hurried:
        yield known.slow, limits.slow_blind_pct if account.is_blind(known) else limits.slow_excess_pct, " over minutes"


def check_voltage_step(view: WatchView) -> Finding:
    """The voltage fell at once by more than the load explains."""
    volts, limits = view.state.power.volts, view.context.limits
    if view.now_s - volts.reported_s > limits.battery_stale_s:
        return STALE
    threshold = limits.voltage_step if volts.known_load else limits.voltage_step_blind
    if not volts.known_load and not view.setup.planned and _is_driven_hard(view):
        return STALE  # nobody knows its load, and it is another one than usual
    if view.failing:
        threshold *= 0.7
    if volts.usual_v is None or volts.voltage_v is None or volts.dropped_s is None or volts.drop < threshold:
        return OK
    expected_v = volts.usual_v if volts.expected_v is None else volts.expected_v
    return f"{volts.voltage_v:.2f} V where {expected_v:.2f} V is usual under this load"


def _is_driven_hard(view: WatchView) -> bool:
    """Return whether it climbs, falls, or says that something else has failed: its motors give what they never do."""
    fix, failed = view.state.motion.fix, view.state.evidence.failed
    moves = fix is not None and abs(fix.velocity_m_s[2]) > view.context.limits.climbs_m_s
    said_s = max((at_s for one, at_s in failed if one.what != "battery"), default=float("-inf"))
    return moves or view.now_s - max(said_s, view.state.telemetry.alarm[1]) <= view.context.limits.alarm_s


def check_cells(view: WatchView) -> Finding:
    """A cell is near its end, or far below the others, for longer than a climb."""
    volts, limits = view.state.power.volts, view.context.limits
    if view.now_s - volts.reported_s > limits.battery_stale_s:
        return STALE
    if volts.spread_since_s is not None and view.now_s - volts.spread_since_s >= limits.cell_low_s:
        return f"one cell at {min(volts.cells_v):.2f} V, {volts.spread_v:.2f} V below the others"
    if volts.low_since_s is not None and view.now_s - volts.low_since_s >= limits.cell_low_s:
        return f"{volts.weakest_v or 0.0:.2f} V a cell under load"
    return OK


def check_reserve(view: WatchView) -> Finding:
    """The mission on board, or where none is known the way home, would end below the reserve."""
    leg, limits = view.state.leg, view.context.limits
    if leg is not None and leg.phase in {Phase.RETURN, Phase.LAND}:
        return OK  # it is on its way home already: nothing else could be ordered
    floor_pct = view.setup.reserve_pct - limits.reserve_slack_pct
    chance = landing_projection.landing_chance_below(view.context, view.state, view.setup, floor_pct)
    if chance is None or not _is_battery_fresh(view):
        return STALE
    if chance < (limits.reserve_clear_chance if view.failing else limits.reserve_chance):
        return OK
    ahead = landing_projection.project_landing(view.context, view.state, view.setup)
    if ahead is None:
        return STALE
    return (
        f"would land with {ahead.mean_pct:.0f} % of its battery, give or take {ahead.band_pct:.1f}, reserve "
        f"{view.setup.reserve_pct:g} %: below it by {100 * chance:.0f} % probability"
    )


def check_pack_charge(view: WatchView) -> Finding:
    """Its resting voltage says that there is much less in it than is counted."""
    if view.now_s - view.state.power.volts.reported_s > view.context.limits.battery_stale_s:
        return STALE
    found = assess_pack_in_flight(view)
    if found is None or not found.in_flight:
        return OK if found is None else STALE
    fails = found.nearly_empty or (found.falls_short and not _is_pack_sufficient(view, found))
    return f"its pack {found.words}" if fails else OK


def _is_pack_sufficient(view: WatchView, found: PackCondition) -> bool:
    """Return whether a plan is flown for which even a pack that gives less than it counts is enough.

    That it gives less is sure by then, so that by how much is taken as it is likely: a real ArduPilot with half a pack
    fell where the lenient figure, of a chemistry that nobody had named, still called the rest enough.
    """
    rest = view.state.power.pack.rest
    ahead = landing_projection.project_landing(view.context, view.state, view.setup) if view.setup.planned else None
    if ahead is None or rest is None or found.times is None or found.likely_times is None:
        return False
    honest_pct = view.setup.pack.honest_pct
    began_pct, reserve_pct = honest_pct(rest.claimed_pct), honest_pct(view.setup.reserve_pct)
    times = max(found.times, found.likely_times)
    return began_pct - times * (began_pct - honest_pct(ahead.mean_pct)) >= reserve_pct


def assess_pack_in_flight(view: WatchView) -> PackCondition | None:
    """Return how its pack's voltage stands to its percentage; None where nothing can be said."""
    power, dialect = view.state.power, view.setup.dialect
    if dialect.rounds_twice and account.is_blind(power.battery):
        return None  # PX4 without a counter reads its percentage off the very same voltage
    facts = pack_facts_of(view.context, view.state)
    return assess_pack(power.pack, power.volts.cells, facts, power.battery.remaining_pct, view.now_s)


def check_battery_failsafe(view: WatchView) -> Finding:
    """The autopilot itself says that it acts on its battery."""
    said = describe_reported_failure(view, "battery")
    # A text is the one thing that anybody can send: what it says must show somewhere else as well.
    return said if said and (not view.setup.planned or _is_alarm_confirmed(view)) else OK


def _is_alarm_confirmed(view: WatchView) -> bool:
    """Return whether an alarm of the battery shows in anything besides its text."""
    state, power, volts = view.state, view.state.power, view.state.power.volts
    if state.is_critical or (state.mode is not None and not is_in_mission_mode(view)):
        return True
    left_pct = power.battery.remaining_pct
    low = left_pct is None or left_pct <= view.setup.reserve_pct + NEAR_PCT
    sick = power.battery.charge_state >= LOW or power.battery_faults or state.sensors.unhealthy & BATTERY_SENSOR
    return bool(low or sick or volts.low_since_s is not None or volts.spread_since_s is not None or volts.dropped_s)


def check_battery_status(view: WatchView) -> Finding:
    """The autopilot itself calls the battery critical, failed or unhealthy."""
    if not _is_battery_fresh(view):
        return STALE
    names = {3: "critical", 4: "emergency", 5: "failed", 6: "unhealthy"}
    state = view.state.power.battery.charge_state
    if state in names:
        return f"the autopilot reports its battery {names[state]}"
    bits = [words for bit, words in _BATTERY_FAULTS.items() if view.state.power.battery_faults & bit]
    return f"its battery reports {', '.join(bits)}" if bits else OK


def _is_battery_fresh(view: WatchView) -> bool:
    # 2 s is PX4's own interval of BATTERY_STATUS; three are waited for.
    fresh = view.now_s - view.state.power.battery.reported_s <= view.context.limits.battery_stale_s
    # Without positions nobody knows what the flight should have cost.
    positions_come = view.state.motion.fix is None or view.fresh_fix is not None
    return fresh and (positions_come or not view.setup.planned)
