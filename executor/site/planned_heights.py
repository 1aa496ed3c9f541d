"""The heights of a plan before any vehicle has answered, over pads that are chosen around the depot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from executor.core.preflight import mission_checks
from executor.errors import SiteError
from executor.site import site_model
from executor.site.site_model import SiteModel
from missions import SafetyError, check_ceiling
from missions.area_rules import check_areas


@dataclass(frozen=True, slots=True)
class PlannedHeights:
    """What a plan's flights are over."""

    words: str
    warnings: tuple[str, ...]
    document: Mapping[str, object] | None
    """None where no pads could be chosen."""

    @property
    def lines(self) -> list[str]:
        """What people read of it."""
        return [f"heights: {self.words}", *(f"warning: {line}" for line in self.warnings)]

    def to_json(self) -> dict[str, object]:
        """Return what a plan's JSON says of it."""
        return {"heights": self.document, "warnings": list(self.warnings)}


def compute_planned_heights(ground: SiteModel, rounds: Sequence[Mapping[str, tuple[int, ...]]]) -> PlannedHeights:
    """Return by which heights a plan of a site would be flown.

    Args:
        ground: The site.
        rounds: Each vehicle's visits of the network by its name; of a day of sorties its first ones, its second ones...

    Raises:
        SiteError: its flights come too near to the ground or to a line, or into an area.
    """
    try:
        setup = site_model.build_flight_setup(ground)
    except SafetyError as error:
        return PlannedHeights(f"not checked: {error}", ground.worth_a_look, None)
    flown = [(routes, list(site_model.build_paths(setup, routes).values())) for routes in rounds]
    paths = [path for _, own in flown for path in own]
    for text in check_areas(setup, paths):
        raise SiteError(f"area: {text}")
    for text in mission_checks.find_low_places(setup, paths):
        raise SiteError(f"{ground.network.source}: heights: {text}")
    returns = (
        line for routes, own in flown for line in mission_checks.describe_returns_through_areas(setup, own, routes)
    )
    return PlannedHeights(
        mission_checks.describe_heights(setup, paths),
        (*ground.worth_a_look, *check_ceiling(setup, paths), *dict.fromkeys(returns)),
        mission_checks.build_heights_document(setup, paths),
    )
