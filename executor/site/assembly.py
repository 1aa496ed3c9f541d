"""From the site file's tables to what planner, missions and core work with."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from executor.core.battery.kalman import Prior
from executor.core.context import Context, FlyAgain, VehicleSetup, draws_pct_s
from executor.core.limits import Limits
from executor.core.preflight.failsafes import LinkFailsafe, declared_lost_after_s
from executor.site.config import Site
from missions import (
    Dialect,
    FlightPath,
    FlightSetup,
    Inspection,
    Network,
    Pad,
    Phase,
    Task,
    default_network_path,
    dialect_for,
    estimate,
    flight_path,
    flight_setup,
    implausible,
    open_task,
    read_network,
    with_heights,
)
from planner import PRESETS, Drone, Plan, Travel, Vehicle, route_energy_pct, travel_for

STALL_REAL_S = 2.0
"""A busy computer may keep a process waiting (1.0 s was seen); faster than real time that is a long flight."""
UPLOAD_ALLOWANCE_S = 1.0
"""Real seconds that putting a re-plan on board may take, for the choice of what is not touched any more."""
DEFAULT_NETWORK = "default"
"""As `network.file`: the network that comes with faultline."""


@dataclass(frozen=True, slots=True)
class Ground:
    """What is known before any vehicle answers."""

    site: Site
    network: Network
    inspection: Inspection
    drone: Drone
    travel: Travel
    worth_a_look: tuple[str, ...] = ()
    """What was found about the network's heights, in words."""

    @property
    def names(self) -> tuple[str, ...]:
        """The vehicles' names, from the lowest layer to the highest."""
        return tuple(vehicle.name for vehicle in self.site.vehicle)


def ground_of(site: Site, base: Path) -> Ground:
    """Read the network and prepare the models; paths are relative to `base`, the site file's folder.

    Raises:
        MissionsError: the network cannot be used, or its heights cannot be flown by.
    """
    file = default_network_path() if site.network.file == DEFAULT_NETWORK else base / site.network.file
    depot = None if site.depot is None else (site.depot.lat_deg, site.depot.lon_deg, site.depot.alt_m)
    network = read_network(file, depot=depot, crs=site.network.crs, radius_m=site.network.radius_m)
    table = site.inspection
    network = with_heights(network, flat=table.heights == "flat")
    worth_a_look = tuple(implausible(network, tallest_m=site.network.tallest_m))
    drone = drone_of(site)
    travel = travel_for(drone, table.transit_speed_m_s, table.speed_m_s, wind_m_s=table.wind_m_s)
    return Ground(site, network, inspection_of(site, network), drone, travel, worth_a_look)


def inspection_of(site: Site, network: Network) -> Inspection:
    """Return how a network is to be flown."""
    table = site.inspection
    return Inspection(
        height_m=table.height_m,
        standoff_m=table.standoff_m,
        speed_m_s=table.speed_m_s,
        transit_speed_m_s=table.transit_speed_m_s,
        layer_m=table.layer_m,
        flat=network.flat,
        ceiling_m=table.ceiling_m,
        return_ceiling_m=table.return_ceiling_m,
    )


def drone_of(site: Site) -> Drone:
    """Return the multicopter: the preset with what the site file changes."""
    changes = site.energy.model_dump(exclude={"drone"}, exclude_none=True)
    return replace(PRESETS[site.energy.drone], **changes)


def task_of(ground: Ground, segments: Iterable[int] | None = None, without: Collection[str] = ()) -> Task:
    """Return the problem of a first plan, from the depot, with the budgets of the site file.

    Args:
        ground: What is known before any vehicle answers.
        segments: What is to be inspected; everything if not given.
        without: Vehicles that do not fly.
    """
    vehicles = [
        Vehicle(vehicle.name, (0.0, 0.0), vehicle.budget_pct)
        for vehicle in ground.site.vehicle
        if vehicle.name not in without
    ]
    wanted = range(len(ground.network.segments)) if segments is None else segments
    return open_task(ground.network, wanted, vehicles, ground.travel)


def setup_of(ground: Ground, pads: Sequence[Pad] | None = None) -> FlightSetup:
    """Return heights and pads; pads are chosen around the depot unless the vehicles' places are known.

    Raises:
        MissionsError: there is no room for pads or layers.
    """
    return flight_setup(ground.network, ground.names, ground.inspection, pads=pads)


def stall_s(speedup: float) -> float:
    """Return the shortest silence, in the vehicles' time, that a simulation can tell from a busy computer."""
    return STALL_REAL_S * speedup if speedup > 1 else 0.0


def link_timeout_s(site: Site, dialect: Dialect, own: LinkFailsafe | None = None) -> float:
    """Return the silence after which a vehicle of a site is lost: see `declared_lost_after_s`."""
    return declared_lost_after_s(dialect, site.faults.link_timeout_s, stall_s(site.flight.speedup), own)


def limits_of(site: Site) -> Limits:
    """Return the thresholds of the watchpoints."""
    table = site.faults
    return Limits(
        link_stale_s=table.link_stale_s,
        battery_step_pct=table.battery_step_pct,
        battery_excess_pct=table.battery_excess_pct,
        battery_window_s=table.battery_window_s,
    )


def routes_of(ground: Ground, task: Task, plan: Plan) -> Mapping[str, tuple[int, ...]]:
    """Return each vehicle's visits of the network by its name."""
    routes = task.plan_to_network(plan).routes
    return {ground.names[route.vehicle]: route.visits for route in routes}


def paths_of(setup: FlightSetup, routes: Mapping[str, tuple[int, ...]]) -> Mapping[str, FlightPath]:
    """Return the flight path of every vehicle that has something to do."""
    return {name: flight_path(setup, name, visits) for name, visits in routes.items() if visits}


@dataclass(frozen=True, slots=True)
class Overhead:
    """What real flight paths cost beyond the planning model."""

    factor: float
    """Of everything that the planner counts, for holds and ramps; at least 1."""
    fixed_pct: float
    """Of the climb from the pad and the descent onto it, in percent of a full battery."""
    landing_pct: float
    """The descent's part of that."""


def overhead_of(ground: Ground, setup: FlightSetup, task: Task, plan: Plan) -> Overhead:
    """Return what the flight paths of a plan cost beyond the plan."""
    modelled = sum(route_energy_pct(task.instance, route) for route in plan.routes if route.visits)
    level_pct, climb_pct, landing_pct = 0.0, 0.0, 0.0
    for path in paths_of(setup, routes_of(ground, task, plan)).values():
        legs = estimate(path, ground.travel, setup.motion).legs
        for waypoint, leg in zip(path.waypoints, legs, strict=True):
            if waypoint.phase is Phase.TAKEOFF:
                climb_pct = max(climb_pct, leg.energy_pct)
            elif waypoint.phase is Phase.LAND:
                landing_pct = max(landing_pct, leg.energy_pct)
            else:
                level_pct += leg.energy_pct
    factor = max(1.0, level_pct / modelled) if modelled > 0 else 1.0
    return Overhead(factor, climb_pct + landing_pct, landing_pct)


def context_of(
    ground: Ground,
    setup: FlightSetup,
    task: Task,
    plan: Plan,
    own: Mapping[str, LinkFailsafe] = MappingProxyType({}),
) -> Context:
    """Return everything that the decisions in flight may look at.

    Args:
        ground: What is known before any vehicle answers.
        setup: Heights and pads.
        task: The problem of the first plan.
        plan: The first plan.
        own: What vehicles do by themselves in silence, by their name, where they were asked.
    """
    site = ground.site
    vehicles: dict[str, VehicleSetup] = {}
    for table in site.vehicle:
        dialect, pad = dialect_for(table.autopilot), setup.pad_of(table.name)
        failsafe = own.get(table.name)
        vehicles[table.name] = VehicleSetup(
            name=table.name,
            sysid=table.sysid,
            dialect=dialect,
            budget_pct=table.budget_pct,
            reserve_pct=table.reserve_pct,
            link_timeout_s=link_timeout_s(site, dialect, failsafe),
            pad_m=(pad.east_m, pad.north_m),
            failsafe_s=failsafe.after_s if failsafe is not None and failsafe.acts else None,
        )
    overhead = overhead_of(ground, setup, task, plan)
    return Context(
        frame=setup.frame,
        setup=setup,
        vehicles=vehicles,
        limits=limits_of(site),
        drone=ground.drone,
        draws_pct_s=draws_pct_s(ground.drone),
        prior=Prior(),
        wind_m_s=site.inspection.wind_m_s,
        travel=ground.travel,
        wanted=frozenset(task.segment_ids),
        corridor_m=site.inspection.corridor_m,
        inspection_speed_m_s=site.inspection.speed_m_s,
        overhead=overhead.factor,
        fixed_pct=overhead.fixed_pct,
        landing_pct=overhead.landing_pct,
        fly_again=FlyAgain(site.flight.fly_again),
        pilot_grace_s=site.flight.pilot_grace_s,
        pilot_returns=site.flight.pilot_return == "auto",
        infers=site.flight.inferred == "count",
        offer_s=site.flight.offer_s,
        horizon_s=2.0 + site.flight.speedup * (site.flight.solve_s + UPLOAD_ALLOWANCE_S),
    )
