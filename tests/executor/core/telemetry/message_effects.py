"""One message folded into what is known of a vehicle."""

from __future__ import annotations

from typing import Any

from executor.core.context import Context
from executor.core.interface.messages import (
    FlightMessage,
    Position,
)
from executor.core.state.vehicle_state import VehicleState
from executor.core.telemetry import message_update
from tests.executor.builders import flat
from tests.executor.core.steps import Changes, changes
from tests.executor.core.vehicles import (
    FLEET,
    NOW_S,
    PAD_E,
    PAD_N,
)

CONTEXT = FLEET.context


def folded(one: VehicleState, message: FlightMessage, context: Context = CONTEXT) -> tuple[Any, ...]:
    """Return what a message changes, what it proves to be inspected, and its words."""
    found = message_update.apply_message(context, one, message, NOW_S)
    changed = changes(one, found.state)
    for name in ("battery", "volts", "quality", "carried", "roundings"):
        if name in changed:
            changed[name] = changes(flat(one)[name], changed[name])
    for name in ("spoke_s", "heard_s"):
        if changed.get(name) == NOW_S:
            del changed[name]  # it was heard
    return (changed, *((found.inspected, found.text) if found.inspected is not None or found.text else ()))


def placed(
    east_m: float = 300.0,
    up_m: float = 20.0,
    *,
    boot_s: float = NOW_S,
    north_m: float = PAD_N,
    speed_m_s: float = 3.0,
    climbs_m_s: float = 0.0,
) -> Position:
    """Return a report of a place so far east of the pad."""
    lat_deg, lon_deg = CONTEXT.frame.to_wgs84_deg(PAD_E + east_m, north_m)
    return Position(boot_s, lat_deg, lon_deg, 450.0 + up_m, up_m, 0.0, speed_m_s, -climbs_m_s, None)


def moved(one: VehicleState, message: Position) -> Changes:
    """Return what a position changes but the position itself, as far as that is worth a word."""
    changed = changes(one, message_update.apply_message(CONTEXT, one, message, NOW_S).state)
    for name in ("spoke_s", "heard_s", "fix"):
        changed.pop(name, None)
    if "battery" in changed:
        changed["battery"] = changed["battery"].modelled_pct - one.power.battery.modelled_pct
    if "anchor" in changed:
        changed["anchor"] = changed["anchor"].boot_s
    return changed
