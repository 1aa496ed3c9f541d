"""Days of many sorties from a site file: its bases, hours and packs as a planning problem, and the plan made for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from executor.errors import SiteError
from executor.site.site_file import Site
from executor.site.site_model import SiteModel, budget_pct_of, build_pricing, consumption_factor_of
from executor.site.tables.day_tables import BaseTable, DayTable, parse_clock_s
from missions import Base, DayPlanFile, PlanBase, SolverRecord, build_plan_segment
from missions.day_plan import Window
from missions.geo import FloatArray
from missions.setup import LOWEST_FLIGHT_M
from planner import Progress, StopRule, build_steady_wind, top_speed_m_s
from planner.road_graph import build_road_graph
from planner.sorties import (
    Objective,
    SortieEvaluation,
    SortiePlan,
    SortieVehicle,
    solve_sorties,
    subtract_quiet_times,
)

DAY_S = 86_400.0
DEPOT = "depot"
"""The only base of a site that names none."""
_NOT_BY_DAY: tuple[tuple[str, Callable[[Site], bool], str], ...] = (
    ("[[area]]", lambda site: bool(site.area), "its sorties are priced straight, not around areas"),
    ("[[look]]", lambda site: bool(site.look), "it knows neither what cameras see nor the time that viewpoints take"),
    ("[terrain]", lambda site: site.terrain is not None, "its sorties are priced as if nothing rose between the lines"),
    (
        "inspection.same_distance", lambda site: site.inspection.same_distance,
        "its sorties are priced in their layers",
    ),
)  # fmt: skip
"""What plans of single flights respect and plans of days do not: the table, whether a site has it, and why."""


@dataclass(frozen=True, slots=True)
class DayPlanRequest:
    """What a day's plan is to be."""

    objective: Objective
    stop: StopRule
    seed: int
    starts: int
    spares: frozenset[str] = frozenset()
    """Vehicles for which nothing is planned."""


def spares_of(ground: SiteModel) -> frozenset[str]:
    """Return the vehicles of a site that stand by."""
    return (
        frozenset() if ground.site.day is None else frozenset(one.name for one in ground.site.day.vehicle if one.spare)
    )


def check_day_site(site: Site) -> None:
    """Refuse a day of a site that asks for more than plans of days respect.

    Raises:
        SiteError: one line that names the first such table.
    """
    for table, has_it, why in _NOT_BY_DAY:
        if has_it(site):
            raise SiteError(f"{table}: expected none in the site of a day plan: {why}; plan single flights instead")


def base_tables(ground: SiteModel) -> tuple[BaseTable, ...]:
    """Return the bases of a site; the depot where it names none."""
    return ground.site.base or (_build_depot(ground),)


def build_day_problem(ground: SiteModel, segments: Sequence[int] | None = None) -> DayPlanFile:
    """Return the days of a site without a plan: nobody flies, every segment is uncovered.

    Args:
        ground: The site.
        segments: What is to be inspected; everything if not given.

    Raises:
        SiteError: a base, a speed or a name cannot be used, or the site has a table that days do not respect.
    """
    site, table = ground.site, ground.site.day or DayTable()
    check_day_site(site)
    tables = base_tables(ground)
    places = tuple(base_place(ground, base) for base in tables)
    at_m = [ground.network.frame.to_local_m(place.lat_deg, place.lon_deg) for place in places]
    days = tuple(
        (DAY_S * day + parse_clock_s(table.begin), DAY_S * day + parse_clock_s(table.end)) for day in range(table.days)
    )
    names = [place.name for place in places]
    wanted = tuple(range(len(ground.network.segments)) if segments is None else sorted(segments))
    pricing = build_pricing(ground).select_segments(wanted, ground.names)
    pads = tuple(
        tuple(
            ground.setup.base_of(one.name) if one.pad is not None and one.name in base.vehicles
            else _build_pad(ground, one.name, place, at)
            for base, place, at in zip(tables, places, at_m, strict=True)
        )
        for one in site.vehicle
    )  # fmt: skip
    vehicles = tuple(_vehicles(ground, table, tables, days))
    models = dict(pricing.models)
    fastest_m_s = max(site.inspection.speed_m_s, site.inspection.transit_speed_m_s, *_collect_speeds_m_s(site, ground))
    power = build_steady_wind(ground.drone, fastest_m_s, site.inspection.wind_m_s)
    for other in table.vehicle:
        model = models[other.name]
        models[other.name] = replace(
            model,
            inspection_speed_m_s=other.speed_m_s or model.inspection_speed_m_s,
            transit_speed_m_s=other.transit_speed_m_s or model.transit_speed_m_s,
        )
    models = {name: replace(model, power=power) for name, model in models.items()}
    nothing = SortiePlan(((),) * len(vehicles), tuple(range(len(wanted))))
    return DayPlanFile(
        frame=ground.network.frame,
        segments=tuple(build_plan_segment(ground.network, number) for number in wanted),
        pricing=replace(
            pricing, models=models, pads_m=(), column_m=0.0,
            bases={own.name: pads[row][own.base] for row, own in enumerate(vehicles)},
        ),
        bases=tuple(
            replace(place, turnaround_s=base.turnaround_s, packs=base.packs, recharge_s=base.recharge_s)
            for base, place in zip(tables, places, strict=True)
        ),
        vehicles=vehicles,
        pads=pads,
        days=days,
        transfer_s=_compute_transfers_s(table, names, at_m),
        stagger_s=table.stagger_s,
        able=_find_able_vehicles(ground, table)[:, list(wanted)],
        plan=nothing,
        evaluation=SortieEvaluation(0.0, 0.0, 0, ((),) * len(vehicles), ((),) * len(vehicles), ()),
        objective=Objective.FINISH,
        solved=SolverRecord("search", 0, 0.0),
        autopilots={one.name: one.autopilot for one in site.vehicle},
    )  # fmt: skip


def _vehicles(
    ground: SiteModel, table: DayTable, tables: Sequence[BaseTable], days: Sequence[Window]
) -> Iterator[SortieVehicle]:
    """Yield who flies: from which base, on what budget and when."""
    for one in ground.site.vehicle:
        home = next(number for number, base in enumerate(tables) if one.name in base.vehicles)
        lands = tuple(range(len(tables))) if table.lands == "any" else (home,)
        quiet = [
            (DAY_S * day + parse_clock_s(own.begin), DAY_S * day + parse_clock_s(own.end))
            for own in table.quiet if not own.vehicles or one.name in own.vehicles for day in range(table.days)
        ]  # fmt: skip
        budget_pct = budget_pct_of(ground.packs.fitted.get(one.name), ground.drone, one)
        yield SortieVehicle(
            one.name, home, budget_pct, subtract_quiet_times(days, quiet), lands, 0,
            consumption_factor_of(ground, one.name),
            days[0][0],
        )  # fmt: skip


def solve_day(
    content: DayPlanFile, wanted: DayPlanRequest, on_progress: Callable[[Progress], None] | None = None
) -> DayPlanFile:
    """Return days with a plan."""
    instance = content.build_instance()
    flies = np.array([[own.name not in wanted.spares] for own in instance.vehicles])
    found = solve_sorties(
        replace(instance, able=instance.able & flies),
        stop=wanted.stop, objective=wanted.objective, seed=wanted.seed, starts=wanted.starts, on_progress=on_progress,
    )  # fmt: skip
    return replace(
        content, plan=found.plan, evaluation=found.evaluation, objective=wanted.objective,
        solved=SolverRecord("search", wanted.seed, found.seconds),
    )  # fmt: skip


def _build_depot(ground: SiteModel) -> BaseTable:
    frame = ground.network.frame
    return BaseTable(name=DEPOT, lat_deg=frame.lat_deg, lon_deg=frame.lon_deg, alt_m=frame.alt_m, vehicles=ground.names)


def base_place(ground: SiteModel, base: BaseTable) -> PlanBase:
    """Return where a base is, its height taken from the nearest pylon where nobody says it."""
    alt_m = base.alt_m
    if alt_m is None:
        at_m = np.array(ground.network.frame.to_local_m(base.lat_deg, base.lon_deg))
        ends_m = ground.network.ends_m.reshape(-1, 2)
        nearest = int(np.hypot(*(ends_m - at_m).T).argmin())
        segment = ground.network.segments[nearest // 2]
        elevation_m = ground.network.pylons[segment.b if nearest % 2 else segment.a].elevation_m
        alt_m = ground.network.frame.alt_m if elevation_m is None else elevation_m
    return PlanBase(base.name, base.lat_deg, base.lon_deg, alt_m)


def _build_pad(ground: SiteModel, vehicle: str, place: PlanBase, at_m: tuple[float, float]) -> Base:
    layers = ground.setup.layers
    up_m = layers.surface.height_m(*at_m)
    climb_m = up_m + layers.offset_m(vehicle) - ground.network.frame.up_m(place.alt_m)
    if climb_m < LOWEST_FLIGHT_M:
        raise SiteError(
            f"base {place.name}: expected flights {LOWEST_FLIGHT_M:g} m or more over it, got {climb_m:.1f} m: "
            f"its alt_m {place.alt_m:.0f} or the site's heights are wrong"
        )
    return Base((*at_m, up_m), climb_m)


def _collect_speeds_m_s(site: Site, ground: SiteModel) -> list[float]:
    most_m_s = top_speed_m_s(ground.drone) - math.hypot(*site.inspection.wind_m_s)
    speeds = []
    for index, other in enumerate(site.day.vehicle if site.day is not None else ()):
        for key in ("speed_m_s", "transit_speed_m_s"):
            asked_m_s = getattr(other, key)
            if asked_m_s is not None:
                if asked_m_s > most_m_s:
                    raise SiteError(
                        f"day.vehicle[{index}].{key}: expected at most {most_m_s:.1f} m/s, what the battery of a "
                        f"{ground.drone.name} can give, got {asked_m_s:g}"
                    )
                speeds.append(asked_m_s)
    return speeds or [0.0]


def _compute_transfers_s(table: DayTable, names: list[str], at_m: list[tuple[float, float]]) -> FloatArray:
    """Return seconds from base to base: roads that are named, straight distances for the others, the shortest way."""
    number = {name: place for place, name in enumerate(names)}
    roads: dict[tuple[int, int], float] = {}
    if table.road_m_s is not None:
        roads = {pair: math.dist(at_m[pair[0]], at_m[pair[1]]) / table.road_m_s
                 for pair in combinations(range(len(names)), 2)}  # fmt: skip
    for road in table.road:
        one, other = sorted(number[name] for name in road.between)
        roads[one, other] = 60.0 * road.minutes
    edges = [(one, other, seconds) for (one, other), seconds in roads.items() if one != other]
    return build_road_graph(len(names), edges).times_s


def _find_able_vehicles(ground: SiteModel, table: DayTable) -> npt.NDArray[np.bool_]:
    names = [ground.network.segment_name(number) for number in range(len(ground.network.segments))]
    able = np.ones((len(ground.names), len(names)), dtype=np.bool_)
    for index, other in enumerate(table.vehicle):
        if not other.segments:
            continue
        for name in other.segments:
            if name not in names:
                raise SiteError(
                    f"day.vehicle[{index}].segments: expected names of the network's segments, such as '{names[0]}', "
                    f"got '{name}'"
                )
        able[ground.names.index(other.name)] = [name in other.segments for name in names]
    return able
