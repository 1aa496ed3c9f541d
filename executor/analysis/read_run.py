"""A run directory back to the flight that left it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from executor.adapters.eventlog import read_events, read_head, read_notes
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FlightReport, read_report
from executor.analysis.flight_record import (
    DecisionLine,
    FlightRecord,
    PlanRevision,
    SegmentRecord,
    VehicleRecord,
    build_launch_revision,
    build_planned_route,
    draw_at_pct,
    inspection_time_s,
    list_uncovered_ids,
    route_join_time_s,
    take_off_time_s,
)
from executor.core.battery.pack_condition import PackHistory
from executor.core.interface.commands import Level
from executor.core.interface.events import Event, Heard, LaunchOrdered, SolveEnded, UploadEnded
from executor.core.interface.messages import Battery, EstimatorStatus, Gps, Heartbeat, Position, SystemStatus
from executor.core.state.inspection_run import PositionSample, Track
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.core.state.vehicle_position import update_positioning
from executor.errors import LogError
from executor.site import site_model
from executor.site.site_file import Site, read_site
from executor.site.site_packs import load_site_packs
from missions import Inspection, LocalFrame, PlanFile, read_plan, tracks_m


@dataclass(slots=True)
class _VehicleMessages:
    """What one vehicle said, in the order of arrival and in seconds since the launch."""

    positions: list[tuple[float, float, float, float]] = field(default_factory=list)
    seas: list[float] = field(default_factory=list)
    """Heights above mean sea level of the positions."""
    samples: list[tuple[float, PositionSample]] = field(default_factory=list)
    battery: list[tuple[float, float]] = field(default_factory=list)
    status: list[tuple[float, float]] = field(default_factory=list)
    positioning: Positioning = field(default_factory=Positioning)
    newest: PositionFix | None = None
    armed: bool = False
    reckoned: list[bool] = field(default_factory=list)
    """Of the positions: whether GPS was lost."""

    def take_position(self, said: Position, place_m: tuple[float, float], t_s: float) -> None:
        """Take where it was; what is reckoned proves nothing."""
        velocity_m_s = (said.east_m_s, said.north_m_s, -said.down_m_s)
        is_reckoned = self.positioning.lost_s is not None
        self.newest = PositionFix(
            t_s, said.boot_s, place_m, said.alt_rel_m, said.alt_msl_m, velocity_m_s, reckoned=is_reckoned
        )
        self.positions.append((t_s, *place_m, said.alt_rel_m))
        self.seas.append(said.alt_msl_m)
        self.reckoned.append(is_reckoned)
        if not is_reckoned:
            self.samples.append((t_s, PositionSample(said.boot_s, place_m)))

    def take_positioning(self, said: Gps | EstimatorStatus | SystemStatus, t_s: float) -> None:
        """Take what it said of its GPS."""
        self.positioning = update_positioning(self.positioning, said, self.newest, t_s, stands=not self.armed)


@dataclass(slots=True)
class _Log:
    """What a record takes from the event log."""

    launched_s: float
    """In the ground station's time; all others are since then."""
    heard: dict[str, _VehicleMessages]
    solved_s: dict[int, float]
    """When each re-plan was found."""
    solving_s: dict[int, float]
    """When its solver began, at the latest."""
    uploaded: dict[tuple[int, str], tuple[float, bool]]
    """When the upload of a revision to a vehicle ended, and whether it is on board."""


def read_run(run: Path) -> FlightRecord:
    """Return the flight that a run directory describes.

    Lines that a dying writer left half written are passed over.

    Raises:
        LogError: report.json or events.jsonl cannot be read, or the log holds no launch.
        SiteError: site.toml cannot be used.
        MissionsError: a plan file cannot be used.
    """
    report = read_report(run)
    site = read_site(RunDirectory(run).site)
    first = read_plan(RunDirectory(run).plan_path(0))
    log = _read_log(RunDirectory(run).events, first.frame, site)
    vehicles = _build_vehicles(site, load_site_packs(site, run).fitted, report, log)
    by_name = {vehicle.name: vehicle for vehicle in vehicles}
    revisions = [build_launch_revision(first)]
    for row in report.replans:
        content = read_plan(RunDirectory(run).plan_path(row.revision))
        revisions.append(_build_replan_revision(row.revision, content, by_name, log))
    return FlightRecord(
        segments=_build_segments(first, site, report, log),
        vehicles=vehicles,
        revisions=tuple(revisions),
        decisions=tuple(_read_decisions(RunDirectory(run).events, log.launched_s)),
        duration_s=report.duration_s,
        areas=first.areas,
        never=tuple((one.name, one.why) for one in first.unreachable),
        launched_unix_s=read_head(RunDirectory(run).events).began_unix_s + log.launched_s,
    )


def _read_log(path: Path, frame: LocalFrame, site: Site) -> _Log:
    events = list(read_events(path))
    launched_s = next((t_s for t_s, event in events if isinstance(event, LaunchOrdered)), None)
    if launched_s is None:
        raise LogError(f"{path}: expected the log of a flight, but nothing was launched")
    log = _Log(launched_s, {table.name: _VehicleMessages() for table in site.vehicle}, {}, {}, {})
    for t_s, event in events:
        _take_event(log, event, t_s - launched_s, frame, site.flight.speedup)
    return log


def _take_event(log: _Log, event: Event, t_s: float, frame: LocalFrame, speedup: float) -> None:
    match event:
        case Heard(vehicle, Position() as position) if vehicle in log.heard:
            log.heard[vehicle].take_position(position, frame.to_local_m(position.lat_deg, position.lon_deg), t_s)
        case Heard(vehicle, Heartbeat(armed=armed)) if vehicle in log.heard:
            log.heard[vehicle].armed = armed
        case Heard(vehicle, Gps() | EstimatorStatus() as said) if vehicle in log.heard:
            log.heard[vehicle].take_positioning(said, t_s)
        case Heard(vehicle, Battery(remaining_pct=remaining)) if vehicle in log.heard and remaining is not None:
            log.heard[vehicle].battery.append((t_s, remaining))
        case Heard(vehicle, SystemStatus(remaining_pct=remaining) as said) if vehicle in log.heard:
            log.heard[vehicle].take_positioning(said, t_s)
            if remaining is not None:
                log.heard[vehicle].status.append((t_s, remaining))
        case SolveEnded():
            log.solved_s[event.revision] = t_s
            log.solving_s[event.revision] = t_s - speedup * event.solve_s
        case UploadEnded():
            log.uploaded[event.revision, event.vehicle] = (t_s, event.accepted)
        case _:
            pass


def _read_decisions(path: Path, launched_s: float) -> Iterator[DecisionLine]:
    """Yield what the operator saw: what was decided, or told of something else, such as a broker."""
    for note in read_notes(path):
        text = note.get("said", note.get("told"))
        if text is not None:
            yield DecisionLine(note["t_s"] - launched_s, Level(note["level"]), text)


def _build_vehicles(
    site: Site, packs: Mapping[str, PackHistory], report: FlightReport, log: _Log
) -> tuple[VehicleRecord, ...]:
    drone = site_model.drone_of(site)
    faults = {row.vehicle: row for row in report.faults}
    vehicles = []
    for layer, table in enumerate(site.vehicle):
        heard = log.heard[table.name]
        vehicles.append(
            VehicleRecord(
                name=table.name,
                layer=layer,
                # It stands there until it takes off; whoever was never heard is shown at the depot.
                pad_m=heard.samples[0][1].place_m if heard.samples else (0.0, 0.0),
                budget_pct=site_model.budget_pct_of(packs.get(table.name), drone, table),
                reserve_pct=table.reserve_pct + site_model.find_empty_pct(packs.get(table.name), drone, table),
                track=np.array(heard.positions, dtype=np.float64).reshape(-1, 4),
                # As in flight: SYS_STATUS counts only where there is no BATTERY_STATUS.
                battery=np.array(heard.battery or heard.status, dtype=np.float64).reshape(-1, 2),
                fault=faults.get(table.name),
                sea_m=np.array(heard.seas, dtype=np.float64),
                reckoned=np.array(heard.reckoned, dtype=np.bool_),
            )
        )
    return tuple(vehicles)


def _build_segments(first: PlanFile, site: Site, report: FlightReport, log: _Log) -> tuple[SegmentRecord, ...]:
    inspected_by = {segment: row.name for row in report.vehicles for segment in row.segments}
    standoff_m = (first.inspection or Inspection()).standoff_m
    lines_m = tracks_m(first.build_network(), standoff_m).tolist()
    segments = []
    for segment, (begin_m, end_m) in zip(first.segments, lines_m, strict=True):
        by = inspected_by.get(segment.id)
        at_s = None
        if by is not None and by in log.heard:
            at_s = inspection_time_s(
                log.heard[by].samples,
                Track(segment.id, tuple(begin_m), tuple(end_m)),
                corridor_m=site.inspection.corridor_m,
                speed_m_s=site.inspection.speed_m_s,
            )
        name = report.segment_names.get(str(segment.id), "")
        segments.append(SegmentRecord(segment.id, segment.a_enu_m[:2], segment.b_enu_m[:2], by, at_s, name))
    return tuple(segments)


def _build_replan_revision(
    number: int, content: PlanFile, vehicles: Mapping[str, VehicleRecord], log: _Log
) -> PlanRevision:
    """Return a re-plan with its routes set where the vehicles began them, in time and in battery."""
    instance = content.build_instance()
    decided_s = log.solved_s.get(number, 0.0)
    routes = []
    for route in content.plan.routes:
        planned_for = content.vehicles[route.vehicle]
        uploaded_s, on_board = log.uploaded.get((number, planned_for.name), (decided_s, True))
        if not on_board or planned_for.name not in vehicles or not (route.visits or planned_for.airborne):
            continue
        vehicle = vehicles[planned_for.name]
        if planned_for.airborne:
            began_s = route_join_time_s(vehicle.track, planned_for.start_m, log.solving_s.get(number, decided_s))
        else:
            began_s = take_off_time_s(vehicle.track, uploaded_s)
        used_pct = draw_at_pct(vehicle, began_s)
        routes.append(build_planned_route(content, instance, route, began_s=began_s, used_pct=used_pct))
    return PlanRevision(number, decided_s, tuple(routes), list_uncovered_ids(content))
