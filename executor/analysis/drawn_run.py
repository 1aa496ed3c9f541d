"""A flight as lines and places on the earth: what was planned, what was flown and when, and who was lost where."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FaultRow
from executor.analysis.flight_record import GAP_S, FlightRecord, VehicleRecord, find_last_row, read_run
from executor.errors import LogError
from executor.site.site_file import read_site
from executor.site.site_model import load_terrain
from missions import (
    FlightPath,
    FlightSetup,
    LocalFrame,
    Pad,
    Phase,
    PlanFile,
    Waypoint,
    build_flight_path,
    continue_path,
    read_plan,
)
from missions.exports import (
    Fact,
    MapFeatureKind,
    MapFeatures,
    MapLine,
    MapLinePiece,
    MapPoint,
    Reference,
    build_pad_points,
    build_route_line,
    build_segment_lines,
)
from missions.geo import FloatArray
from missions.inspection_height import build_first_paths
from missions.plan_file import setup_of_plan
from planner import is_reversed, segment_of, visit_of

DECIMALS = 6
"""Of a degree: more than a decimetre no position carries."""
STEP_S = 0.5
"""Positions that follow sooner say nothing more to who looks at a map."""


def build_drawn_run(run: Path) -> MapFeatures:
    """Return the flight of a run directory.

    Raises:
        LogError: it holds no report, or its log cannot be read.
        SiteError: site.toml cannot be used.
        MissionsError: a plan file cannot be used.
    """
    record, first = read_run(run), read_plan(RunDirectory(run).plan_path(0))
    if first.inspection is None:
        raise LogError(
            f"{RunDirectory(run).plan_path(0)}: inspection: expected heights and speeds, but the plan has none"
        )
    pads = [
        Pad(vehicle.name, *vehicle.pad_m, _home_height_m(vehicle, first.frame.alt_m)) for vehicle in record.vehicles
    ]
    names = tuple(vehicle.name for vehicle in record.vehicles)
    terrain = load_terrain(read_site(RunDirectory(run).site), run, first.build_network())
    setup = setup_of_plan(first, first.inspection, pads=pads, terrain=terrain)
    segments = {
        number: {
            "inspected_by": segment.inspected_by,
            "inspected": None if segment.inspected_s is None else _format_time(record, segment.inspected_s),
        }
        for number, segment in enumerate(record.segments)
    }
    ways = [
        *build_segment_lines(setup, segments),
        *_build_planned_ways(record, setup, first),
        *_build_replanned_ways(run, record, setup, first),
    ]
    ways += [way for vehicle in record.vehicles for way in _build_flown_ways(record, setup.frame, vehicle)]
    spots = [*build_pad_points(setup, Reference.SEA), *_build_loss_places(record, setup)]
    return MapFeatures(f"flight of {_format_time(record, 0.0)}", names, ways, spots)


def _home_height_m(vehicle: VehicleRecord, otherwise_m: float) -> float:
    """Return the height of a vehicle's home above mean sea level, as it said it first."""
    return float(vehicle.sea_m[0] - vehicle.track[0, 3]) if len(vehicle.track) else otherwise_m


def _format_time(record: FlightRecord, t_s: float) -> str:
    when = datetime.fromtimestamp(record.launched_unix_s + t_s, UTC)
    return f"{when:%Y-%m-%dT%H:%M:%S}.{when.microsecond // 1000:03d}Z"


def _build_planned_ways(record: FlightRecord, setup: FlightSetup, first: PlanFile) -> Iterator[MapLine]:
    routes = {first.vehicles[route.vehicle].name: route.visits for route in first.plan.routes}
    for name, path in build_first_paths(setup, routes).items():
        if path.waypoints:
            facts: dict[str, Fact] = {"revision": 0, "begin": _format_time(record, 0.0), "segments": len(routes[name])}
            yield build_route_line(setup, path, f"{name} planned", facts, reference=Reference.SEA)


def _build_replanned_ways(run: Path, record: FlightRecord, setup: FlightSetup, first: PlanFile) -> Iterator[MapLine]:
    """Yield what was put on board in flight, from where the vehicle began it."""
    numbers = {segment.id: number for number, segment in enumerate(first.segments)}
    for revision in record.revisions[1:]:
        content = read_plan(RunDirectory(run).plan_path(revision.number))
        on_board = {route.vehicle for route in revision.routes}
        for route in content.plan.routes:
            vehicle = content.vehicles[route.vehicle]
            if vehicle.name not in on_board:
                continue
            visits = tuple(
                visit_of(numbers[content.segments[segment_of(visit)].id], is_reversed(visit)) for visit in route.visits
            )
            if vehicle.airborne:
                up_m = vehicle.start_up_m if content.pricing is not None else None
                path = _build_path_from_air(setup, vehicle.name, vehicle.start_m, up_m, visits)
            else:
                path = build_flight_path(setup, vehicle.name, visits)
            if path.waypoints:
                facts: dict[str, Fact] = {
                    "revision": revision.number,
                    "begin": _format_time(record, revision.decided_s),
                    "segments": len(visits),
                }
                name = f"{vehicle.name} re-plan {revision.number}"
                yield build_route_line(setup, path, name, facts, reference=Reference.SEA)


def _build_path_from_air(
    setup: FlightSetup, name: str, start_m: tuple[float, float], up_m: float | None, visits: tuple[int, ...]
) -> FlightPath:
    """Return the path that begins where a vehicle was in the air; without its height there, in its layer."""
    layers = setup.layers
    here_m = (layers.surface.height_m(*start_m) if up_m is None else up_m) + layers.offset_m(name)
    alt_rel_m = here_m - setup.frame.up_m(setup.pad_of(name).alt_m)
    begin = Waypoint(Phase.TRANSIT, *setup.frame.to_wgs84_deg(*start_m), alt_rel_m, setup.inspection.transit_speed_m_s)
    return continue_path(setup, FlightPath(name, (begin,)), 1, visits)


def _build_flown_ways(record: FlightRecord, frame: LocalFrame, vehicle: VehicleRecord) -> Iterator[MapLine]:
    """Yield a vehicle's track since the launch, in as many pieces as it was heard in; what is reckoned for itself."""
    kept = _thin_positions(vehicle.track[:, 0])
    adrift = np.zeros(len(vehicle.track), dtype=np.bool_) if vehicle.reckoned is None else vehicle.reckoned
    cuts = (np.diff(vehicle.track[kept, 0]) > GAP_S) | (np.diff(adrift[kept].astype(np.int8)) != 0)
    breaks = [0, *(np.flatnonzero(cuts) + 1).tolist(), len(kept)]
    lat_lon = frame.many_to_wgs84_deg(vehicle.track[kept, 1:3]) if len(kept) else np.zeros((0, 2))
    pieces: dict[bool, list[MapLinePiece]] = {False: [], True: []}
    for begin, end in pairwise(breaks):
        rows = kept[begin:end]
        if len(rows) > 1:
            positions = tuple(
                (round(float(lat), DECIMALS), round(float(lon), DECIMALS), float(sea_m))
                for (lat, lon), sea_m in zip(lat_lon[begin:end], vehicle.sea_m[rows], strict=True)
            )
            times = tuple(_format_time(record, t_s) for t_s in vehicle.track[rows, 0].tolist())
            pieces[bool(adrift[rows[0]])].append(MapLinePiece(positions, times))
    segments = sum(segment.inspected_by == vehicle.name for segment in record.segments)
    told: dict[bool, tuple[str, dict[str, Fact]]] = {
        False: ("flown", {"segments": segments}), True: ("reckoned without GPS", {"known": "reckoned"}),
    }  # fmt: skip
    for is_adrift, (words, facts) in told.items():
        if own := tuple(pieces[is_adrift]):
            name = f"{vehicle.name} {words}"
            yield MapLine(MapFeatureKind.FLOWN, name, own, Reference.SEA, vehicle.name, facts)


def _thin_positions(times_s: FloatArray) -> npt.NDArray[np.intp]:
    """Return the indices of positions since the launch that are `STEP_S` apart or more."""
    kept: list[int] = []
    last_s = -STEP_S
    for index, t_s in enumerate(times_s.tolist()):
        if t_s >= 0.0 and t_s - last_s >= STEP_S:
            kept.append(index)
            last_s = t_s
    return np.array(kept, dtype=np.intp)


def _build_loss_places(record: FlightRecord, setup: FlightSetup) -> Iterator[MapPoint]:
    """Yield where each vehicle that was lost was by GPS last before that was declared, and how long before."""
    for vehicle, fault in record.losses:
        row = find_last_row(vehicle, fault.detected_s)
        if row is None:
            continue
        at_s, east_m, north_m, _ = vehicle.track[row].tolist()
        lat_deg, lon_deg = setup.frame.to_wgs84_deg(east_m, north_m)
        place = (round(lat_deg, DECIMALS), round(lon_deg, DECIMALS), float(vehicle.sea_m[row]))
        yield MapPoint(
            MapFeatureKind.EVENT, f"{vehicle.name} lost: {fault.kind.value}", place, Reference.SEA, vehicle.name,
            _format_time(record, fault.detected_s), _describe_fault(record, fault, fault.detected_s - at_s),
        )  # fmt: skip


def _describe_fault(record: FlightRecord, fault: FaultRow, age_s: float) -> dict[str, Fact]:
    happened = None if fault.happened_s is None else _format_time(record, fault.happened_s)
    return {
        "event": "fault",
        "fault": fault.kind.value,
        "reason": fault.reason,
        "happened": happened,
        "position_age_s": round(age_s, 1),
    }
