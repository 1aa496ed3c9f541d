"""Write a site file to start from."""

from __future__ import annotations

import tomlkit

import missions
from executor.adapters.templates import render_template
from executor.site.site_keys import EnergyTable, InspectionTable, VehicleTable
from planner import PRESETS

COMMENT_AT = 40
FIRST_PORT = 14551


def render_site_template(vehicles: int, autopilot: str, **wish: object) -> str:
    """Return the text of a site file.

    Args:
        vehicles: Number of vehicles.
        autopilot: Autopilot of all of them.
        wish: Further inputs of the template: `file`, the network's path from the site file's folder; `has_heights`,
            whether the network has pylon heights; `depot`, None if the network file has it; `radius_m`; and `choice`,
            the other keys of the network table, None where unset.
    """
    fleet = [
        VehicleTable(
            name=f"uav{number}",
            connection=f"udpin://0.0.0.0:{FIRST_PORT + number - 1}",
            sysid=number,
            autopilot=autopilot,
        )
        for number in range(1, vehicles + 1)
    ]
    return render_template(
        "site.toml", wish=wish, inspection=InspectionTable(), energy=EnergyTable(), vehicles=fleet, drones=PRESETS,
        autopilots=[dialect.name for dialect in missions.AUTOPILOTS], row=_render_row, noted=_append_comment,
    )  # fmt: skip


def _render_row(key: str, value: object, comment: str = "") -> str:
    text = tomlkit.dumps({key: value}).strip()
    if isinstance(value, float | tuple):
        text = f"{key} = {_shorten_figures(value)}"
    return _append_comment(text, comment) if comment else text


def _shorten_figures(value: float | tuple[float, ...]) -> object:
    """Return figures without a fraction of 0."""
    if isinstance(value, tuple):
        return [_shorten_figures(one) for one in value]
    return int(value) if value.is_integer() else value


def _append_comment(text: str, comment: str) -> str:
    return f"{text:{COMMENT_AT - 1}} # {comment}"
