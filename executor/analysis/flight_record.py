"""Read a flight from its run directory as plain data. All times are seconds since the launch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path

import numpy as np
import numpy.typing as npt

import planner
from executor.adapters.eventlog import read_events, read_head, read_notes
from executor.adapters.run_directory import RunDirectory
from executor.analysis.documents import FaultRow, FlightReport, read_flown_day_plan
from executor.core.battery.pack_condition import PackHistory
from executor.core.interface import messages
from executor.core.interface.commands import Level
from executor.core.interface.events import Heard, LaunchOrdered, SolveEnded, UploadEnded
from executor.core.state.gps_loss import update_positioning
from executor.core.state.inspection_proof import InspectionRun, PositionSample, Track, advance_run
from executor.core.state.vehicle_parts import PositionFix, Positioning
from executor.errors import LogError
from executor.site import site_model
from executor.site.learned_files import load_site_packs
from executor.site.site_file import Site, read_site
from missions import DayPlanFile, Inspection, LocalFrame, PlanFile, read_plan, tracks_m
from missions.geo import FloatArray
from missions.no_fly_areas import Area
from missions.pricing import DEPOT_M
from planner.evaluate import compute_legs_pct, compute_legs_s

Place = tuple[float, float]
"""Local east and north in metres."""
Leg = tuple[Place, ...]
"""A transit or an inspection: both ends, and around no-fly areas the corners between them."""

SWAP_PCT = 20.0
"""Rise of the battery level that means a restart or another pack."""
GAP_S = 5.0
"""Longest silence across which a track is drawn."""
JOIN_M = 10.0
"""Distance to the start of a new route within which a vehicle has begun it."""
OFF_GROUND_M = 1.0
"""Height above its pad from which a vehicle has taken off."""
OVERTAKEN_S = 60.0
"""A position older than its predecessor by less than this arrived out of order; by more, the vehicle's clock
restarted."""


@dataclass(frozen=True, slots=True)
class SegmentRecord:
    """One segment, and the vehicle that inspected it."""

    id: int
    a_m: Place
    b_m: Place
    inspected_by: str | None
    """None if it was not inspected."""
    inspected_s: float | None
    """None if it was not inspected, or if no recorded positions show it."""
    name: str = ""
    """Name of the asset; empty if it has none."""

    @property
    def display_name(self) -> str:
        """Asset name, or the segment number if there is none."""
        return self.name or str(self.id)


@dataclass(frozen=True, slots=True, eq=False)
class VehicleRecord:
    """One vehicle's flight, as received."""

    name: str
    layer: int
    """Height layer; 0 is the lowest."""
    pad_m: Place
    budget_pct: float
    reserve_pct: float
    track: FloatArray
    """(n, 4) float64: seconds, east, north, and height over its own home in metres."""
    battery: FloatArray
    """(m, 2) float64: seconds, and remaining percent."""
    fault: FaultRow | None
    """Last declared fault."""
    sea_m: FloatArray
    """(n,) float64: altitude of each track point above mean sea level, as reported."""
    reckoned: npt.NDArray[np.bool_]
    """(n,) bool: whether GPS was lost at each track point."""


@dataclass(frozen=True, slots=True)
class PlannedRoute:
    """One vehicle's route in a plan."""

    vehicle: str
    segments: tuple[int, ...]
    legs_m: tuple[Leg, ...]
    """Transits and inspections in turn, from the start to the depot, or to where a sortie lands."""
    energy: tuple[tuple[float, float], ...]
    """(seconds, percent used since the launch) at the start, at the end of every segment, and at the depot.

    A sortie of a day has only its start and end, with the consumption of its own pack.
    """


@dataclass(frozen=True, slots=True)
class PlanRevision:
    """First plan (0), or a re-plan that was uploaded."""

    number: int
    decided_s: float
    """Time at which the solver returned it; 0 for the first plan."""
    routes: tuple[PlannedRoute, ...]
    """Routes of the vehicles with something to fly."""


@dataclass(frozen=True, slots=True)
class DecisionLine:
    """One line shown to the operator."""

    t_s: float
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """Complete flight."""

    segments: tuple[SegmentRecord, ...]
    vehicles: tuple[VehicleRecord, ...]
    """Vehicles from the lowest layer to the highest."""
    revisions: tuple[PlanRevision, ...]
    """Plan revisions, oldest first."""
    decisions: tuple[DecisionLine, ...]
    duration_s: float
    launched_unix_s: float
    """Unix time of the launch; later times are flight time, which may run faster in simulation."""
    areas: tuple[Area, ...] = ()
    """No-fly areas."""
    never: tuple[tuple[str, str], ...] = ()
    """Names of segments in or behind an area, and why they could not be inspected."""
    sorties: tuple[PlannedRoute, ...] = ()
    """All sorties of a day plan; empty for a single flight, and if no vehicle flies twice."""

    @property
    def first_words(self) -> str:
        """Caption for the routes of the first revision."""
        return "first sorties" if self.sorties else "first plan"

    @property
    def planned_for(self) -> dict[int, str]:
        """Vehicle that each segment was planned for at the launch, by segment id."""
        routes = self.sorties or self.revisions[0].routes
        return {segment: route.vehicle for route in routes for segment in route.segments}

    @property
    def losses(self) -> tuple[tuple[VehicleRecord, FaultRow], ...]:
        """Vehicles that did not finish, in the order of their faults."""
        at_fault = [(vehicle, vehicle.fault) for vehicle in self.vehicles if vehicle.fault is not None]
        return tuple(sorted(at_fault, key=lambda pair: pair[1].detected_s))

    @property
    def uncovered_segments(self) -> tuple[SegmentRecord, ...]:
        """Segments that no vehicle inspected."""
        return tuple(segment for segment in self.segments if segment.inspected_by is None)

    @property
    def longest_route_s(self) -> float:
        """Duration of the first plan's longest route."""
        return max((route.energy[-1][0] for route in self.revisions[0].routes), default=0.0)


def build_launch_revision(content: PlanFile) -> PlanRevision:
    """Return the plan at the launch."""
    instance = content.build_instance()
    routes = [build_planned_route(content, instance, route) for route in content.plan.routes if route.visits]
    return PlanRevision(0, 0.0, tuple(routes))


def build_planned_route(
    content: PlanFile, instance: planner.Instance, route: planner.Route, *, began_s: float = 0.0, used_pct: float = 0.0
) -> PlannedRoute:
    """Return one route of a plan file.

    Args:
        content: The plan file.
        instance: Its `instance()`.
        route: One of its routes.
        began_s: Time at which the vehicle began it, in seconds since the launch.
        used_pct: Battery percentage used by then.
    """
    vehicle = content.vehicles[route.vehicle]
    times_s = accumulate(compute_legs_s(instance, route), initial=began_s)
    uses_pct = accumulate(compute_legs_pct(instance, route), initial=used_pct)
    pad_m = DEPOT_M if content.pricing is None else content.pricing.bases[vehicle.name].place_m[:2]
    start_m = vehicle.start_m if vehicle.airborne else pad_m
    turns_m = _find_turns_m(content, vehicle.name, route.visits, start_m, pad_m)
    return PlannedRoute(
        vehicle=vehicle.name,
        segments=_list_segments(content, route.visits),
        legs_m=tuple(_build_legs_m(content, route.visits, vehicle.start_m, DEPOT_M, turns_m)),
        energy=tuple(zip(times_s, uses_pct, strict=True)),
    )


def build_planned_sorties(content: DayPlanFile) -> Iterator[PlannedRoute]:
    """Yield all sorties of a day plan, each at its time after the first take-off."""
    first_s = min((one.start_s for one in content.routes), default=0.0)
    own = {vehicle.name: dict(zip(content.base_names, vehicle.pads, strict=True)) for vehicle in content.vehicles}
    for one in content.routes:
        visits, began_s = content.visits_of(one), one.start_s - first_s
        start_m, end_m = (own[one.vehicle][base].place_m[:2] for base in (one.base, one.lands))
        turns_m = _find_turns_m(content, one.vehicle, visits, start_m, end_m)
        yield PlannedRoute(
            vehicle=one.vehicle,
            segments=_list_segments(content, visits),
            legs_m=tuple(_build_legs_m(content, visits, start_m, end_m, turns_m)),
            energy=((began_s, 0.0), (began_s + one.duration_s, one.energy_pct)),
        )


def _list_segments(content: PlanFile | DayPlanFile, visits: Iterable[int]) -> tuple[int, ...]:
    return tuple(content.segments[planner.segment_of(visit)].id for visit in visits)


def _build_legs_m(
    content: PlanFile | DayPlanFile, visits: Iterable[int], start_m: Place, end_m: Place, turns_m: Iterator[Leg]
) -> Iterator[Leg]:
    """Yield the transits and inspections of a route in turn, with the corners of each transit if there are any."""
    here_m = start_m
    for visit in visits:
        segment = content.segments[planner.segment_of(visit)]
        inspected_m = (segment.a_enu_m[:2], segment.b_enu_m[:2])[:: -1 if planner.is_reversed(visit) else 1]
        yield (here_m, *next(turns_m, ()), inspected_m[0])
        yield inspected_m
        here_m = inspected_m[1]
    yield (here_m, *next(turns_m, ()), end_m)


def _find_turns_m(
    content: PlanFile | DayPlanFile, vehicle: str, visits: Iterable[int], start_m: Place, end_m: Place
) -> Iterator[Leg]:
    """Yield the corners of every transit between two inspections, from the start, and to the landing."""
    if content.pricing is None or not content.areas:
        return
    around = content.pricing.build_vehicle_moves(vehicle, around=True).columns
    tracks_m = content.pricing.tracks_m[:, :, :2]
    here_m = np.array(start_m)
    for visit in visits:
        begin_m, then_m = tracks_m[planner.segment_of(visit)][:: -1 if planner.is_reversed(visit) else 1]
        yield tuple((float(east), float(north)) for east, north in around.way_m(here_m, begin_m))
        here_m = then_m
    yield tuple((float(east), float(north)) for east, north in around.way_m(here_m, np.array(end_m)))


def find_abandoned_segments(record: FlightRecord) -> list[tuple[SegmentRecord, str]]:
    """Return the segments planned for vehicles that were lost before inspecting them, with the vehicle's name.

    A segment left by two vehicles in turn is listed once, for the last one.
    """
    segments = {segment.id: segment for segment in record.segments}
    left: dict[int, str] = {}
    for vehicle, fault in record.losses:
        for segment, planned_for in _map_planned_vehicles(record, fault.detected_s).items():
            if planned_for == vehicle.name and segments[segment].inspected_by != vehicle.name:
                left[segment] = vehicle.name
    return [(segments[number], name) for number, name in sorted(left.items())]


def _map_planned_vehicles(record: FlightRecord, until_s: float) -> dict[int, str]:
    planned = record.planned_for
    for revision in record.revisions[1:]:
        if revision.decided_s <= until_s:
            planned |= {segment: route.vehicle for route in revision.routes for segment in route.segments}
    return planned


def compute_used_pct(battery: FloatArray) -> FloatArray:
    """Return (m, 2) float64, seconds and percent used, from (m, 2) reports of the remaining percentage.

    A rise is not counted: both autopilots report 100 % again after a restart.
    """
    drops = -np.diff(battery[:, 1], prepend=battery[:1, 1])
    drops[drops < -SWAP_PCT] = 0.0
    return np.column_stack((battery[:, 0], np.cumsum(drops)))


def draw_at_pct(vehicle: VehicleRecord, t_s: float) -> float:
    """Return the percentage that a vehicle had used at a time; 0 if its battery never reported."""
    if len(vehicle.battery) == 0:
        return 0.0
    account = compute_used_pct(vehicle.battery)
    return float(np.interp(t_s, account[:, 0], account[:, 1]))


def find_last_row(vehicle: VehicleRecord, t_s: float) -> int | None:
    """Return the row of a track with the last GPS position up to a time; None if there is none."""
    heard = np.flatnonzero((vehicle.track[:, 0] <= t_s) & ~vehicle.reckoned)
    return int(heard[-1]) if len(heard) else None


def take_off_time_s(track: FloatArray, after_s: float) -> float:
    """Return the first time after `after_s` at which a (n, 4) track is airborne; `after_s` if it never is."""
    up = track[(track[:, 0] >= after_s) & (track[:, 3] > OFF_GROUND_M)]
    return float(up[0, 0]) if len(up) else after_s


def route_join_time_s(track: FloatArray, start_m: Place, after_s: float) -> float:
    """Return when a (n, 4) track first passes a place after a time: nearest point of its first visit within `JOIN_M`.

    If it never comes within `JOIN_M`, the time of its nearest point; `after_s` itself if nothing is recorded after it.
    """
    rest = track[track[:, 0] >= after_s]
    if len(rest) == 0:
        return after_s
    away_m = np.hypot(rest[:, 1] - start_m[0], rest[:, 2] - start_m[1])
    near = away_m <= JOIN_M
    if near.any():
        first = int(near.argmax())
        gone = np.flatnonzero(~near[first:])
        away_m[:first] = np.inf
        if len(gone):
            away_m[first + gone[0] :] = np.inf
    return float(rest[int(away_m.argmin()), 0])


def inspection_time_s(
    samples: Iterable[tuple[float, PositionSample]], line: Track, *, corridor_m: float, speed_m_s: float
) -> float | None:
    """Return when a line was first flown as `coverage` requires, in either direction; None if never.

    Args:
        samples: A vehicle's positions, each with its time of arrival.
        line: The inspection track, in one of its directions.
        corridor_m: Largest distance from the track.
        speed_m_s: Requested inspection speed.
    """
    directions = (line, Track(line.segment, line.end_m, line.begin_m))
    runs: list[InspectionRun | None] = [None, None]
    last_s: float | None = None
    for arrived_s, sample in samples:
        if last_s is not None and -OVERTAKEN_S < sample.boot_s - last_s <= 0.0:
            continue
        last_s = sample.boot_s
        for index, direction in enumerate(directions):
            step = advance_run(runs[index], direction, sample, corridor_m=corridor_m, speed_m_s=speed_m_s)
            runs[index] = step.run
            if step.flown is not None:
                return arrived_s
    return None


@dataclass(slots=True)
class _VehicleMessages:
    """Messages of one vehicle, in order of arrival and in seconds since the launch."""

    positions: list[tuple[float, ...]] = field(default_factory=list)
    """Seconds, east, north, height above home, altitude above mean sea level, and whether GPS was lost."""
    samples: list[tuple[float, PositionSample]] = field(default_factory=list)
    battery: list[tuple[float, float]] = field(default_factory=list)
    status: list[tuple[float, float]] = field(default_factory=list)
    positioning: Positioning = field(default_factory=Positioning)
    newest: PositionFix | None = None
    armed: bool = False

    def take(self, said: messages.FlightMessage, t_s: float, frame: LocalFrame) -> None:
        """Take its messages; a reckoned position proves nothing."""
        match said:
            case messages.Position():
                self._take_position(said, frame.to_local_m(said.lat_deg, said.lon_deg), t_s)
            case messages.Heartbeat():
                self.armed = said.armed
            case messages.Gps() | messages.EstimatorStatus() | messages.SystemStatus():
                self.positioning = update_positioning(self.positioning, said, self.newest, t_s, stands=not self.armed)
            case _:
                pass
        if isinstance(said, messages.Battery | messages.SystemStatus) and said.remaining_pct is not None:
            reports = self.battery if isinstance(said, messages.Battery) else self.status
            reports.append((t_s, said.remaining_pct))

    def _take_position(self, said: messages.Position, place_m: Place, t_s: float) -> None:
        velocity_m_s = (said.east_m_s, said.north_m_s, -said.down_m_s)
        is_reckoned = self.positioning.lost_s is not None
        self.newest = PositionFix(
            t_s, said.boot_s, place_m, said.alt_rel_m, said.alt_msl_m, velocity_m_s, reckoned=is_reckoned
        )
        self.positions.append((t_s, *place_m, said.alt_rel_m, said.alt_msl_m, is_reckoned))
        if not is_reckoned:
            self.samples.append((t_s, PositionSample(said.boot_s, place_m)))


@dataclass(slots=True)
class _Log:
    """Data that a record takes from the event log."""

    launched_s: float
    """Launch on the ground station's clock; all other times count from it."""
    heard: dict[str, _VehicleMessages]
    solved_s: dict[int, float]
    """Time at which each re-plan was found."""
    solving_s: dict[int, float]
    """Latest time at which each solver began."""
    uploaded: dict[tuple[int, str], tuple[float, bool]]
    """End of the upload of each revision to each vehicle, and whether it is on board."""


def read_run(run: Path) -> FlightRecord:
    """Return the flight in a run directory.

    Lines torn by a crash of the writer are skipped.

    Raises:
        LogError: report.json or events.jsonl cannot be read, or the log holds no launch.
        SiteError: site.toml cannot be used.
        MissionsError: a plan file cannot be used.
    """
    report, day = FlightReport.read(RunDirectory(run).report), read_flown_day_plan(run)
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
        decisions=tuple(
            DecisionLine(note["t_s"] - log.launched_s, Level(note["level"]), text)
            for note in read_notes(RunDirectory(run).events)
            if (text := note.get("said", note.get("told"))) is not None  # on another subject, such as a broker
        ),
        duration_s=report.duration_s,
        areas=first.areas,
        never=tuple((one.name, one.why) for one in first.unreachable),
        sorties=() if day is None or day.flying == len(day.routes) else tuple(build_planned_sorties(day)),
        launched_unix_s=read_head(RunDirectory(run).events).began_unix_s + log.launched_s,
    )


def _read_log(path: Path, frame: LocalFrame, site: Site) -> _Log:
    events = list(read_events(path))
    launched_s = next((t_s for t_s, event in events if isinstance(event, LaunchOrdered)), None)
    if launched_s is None:
        raise LogError(f"{path}: expected the log of a flight, but nothing was launched")
    log = _Log(launched_s, {table.name: _VehicleMessages() for table in site.vehicle}, {}, {}, {})
    for at_s, event in events:
        t_s = at_s - launched_s
        match event:
            case Heard(vehicle, message) if vehicle in log.heard:
                log.heard[vehicle].take(message, t_s, frame)
            case SolveEnded():
                log.solved_s[event.revision] = t_s
                log.solving_s[event.revision] = t_s - site.flight.speedup * event.solve_s
            case UploadEnded():
                log.uploaded[event.revision, event.vehicle] = (t_s, event.accepted)
            case _:
                pass
    return log


def _build_vehicles(
    site: Site, packs: Mapping[str, PackHistory], report: FlightReport, log: _Log
) -> tuple[VehicleRecord, ...]:
    drone = site_model.drone_of(site)
    faults = {row.vehicle: row for row in report.faults}
    vehicles = []
    for layer, table in enumerate(site.vehicle):
        heard = log.heard[table.name]
        positions = np.array(heard.positions, dtype=np.float64).reshape(-1, 6)
        vehicles.append(
            VehicleRecord(
                name=table.name,
                layer=layer,
                # It stands there until it takes off; a vehicle never heard is shown at the depot.
                pad_m=heard.samples[0][1].place_m if heard.samples else (0.0, 0.0),
                budget_pct=site_model.budget_pct_of(packs.get(table.name), drone, table),
                reserve_pct=table.reserve_pct + site_model.find_empty_pct(packs.get(table.name), drone, table),
                track=positions[:, :4],
                # As in flight: SYS_STATUS counts only without BATTERY_STATUS.
                battery=np.array(heard.battery or heard.status, dtype=np.float64).reshape(-1, 2),
                fault=faults.get(table.name),
                sea_m=positions[:, 4],
                reckoned=positions[:, 5] > 0,
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
    """Return a re-plan whose routes start where the vehicles began them, in time and in battery."""
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
    return PlanRevision(number, decided_s, tuple(routes))
