"""Build the page's view of a plan: figures, and each vehicle's position and battery over time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from executor.analysis.height_profile import build_profiles
from executor.plan_page.site_view import to_place
from executor.site import plan_summary, site_model
from executor.site.day_plans import add_day_pads, name_sortie_rounds
from executor.site.site_model import SiteModel
from missions import DayPlanFile, FlightModel, FlightPath, FlightSetup, Pad, Phase, PlanFile, estimate
from missions.flight_model import Estimate
from missions.geo import FloatArray
from missions.no_fly_areas import Unreachable
from missions.waypoints import legs_m
from planner import is_reversed, segment_of

MOST_PROFILE = 400
"""Points of one vehicle's profile."""


@dataclass(frozen=True, slots=True)
class Sortie:
    """One vehicle's flight on one pack."""

    vehicle: str
    visits: tuple[int, ...]
    """Visits by network segment."""
    start_s: float = 0.0
    number: int = 0
    day: int = 1
    base: str = ""
    """Base of take-off; days only."""
    lands: str = ""
    planned: tuple[float, float] | None = None
    """Planned duration in seconds, and energy."""


def summarise(plan: PlanFile | DayPlanFile) -> dict[str, Any]:
    """Return a plan's summary for the list of plans."""
    energy_pct = dict.fromkeys(plan.names, 0.0)
    for route in plan.routes:
        energy_pct[route.vehicle] += round(route.energy_pct, 2)
    window = plan.window if isinstance(plan, PlanFile) else None
    breaking = None if window is None else window.breaking
    return {
        "kind": "day" if isinstance(plan, DayPlanFile) else "flight",
        "longest_s": max((one.duration_s for one in plan.routes), default=0.0),
        "energy_pct": energy_pct,
        "window_pct": None if window is None else window.window_pct,
        "window_from_s": None if window is None else window.earliest_s,
        "breaking": None if breaking is None else asdict(breaking),
        "uncovered": len(plan.uncovered) + len(plan.unreachable),
        "cost": plan.cost.name,
        "value": plan.cost.value,
        "seconds": plan.seconds,
        "finish_s": plan.finish_s if isinstance(plan, DayPlanFile) else max(plan.durations_s, default=0.0),
    }  # fmt: skip


def describe_plan(plan: PlanFile | DayPlanFile, ground: SiteModel) -> dict[str, Any]:
    """Return the full view of a plan of a site.

    Raises:
        SiteError: its flights come too near to the ground or to a line, or into an area.
        MissionsError: it does not match the site.
    """
    if isinstance(plan, DayPlanFile):
        lines = plan_summary.describe_day(plan)
        rounds, windows = name_sortie_rounds(plan), [asdict(one) for one in plan.windows]
    else:
        lines = [*plan_summary.describe_routes(plan), *plan_summary.describe_window(plan)]
        rounds, windows = [plan.network_routes], []
    heights = plan_summary.compute_planned_heights(ground, rounds)
    return {
        "vehicles": describe_vehicles(list_sorties(plan), plan, ground),
        "uncovered": list_uncovered(plan),
        "windows": windows,
        "lines": [*lines, *plan_summary.describe_left_over(plan), *heights.lines],
    }


def list_uncovered(plan: PlanFile | DayPlanFile) -> list[dict[str, Any]]:
    """Return the segments that a plan does not inspect, with reasons."""
    left: list[plan_summary.LeftOver | Unreachable] = [*plan_summary.find_left_over(plan), *plan.unreachable]
    return [{"segment": one.segment, "name": one.name, "why": one.why} for one in left]


def list_sorties(plan: PlanFile | DayPlanFile) -> list[Sortie]:
    """Return the sorties of a plan, in the order of its file."""
    numbers: dict[str, int] = {}
    found = []
    for route in plan.routes:
        number = numbers[route.vehicle] = numbers.get(route.vehicle, -1) + 1
        ends = (route.base, route.lands) if isinstance(plan, DayPlanFile) else ("", "")
        planned = route.duration_s, route.energy_pct
        found.append(Sortie(route.vehicle, route.network_visits, route.start_s, number, route.day, *ends, planned))
    return found


def describe_vehicles(
    sorties: Sequence[Sortie], plan: PlanFile | DayPlanFile, ground: SiteModel
) -> list[dict[str, Any]]:
    """Return each vehicle's sorties with their paths, and the height profile of its first one."""
    models = {} if plan.pricing is None else plan.pricing.models
    flights = _build_all_flights(sorties, ground)
    shown = []
    for vehicle in plan.vehicles:
        own = [one for one in sorties if one.vehicle == vehicle.name and one.visits]
        flown = [
            _describe_sortie(one, *flights[one], models[vehicle.name], vehicle.consumption)
            for one in own if vehicle.name in models
        ]  # fmt: skip
        shown.append({
            "name": vehicle.name, "budget_pct": vehicle.budget_pct, "routes": flown,
            "profile": _describe_profile(*flights[own[0]]) if own else [],
        })  # fmt: skip
    return shown


def _build_all_flights(sorties: Sequence[Sortie], ground: SiteModel) -> Mapping[Sortie, tuple[FlightSetup, FlightPath]]:
    """Return each sortie's path and pads; sorties of the same number fly concurrently."""
    flights = dict[Sortie, tuple[FlightSetup, FlightPath]]()
    for number in sorted({one.number for one in sorties}):
        beside = [one for one in sorties if one.number == number and one.visits]
        setup = _place_sorties(beside, ground)
        built = site_model.build_paths(setup, {one.vehicle: one.visits for one in beside})
        flights |= {one: (setup, built[one.vehicle]) for one in beside}
    return flights


def _place_sorties(beside: Sequence[Sortie], ground: SiteModel) -> FlightSetup:
    """Return the heights and pads of concurrent sorties: each with its own take-off and landing."""
    if not any(one.base for one in beside):
        return ground.setup
    setup = add_day_pads(ground.setup, ground.day_pads)

    def find_pad(vehicle: str, base: str) -> Pad:
        return ground.day_pads.get(vehicle, {}).get(base) or setup.pad_of(vehicle)

    begins, ends = ({one.vehicle: find_pad(one.vehicle, base) for one in beside for base in [getattr(one, key)]}
                    for key in ("base", "lands"))  # fmt: skip
    return replace(setup, pads=tuple(begins.get(pad.vehicle, pad) for pad in setup.pads), landings=ends)


def _describe_sortie(
    sortie: Sortie, setup: FlightSetup, path: FlightPath, model: FlightModel, consumption: float
) -> dict[str, Any]:
    figures = _fit_to_plan(estimate(path, model, consumption=consumption), path, sortie.planned)
    frame, pad = setup.frame, setup.pad_of(sortie.vehicle)
    home_up_m = frame.up_m(pad.alt_m)
    ends_s, used_pct = np.cumsum(figures, axis=1).tolist()
    ends_s = [sortie.start_s + one for one in ends_s]
    track = [[round(sortie.start_s, 1), *to_place(frame, (pad.east_m, pad.north_m)), round(home_up_m, 1), 100.0]]
    track += [
        [round(at_s, 1), round(point.lat_deg, 7), round(point.lon_deg, 7), round(home_up_m + point.alt_rel_m, 1),
         round(100.0 - pct, 2)]
        for at_s, pct, point in zip(ends_s, used_pct, path.waypoints, strict=True)
    ]  # fmt: skip
    duration_s, energy_pct = sortie.planned or figures.sum(axis=1).tolist()
    return {
        "sortie": sortie.number, "day": sortie.day, "start_s": sortie.start_s, "duration_s": duration_s,
        "energy_pct": energy_pct, "visits": list(_describe_visits(sortie, path, ends_s)), "track": track,
    }  # fmt: skip


def _fit_to_plan(found: Estimate, path: FlightPath, planned: tuple[float, float] | None) -> FloatArray:
    """Return (2, n) seconds and energies of a flight's legs, scaled to the plan's totals.

    A plan prices straight legs. Flown, they follow the surface and take some seconds more, so the transits are scaled
    to fit.
    """
    legs = np.array([(leg.duration_s, leg.energy_pct) for leg in found.legs]).reshape(-1, 2).T
    if planned is None:
        return legs
    on_way = np.array([point.phase is not Phase.INSPECT for point in path.waypoints])
    ways, others = legs[:, on_way].sum(axis=1), legs[:, ~on_way].sum(axis=1)
    factors = np.maximum(0.0, np.array(planned) - others) / np.maximum(ways, 1e-9)
    return np.asarray(np.where(on_way, factors[:, np.newaxis], 1.0) * legs)


def _describe_visits(sortie: Sortie, path: FlightPath, ends_s: Sequence[float]) -> Iterator[dict[str, Any]]:
    begins_s = [sortie.start_s, *ends_s[:-1]]
    for number, visit in enumerate(sortie.visits):
        legs = [
            at for at, point in enumerate(path.waypoints) if point.visit == number and point.phase is Phase.INSPECT
        ]  # fmt: skip
        if legs:
            yield {
                "segment": segment_of(visit), "reversed": is_reversed(visit),
                "from_s": round(begins_s[legs[0]], 1), "to_s": round(ends_s[legs[-1]], 1),
            }  # fmt: skip


def _describe_profile(setup: FlightSetup, path: FlightPath) -> list[list[float | None]]:
    """Return rows of metres flown, height above the depot, and ground height, where a raster covers it."""
    known = build_profiles(setup, [path])
    if not known:
        ends = legs_m(path, setup.frame, setup.frame.up_m(setup.pad_of(path.vehicle).alt_m))
        lengths_m = np.hypot(*(ends[:, 1] - ends[:, 0]).T[:2])
        along = np.concatenate((np.zeros(1), np.cumsum(lengths_m)))
        up = np.concatenate((ends[:1, 0, 2], ends[:, 1, 2]))
        return [[round(one, 1), round(other, 1), None] for one, other in zip(along.tolist(), up.tolist(), strict=True)]
    profile = known[0]
    every = max(1, len(profile.along_m) // MOST_PROFILE)
    ground = profile.ground_m[::every] - setup.frame.alt_m
    flown = profile.flown_m[::every] - setup.frame.alt_m
    return [
        [round(along, 1), round(up, 1), round(below, 1) if np.isfinite(below) else None]
        for along, up, below in zip(profile.along_m[::every].tolist(), flown.tolist(), ground.tolist(), strict=True)
    ]
