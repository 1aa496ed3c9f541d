"""Build from the site file the models of planner, missions and core."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType

import missions
from executor.core.battery.account import NO_PRIOR
from executor.core.battery.pack_condition import PackHistory
from executor.core.battery.voltage import PackFacts
from executor.core.context import Context, FenceRules, RelaunchPolicy, VehicleSetup, power_draw_table_pct_s
from executor.core.fault_thresholds import Limits
from executor.core.interface.connection import Connection, Scheme
from executor.core.preflight.onboard_failsafes import LinkFailsafe, effective_link_timeout_s
from executor.core.radio_budget import RadioShare
from executor.core.replanning.replan_separation import find_layer_bound_vehicles, line_clear_time_s
from executor.core.vehicle_learning import UNKNOWN, KnownVehicle
from executor.errors import SiteError
from executor.site import site_parts
from executor.site.learned_files import SitePacks, load_site_packs
from executor.site.site_file import Site
from executor.site.site_keys import DepotTable, NetworkTable, VehicleTable
from executor.site.span_names import find_left_out, find_locks
from missions.area_rules import apply_areas
from missions.flight_model import AS_MODELLED
from missions.inspection_height import build_first_paths, find_low_segments
from missions.line_heights import add_ground_heights, add_structure_heights
from missions.no_fly_areas import Unreachable
from missions.pads import column_radius_m
from missions.plan_parts import PlanTerrain
from missions.readers.elevation_rasters import RasterOptions, read_elevation
from missions.terrain import DETOUR_M, Terrain, reading_box_m
from missions.viewpoints import add_viewpoints, build_pylon_tasks, extra_time_s
from planner import PRESETS, Drone, Plan, Travel, Vehicle, build_steady_wind, segment_of, top_speed_m_s, travel_for

STALL_REAL_S = 2.0
"""Real seconds for which a busy computer may stall a process (1.0 s measured), which is long in fast simulation."""
UPLOAD_ALLOWANCE_S = 1.0
"""Real seconds allowed for uploading a re-plan when choosing which segments stay untouched."""
FENCE_ALLOWANCE_S = 3.0
"""Additional vehicle seconds for uploading a wider fence before a new mission."""
SEEN_S = 2.0
"""Age of telemetry: a vehicle is this far ahead of its last report."""
DEFAULT_NETWORK = "default"
"""Value of `network.file` for the network that comes with faultline."""


@dataclass(frozen=True, slots=True)
class SiteModel:
    """Data known before any vehicle answers."""

    site: Site
    network: missions.Network
    inspection: missions.Inspection
    drone: Drone
    travel: Travel
    setup: missions.FlightSetup
    """Heights, and pads chosen near the depot and the bases."""
    terrain: Terrain | None = None
    """Terrain from rasters, if any."""
    worth_a_look: tuple[str, ...] = ()
    """Repairs and findings of the network file and its heights, in words."""
    learned: Mapping[str, KnownVehicle] = field(default_factory=dict)
    """Results of earlier flights by vehicle name."""
    packs: SitePacks = field(default_factory=SitePacks)
    """History of packs from earlier flights."""
    day_pads: Mapping[str, Mapping[str, missions.Pad]] = field(default_factory=dict)
    """Pads at other bases, by vehicle and base name, for days that land there."""
    left_out: frozenset[int] = frozenset()
    """Segments not to inspect; they stay in the network."""
    locked: Mapping[int, str] = field(default_factory=dict)
    """Locked segments, and the vehicle that flies each."""
    directions: Mapping[int, bool] = field(default_factory=dict)
    """Segments with a fixed direction, and whether it is reversed."""

    @property
    def names(self) -> tuple[str, ...]:
        """Vehicles' names, from the lowest layer to the highest."""
        return tuple(vehicle.name for vehicle in self.site.vehicle)


def load_site_model(
    site: Site,
    base: Path,
    learned: Mapping[str, KnownVehicle] = MappingProxyType({}),
    understood: missions.NetworkImport | None = None,
) -> SiteModel:
    """Read the network and prepare the models.

    Args:
        site: Tables of the site file.
        base: Its folder, which its paths are relative to.
        learned: Figures from earlier flights, by vehicle name.
        understood: Result of `import_site_network`, if the network is already read, also without a depot.

    Raises:
        MissionsError: the network cannot be used, or its heights cannot be flown by; or the ground is unknown.
    """
    understood = understood or import_site_network(site.network, site.depot, base)
    if understood.lacks:
        raise missions.errors.NetworkError(f"{understood.network.source}: {understood.lacks}")
    network = add_structure_heights(understood.network, site.network.pylon_height_m)
    found: tuple[str, ...] = ()
    terrain = load_terrain(site, base, network)
    if terrain is not None:
        # A depot height of 0 that no file states is the reader's default for an unknown one.
        depot_known = network.frame.alt_m != 0.0 or (site.depot is not None and site.depot.alt_m is not None)
        network, found = add_ground_heights(network, terrain.elevation, depot_known=depot_known)
        found = (*terrain.elevation.remarks, *found)
    network = missions.with_heights(network, flat=site.inspection.heights == "flat")
    worth_a_look = (
        *describe_remarks(understood.found),
        *found,
        *missions.check_line_heights(network, tallest_m=site.network.tallest_m),
    )
    ground = build_site_model(site, network, worth_a_look, base, terrain)
    return replace(ground, learned=dict(learned), packs=load_site_packs(site, base))


def import_site_network(
    table: NetworkTable, depot: DepotTable | None, base: Path, *, anywhere: bool = False
) -> missions.NetworkImport:
    """Read the network of a site.

    Args:
        table: Its table in the site file.
        depot: Depot in the site file.
        base: Folder of the site file.
        anywhere: Whether a depot may be missing.

    Raises:
        NetworkError: the network cannot be used.
    """
    file = missions.default_network_path() if table.file == DEFAULT_NETWORK else base / table.file
    place = None if depot is None else (depot.lat_deg, depot.lon_deg, depot.alt_m)
    chosen = build_selection(table)
    return missions.import_network(file, chosen, depot=place, radius_m=table.radius_m, anywhere=anywhere)


def load_terrain(site: Site, base: Path, network: missions.Network) -> Terrain | None:
    """Read the ground around a network; None if the site names no raster.

    Raises:
        MissionsError: a raster cannot be used, or does not cover the ground there.
    """
    table = site.terrain
    if table is None:
        return None
    files = (table.files,) if isinstance(table.files, str) else table.files
    bases_m = site_parts.base_places_m(site, network.frame).values()
    box_m = reading_box_m(network, DETOUR_M, bases_m) if site.area else reading_box_m(network, bases_m=bases_m)
    reading = RasterOptions(network.frame, *box_m, table.vertical, table.uncertainty_m)
    return Terrain(read_elevation([base / file for file in files], reading), table.margin_m, table.line_margin_m)


def build_plan_terrain(ground: SiteModel) -> PlanTerrain | None:
    """Return a plan file's record of the ground that it was made over."""
    terrain = ground.terrain
    if terrain is None:
        return None
    known = terrain.elevation
    return PlanTerrain(
        known.source, known.digest, known.vertical, known.uncertainty_m, terrain.margin_m, terrain.line_margin_m
    )


def list_cameras(site: Site) -> tuple[str, ...]:
    """Return the names of the cameras that missions of a site trigger or point."""
    return tuple(dict.fromkeys(look.camera for look in site.look))


def build_selection(table: NetworkTable) -> missions.Selection:
    """Return the selection of a network file that a site asks for."""
    layers = (table.layer,) if isinstance(table.layer, str) else table.layer
    where = () if table.where is None else missions.parse_where(table.where)
    return missions.Selection(
        layers, where, table.crs, missions.MendingLimits(table.snap_m, table.max_span_m), table.encoding
    )


def describe_remarks(found: Sequence[missions.Remark]) -> Iterator[str]:
    """Yield a line for each kind of finding about a network file: the first one, and the number of them."""
    for matter in dict.fromkeys(one.matter.value for one in found):
        own = [one for one in found if one.matter.value == matter]
        more = f"; {len(own) - 1} more in 'faultline network'" if len(own) > 1 else ""
        yield f"{matter}: {own[0].words}{more}"


def build_site_model(
    site: Site,
    network: missions.Network,
    worth_a_look: tuple[str, ...] = (),
    base: Path = Path(),
    terrain: Terrain | None = None,
) -> SiteModel:
    """Return the data known before any vehicle answers, over a network with known heights.

    Raises:
        MissionsError: there is no room for pads or layers, or an area cannot be used.
        SiteError: a speed is more than the battery can give.
    """
    table, drone = site.inspection, drone_of(site)
    _check_speeds(site, drone)
    travel = travel_for(drone, table.transit_speed_m_s, table.speed_m_s, wind_m_s=table.wind_m_s)
    said = table.model_dump(include={one.name for one in fields(missions.Inspection)})
    inspection = missions.Inspection(**said, flat=network.flat)
    network, wished = add_viewpoints(network, site_parts.build_viewpoint_requests(site, network), table.standoff_m)
    left_out = find_left_out(site, network, {asset: wish.pylon for asset, wish in wished.items()})
    locked, directions = find_locks(site, network, left_out)
    names = tuple(vehicle.name for vehicle in site.vehicle)
    (areas, unused), (stated, alternates) = (
        site_parts.load_areas(site, base, network),
        site_parts.build_places(site, network.frame),
    )
    setup = missions.plan_flight_setup(
        network, names, inspection, stated=stated, areas=areas, terrain=terrain,
        bases=site_parts.find_base_pads(site, network),
    )  # fmt: skip
    pylons, higher = build_pylon_tasks(setup, wished)
    setup = replace(setup, looks=site_parts.build_looks(site, network, pylons))
    if areas or alternates:
        setup = apply_areas(setup, areas, alternates)
    # One line for all viewpoints that are flown higher than requested.
    raised = [f"{higher[0]}; so are {len(higher) - 1} more" if len(higher) > 1 else higher[0]] if higher else []
    remarks = (*worth_a_look, *unused, *raised)
    day_pads = site_parts.place_day_pads(site, setup, areas)
    return SiteModel(
        site, network, inspection, drone, travel, setup, terrain, remarks, day_pads=day_pads, left_out=left_out,
        locked=locked, directions=directions,
    )  # fmt: skip


def _check_speeds(site: Site, drone: Drone) -> None:
    most_m_s = top_speed_m_s(drone)
    wind_m_s = math.hypot(*site.inspection.wind_m_s)
    for key in ("speed_m_s", "transit_speed_m_s"):
        asked_m_s = getattr(site.inspection, key)
        if asked_m_s + wind_m_s > most_m_s:
            against = f" against a wind of {wind_m_s:.1f} m/s" if wind_m_s else ""
            raise SiteError(
                f"inspection.{key}: expected at most {max(0.0, most_m_s - wind_m_s):.1f} m/s, what the battery of a "
                f"{drone.name} can give{against}, got {asked_m_s:g}"
            )


def drone_of(site: Site) -> Drone:
    """Return the multicopter: the preset with the site file's changes."""
    changes = site.energy.model_dump(exclude={"drone", "chemistry", "packs"}, exclude_none=True)
    return replace(PRESETS[site.energy.drone], **changes)


def pack_of(site: Site) -> PackFacts:
    """Return the site file's pack data; the cells of a preset are a guess, and not included."""
    return PackFacts(cells=site.energy.cells, chemistry=site.energy.chemistry)


def budget_pct_of(known: PackHistory | None, drone: Drone, vehicle: VehicleTable) -> float:
    """Return the budget of a vehicle's route: the site's, or what its pack has."""
    if known is None:
        return vehicle.budget_pct
    return known.budget_pct(vehicle.budget_pct, vehicle.reserve_pct, drone.capacity_ah)


def find_empty_pct(known: PackHistory | None, drone: Drone, vehicle: VehicleTable) -> float:
    """Return the level that a vehicle's autopilot reports for an empty pack."""
    counts = not missions.dialect_for(vehicle.autopilot).rounds_twice  # PX4 without a capacity uses the voltage
    return 0.0 if known is None else known.empty_reading_pct(drone.capacity_ah, counts=counts)


def _with_pack(setup: VehicleSetup, known: PackHistory | None, drone: Drone, table: VehicleTable) -> VehicleSetup:
    if known is None:
        return setup
    empty_pct = find_empty_pct(known, drone, table)
    return replace(
        setup,
        budget_pct=budget_pct_of(known, drone, table),
        reserve_pct=table.reserve_pct + empty_pct,
        pack=replace(setup.pack, share=1.0 - empty_pct / 100.0, ohm=known.ohm),
        history=known,
        empty_pct=empty_pct,
    )


def build_first_task(
    ground: SiteModel, segments: Iterable[int] | None = None, without: Collection[str] = ()
) -> missions.Task:
    """Return the problem of a first plan, with the budgets of the site file.

    Args:
        ground: Data known before any vehicle answers.
        segments: Segments to inspect; all by default.
        without: Vehicles that do not fly.

    Raises:
        SiteError: none of these segments can be reached.
    """
    vehicles = [one for one in build_vehicles(ground) if one.name not in without]
    wanted, never = select_reachable(ground, segments)
    return replace(missions.build_open_task(build_pricing(ground), wanted, vehicles), unreachable=never)


def build_vehicles(ground: SiteModel) -> tuple[Vehicle, ...]:
    """Return every vehicle on its pad, with the usable charge of its pack."""
    return tuple(
        Vehicle(
            one.name, (0.0, 0.0), budget_pct_of(ground.packs.fitted.get(one.name), ground.drone, one),
            ground.learned[one.name].consumption.factor if one.name in ground.learned else 1.0,
        )
        for one in ground.site.vehicle
    )  # fmt: skip


def select_reachable(
    ground: SiteModel, segments: Iterable[int] | None = None
) -> tuple[tuple[int, ...], tuple[Unreachable, ...]]:
    """Return the reachable segments, ascending, and the others; of all segments by default.

    Segments that the site leaves out are in neither.

    Raises:
        SiteError: none can be reached.
    """
    wanted = set(range(len(ground.network.segments)) if segments is None else segments) - ground.left_out
    never = tuple(one for one in ground.setup.unreachable if one.segment in wanted)
    if never and len(never) == len(wanted):
        name = ground.network.segment_name(never[0].segment)
        raise SiteError(
            f"area: expected a segment that can be reached, found none of {len(never)}: {name} {never[0].why}"
        )
    return tuple(sorted(wanted - {one.segment for one in never})), never


def build_pricing(
    ground: SiteModel,
    setup: missions.FlightSetup | None = None,
    performances: Mapping[str, missions.Performance] = MappingProxyType({}),
    speeds_m_s: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> missions.Pricing:
    """Return the time and energy of flights.

    Args:
        ground: Data known before any vehicle answers.
        setup: Heights and pads; by default the chosen ones.
        performances: Performance by vehicle name from its own parameters, where they were read.
        speeds_m_s: Speeds in transit and along the line, by name, of vehicles that differ from [inspection].
    """
    table, setup = ground.site.inspection, setup or ground.setup
    usual_m_s = (table.transit_speed_m_s, table.speed_m_s)
    fastest_m_s = max(max(own_m_s) for own_m_s in (usual_m_s, *speeds_m_s.values()))
    power = build_steady_wind(ground.drone, fastest_m_s, table.wind_m_s)
    models = {}
    for vehicle in ground.site.vehicle:
        known, usual = ground.learned.get(vehicle.name), missions.dialect_for(vehicle.autopilot).performance
        if known is not None and known.performance is not None:
            usual = known.performance
        models[vehicle.name] = missions.FlightModel(
            performances.get(vehicle.name, usual), power, *speeds_m_s.get(vehicle.name, usual_m_s),
            AS_MODELLED if known is None else known.pace,
        )  # fmt: skip
    bases = {name: setup.base_of(name) for name in ground.names}
    pads_m = tuple(dict.fromkeys((pad.east_m, pad.north_m) for pad in (*setup.pads, *setup.day_pads)))
    slowest = max((model.performance for model in models.values()), key=lambda one: one.hold_s + one.settle_s)
    pylons, slow_m_s = setup.looks.pylons.items(), min(model.inspection_speed_m_s for model in models.values())
    longer = {segment: extra_time_s(look, slowest, slow_m_s) for segment, look in pylons}
    from_layer = {
        segment: extra_time_s(look, slowest, slow_m_s, in_layer=True) for segment, look in pylons if look.deepest_m
    }
    dialects = [missions.dialect_for(vehicle.autopilot) for vehicle in ground.site.vehicle]
    barred = {name: looks for name in ground.names if (looks := setup.looks.find_barred_segments(name))}
    return missions.Pricing(
        setup.tracks_up_m,
        bases,
        models,
        pads_m,
        column_radius_m(setup.layers.layer_m),
        # After a loss all others fly on as planned until it is detected; a silent link takes longest.
        max(link_timeout_s(ground.site, dialect) for dialect in dialects)
        + horizon_s(ground.site)
        + max((line_clear_time_s(setup, models[name], name) for name in setup.steps_m), default=0.0),
        kept_out=setup.kept_out,
        relief=setup.layers.relief,
        barred=barred,
        besides_s=longer,
        in_layer_s=from_layer,
        deep_m={segment: setup.looks.pylons[segment].deepest_m for segment in from_layer},
        steps_m=setup.steps_m,
        locked=ground.locked,
        directions=ground.directions,
    )


def horizon_s(site: Site) -> float:
    """Return how far ahead of a re-plan's start missions stay unchanged, in vehicle time."""
    fence_s = FENCE_ALLOWANCE_S if site.fence is not None and site.fence.enabled else 0.0
    return SEEN_S + fence_s + site.flight.speedup * (site.flight.solve_s + UPLOAD_ALLOWANCE_S)


def stall_s(speedup: float) -> float:
    """Return the shortest silence, in vehicle time, that a simulation can tell from a busy computer."""
    return STALL_REAL_S * speedup if speedup > 1 else 0.0


def link_timeout_s(site: Site, dialect: missions.Dialect, own: LinkFailsafe | None = None) -> float:
    """Return the silence after which a vehicle of a site is lost: see `effective_link_timeout_s`."""
    return effective_link_timeout_s(dialect, site.faults.link_timeout_s, stall_s(site.flight.speedup), own)


def radio_share_of(site: Site, name: str) -> RadioShare:
    """Return a vehicle's share of its radio, and of the radio on each of its links.

    Vehicles with the same connection share one; of several links of one vehicle the serial ports are radios.
    """
    links = next(table.links for table in site.vehicle if table.name == name)
    has_serial = any(link.scheme is Scheme.SERIAL for link in links)
    others_bytes_s = site.forward.bytes_s if site.forward.allow_orders else 0.0

    def share_of(link: Connection, *, first: bool) -> RadioShare:
        one_radio, is_serial = first and site.link.one_radio, link.scheme is Scheme.SERIAL
        names = tuple(table.name for table in site.vehicle if one_radio or link in table.links)
        carries_bytes_s = site.link.bytes_s if one_radio or is_serial or not has_serial else None
        is_radio = one_radio or is_serial
        return RadioShare(len(names), carries_bytes_s, site.signing is not None, is_radio, others_bytes_s, names)

    further = tuple((str(link), share_of(link, first=False)) for link in links[1:])
    return replace(share_of(links[0], first=True), further=further)


def build_limits(site: Site) -> Limits:
    """Return the thresholds of the watchpoints."""
    return Limits(**site.faults.model_dump(include={one.name for one in fields(Limits)}))


def name_routes(ground: SiteModel, task: missions.Task, plan: Plan) -> Mapping[str, tuple[int, ...]]:
    """Return each vehicle's visits of the network by its name."""
    routes = task.plan_to_network(plan).routes
    return {ground.names[route.vehicle]: route.visits for route in routes}


def build_paths(
    setup: missions.FlightSetup,
    routes: Mapping[str, tuple[int, ...]],
    vehicles: Mapping[str, VehicleSetup] = MappingProxyType({}),
) -> Mapping[str, missions.FlightPath]:
    """Return the flight path of every vehicle that has something to fly.

    Args:
        setup: Heights and pads.
        routes: Visits of the network, by vehicle name.
        vehicles: Their answers. A vehicle that did not report RTL on a lost link inspects in its own layer.
    """
    return build_first_paths(setup, routes, find_layer_bound_vehicles(vehicles))


def adjust_task_to_layers(ground: SiteModel, task: missions.Task, plan: Plan) -> missions.Task:
    """Return the task as its plan is flown: with the segments that vehicles inspect in their layers after all.

    A plan is made as if every vehicle descended to every line, which takes the longest.
    """
    if task.pricing is None or not ground.inspection.same_distance:
        return task
    routes, numbers = name_routes(ground, task, plan), {one: number for number, one in enumerate(task.segment_ids)}
    layered = dict(task.pricing.layered)
    for name, path in build_paths(ground.setup, routes).items():
        high = {segment_of(visit) for visit in routes[name]} - find_low_segments(path, routes[name])
        layered[name] = layered.get(name, frozenset()) | {numbers[segment] for segment in high}
    pricing = replace(task.pricing, layered=layered)
    return replace(task, instance=missions.build_priced_instance(pricing, task.instance.vehicles), pricing=pricing)


def build_context(
    ground: SiteModel,
    setup: missions.FlightSetup,
    task: missions.Task,
    own: Mapping[str, LinkFailsafe] = MappingProxyType({}),
    performances: Mapping[str, missions.Performance] = MappingProxyType({}),
) -> Context:
    """Return the context of all decisions in flight.

    Args:
        ground: Data known before any vehicle answers.
        setup: Heights and pads.
        task: Problem of the first plan.
        own: Each vehicle's own action on a lost link, by name, where it was read.
        performances: As in `build_pricing`.
    """
    site = ground.site
    vehicles: dict[str, VehicleSetup] = {}
    for table in site.vehicle:
        dialect, pad = missions.dialect_for(table.autopilot), setup.pad_of(table.name)
        failsafe, known = own.get(table.name), ground.learned.get(table.name)
        one = VehicleSetup(
            name=table.name,
            sysid=table.sysid,
            dialect=dialect,
            budget_pct=table.budget_pct,
            reserve_pct=table.reserve_pct,
            link_timeout_s=link_timeout_s(site, dialect, failsafe),
            pad_m=(pad.east_m, pad.north_m),
            day_pads_m=(
                pads_m := tuple((one.east_m, one.north_m) for one in setup.day_pads if one.vehicle == table.name)
            ),
            rallies=bool(pads_m) and site.fence is not None and site.fence.gives_rally,
            failsafe_s=failsafe.after_s if failsafe is not None and failsafe.acts else None,
            returns=failsafe is not None and failsafe.returns,
            holds_s=failsafe.holds_s if failsafe is not None else 0.0,
            prior=NO_PRIOR if known is None else known.prior,
            start=UNKNOWN if known is None else known.start,
            pack=pack_of(site),
            radio=radio_share_of(site, table.name),
        )
        others = {label: _with_pack(one, known, ground.drone, table) for label, known in ground.packs.labelled.items()}
        first = _with_pack(one, ground.packs.fitted.get(table.name), ground.drone, table)
        vehicles[table.name] = replace(first, packs={"": one, **others})
    return Context(
        frame=setup.frame,
        setup=setup,
        vehicles=vehicles,
        limits=build_limits(site),
        drone=ground.drone,
        draws_pct_s=power_draw_table_pct_s(ground.drone),
        wind_m_s=site.inspection.wind_m_s,
        pricing=build_pricing(ground, setup, performances),
        wanted=frozenset(task.segment_ids),
        unreachable=task.unreachable,
        corridor_m=site.inspection.corridor_m,
        inspection_speed_m_s=site.inspection.speed_m_s,
        fly_again=RelaunchPolicy(site.flight.fly_again),
        pilot_grace_s=site.flight.pilot_grace_s,
        pilot_returns=site.flight.pilot_return == "auto",
        infers=site.flight.inferred == "count",
        offer_s=site.flight.offer_s,
        horizon_s=horizon_s(site),
        fencing=None if site.fence is None else FenceRules(**site.fence.model_dump()),
        camera_home=site.faults.camera == "home",
    )
