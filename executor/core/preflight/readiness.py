"""Decide whether a vehicle may leave the ground, with the reasons against it.

A caller leaves out what it is about to change: an include ends a fault, a swap also brings another pack.
"""

from __future__ import annotations

import math

from executor.core.battery.pack_condition import LEAST_SPARE_PCT
from executor.core.context import Context, RelaunchPolicy
from executor.core.interface.intents import Reason, fill_in
from executor.core.lines import operator, sorties
from executor.core.state.bases import is_at_closed_base
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import CLEARED_S
from executor.core.state.vehicle_state import Stage, VehicleState, current_setup_of
from executor.core.telemetry.message_update import CLOCK_LOSS_S
from missions.autopilots.dialect import is_manual_mode

AWAY = frozenset({operator.NOT_AT_REST, operator.NOT_ON_BASE})
"""Reasons of a vehicle that is not on the ground at its base, with its motors off."""
OUT_OF_SERVICE = AWAY | {operator.WITH_PILOT, operator.AT_FAULT, operator.OUT_OF_PLAN}
"""Reasons that neither a pack nor an open base removes."""
CHECKS_OUTDATED = frozenset({sorties.REBOOTED, sorties.CLOCK_FELL_BACK})
"""Reasons of an autopilot that is no longer as it was checked or cleared."""


def find_obstacles(
    context: Context, fleet: FleetState, vehicle: VehicleState, now_s: float, *, within_s: float = CLEARED_S
) -> dict[Reason, Reason]:
    """Return what keeps a vehicle on the ground, the most important first; empty if it may take off.

    Args:
        context: What the flight knows before it begins.
        fleet: The state of the fleet.
        vehicle: The vehicle, which `fleet` may hold in another state.
        now_s: The time.
        within_s: Age up to which the crew's clearance holds.

    Returns:
        The reasons with their values, by their lines in `executor/core/lines`.
    """
    setup, fix, left_pct = current_setup_of(context, vehicle), vehicle.motion.fix, vehicle.power.battery.remaining_pct
    heard_s, cleared_s, ready_s = vehicle.link.heard_s, vehicle.orders.cleared_s, vehicle.turn.ready_s
    checked_s = max(cleared_s or -math.inf, ready_s or -math.inf)
    rows = (
        (fleet.progress.recalled, operator.ABORTED),
        (not vehicle.is_at_rest or vehicle.armed, operator.NOT_AT_REST),
        (not vehicle.is_on_base, operator.NOT_ON_BASE),
        (vehicle.is_under_foreign_control, operator.WITH_PILOT),
        (heard_s is None, operator.NEVER_HEARD),
        (heard_s is not None and not is_heard(context, vehicle, now_s), operator.LINK_STALE),
        (vehicle.sensors.tilted_since_s is not None, operator.TILTED),
        (is_at_closed_base(context, fleet, vehicle), operator.BASE_CLOSED),
        (vehicle.fault is not None, operator.AT_FAULT),
        (vehicle.orders.excluded, operator.OUT_OF_PLAN),
        (vehicle.assignment.stubborn, operator.DECLINED),
        (vehicle.stage is Stage.LANDED and context.fly_again is RelaunchPolicy.NEVER, operator.FLOWN_ALREADY),
        (vehicle.turn.asked_s is not None, operator.SWAPPING),
        (vehicle.assignment.pending is not None, operator.UPLOADING),
        (fix is None or setup.pad_distance_m(fix.place_m) > context.limits.off_pad_m, operator.OFF_PAD),
        (left_pct is None or left_pct < setup.reserve_pct + LEAST_SPARE_PCT, operator.BATTERY_LOW),
        ((vehicle.sortie.rebooted_s or -math.inf) > checked_s, sorties.REBOOTED),
        (vehicle.motion.behind_s >= CLOCK_LOSS_S and vehicle.motion.fell_back_s > checked_s, sorties.CLOCK_FELL_BACK),
        (not _is_cleared(context, vehicle, now_s, within_s), operator.UNCLEARED),
    )
    values = {
        "stage": vehicle.stage.value,
        "age_s": 0.0 if heard_s is None else now_s - heard_s,
        "fault": "" if vehicle.fault is None else vehicle.fault.reason,
        "left": "unknown" if left_pct is None else f"{left_pct:.0f} %",
        "reserve_pct": setup.reserve_pct,
    }
    return {line: fill_in(line, **values) for applies, line in rows if applies}


def is_heard(context: Context, vehicle: VehicleState, now_s: float) -> bool:
    """Return whether a vehicle is received now."""
    return vehicle.link.heard_s is not None and now_s - vehicle.link.heard_s < context.limits.link_stale_s


def _is_cleared(context: Context, vehicle: VehicleState, now_s: float, within_s: float) -> bool:
    """Return whether a vehicle was cleared recently, or needs no clearance.

    A clearance is needed if a mode only a person flies in was set since it landed.
    """
    held = vehicle.stage is Stage.LANDED and is_manual_mode(context.vehicles[vehicle.name].dialect, vehicle.mode)
    if context.fly_again is RelaunchPolicy.AUTO and not held:
        return True
    return vehicle.orders.cleared_s is not None and now_s - vehicle.orders.cleared_s <= within_s
