"""What the site says of a vehicle with the pack that is in it now."""

from __future__ import annotations

from dataclasses import replace

from executor.core.context import Scene, VehicleSetup
from executor.core.state.vehicle_state import VehicleState


def current_setup_of(context: Scene, vehicle: VehicleState) -> VehicleSetup:
    """Return the setup of a vehicle; what its percentage says too much is a part of the reserve in it."""
    setup, turn = context.vehicles[vehicle.name], vehicle.turn
    if turn.swaps == 0:
        return setup
    setup = setup.with_pack(turn.label)
    if turn.overstated_pct > 0.0:
        return replace(setup, reserve_pct=setup.reserve_pct + turn.overstated_pct)
    return setup
