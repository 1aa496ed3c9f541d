"""Define the command `export`: files for other ground stations, Google Earth, GIS programs and handhelds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer

import missions
from executor.adapters.run_directory import RunDirectory
from executor.analysis.flight_record import GAP_S, FlightRecord, VehicleRecord, find_last_row, read_run
from executor.cli.console import TerminalConsole
from executor.cli.options import FIRST_AUTOPILOT, AutopilotName, FormatName
from executor.cli.plan_inputs import write_named_file
from executor.core.interface.commands import Level
from executor.core.preflight.mission_checks import find_low_places
from executor.errors import LogError, SiteError
from executor.site import site_model, site_planning
from executor.site.site_file import read_site
from missions import exports
from missions.clearance import check_mission_ceiling
from missions.fences import build_fence, build_fence_items, build_rally_items, flown_places
from missions.files import write_whole
from missions.geo import FloatArray
from missions.inspection_height import build_first_paths
from missions.plan_file import setup_of_plan

SAME_PAD_M = 1.0
"""Pads farther apart than this are separate pads."""
DECIMALS = 6
"""Decimals of a degree: one decimetre, the accuracy of a position."""
STEP_S = 0.5
"""Shortest interval between exported positions; denser ones add nothing on a map."""


def build_drawn_run(run: Path) -> exports.MapFeatures:
    """Return the map features of a run directory's flight.

    Raises:
        LogError: it holds no report, or its log cannot be read.
        SiteError: site.toml cannot be used.
        MissionsError: a plan file cannot be used.
    """
    record, first = read_run(run), missions.read_plan(RunDirectory(run).plan_path(0))
    if first.inspection is None:
        raise LogError(
            f"{RunDirectory(run).plan_path(0)}: inspection: expected heights and speeds, but the plan has none"
        )
    pads = []
    for one in record.vehicles:  # home altitude: the vehicle's first report
        at_m = float(one.sea_m[0] - one.track[0, 3]) if len(one.track) else first.frame.alt_m
        pads.append(missions.Pad(one.name, *one.pad_m, at_m))
    names = tuple(vehicle.name for vehicle in record.vehicles)
    terrain = site_model.load_terrain(read_site(RunDirectory(run).site), run, first.build_network())
    setup = setup_of_plan(first, first.inspection, pads=pads, terrain=terrain)
    segments = {
        number: {
            "inspected_by": segment.inspected_by,
            "inspected": None if segment.inspected_s is None else _format_time(record, segment.inspected_s),
        }
        for number, segment in enumerate(record.segments)
    }
    ways = [*exports.build_segment_lines(setup, segments), *_build_planned_ways(run, record, setup, first)]
    ways += [way for vehicle in record.vehicles for way in _build_flown_ways(record, setup.frame, vehicle)]
    spots = [*exports.build_pad_points(setup, exports.Reference.SEA), *_build_loss_places(record, setup)]
    return exports.MapFeatures(f"flight of {_format_time(record, 0.0)}", names, ways, spots)


def _format_time(record: FlightRecord, t_s: float) -> str:
    when = datetime.fromtimestamp(record.launched_unix_s + t_s, UTC)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 1000:03d}Z"


def _build_planned_ways(
    run: Path, record: FlightRecord, setup: missions.FlightSetup, first: missions.PlanFile
) -> Iterator[exports.MapLine]:
    """Yield the routes of the first plan, and those uploaded in flight, each from where the vehicle began it."""
    firsts = build_first_paths(setup, {route.vehicle: first.visits_of(route) for route in first.routes})
    for revision in record.revisions:
        number = revision.number
        content = missions.read_plan(RunDirectory(run).plan_path(number)) if number else first
        on_board = {route.vehicle for route in revision.routes}
        for vehicle, route in zip(content.vehicles, content.routes, strict=True):
            if vehicle.name not in on_board:
                continue
            visits = first.visits_of(route)
            if not number:
                path = firsts[vehicle.name]
            elif vehicle.airborne:
                up_m = vehicle.start_up_m if content.pricing is not None else None
                path = _build_path_from_air(setup, vehicle.name, vehicle.start_m, up_m, visits)
            else:
                path = missions.build_flight_path(setup, vehicle.name, visits)
            if path.waypoints:
                facts: dict[str, exports.Fact] = {
                    "revision": number,
                    "begin": _format_time(record, revision.decided_s),
                    "segments": len(visits),
                }
                name = f"{vehicle.name} {f're-plan {number}' if number else 'planned'}"
                yield exports.build_route_line(setup, path, name, facts, reference=exports.Reference.SEA)


def _build_path_from_air(
    setup: missions.FlightSetup, name: str, start_m: tuple[float, float], up_m: float | None, visits: tuple[int, ...]
) -> missions.FlightPath:
    """Return the path from a vehicle's position in the air; without its height there, in its layer."""
    layers = setup.layers
    here_m = (layers.surface.height_m(*start_m) if up_m is None else up_m) + layers.offset_m(name)
    alt_rel_m = here_m - setup.frame.up_m(setup.pad_of(name).alt_m)
    begin = missions.Waypoint(
        missions.Phase.TRANSIT, *setup.frame.to_wgs84_deg(*start_m), alt_rel_m, setup.inspection.transit_speed_m_s
    )
    return missions.continue_path(setup, missions.FlightPath(name, (begin,)), 1, visits)


def _build_flown_ways(
    record: FlightRecord, frame: missions.LocalFrame, vehicle: VehicleRecord
) -> Iterator[exports.MapLine]:
    """Yield a vehicle's track since the launch, split at gaps; reckoned parts separately."""
    kept = _thin_positions(vehicle.track[:, 0])
    adrift = vehicle.reckoned
    cuts = (np.diff(vehicle.track[kept, 0]) > GAP_S) | np.diff(adrift[kept])
    breaks = [0, *(np.flatnonzero(cuts) + 1).tolist(), len(kept)]
    lat_lon = frame.many_to_wgs84_deg(vehicle.track[kept, 1:3]) if len(kept) else np.zeros((0, 2))
    pieces: dict[bool, list[exports.MapLinePiece]] = {False: [], True: []}
    for begin, end in pairwise(breaks):
        rows = kept[begin:end]
        if len(rows) > 1:
            positions = tuple(
                (round(float(lat), DECIMALS), round(float(lon), DECIMALS), float(sea_m))
                for (lat, lon), sea_m in zip(lat_lon[begin:end], vehicle.sea_m[rows], strict=True)
            )
            times = tuple(_format_time(record, t_s) for t_s in vehicle.track[rows, 0].tolist())
            pieces[bool(adrift[rows[0]])].append(exports.MapLinePiece(positions, times))
    segments = sum(segment.inspected_by == vehicle.name for segment in record.segments)
    told: dict[bool, tuple[str, dict[str, exports.Fact]]] = {
        False: ("flown", {"segments": segments}), True: ("reckoned without GPS", {"known": "reckoned"}),
    }  # fmt: skip
    for is_adrift, (words, facts) in told.items():
        if own := tuple(pieces[is_adrift]):
            name = f"{vehicle.name} {words}"
            yield exports.MapLine(exports.MapFeatureKind.FLOWN, name, own, exports.Reference.SEA, vehicle.name, facts)


def _thin_positions(times_s: FloatArray) -> npt.NDArray[np.intp]:
    """Return the indices of positions since the launch that are at least `STEP_S` apart."""
    kept: list[int] = []
    last_s = -STEP_S
    for index, t_s in enumerate(times_s.tolist()):
        if t_s >= 0.0 and t_s - last_s >= STEP_S:
            kept.append(index)
            last_s = t_s
    return np.array(kept, dtype=np.intp)


def _build_loss_places(record: FlightRecord, setup: missions.FlightSetup) -> Iterator[exports.MapPoint]:
    """Yield each lost vehicle's last GPS position before its fault was declared, and its age."""
    for vehicle, fault in record.losses:
        row = find_last_row(vehicle, fault.detected_s)
        if row is None:
            continue
        at_s, east_m, north_m, _ = vehicle.track[row].tolist()
        lat_deg, lon_deg = setup.frame.to_wgs84_deg(east_m, north_m)
        place = (round(lat_deg, DECIMALS), round(lon_deg, DECIMALS), float(vehicle.sea_m[row]))
        facts: dict[str, exports.Fact] = {
            "event": "fault",
            "fault": fault.kind.value,
            "reason": fault.reason,
            "happened": None if fault.happened_s is None else _format_time(record, fault.happened_s),
            "position_age_s": round(fault.detected_s - at_s, 1),
        }
        yield exports.MapPoint(
            exports.MapFeatureKind.EVENT, f"{vehicle.name} lost: {fault.kind.value}", place, exports.Reference.SEA,
            vehicle.name, _format_time(record, fault.detected_s), facts,
        )  # fmt: skip


DRAWN: Mapping[FormatName, Callable[[exports.MapFeatures], str]] = {
    FormatName.KML: exports.format_kml,
    FormatName.GEOJSON: exports.format_geojson,
    FormatName.GPX: exports.format_gpx,
}
"""Formats that show the plan: one file for all vehicles."""
SUFFIXES = {FormatName.QGC: "plan", FormatName.WAYPOINTS: "waypoints"}
"""Formats that are flown: one file for each vehicle."""


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
            "geojson, gpx: one file with the line, the pads and all routes, for a flight also the flown tracks. By "
            "default qgc for a plan and kml for a flight.",
        ),
    ] = None,
    autopilot: Annotated[
        AutopilotName | None,
        typer.Option(
            help="Autopilot of all vehicles, for qgc and waypoints; by default each vehicle's own, from the plan."
        ),
    ] = None,
    site: Annotated[
        Path | None,
        typer.Option(
            metavar="SITE",
            help="The plan's site file, for a plan over [terrain], with [[look]], or from [[base]] and [[place]]: "
            "the plan file does not hold the ground, the cameras and the pads.",
        ),
    ] = None,
) -> None:
    """Write a plan for other ground stations, or a plan or a flight for maps."""
    if what.is_dir():
        shown = to or FormatName.KML
        if shown not in DRAWN:
            raise SiteError(
                f"{what}: --format {shown.value}: expected kml, geojson or gpx for a run directory; its plans can be "
                f"exported one by one, such as {RunDirectory(what).plan_path(0)}"
            )
        _write(output, f"flight.{shown.value}", DRAWN[shown](build_drawn_run(what)))
        return
    content = missions.read_plan(what)
    setup, paths = _build_paths(content, what, site)
    to = to or FormatName.QGC
    if to in DRAWN:
        _write(output, f"{what.stem}.{to.value}", DRAWN[to](exports.build_plan_features(content, setup, what.stem)))
    else:
        _export_missions(content, setup, paths, output, to, autopilot)


def _build_paths(
    content: missions.PlanFile, source: Path, site: Path | None
) -> tuple[missions.FlightSetup, Mapping[str, missions.FlightPath]]:
    """Return heights and pads, and every vehicle's path, if they are within the height limits."""
    if content.inspection is None:
        raise SiteError(f"{source}: inspection: expected heights and speeds, but the plan has none")
    for name in {} if content.pricing is None else content.pricing.starts:
        raise SiteError(
            f"{source}: {name} lands at another base than it takes off: expected a plan of a flight, not of a day"
        )
    if site is not None:
        ground = site_model.load_site_model(read_site(site), site.parent)
        site_planning.check_plan_fits(content, ground, str(source))
        setup = ground.setup
    else:
        for key in ("terrain", "cameras"):
            if getattr(content, key):
                raise SiteError(f"{source}: {key}: expected --site with the site file that the plan was made of")
        setup = setup_of_plan(content, content.inspection)
        for name, base in ({} if content.pricing is None else content.pricing.bases).items():
            if math.dist(base.place_m[:2], setup.base_of(name).place_m[:2]) > SAME_PAD_M:
                raise SiteError(
                    f"{source}: {name} stands on a pad of its site: expected --site with the site file that the plan "
                    "was made of"
                )
    paths = site_model.build_paths(setup, {route.vehicle: content.visits_of(route) for route in content.routes})
    for line in (*find_low_places(setup, list(paths.values())), *check_mission_ceiling(setup, paths.values())):
        raise SiteError(f"{source}: heights: {line}")
    return setup, paths


def _export_missions(
    content: missions.PlanFile,
    setup: missions.FlightSetup,
    paths: Mapping[str, missions.FlightPath],
    output: Path,
    to: FormatName,
    autopilot: AutopilotName | None,
) -> None:
    texts = {}
    for name, path in paths.items():
        own = missions.dialect_for(_autopilot_of(content, name, autopilot))
        try:
            texts[name] = _mission_text(content, setup, path, to, own)
        except missions.MissionFileError as error:
            instead = f"; --format {FormatName.QGC.value} has a word for it" if to is not FormatName.QGC else ""
            raise SiteError(f"{name}: --format {to.value}: {own.title}: {error}{instead}") from error
    for name, text in texts.items():
        _write(output, f"{name}.{SUFFIXES[to]}", text)
    if to is FormatName.QGC and (content.fence is None or content.fence.rally == "keep"):
        what = "neither fence nor rally points" if content.fence is None else "no rally points"
        _warn(f"the plan has {what} ([fence] of its site): the upload of these files clears those on board")


def _mission_text(
    content: missions.PlanFile,
    setup: missions.FlightSetup,
    path: missions.FlightPath,
    to: FormatName,
    dialect: missions.Dialect,
) -> str:
    items, pad, frame = missions.encode(path, dialect).items, setup.pad_of(path.vehicle), setup.frame
    home = (*frame.to_wgs84_deg(pad.east_m, pad.north_m), pad.alt_m)
    if to is not FormatName.QGC:
        return exports.format_qgc_waypoints(items, dialect, home)
    if content.fence is None:
        return exports.format_qgc_plan(items, dialect, home)
    pad_m = (pad.east_m, pad.north_m)
    fence = build_fence(flown_places(pad_m, path, frame), content.fence.margin_m, top_m=0.0)
    rally = build_rally_items((pad_m,), frame) if content.fence.rally == "pad" else ()
    return exports.format_qgc_plan(items, dialect, home, fence=build_fence_items(fence, frame), rally=rally)


def _autopilot_of(content: missions.PlanFile, name: str, asked: AutopilotName | None) -> str:
    """Return the dialect to write a vehicle's mission in, and warn if it differs from the plan's."""
    planned = next(vehicle.autopilot for vehicle in content.vehicles if vehicle.name == name)
    if asked is None and planned is None:
        _warn(f"{name}: the plan does not say its autopilot; written for {FIRST_AUTOPILOT.value}, or see --autopilot")
    elif asked is not None and planned is not None and asked.value != planned:
        _warn(f"{name}: written for {asked.value} as --autopilot has it; the plan is for {planned}")
    return planned or FIRST_AUTOPILOT.value if asked is None else asked.value


def _warn(text: str) -> None:
    TerminalConsole(quiet=False, yes=True).say(Level.WARNING, text)


def _write(output: Path, name: str, text: str) -> None:
    write_named_file(output, lambda folder: folder.mkdir(parents=True, exist_ok=True))
    path = output / name
    write_named_file(path, lambda file: write_whole(file, text.encode()))
    print(path)
