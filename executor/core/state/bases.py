"""Track at which base of a day each vehicle stands and lands, and place the flight's pads accordingly.

Each vehicle has its own pad at every base where its sorties begin or end, so pads are neither waited for nor assigned
twice. Its autopilot takes the pad where it arms as home: its heights count from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

from executor.core.context import Context
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from missions import FlightSetup, Pad, Pricing


def base_of(context: Context, vehicle: VehicleState) -> str:
    """Return the base where a vehicle stands, or took off; empty if the flight is no day of sorties."""
    return vehicle.turn.base or ("" if context.day is None else context.day.bases.get(vehicle.name, ""))


def landing_base_of(context: Context, vehicle: VehicleState) -> str:
    """Return the base where a vehicle's mission ends; for one without a mission, the base where it stands."""
    idle = vehicle.is_on_base and vehicle.turn.asked_s is None
    return (not idle and vehicle.turn.lands_at) or base_of(context, vehicle)


def is_at_closed_base(context: Context, state: FleetState, vehicle: VehicleState) -> bool:
    """Return whether the base of a vehicle's next take-off is closed: where it stands, or will land."""
    stands = vehicle.is_on_base or vehicle.stage is Stage.STARTING
    return (base_of if stands else landing_base_of)(context, vehicle) in state.crew.closed_bases


def find_planned_landing(context: Context, vehicle: VehicleState, visits: tuple[int, ...]) -> str:
    """Return the base where the rest of a sortie ends; the vehicle's own if the sortie began elsewhere."""
    base, wanted = base_of(context, vehicle), set(visits)
    planned = (one.lands for one in vehicle.turn.ahead if wanted <= set(one.visits) and one.base in {"", base})
    return next(planned, "") or base


def settle_at_base(context: Context, vehicle: VehicleState) -> VehicleState:
    """Return a vehicle on the ground with the base on whose pad it stands; on no pad, the base where it took off."""
    own, fix = {} if context.day is None else context.day.pads.get(vehicle.name, {}), vehicle.motion.fix
    if not own:
        return vehicle
    was = base = base_of(context, vehicle)
    if fix is not None:
        away_m = {name: math.dist(fix.place_m, (pad.east_m, pad.north_m)) for name, pad in own.items()}
        nearest = min(away_m, key=away_m.__getitem__)
        base = nearest if away_m[nearest] <= context.limits.off_pad_m else was
    return vehicle.with_turn(base=base, lands_at="", moved=vehicle.turn.moved or base != was)


def place_vehicles(context: Context, vehicles: Iterable[VehicleState]) -> Context:
    """Return the context with the present pads: where each vehicle stands or took off, and where it lands."""
    day = context.day
    if day is None or not day.pads:
        return context
    moved = tuple(
        (day.pads[one.name][base_of(context, one)], day.pads[one.name][landing_base_of(context, one)])
        for one in vehicles
        if one.name in day.pads and (one.turn.base or one.turn.lands_at)
    )
    if not moved:
        return context
    setup, pricing = _move_pads(context.setup, context.pricing, moved)
    homes = {
        home.vehicle: replace(context.vehicles[home.vehicle], pad_m=(home.east_m, home.north_m)) for home, _ in moved
    }
    return replace(context, setup=setup, pricing=pricing, vehicles={**context.vehicles, **homes})


@lru_cache(maxsize=64)
def _move_pads(setup: FlightSetup, pricing: Pricing, moved: tuple[tuple[Pad, Pad], ...]) -> tuple[FlightSetup, Pricing]:
    """Return heights and prices for other pads; cached, as every event needs them and they seldom change."""
    homes = {home.vehicle: home for home, _ in moved}
    setup = replace(
        setup,
        pads=tuple(homes.get(pad.vehicle, pad) for pad in setup.pads),
        landings={landing.vehicle: landing for home, landing in moved if landing != home},
    )
    bases = {**pricing.bases, **{name: setup.base_of(name) for name in homes}}
    starts = {name: setup.base_at(homes[name]) for name in setup.landings}
    return setup, replace(pricing, bases=bases, starts=starts)
