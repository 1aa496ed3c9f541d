"""A site file to begin with: every table with what holds if nothing is said, and what it means."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import tomli_w

from executor.adapters.templates import render_template
from executor.site.tables.aircraft import EnergyTable, VehicleTable
from executor.site.tables.ground import DepotTable, InspectionTable
from missions import AUTOPILOTS
from planner import PRESETS

COMMENT_AT = 40
FIRST_PORT = 14551


@dataclass(frozen=True, slots=True)
class SiteTemplate:
    """What a site file is to begin with."""

    file: str
    """The network, as seen from the site file's folder; or 'default'."""
    has_heights: bool
    """Whether the network knows the heights of its pylons."""
    depot: DepotTable | None
    """Where the vehicles stand; None where the network's file says it."""
    radius_m: float | None
    vehicles: int
    autopilot: str
    choice: Mapping[str, object] = field(default_factory=dict)
    """What else is said of the network's file, by its keys; None for what is not."""


def render_site_template(wish: SiteTemplate) -> str:
    """Return the text of a site file."""
    vehicles = [
        VehicleTable(
            name=f"uav{number}",
            connection=f"udpin://0.0.0.0:{FIRST_PORT + number - 1}",
            sysid=number,
            autopilot=wish.autopilot,
        )
        for number in range(1, wish.vehicles + 1)
    ]
    return render_template(
        "site.toml", wish=wish, inspection=InspectionTable(), energy=EnergyTable(), vehicles=vehicles, drones=PRESETS,
        autopilots=[dialect.name for dialect in AUTOPILOTS], row=_render_row, noted=_append_comment,
    )  # fmt: skip


def _render_row(key: str, value: object, comment: str = "") -> str:
    text = tomli_w.dumps({key: value}).strip()
    if isinstance(value, float | tuple):
        text = f"{key} = {_shorten_figures(value)}"
    return _append_comment(text, comment) if comment else text


def _shorten_figures(value: float | tuple[float, ...]) -> object:
    """Return figures without a fraction that is 0."""
    if isinstance(value, tuple):
        return [_shorten_figures(one) for one in value]
    return int(value) if value.is_integer() else value


def _append_comment(text: str, comment: str) -> str:
    return f"{text:{COMMENT_AT - 1}} # {comment}"
