"""A day plan as it is flown: the first sorties as a first plan, the later ones behind them, and the day's rules."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from executor.core.context import DayRules
from executor.core.formatting import format_count
from executor.core.state.vehicle_parts import PlannedSortie
from executor.site import site_model
from executor.site.day_problem import base_place, build_day_problem
from executor.site.site_model import SiteModel
from executor.site.site_planning import SAME_PLACE_M, build_site_plan_file, check_same_segments
from missions import DayPlanFile, LocalFrame, Pad, PlanFile, PlanFileError, check_day_plan, place_pads
from planner import Cost, Plan, Route, is_reversed, segment_of, visit_of
from planner.sorties import Sortie

AT_DEPOT_M = 50.0
"""A base nearer to the depot than this is the depot."""
SAME_PCT = 1e-6
"""Budgets that differ by less are one."""
SAME_M_S = 1e-6
"""The same of speeds."""
_SPEEDS = {"inspection_speed_m_s": "speed_m_s", "transit_speed_m_s": "transit_speed_m_s"}
"""Of a vehicle's flight model, as sites call them."""


def build_first_sorties_plan(content: DayPlanFile, ground: SiteModel) -> PlanFile:
    """Return the plan of a day's first flights; everything else is left for later ones.

    Raises:
        PlanFileError: the day plan is another site's, or cannot be flown: one line that says where.
        SiteError: the site's bases cannot be used.
    """
    _check_day_plan(content, ground)
    ids = [segment.id for segment in content.segments]
    task = site_model.build_first_task(ground, ids)
    if task.unreachable:
        never = task.unreachable[0]
        name = ground.network.segment_name(never.segment)
        raise PlanFileError(f"{content.source}: {name}: expected a segment that can be reached, but it {never.why}")
    routes = {name: own[0].visits if own else () for name, own in _select_first_day(content).items()}
    plan = Plan(
        tuple(
            Route(number, task.from_network(_to_network_visits(ids, routes[name])))
            for number, name in enumerate(ground.names)
        ),
        (),
    )
    flown = {segment_of(visit) for route in plan.routes for visit in route.visits}
    plan = replace(plan, uncovered=tuple(one for one in range(len(ids)) if one not in flown))
    return build_site_plan_file(ground, task, plan, Cost.MINMAX, content.solved)


def sorties_ahead_of(content: DayPlanFile) -> Mapping[str, tuple[PlannedSortie, ...]]:
    """Return every vehicle's sorties of the first day, with the network's visits."""
    ids, begins_s = [segment.id for segment in content.segments], _first_take_off_s(content)
    return {
        name: tuple(PlannedSortie(_to_network_visits(ids, one.visits), one.start_s - begins_s) for one in own)
        for name, own in _select_first_day(content).items()
    }


def build_day_rules(content: DayPlanFile) -> DayRules:
    """Return what a day plan says beside its sorties; its clock begins with the first planned take-off."""
    begins_s, until_s = _first_take_off_s(content), content.days[0][1]
    return DayRules(
        stagger_s=content.stagger_s,
        bases={own.name: content.bases[own.base].name for own in content.vehicles},
        windows_s={
            own.name: tuple((begin - begins_s, end - begins_s) for begin, end in own.windows if begin < until_s)
            for own in content.vehicles
        },
        barred={
            own.name: frozenset(content.segments[number].id for number in np.flatnonzero(~able))
            for own, able in zip(content.vehicles, content.able, strict=True)
            if not able.all()
        },
    )


def base_places_m(content: DayPlanFile, frame: LocalFrame) -> Mapping[str, tuple[float, float]]:
    """Return where each vehicle's base is, local east and north."""
    places = content.bases
    return {own.name: frame.to_local_m(places[own.base].lat_deg, places[own.base].lon_deg) for own in content.vehicles}


def find_morning_pads(ground: SiteModel) -> Mapping[str, Pad]:
    """Return where vehicles stand in the morning whose base is not the depot, and whose pad is not named.

    Around each base they stand as they would around the depot; areas are not looked at.

    Raises:
        SafetyError: there is no room around a base.
    """
    setup, frame, found = ground.setup, ground.network.frame, dict[str, Pad]()
    named = {table.name for table in ground.site.vehicle if table.pad is not None}
    for table in ground.site.base:
        place, own = base_place(ground, table), [name for name in table.vehicles if name not in named]
        at_m = np.array(frame.to_local_m(place.lat_deg, place.lon_deg))
        if not own or float(np.hypot(*at_m)) <= AT_DEPOT_M:
            continue
        pads = place_pads(own, setup.tracks_m - at_m, layer_m=setup.inspection.layer_m, alt_m=place.alt_m)
        for pad in pads:
            east_m, north_m = pad.east_m + float(at_m[0]), pad.north_m + float(at_m[1])
            found[pad.vehicle] = replace(pad, east_m=east_m, north_m=north_m)
    return found


def find_later_segments(content: DayPlanFile) -> frozenset[int]:
    """Return the network's segments that are planned for a vehicle's second sortie of the day, or a later one."""
    return frozenset(
        segment_of(visit) for own in sorties_ahead_of(content).values() for sortie in own[1:] for visit in sortie.visits
    )


def describe_later_sorties(content: DayPlanFile) -> list[str]:
    """Return the day in words, for the crew to confirm."""
    lines = []
    for name, own in _select_first_day(content).items():
        later = format_count(len(own) - 1, "later sortie")
        if len(own) > 1:
            lines.append(f"{name}: {later}, each by the crew's word when its pack is changed")
    return lines


def _check_day_plan(content: DayPlanFile, ground: SiteModel) -> None:
    source, names = content.source, [own.name for own in content.vehicles]
    if sorted(names) != sorted(ground.names):
        raise PlanFileError(f"{source}: vehicles: expected {', '.join(ground.names)} as in the site, got {names}")
    for line in check_day_plan(content):
        raise PlanFileError(f"{source}: {line}; `faultline check` says more")
    check_same_segments(content, ground, source)
    _check_vehicles(content, ground)
    for name, sorties in _select_first_day(content).items():
        home = content.vehicles[names.index(name)].base
        for number, one in enumerate(sorties, 1):
            if (one.base, one.lands) != (home, home):
                place = content.bases[home].name
                raise PlanFileError(
                    f"{source}: sortie {number} of {name}: expected to begin and end at its base {place}, where it "
                    'stands: plan with [day] lands = "own"'
                )


def _check_vehicles(content: DayPlanFile, ground: SiteModel) -> None:
    """Refuse a day of vehicles that now stand elsewhere, may use something else, or do not fly as it has them."""
    source, now = content.source, build_day_problem(ground)
    budgets = {own.name: own.budget_pct for own in now.vehicles}
    at_m, was_m = _pads_m(now), _pads_m(content)
    for own in content.vehicles:
        if abs(own.budget_pct - budgets[own.name]) > SAME_PCT:
            changed = f"{own.name}: budget_pct is {own.budget_pct:g} there and {budgets[own.name]:g} in the site"
            raise PlanFileError(f"{source}: the site has changed: {changed}: plan again")
        if math.dist(at_m[own.name], was_m[own.name]) > SAME_PLACE_M:
            raise PlanFileError(f"{source}: the site has changed: the pad of {own.name} is elsewhere: plan again")
        planned = content.pricing.models[own.name]
        for key, called in _SPEEDS.items():
            said_m_s, flown_m_s = getattr(planned, key), getattr(ground.inspection, called)
            if abs(said_m_s - flown_m_s) > SAME_M_S:
                raise PlanFileError(
                    f"{source}: {own.name}: expected {called} {flown_m_s:g} of [inspection], at which everybody "
                    f"flies, got {said_m_s:g}: plan again, without it in [[day.vehicle]]"
                )


def _pads_m(content: DayPlanFile) -> dict[str, tuple[float, ...]]:
    """Return where each vehicle stands in the morning, local east and north."""
    return {own.name: content.pads[row][own.base].place_m[:2] for row, own in enumerate(content.vehicles)}


def _select_first_day(content: DayPlanFile) -> dict[str, tuple[Sortie, ...]]:
    """Return each vehicle's sorties of the first day."""
    until_s = content.days[0][1]
    return {
        own.name: tuple(one for one in content.plan.sorties[row] if one.start_s < until_s)
        for row, own in enumerate(content.vehicles)
    }


def _first_take_off_s(content: DayPlanFile) -> float:
    starts = [one.start_s for own in _select_first_day(content).values() for one in own]
    return min(starts, default=content.days[0][0])


def _to_network_visits(ids: list[int], visits: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(visit_of(ids[segment_of(visit)], is_reversed(visit)) for visit in visits)
