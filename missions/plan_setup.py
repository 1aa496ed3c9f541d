"""Heights, pads and areas that a plan file's flights are made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from missions.pads import Pad
from missions.plan_file import PlanFile
from missions.setup import FlightSetup, Inspection, plan_flight_setup
from missions.terrain import Terrain


def setup_of_plan(
    content: PlanFile, inspection: Inspection, *, pads: Sequence[Pad] | None = None, terrain: Terrain | None = None
) -> FlightSetup:
    """Return what a plan's routes become flights by.

    Args:
        content: The plan.
        inspection: Its heights and speeds.
        pads: Where the vehicles really stand, once known.
        terrain: The ground that it was made over, which is not in the plan itself.

    Raises:
        MissionsError: as `plan_flight_setup` has it.
    """
    names = [vehicle.name for vehicle in content.vehicles]
    setup = plan_flight_setup(
        content.build_network(), names, inspection, pads=pads, areas=content.areas, terrain=terrain
    )
    kept_out = () if content.pricing is None else content.pricing.kept_out
    return replace(setup, areas=content.areas, kept_out=kept_out) if content.areas else setup
