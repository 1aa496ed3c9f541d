"""A day between two bases."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from executor.site.day_plans import build_day_problem
from executor.site.site_model import SiteModel
from missions import DayPlanFile
from planner import Plan, Route
from planner.sorties import Objective, evaluate_sorties
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import FRAME, line_east

HOURS = {"begin": "08:00", "end": "10:00", "quiet": [{"begin": "09:00", "end": "09:30"}]}


def between_bases(**tables: object) -> tuple[SiteModel, DayPlanFile]:
    """Return a day on which uav1 flies to the other base and back, with uav2's segment beside it."""
    bases = []
    for name, east_m, own in (("west", 0.0, ["uav1", "uav2"]), ("east", 1300.0, [])):
        lat_deg, lon_deg = FRAME.to_wgs84_deg(east_m, -60.0)
        bases.append({"name": name, "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": FRAME.alt_m, "vehicles": own})
    known: dict[str, Any] = {"base": bases, "day": {**HOURS, "lands": "any"}, "energy": {"capacity_ah": 3.0}, **tables}
    ground = ground_for(site_of(("uav1", "uav2"), **known), line_east(13))
    problem = build_day_problem(ground)
    first, second = tuple(2 * one for one in range(6)), tuple(2 * one + 1 for one in reversed(range(6, 12)))
    plan = Plan((Route(0, first, 0, 1, 28_800.0), Route(0, second, 1, 0, 30_600.0)))
    found = evaluate_sorties(problem.build_instance(), plan)
    return ground, replace(problem.with_plan(plan, found, Objective.FINISH), source="day.json")
