"""Plan days of many sorties from a site's bases, hours and packs, and turn the plan into flights."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from executor.core.context import DayRules, PackRules
from executor.core.formatting import format_count
from executor.core.state.vehicle_parts import PlannedSortie
from executor.errors import SiteError
from executor.site import site_model
from executor.site.flight_keys import BaseTable, DayTable, parse_clock_s
from executor.site.site_model import (
    SiteModel,
    build_plan_terrain,
    build_pricing,
    build_vehicles,
    list_cameras,
    select_reachable,
)
from executor.site.site_parts import AT_DEPOT_M, base_place, base_tables
from executor.site.site_planning import PlanRequest, build_site_plan_file, check_plan_fits, check_same_segments
from executor.site.span_names import SpanNames
from missions import (
    Base,
    BasePlace,
    DayPlanFile,
    FlightSetup,
    Pad,
    PlanFile,
    PlanFileError,
    Pricing,
    SolverRecord,
    Task,
    build_plan_segment,
    build_priced_instance,
    check_plan,
)
from missions.flight_model import UNKNOWN
from missions.plan_file import FORMAT
from missions.plan_parts import DayCost, DayVehicle, PlanRoute
from missions.pricing import price_fleet
from missions.setup import LOWEST_FLIGHT_M
from missions.shortest_ways import build_visibility_graph
from missions.validation import Pair
from planner import Cost, Plan, Progress, Route, Vehicle, segment_of, top_speed_m_s
from planner.sorties import (
    Objective,
    SortieInstance,
    build_sorties_after_loss,
    evaluate_sorties,
    replan_sorties,
    solve_sorties,
    subtract_quiet_times,
)

if TYPE_CHECKING:
    from planner.sorties.sortie_annealing import MoveTable

DAY_S = 86_400.0


def build_day_problem(ground: SiteModel, segments: Iterable[int] | None = None) -> DayPlanFile:
    """Return the days of a site without sorties: every reachable segment is uncovered.

    Args:
        ground: The site.
        segments: Segments to inspect; all by default.

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
    pads = [
        [
            ground.setup.base_of(name) if name in base.vehicles else _build_pad(ground, name, place, at)
            for base, place, at in zip(tables, places, at_m, strict=True)
        ]
        for name in ground.names
    ]  # fmt: skip
    vehicles = tuple(_build_day_vehicles(ground, table, tables, days, pads))
    _check_landings(ground, vehicles, {place.name: at for place, at in zip(places, at_m, strict=True)})
    pricing = build_pricing(ground, add_day_pads(ground.setup, ground.day_pads), speeds_m_s=_collect_speeds_m_s(ground))
    return DayPlanFile(
        format=FORMAT,
        frame=ground.network.frame,
        bases=places,
        vehicles=vehicles,
        routes=(),
        uncovered=tuple(wanted),
        **asdict(SolverRecord("search", 0, 0.0)),
        pricing=_bar_segments(ground, table, pricing).select_segments(wanted, ground.names),
        unreachable=never,
        terrain=build_plan_terrain(ground),
        cameras=list_cameras(ground.site),
        segments=tuple(build_plan_segment(ground.network, number) for number in wanted),
        days=days,
        stagger_s=table.stagger_s,
        transfers_s=_compute_transfers_s(table, [place.name for place in places], at_m),
        cost=DayCost(Objective.FINISH.value, 0.0),
        finish_s=0.0,
        flight_s=0.0,
    )


def _build_day_vehicles(
    ground: SiteModel,
    table: DayTable,
    tables: Sequence[BaseTable],
    days: Sequence[Pair],
    pads: Sequence[Sequence[Base]],
) -> Iterator[DayVehicle]:
    """Yield the vehicles that fly: base, budget and hours of each."""
    names = tuple(base.name for base in tables)
    autopilots = {one.name: one.autopilot for one in ground.site.vehicle}
    for own, at in zip(build_vehicles(ground), pads, strict=True):
        home = next(number for number, base in enumerate(tables) if own.name in base.vehicles)
        quiet = [
            (DAY_S * day + parse_clock_s(one.begin), DAY_S * day + parse_clock_s(one.end))
            for one in table.quiet if not one.vehicles or own.name in one.vehicles for day in range(table.days)
        ]  # fmt: skip
        yield DayVehicle(
            name=own.name, start_m=at[home].place_m[:2], budget_pct=own.budget_pct, consumption=own.consumption,
            autopilot=autopilots[own.name], base=names[home], lands=names if table.lands == "any" else (names[home],),
            hours=subtract_quiet_times(days, quiet), pads=tuple(at),
        )  # fmt: skip


def solve_day(
    content: DayPlanFile,
    wanted: PlanRequest,
    spares: Collection[str] = (),
    on_progress: Callable[[Progress], None] | None = None,
) -> DayPlanFile:
    """Return days with a plan, without sorties for spares."""
    instance = content.build_instance()
    flies = np.array([[own.name not in spares] for own in instance.vehicles])
    found = solve_sorties(
        replace(instance, able=instance.able & flies), stop=wanted.build_stop_rule(), objective=wanted.objective,
        seed=wanted.seed, starts=wanted.threads, on_progress=on_progress,
    )  # fmt: skip
    planned = content.with_plan(found.plan, found.evaluation, wanted.objective)
    return replace(planned, **asdict(SolverRecord("search", wanted.seed, found.seconds)))


@dataclass(frozen=True, slots=True)
class PricedDays:
    """Problem of a day plan, with all its moves priced."""

    instance: SortieInstance
    table: MoveTable


def price_days(content: DayPlanFile) -> PricedDays:
    """Return the priced problem for every re-plan of these days."""
    # Imported here only: it loads the kernels.
    from planner.sorties.sortie_annealing import build_move_table

    instance = content.build_instance()
    return PricedDays(instance, build_move_table(instance))


def preview_day_loss(
    content: DayPlanFile, lost: str, at_s: float, *, seed: int, priced: PricedDays | None = None
) -> tuple[DayPlanFile, bool]:
    """Re-plan days after one vehicle is lost for good; return also whether everything is inspected.

    Segments count once the lost vehicle has landed with them, sorties under way are completed, and spares fly.

    Args:
        content: The plan.
        lost: The vehicle's name.
        at_s: Time of the loss, in seconds from the first midnight.
        seed: Random seed of the search.
        priced: Result of `price_days`, if already computed.

    Raises:
        PlanFileError: the plan has no such vehicle.
    """
    if lost not in content.names:
        raise PlanFileError(f"{content.source}: --lost: expected one of {', '.join(content.names)}, got {lost}")
    began_s = time.perf_counter()
    priced = priced or price_days(content)
    left = build_sorties_after_loss(priced.instance, content.plan.routes, {content.names.index(lost): at_s}, at_s)
    found = replan_sorties(left, seed, priced.table)
    flown = Plan(
        tuple(sorted((*left.kept, *found.routes), key=lambda one: (one.vehicle, one.start_s))), found.uncovered
    )
    locked = {segment: keeper for segment, keeper in content.pricing.locked.items() if keeper != lost}
    days = replace(content, pricing=replace(content.pricing, locked=locked), windows=())
    made = days.with_plan(flown, evaluate_sorties(priced.instance, flown), Objective(content.cost.name))
    solved = SolverRecord("search", seed, time.perf_counter() - began_s)
    return replace(made, **asdict(solved)), not found.uncovered


def list_spares(ground: SiteModel) -> list[str]:
    """Return the spares of a site's days."""
    return [] if ground.site.day is None else [one.name for one in ground.site.day.vehicle if one.spare]


def _check_landings(
    ground: SiteModel, vehicles: Sequence[DayVehicle], bases_m: Mapping[str, tuple[float, float]]
) -> None:
    """Refuse bases where a vehicle may land that lie in an area or cannot be reached from its pad."""
    for own in vehicles:
        areas, pads = ground.setup.obstacles_for(own.name).areas, dict(zip(bases_m, own.pads, strict=True))
        for name in own.lands if areas else ():
            begin_m, end_m = np.array(own.start_m), np.array(pads[name].place_m[:2])
            for area in ground.setup.areas_at(own.name, pads[name].place_m[:2] if name == own.base else bases_m[name]):
                kept = f"{area.margin_m:g} m or more outside of area {area.name!r}"
                raise SiteError(f"base {name}: expected {kept}, got a place in it")
            if build_visibility_graph(areas).is_cut_off(begin_m, end_m[np.newaxis])[0]:
                raise SiteError(f"base {name}: expected a path from the pad of {own.name}, got none around the areas")


def _build_pad(ground: SiteModel, vehicle: str, place: BasePlace, at_m: tuple[float, float]) -> Base:
    layers, own = ground.setup.layers, ground.day_pads.get(vehicle, {}).get(place.name)
    if own is not None:
        place, at_m = replace(place, alt_m=own.alt_m), (own.east_m, own.north_m)
    up_m = layers.surface.height_m(*at_m)
    climb_m = up_m + layers.offset_m(vehicle) - ground.network.frame.up_m(place.alt_m)
    if climb_m < LOWEST_FLIGHT_M:
        raise SiteError(
            f"base {place.name}: expected flights {LOWEST_FLIGHT_M:g} m or more over it, got {climb_m:.1f} m: "
            f"its alt_m {place.alt_m:.0f} or the site's heights are wrong"
        )
    return Base((*at_m, up_m), climb_m)


def _collect_speeds_m_s(ground: SiteModel) -> dict[str, tuple[float, float]]:
    """Return the speeds of vehicles that differ from the site's, in transit and along the line, by name."""
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


def _compute_transfers_s(
    table: DayTable, names: list[str], at_m: list[tuple[float, float]]
) -> tuple[tuple[float | None, ...], ...]:
    """Return driving times from base to base by the shortest route, in seconds; None if there is none.

    Listed roads count as given, all other pairs by straight distance.
    """
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
    return tuple(tuple(one if math.isfinite(one) else None for one in row) for row in times_s.tolist())


def _bar_segments(ground: SiteModel, table: DayTable, pricing: Pricing) -> Pricing:
    """Return a pricing in which vehicles get only the segments that [[day.vehicle]] lists for them."""
    names, barred, spares = SpanNames(ground.network), dict(pricing.barred), list_spares(ground)
    for index, lock in enumerate(ground.site.lock):
        if lock.vehicle in spares:
            raise SiteError(
                f"lock[{index}].vehicle: expected one that is planned for, got '{lock.vehicle}', a spare of [day]"
            )
    for index, other in enumerate(table.vehicle):
        if other.segments:
            own = names.find(other.segments, f"day.vehicle[{index}].segments")
            others = frozenset(range(len(ground.network.segments))) - own
            barred[other.name] = barred.get(other.name, frozenset()) | others
    return replace(pricing, barred=barred)


SAME_M_S = 1e-6
"""Difference below which two speeds are equal."""
_SPEEDS = {"inspection_speed_m_s": "speed_m_s", "transit_speed_m_s": "transit_speed_m_s"}
"""Speeds in a vehicle's flight model, by site key."""


def build_first_sorties_plan(content: DayPlanFile, ground: SiteModel) -> PlanFile:
    """Return the plan of a day's first sorties, with the day plan's prices; all other segments are left for later ones.

    Raises:
        PlanFileError: the day plan is another site's, or cannot be flown: one line with the place.
    """
    _check_day_plan(content, ground)
    content = replace(content, pricing=_price_first_landings(content))
    fleet = {own.name: own for own in content.vehicles}
    vehicles = [Vehicle(name, (0.0, 0.0), fleet[name].budget_pct, fleet[name].consumption) for name in ground.names]
    task = Task(
        build_priced_instance(content.pricing, vehicles), tuple(content.positions), content.pricing, content.unreachable
    )
    first = {name: content.visits_of(own[0]) if own else () for name, own in _select_first_day(content).items()}
    flown = {segment_of(visit) for visits in first.values() for visit in visits}
    plan = Plan(
        tuple(Route(number, first[name]) for number, name in enumerate(ground.names)),
        tuple(one for one in range(len(content.segments)) if one not in flown),
    )
    task = site_model.adjust_task_to_layers(ground, task, plan)
    made = build_site_plan_file(ground, task, plan, Cost.MINMAX, content.solved)
    made = replace(made, terrain=content.terrain)
    check_plan_fits(made, ground, content.source)
    return made


def select_day(content: DayPlanFile, number: int, inspected: Collection[int], names: Collection[str]) -> DayPlanFile:
    """Return the rest of one day of a plan, as a plan of that day alone; the rest of the plan is left over in it.

    Args:
        content: The plan.
        number: Index of the day in the plan, from 0.
        inspected: Ids of segments not to fly again.
        names: Vehicles that still fly; the sorties of the others are left over too.
    """
    opens_s, closes_s = content.days[number]
    kept = [place for place, segment in enumerate(content.segments) if segment.id not in inspected]
    stands = {
        own.name: next((one.lands for one in content.routes_of(own.name)[::-1] if one.start_s < opens_s), own.base)
        for own in content.vehicles
    }
    vehicles = [
        replace(
            own, base=stands[own.name], start_m=own.pads[content.base_names.index(stands[own.name])].place_m[:2],
            hours=tuple(one for one in own.hours if opens_s <= one[0] < closes_s),
        )
        for own in content.vehicles if own.name in names
    ]  # fmt: skip
    shortened = (
        replace(route, visits=tuple(visit for visit in route.visits if visit.segment not in inspected))
        for route in content.routes_on(number) if route.vehicle in names
    )  # fmt: skip
    routes = tuple(_select_reached(content, stands, (route for route in shortened if route.visits)))
    segments = tuple(content.segments[place] for place in kept)
    flown = {visit.segment for route in routes for visit in route.visits}
    part = replace(
        content,
        segments=segments,
        pricing=content.pricing.select_segments(kept, [own.name for own in vehicles]),
        vehicles=tuple(vehicles),
        routes=routes,
        uncovered=tuple(one.id for one in segments if one.id not in flown),
        days=((opens_s, closes_s),),
        windows=(),
        part_of=content.schedule_id,
    )
    found = evaluate_sorties(part.build_instance(), part.plan)
    return part.with_plan(part.plan, found, Objective(content.cost.name))


def _select_reached(
    content: DayPlanFile, stands: Mapping[str, str], routes: Iterable[PlanRoute]
) -> Iterator[PlanRoute]:
    """Yield the sorties that start where their vehicle can be; others may be inspected, and not flown."""
    place, number = dict(stands), content.base_names.index
    for route in routes:
        if content.transfers_s[number(place[route.vehicle])][number(route.base)] is not None:
            place[route.vehicle] = route.lands
            yield route


def sorties_ahead_of(content: DayPlanFile) -> Mapping[str, tuple[PlannedSortie, ...]]:
    """Return every vehicle's sorties of the first day, as visits of the network."""
    begins_s, moving = _first_take_off_s(content), _find_moving_vehicles(content)

    def build(one: PlanRoute) -> PlannedSortie:
        ends = (one.base, one.lands) if one.vehicle in moving else ("", "")
        return PlannedSortie(one.network_visits, one.start_s - begins_s, *ends)

    return {name: tuple(map(build, own)) for name, own in _select_first_day(content).items()}


def _find_moving_vehicles(content: DayPlanFile) -> dict[str, DayVehicle]:
    """Return by name the vehicles whose sorties of the first day do not all begin and end at their own base."""
    first = _select_first_day(content)
    return {
        own.name: own
        for own in content.vehicles
        if any((one.base, one.lands) != (own.base, own.base) for one in first[own.name])
    }


def find_day_pads(content: DayPlanFile, ground: SiteModel, setup: FlightSetup) -> dict[str, dict[str, Pad]]:
    """Return the pads of vehicles whose sorties use several bases, by vehicle and base name."""
    found, first = {}, _select_first_day(content)
    for name, own in _find_moving_vehicles(content).items():
        known = {**ground.day_pads.get(name, {}), own.base: setup.pad_of(name)}
        used = dict.fromkeys((own.base, *(base for one in first[name] for base in (one.base, one.lands))))
        found[name] = {base: known[base] for base in used}
    return found


def add_day_pads(setup: FlightSetup, pads: Mapping[str, Mapping[str, Pad]]) -> FlightSetup:
    """Return the heights and pads of a flight, with all pads of the vehicles that land at several bases."""
    return replace(setup, day_pads=tuple(pad for own in pads.values() for pad in own.values()))


def find_first_landings(content: DayPlanFile, pads: Mapping[str, Mapping[str, Pad]]) -> dict[str, Pad]:
    """Return first landing pads by vehicle name, for vehicles that do not land where they take off."""
    firsts = {name: own[0] for name, own in _select_first_day(content).items() if own and name in pads}
    return {name: pads[name][one.lands] for name, one in firsts.items() if one.base != one.lands}


def name_sortie_rounds(content: DayPlanFile) -> list[dict[str, tuple[int, ...]]]:
    """Return the network visits of every vehicle's first sortie by name, then of the second ones, and so on.

    Only sorties that end at the vehicle's own base count: others are not flown.
    """
    rounds = list[dict[str, tuple[int, ...]]]()
    for own in content.vehicles:
        at_home = (one for one in content.routes_of(own.name) if (one.base, one.lands) == (own.base, own.base))
        for number, one in enumerate(at_home):
            rounds += [{}] if number == len(rounds) else []
            rounds[number][own.name] = one.network_visits
    return rounds


def build_day_rules(content: DayPlanFile, pads: Mapping[str, Mapping[str, Pad]] = MappingProxyType({})) -> DayRules:
    """Return a day plan's rules besides its sorties; its clock begins with the first planned take-off.

    Args:
        content: The plan.
        pads: Result of `find_day_pads`.
    """
    begins_s, until_s = _first_take_off_s(content), content.days[0][1]
    return DayRules(
        stagger_s=content.stagger_s,
        bases={own.name: own.base for own in content.vehicles},
        windows_s={
            own.name: tuple((begin - begins_s, end - begins_s) for begin, end in own.hours if begin < until_s)
            for own in content.vehicles
        },
        barred={
            name: frozenset(content.segments[number].id for number in own)
            for name, own in content.pricing.barred.items()
        },
        packs={base.name: PackRules(base.packs, base.recharge_s) for base in content.bases if base.packs is not None},
        pads=pads,
    )


def find_later_segments(content: DayPlanFile) -> frozenset[int]:
    """Return the network segments planned for a vehicle's second or later sortie of the day."""
    later = [route for own in _select_first_day(content).values() for route in own[1:]]
    return frozenset(visit.segment for route in later for visit in route.visits)


def describe_later_sorties(content: DayPlanFile) -> list[str]:
    """Return the day in words, for the crew to confirm."""
    return [
        f"{name}: {format_count(len(own) - 1, 'later sortie')}, each by the crew's word when its pack is changed"
        for name, own in _select_first_day(content).items()
        if len(own) > 1
    ]


def _check_day_plan(content: DayPlanFile, ground: SiteModel) -> None:
    source, names = content.source, list(content.names)
    if sorted(names) != sorted(ground.names):
        raise PlanFileError(f"{source}: vehicles: expected {', '.join(ground.names)} as in the site, got {names}")
    for line in check_plan(content):
        raise PlanFileError(f"{source}: {line}; `faultline check` says more")
    check_same_segments(content, ground, source)
    for own, sorties in zip(content.vehicles, _select_first_day(content).values(), strict=True):
        for line in _check_bases(content, ground, own, sorties):
            raise PlanFileError(f"{source}: {line}")
        for key, called in _SPEEDS.items():
            said_m_s, flown_m_s = getattr(content.pricing.models[own.name], key), getattr(ground.inspection, called)
            if abs(said_m_s - flown_m_s) > SAME_M_S:
                raise PlanFileError(
                    f"{source}: {own.name}: expected {called} {flown_m_s:g} of [inspection], at which all vehicles "
                    f"fly, got {said_m_s:g}: plan again, without it in [[day.vehicle]]"
                )


def _check_bases(
    content: DayPlanFile, ground: SiteModel, own: DayVehicle, sorties: Sequence[PlanRoute]
) -> Iterator[str]:
    """Yield the reasons why a vehicle's sorties of a day cannot be flown from base to base."""
    tables, pads = base_tables(ground.site, ground.network.frame), dict(zip(content.base_names, own.pads, strict=True))
    if own.base != next(base.name for base in tables if own.name in base.vehicles):
        yield f"{own.name}: expected at base {own.base}, where it begins the day: name it there in [[base]]"
        return
    elsewhere = {name: (pad.east_m, pad.north_m) for name, pad in ground.day_pads.get(own.name, {}).items()}
    known_m = {**elsewhere, own.base: ground.setup.base_of(own.name).place_m[:2]}
    for base in dict.fromkeys((own.base, *(base for one in sorties for base in (one.base, one.lands)))):
        if base not in known_m or math.dist(pads[base].place_m[:2], known_m[base]) > AT_DEPOT_M:
            yield f"the site has changed: the pad of {own.name} is elsewhere: plan again"
    for number, one in enumerate(sorties, 1):
        if one.base == one.lands:
            continue
        place = f"sortie {number} of {own.name} ends at base {one.lands}"
        if ground.inspection.same_distance:
            yield (
                f"{place}: expected the base where it begins, as a vehicle below its layer is kept clear of "
                'returns to one pad only: plan with [day] lands = "own", or without inspection.same_distance'
            )
        if ground.site.fence is not None and ground.site.fence.gives_rally:
            continue
        needs_pct = _compute_return_pct(content, own, one)
        if needs_pct > own.budget_pct:
            yield (
                f"{place}: its own RTL ends where it took off, and takes {needs_pct:.0f} % in all, its "
                f'budget is {own.budget_pct:.0f} %: expected [fence] with enabled = true and rally = "pad", which '
                "lets it return to the nearer of its pads"
            )


def _compute_return_pct(content: DayPlanFile, own: DayVehicle, sortie: PlanRoute) -> float:
    """Return the most battery that a sortie uses including RTL to its take-off, from a segment's end or its landing."""
    moves, _ = price_fleet(content.pricing, [own.name])
    home, pad = (own.pads[content.base_names.index(base)] for base in (sortie.base, sortie.lands))
    visits = list(content.visits_of(sortie))
    out_pct, back_pct, on_pct = moves.price_out(0, home)[1], moves.price_home(0, home)[1], moves.price_home(0, pad)[1]
    between_pct = moves.pct(0, visits[:-1], visits[1:])
    used_pct = out_pct[visits[0]] + np.concatenate(([0.0], np.cumsum(between_pct)))
    from_pad_pct = float(moves.fliers[0].price_ways_home(np.array([pad.place_m]), UNKNOWN, home)[1][0])
    lands_pct = float(used_pct[-1] + on_pct[visits[-1]]) + from_pad_pct
    return own.consumption * max(lands_pct, float((used_pct + back_pct[visits]).max()))


def _price_first_landings(content: DayPlanFile) -> Pricing:
    """Return the prices of the first sorties, each from its start to its landing."""
    bases, starts, first = dict(content.pricing.bases), dict[str, Base](), _select_first_day(content)
    for own in content.vehicles:
        for one in first[own.name][:1]:
            if one.base != one.lands:
                pads = dict(zip(content.base_names, own.pads, strict=True))
                bases[own.name], starts[own.name] = pads[one.lands], pads[one.base]
    return replace(content.pricing, bases=bases, starts=starts)


def _select_first_day(content: DayPlanFile) -> dict[str, tuple[PlanRoute, ...]]:
    until_s = content.days[0][1]
    return {name: tuple(one for one in content.routes_of(name) if one.start_s < until_s) for name in content.names}


def _first_take_off_s(content: DayPlanFile) -> float:
    starts = [one.start_s for own in _select_first_day(content).values() for one in own]
    return min(starts, default=content.days[0][0])
