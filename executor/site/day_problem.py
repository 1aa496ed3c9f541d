"""Days of many sorties from a site file: its bases, hours and packs as a planning problem, and the plan made for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from executor.errors import SiteError
from executor.site.site_bases import base_place, base_tables
from executor.site.site_model import (
    SiteModel,
    build_plan_terrain,
    build_pricing,
    build_vehicles,
    select_reachable,
)
from executor.site.site_planning import PlanRequest
from executor.site.tables.day_tables import BaseTable, DayTable, parse_clock_s
from missions import Base, BasePlace, DayPlanFile, Pricing, SolverRecord, build_plan_segment
from missions.geo import FloatArray
from missions.setup import LOWEST_FLIGHT_M
from missions.shortest_ways import build_visibility_graph
from missions.validation import Pair
from planner import Progress, top_speed_m_s
from planner.sorties import (
    Objective,
    SortieEvaluation,
    SortiePlan,
    SortieVehicle,
    solve_sorties,
    subtract_quiet_times,
)

DAY_S = 86_400.0


def build_day_problem(ground: SiteModel, segments: Iterable[int] | None = None) -> DayPlanFile:
    """Return the days of a site without a plan: nobody flies, every segment that can be reached is uncovered.

    Args:
        ground: The site.
        segments: What is to be inspected; everything if not given.

    Raises:
        SiteError: a base, a speed or a name cannot be used, or none of the segments can be reached.
    """
    table = ground.site.day or DayTable()
    tables = base_tables(ground.site, ground.network.frame)
    places = tuple(base_place(ground.network, base, ground.terrain) for base in tables)
    at_m = [ground.network.frame.to_local_m(place.lat_deg, place.lon_deg) for place in places]
    days = tuple(
        (DAY_S * day + parse_clock_s(table.begin), DAY_S * day + parse_clock_s(table.end)) for day in range(table.days)
    )
    wanted, never = select_reachable(ground, segments)
    pads = tuple(
        tuple(
            ground.setup.base_of(name) if name in base.vehicles else _build_pad(ground, name, place, at)
            for base, place, at in zip(tables, places, at_m, strict=True)
        )
        for name in ground.names
    )  # fmt: skip
    vehicles = tuple(_build_sortie_vehicles(ground, table, tables, days))
    _check_landings(ground, vehicles, pads)
    pricing = build_pricing(ground, speeds_m_s=_collect_speeds_m_s(ground))
    return DayPlanFile(
        frame=ground.network.frame,
        segments=tuple(build_plan_segment(ground.network, number) for number in wanted),
        pricing=_bar_segments(ground, table, pricing).select_segments(wanted, ground.names),
        bases=tuple(
            replace(place, turnaround_s=base.turnaround_s, packs=base.packs, recharge_s=base.recharge_s)
            for base, place in zip(tables, places, strict=True)
        ),
        vehicles=vehicles,
        pads=pads,
        days=days,
        transfer_s=_compute_transfers_s(table, [place.name for place in places], at_m),
        stagger_s=table.stagger_s,
        plan=SortiePlan(((),) * len(vehicles), tuple(range(len(wanted)))),
        evaluation=SortieEvaluation(0.0, 0.0, 0, ((),) * len(vehicles), ((),) * len(vehicles), ()),
        objective=Objective.FINISH,
        solved=SolverRecord("search", 0, 0.0),
        unreachable=never,
        terrain=build_plan_terrain(ground),
        autopilots={one.name: one.autopilot for one in ground.site.vehicle},
    )


def _build_sortie_vehicles(
    ground: SiteModel, table: DayTable, tables: Sequence[BaseTable], days: Sequence[Pair]
) -> Iterator[SortieVehicle]:
    """Yield who flies: from which base, on what budget and when."""
    for own in build_vehicles(ground):
        home = next(number for number, base in enumerate(tables) if own.name in base.vehicles)
        lands = tuple(range(len(tables))) if table.lands == "any" else (home,)
        quiet = [
            (DAY_S * day + parse_clock_s(one.begin), DAY_S * day + parse_clock_s(one.end))
            for one in table.quiet if not one.vehicles or own.name in one.vehicles for day in range(table.days)
        ]  # fmt: skip
        yield SortieVehicle(
            own.name, home, own.budget_pct, subtract_quiet_times(days, quiet), lands, 0, own.consumption, days[0][0]
        )


def solve_day(
    content: DayPlanFile,
    wanted: PlanRequest,
    spares: Collection[str] = (),
    on_progress: Callable[[Progress], None] | None = None,
) -> DayPlanFile:
    """Return days with a plan, in which nothing is planned for those who stand by."""
    instance = content.build_instance()
    flies = np.array([[own.name not in spares] for own in instance.vehicles])
    found = solve_sorties(
        replace(instance, able=instance.able & flies), stop=wanted.build_stop_rule(), objective=wanted.objective,
        seed=wanted.seed, starts=wanted.threads, on_progress=on_progress,
    )  # fmt: skip
    return replace(
        content, plan=found.plan, evaluation=found.evaluation, objective=wanted.objective,
        solved=SolverRecord("search", wanted.seed, found.seconds),
    )  # fmt: skip


def list_spares(ground: SiteModel) -> list[str]:
    """Return the vehicles of a site that stand by on its days."""
    return [] if ground.site.day is None else [one.name for one in ground.site.day.vehicle if one.spare]


def _check_landings(ground: SiteModel, vehicles: Sequence[SortieVehicle], pads: Sequence[Sequence[Base]]) -> None:
    """Refuse bases of others where a vehicle may land, and that are in an area or that no way leads to."""
    for row, own in enumerate(vehicles):
        areas = ground.setup.obstacles_for(own.name).areas
        for base in own.lands if areas else ():
            begin_m, end_m = (np.array(pads[row][number].place_m[:2]) for number in (own.base, base))
            name = base_tables(ground.site, ground.network.frame)[base].name
            for area in ground.setup.areas_at(own.name, pads[row][base].place_m[:2]):
                kept = f"{area.margin_m:g} m or more outside of area {area.name!r}"
                raise SiteError(f"base {name}: expected {kept}, got a place in it")
            if np.isinf(build_visibility_graph(areas).distances_m(begin_m, end_m[np.newaxis])[0]):
                raise SiteError(f"base {name}: expected a way from the pad of {own.name}, got none around the areas")


def _build_pad(ground: SiteModel, vehicle: str, place: BasePlace, at_m: tuple[float, float]) -> Base:
    layers = ground.setup.layers
    up_m = layers.surface.height_m(*at_m)
    climb_m = up_m + layers.offset_m(vehicle) - ground.network.frame.up_m(place.alt_m)
    if climb_m < LOWEST_FLIGHT_M:
        raise SiteError(
            f"base {place.name}: expected flights {LOWEST_FLIGHT_M:g} m or more over it, got {climb_m:.1f} m: "
            f"its alt_m {place.alt_m:.0f} or the site's heights are wrong"
        )
    return Base((*at_m, up_m), climb_m)


def _collect_speeds_m_s(ground: SiteModel) -> dict[str, tuple[float, float]]:
    """Return at which speeds, in transit and along the line, those fly who differ."""
    inspection, found = ground.site.inspection, {}
    most_m_s = top_speed_m_s(ground.drone) - math.hypot(*inspection.wind_m_s)
    for index, other in enumerate(ground.site.day.vehicle if ground.site.day is not None else ()):
        asked = {"transit_speed_m_s": other.transit_speed_m_s, "speed_m_s": other.speed_m_s}
        for key, asked_m_s in asked.items():
            if asked_m_s is not None and asked_m_s > most_m_s:
                raise SiteError(
                    f"day.vehicle[{index}].{key}: expected at most {most_m_s:.1f} m/s, what the battery of a "
                    f"{ground.drone.name} can give, got {asked_m_s:g}"
                )
        found[other.name] = (
            other.transit_speed_m_s or inspection.transit_speed_m_s, other.speed_m_s or inspection.speed_m_s
        )  # fmt: skip
    return found


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
    times_s = np.full((len(names), len(names)), np.inf)
    for (one, other), seconds in roads.items():
        times_s[one, other] = times_s[other, one] = seconds
    np.fill_diagonal(times_s, 0.0)
    for middle in range(len(names)):  # Floyd, Warshall 1962
        np.minimum(times_s, times_s[:, [middle]] + times_s[middle], out=times_s)
    return times_s


def _bar_segments(ground: SiteModel, table: DayTable, pricing: Pricing) -> Pricing:
    """Return a pricing in which vehicles are given no other segments than [[day.vehicle]] names for them."""
    names = [ground.network.segment_name(number) for number in range(len(ground.network.segments))]
    barred = dict(pricing.barred)
    for index, other in enumerate(table.vehicle):
        for name in other.segments:
            if name not in names:
                raise SiteError(
                    f"day.vehicle[{index}].segments: expected names of the network's segments, such as '{names[0]}', "
                    f"got '{name}'"
                )
        if other.segments:
            others = frozenset(number for number, name in enumerate(names) if name not in other.segments)
            barred[other.name] = barred.get(other.name, frozenset()) | others
    return replace(pricing, barred=barred)
