"""A site for a flight in virtual time: only the network is a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from executor.simulated.simulated_fleet import SIMULATED_CEILING_M, build_demo_site
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_model import SiteModel
from missions import Network, PlanFile, default_network_path, estimate, read_network

FIRST_PORT = 20_000
"""First port; none is opened."""
EVERYTHING_M = 1e6
SIZED_PCT = 0.01
MOST_TRIES = 50
AMPLE_AH = 1e4
"""A battery that no route empties, until the real one is chosen."""


def build_virtual_site(
    network: Path | None,
    radius_m: float | None,
    vehicles: int,
    autopilot: str,
    *,
    wind_m_s: tuple[float, float] = (0.0, 0.0),
    capacity_ah: float | None = None,
    same_distance: bool = False,
    tables: Mapping[str, object] = MappingProxyType({}),
) -> SiteModel:
    """Return the site of a simulated fleet over a network, as known before the flight.

    A network without heights counts as flat, and no permit is needed for any height.

    Args:
        network: GeoJSON or a graph file; None for faultline's own.
        radius_m: Only segments within this of the depot; None for all.
        vehicles: Number of vehicles.
        autopilot: Autopilot of all vehicles.
        wind_m_s: Direction of the air's motion, east and north.
        capacity_ah: Of the batteries; None for the default.
        same_distance: Whether all vehicles inspect at the requested distance where no other vehicle's path crosses.
        tables: More tables of the site file.

    Raises:
        MissionsError: the network cannot be used.
        SiteError: a figure is out of range.
    """
    content: dict[str, Any] = build_demo_site(
        network=network, radius_m=radius_m or EVERYTHING_M, vehicles=vehicles, speedup=1.0, autopilot=autopilot,
        ports=range(FIRST_PORT, FIRST_PORT + vehicles),
    )  # fmt: skip
    inspection: dict[str, object] = {
        "ceiling_m": SIMULATED_CEILING_M, "wind_m_s": wind_m_s, "same_distance": same_distance
    }  # fmt: skip
    if not _has_heights(network, content.get("depot")):
        inspection["heights"] = "flat"
    content |= {"inspection": inspection, **tables}
    if capacity_ah is not None:
        content["energy"] = {"capacity_ah": capacity_ah}
    return site_model.load_site_model(check_site(content, "bench"), Path())


def _has_heights(network: Path | None, depot: Mapping[str, float] | None) -> bool:
    given = None if depot is None else (depot["lat_deg"], depot["lon_deg"], depot["alt_m"])
    found = read_network(default_network_path() if network is None else network, depot=given)
    return found.has_heights or found.flat


def with_network(ground: SiteModel, network: Network) -> SiteModel:
    """Return the same site over a changed network."""
    return site_model.build_site_model(ground.site, network, terrain=ground.terrain)


def with_capacity(ground: SiteModel, capacity_ah: float) -> SiteModel:
    """Return the same site with other batteries."""
    energy = ground.site.energy.model_copy(update={"capacity_ah": capacity_ah})
    site = ground.site.model_copy(update={"energy": energy})
    return site_model.build_site_model(site, ground.network, terrain=ground.terrain)


def with_budgets(ground: SiteModel, budget_pct: float) -> SiteModel:
    """Return the same site with another budget for every vehicle."""
    vehicles = tuple(table.model_copy(update={"budget_pct": budget_pct}) for table in ground.site.vehicle)
    site = ground.site.model_copy(update={"vehicle": vehicles})
    return site_model.build_site_model(site, ground.network, terrain=ground.terrain)


def dearest_route_pct(ground: SiteModel, plan: PlanFile) -> float:
    """Return the consumption of a plan's most expensive route as flown, with its climb and its landing."""
    paths = site_model.build_paths(ground.setup, plan.network_routes)
    models = site_model.build_pricing(ground).models
    return max(estimate(path, models[name]).energy_pct for name, path in paths.items())


def size_batteries(ground: SiteModel, plan: PlanFile, uses_pct: float) -> SiteModel:
    """Return the same site with batteries of which the most expensive route of a plan uses this share."""
    for _ in range(MOST_TRIES):
        takes_pct = dearest_route_pct(ground, plan)
        if abs(takes_pct - uses_pct) < SIZED_PCT:
            break
        # A small battery delivers less at the same power, so the relation is not proportional.
        ground = with_capacity(ground, ground.drone.capacity_ah * takes_pct / uses_pct)
    return ground
