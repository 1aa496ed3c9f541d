"""The hours of a day within which a vehicle may fly, and what a flight draws in them at least."""

from __future__ import annotations

import math
from dataclasses import replace

from executor.core.context import Context
from executor.core.interface.commands import Survivor
from executor.core.state import legs
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import CLEARED_S


def find_remaining_hours(
    context: Context, state: FleetState, name: str, now_s: float, *, ahead_s: float = 0.0
) -> tuple[float, float | None]:
    """Return how long a vehicle may fly, and when it may again.

    Args:
        context: Of the flight.
        state: Of the flight.
        name: Of the vehicle.
        now_s: The time.
        ahead_s: Hours that begin so soon count as begun: a clearance may be so old at the take-off.

    Returns:
        The seconds until its hours end, infinite where nobody set any, and 0 outside them; and the seconds after the
        launch at which its next ones begin, None if there are none.
    """
    day, launched_s = context.day, state.progress.launched_s
    if day is None:
        return math.inf, None
    flight_s, windows = now_s - (now_s if launched_s is None else launched_s), day.windows_s.get(name, ())
    left_s = max((end - flight_s for begin, end in windows if begin - ahead_s <= flight_s), default=0.0)
    return max(0.0, left_s), min((begin for begin, _ in windows if begin - ahead_s > flight_s), default=None)


def min_draw_pct(context: Context, seconds: float) -> float:
    """Return what a flight draws in a time at least, in percent: nothing that draws no more lasts longer."""
    return seconds * min(context.draws_pct_s)


def limit_to_hours(context: Context, state: FleetState, offer: Survivor, now_s: float) -> Survivor:
    """Return what a vehicle can offer to a re-plan that has it land within its hours.

    What it carries already it may go on with if that ends in time. One in the air was sent up for hours that are about
    to begin, if they have not.
    """
    left_s, _ = find_remaining_hours(context, state, offer.vehicle, now_s, ahead_s=CLEARED_S if offer.airborne else 0.0)
    if math.isinf(left_s):
        return offer
    vehicle = state.vehicles[offer.vehicle]
    free_s = home_s = 0.0
    if offer.airborne and vehicle.assignment.board is not None:
        free_s = legs.time_to_reach_s(vehicle, offer.kept - 1)
        home_s = legs.time_to_reach_s(vehicle, len(vehicle.assignment.board.legs) - 1)
    most_pct = min_draw_pct(context, max(0.0, left_s - free_s))
    in_time = offer.airborne and home_s <= left_s
    return replace(
        offer,
        budget_pct=min(offer.budget_pct, most_pct),
        most_pct=offer.most_pct if in_time else min(offer.most_pct, most_pct),
    )
