"""A day plan as it is flown: the first sorties as a first plan, the later ones behind them, and the day's rules."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from executor.core.context import DayRules
from executor.core.formatting import format_count
from executor.core.state.vehicle_parts import PlannedSortie
from executor.site import site_model
from executor.site.site_bases import AT_DEPOT_M
from executor.site.site_model import SiteModel
from executor.site.site_planning import build_site_plan_file, check_plan_fits, check_same_segments
from missions import DayPlanFile, PlanFile, PlanFileError, Task, build_priced_instance, check_day_plan
from planner import Cost, Plan, Route, Vehicle, is_reversed, segment_of, visit_of
from planner.sorties import Sortie

SAME_M_S = 1e-6
"""Speeds that differ by less are one."""
_SPEEDS = {"inspection_speed_m_s": "speed_m_s", "transit_speed_m_s": "transit_speed_m_s"}
"""Of a vehicle's flight model, as sites call them."""


def build_first_sorties_plan(content: DayPlanFile, ground: SiteModel) -> PlanFile:
    """Return the plan of a day's first flights, as the day prices them; everything else is left for later ones.

    Raises:
        PlanFileError: the day plan is another site's, or cannot be flown: one line that says where.
    """
    _check_day_plan(content, ground)
    ids, fleet = tuple(segment.id for segment in content.segments), {own.name: own for own in content.vehicles}
    vehicles = [Vehicle(name, (0.0, 0.0), fleet[name].budget_pct, fleet[name].consumption) for name in ground.names]
    task = Task(build_priced_instance(content.pricing, vehicles), ids, content.pricing, content.unreachable)
    first = {name: own[0].visits if own else () for name, own in _select_first_day(content).items()}
    plan = Plan(tuple(Route(number, first[name]) for number, name in enumerate(ground.names)))
    flown = {segment_of(visit) for visits in first.values() for visit in visits}
    plan = replace(plan, uncovered=tuple(one for one in range(len(ids)) if one not in flown))
    task = site_model.adjust_task_to_layers(ground, task, plan)
    made = build_site_plan_file(ground, task, plan, Cost.MINMAX, content.solved)
    made = replace(made, terrain=content.terrain)
    check_plan_fits(made, ground, content.source)
    return made


def sorties_ahead_of(content: DayPlanFile) -> Mapping[str, tuple[PlannedSortie, ...]]:
    """Return every vehicle's sorties of the first day, with the network's visits."""
    ids, begins_s = [segment.id for segment in content.segments], _first_take_off_s(content)
    return {
        name: tuple(PlannedSortie(_to_network_visits(ids, one.visits), one.start_s - begins_s) for one in own)
        for name, own in _select_first_day(content).items()
    }


def name_sortie_rounds(content: DayPlanFile) -> list[dict[str, tuple[int, ...]]]:
    """Return the network's visits of everybody's first sorties by name, of the second ones, and so on.

    Only of those that end at the base where the vehicle stands: others are not flown.
    """
    ids, rounds = [segment.id for segment in content.segments], list[dict[str, tuple[int, ...]]]()
    for own, sorties in zip(content.vehicles, content.plan.sorties, strict=True):
        at_home = (one for one in sorties if (one.base, one.lands) == (own.base, own.base))
        for number, one in enumerate(at_home):
            rounds += [{}] if number == len(rounds) else []
            rounds[number][own.name] = _to_network_visits(ids, one.visits)
    return rounds


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
            name: frozenset(content.segments[number].id for number in own)
            for name, own in content.pricing.barred.items()
        },
    )


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
    for name, sorties in _select_first_day(content).items():
        row = names.index(name)
        home = content.vehicles[row].base
        for number, one in enumerate(sorties, 1):
            if (one.base, one.lands) != (home, home):
                place = content.bases[home].name
                raise PlanFileError(
                    f"{source}: sortie {number} of {name}: expected to begin and end at its base {place}, where it "
                    'stands: plan with [day] lands = "own"'
                )
        if math.dist(content.pads[row][home].place_m[:2], ground.setup.base_of(name).place_m[:2]) > AT_DEPOT_M:
            raise PlanFileError(f"{source}: the site has changed: the pad of {name} is elsewhere: plan again")
        for key, called in _SPEEDS.items():
            said_m_s, flown_m_s = getattr(content.pricing.models[name], key), getattr(ground.inspection, called)
            if abs(said_m_s - flown_m_s) > SAME_M_S:
                raise PlanFileError(
                    f"{source}: {name}: expected {called} {flown_m_s:g} of [inspection], at which everybody "
                    f"flies, got {said_m_s:g}: plan again, without it in [[day.vehicle]]"
                )


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
