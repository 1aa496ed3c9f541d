"""A site file to begin with: every table with what holds if nothing is said, and what it means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import tomli_w

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
    return "\n".join(_render_lines(wish)) + "\n"


def _render_lines(wish: SiteTemplate) -> Iterator[str]:
    if wish.depot is None:
        yield "# [depot] with lat_deg, lon_deg and alt_m is where the vehicles stand; this network's file has it"
    else:
        yield _append_comment("[depot]", "where the vehicles stand; alt_m is the ground's, above mean sea level")
        yield from (_render_row(key, value) for key, value in wish.depot.model_dump(exclude_none=True).items())
    radius = "# radius_m = 1500" if wish.radius_m is None else _render_row("radius_m", wish.radius_m)
    yield from (
        "",
        "[network]",
        _render_row("file", wish.file, "what 'faultline network' reads; 'default' is faultline's own"),
        *(tomli_w.dumps({key: value}).strip() for key, value in wish.choice.items() if value),
        _append_comment(radius, "only segments whose two pylons are nearer to the depot than this"),
        "",
        *_render_inspection(has_heights=wish.has_heights),
        "",
        "[energy]",
        _render_row("drone", EnergyTable().drone, f"{', '.join(PRESETS)};"),
        _append_comment("", "mass_kg, capacity_ah and the other figures can be set, too"),
    )
    yield ""
    yield _append_comment("# [[area]]", "what flights keep out of: GeoJSON or KML, or a polygon")
    yield '# file = "areas.geojson"'
    for number in range(1, wish.vehicles + 1):
        yield ""
        yield from _render_vehicle(number, wish.autopilot, commented=number == 1)


def _render_inspection(*, has_heights: bool) -> Iterator[str]:
    table = InspectionTable()
    yield "[inspection]"
    yield _render_row(
        "height_m", table.height_m, "over the pylon tops where they are known, else over the depot's ground"
    )
    if not has_heights:
        yield _append_comment('# heights = "flat"', "say so if it is: this network does not know all of its heights")
    yield _render_row("standoff_m", table.standoff_m, "beside the line")
    yield _render_row("speed_m_s", table.speed_m_s, "along the line")
    yield _render_row("transit_speed_m_s", table.transit_speed_m_s, "on the way")
    yield _render_row(
        "wind_m_s", list(table.wind_m_s), "where the air moves to, east and north: one way is dearer than the other"
    )
    yield _render_row("layer_m", table.layer_m, "any two vehicles keep this distance")


def _render_vehicle(number: int, autopilot: str, *, commented: bool) -> Iterator[str]:
    table = VehicleTable(
        name=f"uav{number}", connection=f"udpin://0.0.0.0:{FIRST_PORT + number - 1}", sysid=number, autopilot=autopilot
    )  # fmt: skip
    comments = {
        "connection": "or udpout://, tcpin://, tcpout://HOST:PORT, serial:///dev/ttyUSB0:57600",
        "autopilot": " or ".join(dialect.name for dialect in AUTOPILOTS),
        "backend": "or mavsdk: MAVSDK 4 in this process carries the messages",
        "budget_pct": "what a route may use",
        "reserve_pct": "never planned with",
    }
    yield "[[vehicle]]"
    for key in ("name", "connection", "sysid", "autopilot", "backend", "budget_pct", "reserve_pct"):
        if commented or key != "backend":
            yield _render_row(key, getattr(table, key), comments.get(key, "") if commented else "")


def _render_row(key: str, value: object, comment: str = "") -> str:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, list):
        value = [int(one) if one.is_integer() else one for one in value]
        text = f"{key} = {value}"
    else:
        text = tomli_w.dumps({key: value}).strip()
    return _append_comment(text, comment) if comment else text


def _append_comment(text: str, comment: str) -> str:
    return f"{text:{COMMENT_AT - 1}} # {comment}"
