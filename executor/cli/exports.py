"""The command `export`: files for other ground stations, for Google Earth, for GIS programs and for handhelds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer

from executor.adapters.run_directory import RunDirectory
from executor.cli.console import TerminalConsole
from executor.cli.options import FIRST_AUTOPILOT, AutopilotName, FormatName
from executor.cli.plan_inputs import write_named_file
from executor.core.interface.commands import Level
from executor.core.preflight.mission_checks import find_low_places
from executor.errors import SiteError
from executor.site import site_model, site_planning
from executor.site.site_file import read_site
from missions import (
    Dialect,
    FlightPath,
    FlightSetup,
    MissionFileError,
    PlanFile,
    dialect_for,
    encode,
    format_qgc_plan,
    format_qgc_waypoints,
    read_plan,
)
from missions.exports import MapFeatures, build_plan_features, format_geojson, format_gpx, format_kml
from missions.fences import build_fence, build_fence_items, build_rally_items, flown_places
from missions.files import write_whole
from missions.plan_file import setup_of_plan

DRAWN: Mapping[FormatName, Callable[[MapFeatures], str]] = {
    FormatName.KML: format_kml,
    FormatName.GEOJSON: format_geojson,
    FormatName.GPX: format_gpx,
}
"""One file of everything, in formats that show rather than fly it."""
SUFFIXES = {FormatName.QGC: "plan", FormatName.WAYPOINTS: "waypoints"}
"""One file for each vehicle."""


def export(
    what: Annotated[
        Path, typer.Argument(metavar="PLAN", help="A plan file, or the run directory of a flight that has ended.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Directory for the files.")],
    to: Annotated[
        FormatName | None,
        typer.Option(
            "--format",
            help="qgc: QGroundControl .plan; waypoints: Mission Planner .waypoints; each a file per vehicle. kml, "
            "geojson, gpx: one file with the line, the pads and all routes, of a flight also with what was flown. "
            "Without it qgc, and kml of a flight.",
        ),
    ] = None,
    autopilot: Annotated[
        AutopilotName | None,
        typer.Option(
            help="Autopilot of all vehicles, for qgc and waypoints; without it each vehicle's own, as the plan has it."
        ),
    ] = None,
    site: Annotated[
        Path | None,
        typer.Option(metavar="SITE", help="Its site file, for a plan over [terrain]: the ground is not in the plan."),
    ] = None,
) -> None:
    """Write a plan for other ground stations, or a plan or a flight for maps."""
    if what.is_dir():
        _export_run(what, output, FormatName.KML if to is None else to)
        return
    content = read_plan(what)
    setup = _build_setup(content, what, site)
    to = to or FormatName.QGC
    if to in DRAWN:
        _write(output, f"{what.stem}.{to.value}", DRAWN[to](build_plan_features(content, setup, what.stem)))
    else:
        _export_missions(content, setup, output, to, autopilot)


def _build_setup(content: PlanFile, source: Path, site: Path | None) -> FlightSetup:
    if content.inspection is None:
        raise SiteError(f"{source}: inspection: expected heights and speeds, but the plan has none")
    terrain = None
    if content.terrain is not None:
        if site is None:
            raise SiteError(f"{source}: terrain: expected --site with the site file that the plan was made of")
        ground = site_model.load_site_model(read_site(site), site.parent)
        site_planning.check_plan_fits(content, ground, str(source))
        terrain = ground.terrain
    setup = setup_of_plan(content, content.inspection, terrain=terrain)
    routes = {content.vehicles[route.vehicle].name: route.visits for route in content.plan.routes}
    for line in find_low_places(setup, list(site_model.build_paths(setup, routes).values())):
        raise SiteError(f"{source}: heights: {line}")
    return setup


def _export_missions(
    content: PlanFile, setup: FlightSetup, output: Path, to: FormatName, autopilot: AutopilotName | None
) -> None:
    routes = {content.vehicles[route.vehicle].name: route.visits for route in content.plan.routes}
    paths = site_model.build_paths(setup, routes)
    texts = {}
    for name, path in paths.items():
        own = dialect_for(_autopilot_of(content, name, autopilot))
        try:
            texts[name] = _mission_text(content, setup, path, to, own)
        except MissionFileError as error:
            instead = f"; --format {FormatName.QGC.value} has a word for it" if to is not FormatName.QGC else ""
            raise SiteError(f"{name}: --format {to.value}: {own.title}: {error}{instead}") from error
    for name, text in texts.items():
        _write(output, f"{name}.{SUFFIXES[to]}", text)
    if to is FormatName.QGC and (content.fence is None or content.fence.rally == "keep"):
        what = "neither fence nor rally points" if content.fence is None else "no rally points"
        _warn(f"the plan has {what} ([fence] of its site): the upload of these files clears those on board")


def _mission_text(content: PlanFile, setup: FlightSetup, path: FlightPath, to: FormatName, dialect: Dialect) -> str:
    items, pad, frame = encode(path, dialect).items, setup.pad_of(path.vehicle), setup.frame
    home = (*frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m)
    if to is not FormatName.QGC:
        return format_qgc_waypoints(items, dialect, home)
    if content.fence is None:
        return format_qgc_plan(items, dialect, home)
    pad_m = (pad.east_m, pad.north_m)
    fence = build_fence(flown_places(pad_m, path, frame), content.fence.margin_m, top_m=0.0)
    rally = build_rally_items((pad_m,), frame) if content.fence.rally == "pad" else ()
    return format_qgc_plan(items, dialect, home, fence=build_fence_items(fence, frame), rally=rally)


def _autopilot_of(content: PlanFile, name: str, asked: AutopilotName | None) -> str:
    """Return in whose dialect a vehicle's mission is written, and say where that is not what the plan says."""
    planned = content.autopilots.get(name)
    if asked is None and planned is None:
        _warn(f"{name}: the plan does not say its autopilot; written for {FIRST_AUTOPILOT.value}, or see --autopilot")
    elif asked is not None and planned is not None and asked.value != planned:
        _warn(f"{name}: written for {asked.value} as --autopilot has it; the plan is for {planned}")
    return planned or FIRST_AUTOPILOT.value if asked is None else asked.value


def _warn(text: str) -> None:
    TerminalConsole(quiet=False, yes=True).say(Level.WARNING, text)


def _export_run(run: Path, output: Path, to: FormatName) -> None:
    from executor.analysis.drawn_run import build_drawn_run

    if to not in DRAWN:
        raise SiteError(
            f"{run}: --format {to.value}: expected kml, geojson or gpx for a run directory; its plans can be exported "
            f"one by one, such as {RunDirectory(run).plan_path(0)}"
        )
    _write(output, f"flight.{to.value}", DRAWN[to](build_drawn_run(run)))


def _write(output: Path, name: str, text: str) -> None:
    write_named_file(output, lambda folder: folder.mkdir(parents=True, exist_ok=True))
    path = output / name
    write_named_file(path, lambda file: write_whole(file, text.encode()))
    print(path)
