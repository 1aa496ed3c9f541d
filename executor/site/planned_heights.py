"""The heights of a plan before any vehicle has answered, over pads that are chosen around the depot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executor.core.preflight import area_checks, height_checks
from executor.errors import SiteError
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import PlanFile, SafetyError, check_ceiling
from missions.area_check import check_areas


@dataclass(frozen=True, slots=True)
class PlannedHeights:
    """What a plan's flights are over."""

    words: str
    warnings: tuple[str, ...]
    document: Mapping[str, object] | None
    """None where no pads could be chosen."""


def compute_planned_heights(ground: SiteModel, plan: PlanFile) -> PlannedHeights:
    """Return by which heights a plan of a site would be flown.

    Raises:
        SiteError: its flights come too near to the ground or to a line, or into an area.
    """
    try:
        setup = site_model.build_flight_setup(ground)
    except SafetyError as error:
        return PlannedHeights(f"not checked: {error}", ground.worth_a_look, None)
    routes = site_model.name_routes(ground, plan.build_task(), plan.plan)
    paths = list(site_model.build_paths(setup, routes).values())
    for text in check_areas(setup, paths):
        raise SiteError(f"area: {text}")
    for text in height_checks.find_low_places(setup, paths):
        raise SiteError(f"{ground.network.source}: heights: {text}")
    warnings = (
        *ground.worth_a_look,
        *check_ceiling(setup, paths),
        *area_checks.describe_returns_through_areas(setup, paths, routes),
    )
    return PlannedHeights(
        height_checks.describe_heights(setup, paths), warnings, height_checks.build_heights_document(setup, paths)
    )
