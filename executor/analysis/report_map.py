"""Build the map data of a report; report.js draws it with the pages' map component."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TypedDict

import numpy as np

from executor.adapters.web.snapshot import PageArea, list_page_areas, round_place
from executor.analysis import flight_record
from executor.analysis.documents import FlightReport, VehicleRow
from executor.core import formatting
from executor.site.site_model import SiteModel
from missions.geo import FloatArray

STEP_M = 3.0
"""Distance between two points of a track."""
APART_M = 10.0
"""Distance below which the last position and the place of the loss are drawn as one."""
LOOKS = (
    ("inferred", "inferred", "l-done l-inferred"),
    ("missed", "missed", "l-missed"),
    ("left-over", "not inspected", "l-left"),
    ("left-out", "left out", "l-out"),
    ("unreachable", "out of reach", "l-barred"),
)
"""States other than `done`: text, and class of the line in the legend."""


class ReportSegment(TypedDict):
    """A segment on a report's map."""

    name: str
    ends_m: tuple[flight_record.Place, flight_record.Place]
    state: str
    """State on the map: done, inferred, missed, left-over, left-out or unreachable."""
    by: str | None
    """Vehicle that inspected it."""
    at: str
    """Time of the inspection; empty if unknown."""
    planned: str | None
    """Vehicle that it was planned for when the flight began."""
    taken_over: bool
    """Whether it was taken over from a lost vehicle."""


class ReportLoss(TypedDict):
    """Vehicle that was lost."""

    place_m: flight_record.Place
    """Last GPS position."""
    at: str
    why: str


class ReportEnd(TypedDict):
    """Vehicle that did not return to its pad."""

    place_m: flight_record.Place
    """Last reported position."""
    state: str


class ReportVehicle(TypedDict):
    """A vehicle on a report's map."""

    name: str
    pad_m: flight_record.Place
    flown_m: list[list[flight_record.Place]]
    """Track in pieces, split where nothing was received."""
    lost: ReportLoss | None
    end: ReportEnd | None


class ReportRoute(TypedDict):
    """A route of a plan."""

    vehicle: str
    way_m: list[flight_record.Place]


class ReportPlan(TypedDict):
    """First plan (for a day with all its sorties), or a re-plan."""

    name: str
    routes: list[ReportRoute]


class ReportPlace(TypedDict):
    """Landing place other than a pad."""

    kind: str
    """Kind: base or alternate."""
    name: str
    place_m: flight_record.Place


class ReportFrame(TypedDict):
    """Origin of the local metres."""

    lat_deg: float
    lon_deg: float


class ReportMap(TypedDict):
    """`flight` in report.html: content of its map."""

    frame: ReportFrame | None
    segments: list[ReportSegment]
    areas: list[PageArea]
    places: list[ReportPlace]
    vehicles: list[ReportVehicle]
    plans: list[ReportPlan]


def build_report_map(
    record: flight_record.FlightRecord, report: FlightReport, ground: SiteModel | None = None
) -> ReportMap:
    """Return the content of the map.

    Args:
        record: The flight.
        report: Content of report.json.
        ground: Its site, whose network includes segments that the flight left out; without it they are not drawn.
    """
    frame = None if ground is None else ground.network.frame
    rows = {row.name: row for row in report.vehicles}
    return ReportMap(
        frame=None if frame is None else ReportFrame(lat_deg=frame.lat_deg, lon_deg=frame.lon_deg),
        segments=[*_list_flown(record, report), *(() if ground is None else _list_others(record, ground))],
        areas=list_page_areas(record.areas),
        places=[] if ground is None else list(_list_places(ground)),
        vehicles=[_build_vehicle(vehicle, rows.get(vehicle.name)) for vehicle in record.vehicles],
        plans=list(_list_plans(record)),
    )


def _list_flown(record: flight_record.FlightRecord, report: FlightReport) -> Iterator[ReportSegment]:
    planned = record.planned_for
    left = {segment.id for segment, _ in flight_record.find_abandoned_segments(record)}
    inferred, missed = set(report.inferred), {row.segment for row in report.seen if row.state == "not seen"}
    for one in record.segments:
        state = "done" if one.inspected_by is not None else "missed" if one.id in missed else "left-over"
        yield _build_segment(
            one, "inferred" if one.id in inferred else state, planned.get(one.id), taken_over=one.id in left
        )


def _list_others(record: flight_record.FlightRecord, ground: SiteModel) -> Iterator[ReportSegment]:
    """Yield the segments that were not part of the flight."""
    flown = {segment.id for segment in record.segments}
    never = {one.segment for one in ground.setup.unreachable} - ground.left_out
    for number, (a_m, b_m) in enumerate(ground.network.ends_m.tolist()):
        if number not in flown:
            name = ground.network.segment_name(number)
            one = flight_record.SegmentRecord(number, tuple(a_m), tuple(b_m), None, None, name)
            yield _build_segment(one, "unreachable" if number in never else "left-out")


def _list_places(ground: SiteModel) -> Iterator[ReportPlace]:
    alternates = (one for one in ground.site.place if one.kind == "alternate")
    for kind, places in (("base", ground.site.base), ("alternate", alternates)):
        for one in places:
            place_m = round_place(ground.network.frame.to_local_m(one.lat_deg, one.lon_deg))
            yield ReportPlace(kind=kind, name=one.name, place_m=place_m)


def _build_segment(
    one: flight_record.SegmentRecord, state: str, planned: str | None = None, *, taken_over: bool = False
) -> ReportSegment:
    return ReportSegment(
        name=one.display_name,
        ends_m=(round_place(one.a_m), round_place(one.b_m)),
        state=state,
        by=one.inspected_by,
        at="" if one.inspected_s is None else formatting.format_flight_time(one.inspected_s),
        planned=planned,
        taken_over=taken_over,
    )


def _build_vehicle(vehicle: flight_record.VehicleRecord, row: VehicleRow | None) -> ReportVehicle:
    lost, end = None, None
    fault, track_m = vehicle.fault, vehicle.track[:, 1:3].tolist()
    at = None if fault is None else flight_record.find_last_row(vehicle, fault.detected_s)
    if fault is not None and at is not None:
        when = formatting.format_flight_time(fault.detected_s)
        lost = ReportLoss(place_m=round_place(track_m[at]), at=when, why=fault.reason)
    is_out = row is not None and not row.landed and row.state not in {"", "ground"}
    if row is not None and is_out and track_m and (at is None or math.dist(track_m[at], track_m[-1]) > APART_M):
        end = ReportEnd(place_m=round_place(track_m[-1]), state=row.state)
    return ReportVehicle(
        name=vehicle.name,
        pad_m=round_place(vehicle.pad_m),
        flown_m=list(_thin_track(vehicle.track)),
        lost=lost,
        end=end,
    )


def _thin_track(track: FloatArray) -> Iterator[list[flight_record.Place]]:
    """Yield a (n, 4) track in pieces split at gaps, without points too close to see."""
    cuts = np.flatnonzero(np.diff(track[:, 0]) > flight_record.GAP_S) + 1
    for piece in np.split(track[:, 1:3], cuts):
        kept: list[flight_record.Place] = []
        for place in piece.tolist():
            if not kept or math.dist(kept[-1], place) >= STEP_M:
                kept.append(round_place(place))
        if len(kept) > 1:
            yield kept


def _list_plans(record: flight_record.FlightRecord) -> Iterator[ReportPlan]:
    """Yield the plans to show: for a day all its sorties, not only the first ones."""
    first, *later = record.revisions
    name, routes = ("plan of the day", record.sorties) if record.sorties else (record.first_words, first.routes)
    yield _build_plan(name, routes)
    for one in later:
        yield _build_plan(f"re-plan {one.number}, {formatting.format_flight_time(one.decided_s)}", one.routes)


def _build_plan(name: str, routes: Iterable[flight_record.PlannedRoute]) -> ReportPlan:
    ways = ((route.vehicle, [round_place(place) for place in _list_way(route)]) for route in routes)
    return ReportPlan(name=name, routes=[ReportRoute(vehicle=vehicle, way_m=way_m) for vehicle, way_m in ways])


def _list_way(route: flight_record.PlannedRoute) -> Iterator[flight_record.Place]:
    """Yield all places of a route, in order."""
    for leg in route.legs_m:
        yield from leg[:-1]
    yield route.legs_m[-1][-1]
