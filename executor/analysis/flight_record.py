"""What a flight was, as plain data: what the pictures and the page show. All times are seconds since the launch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from executor.analysis.documents import FaultRow
from executor.core.interface.commands import Level
from executor.core.state.inspection_run import InspectionRun, PositionSample, Track, advance_run
from missions import PlanFile
from missions.areas import Area
from missions.geo import FloatArray
from missions.pricing import DEPOT_M
from planner import (
    Instance,
    Route,
    completion_times_s,
    energy_use_pct,
    is_reversed,
    route_duration_s,
    route_energy_pct,
    segment_of,
)

Place = tuple[float, float]
"""Local east and north in metres."""

SWAP_PCT = 20.0
"""A percentage that rises by more than this is a restart or another pack, not a charge in flight."""
GAP_S = 5.0
"""Where nothing was heard for longer than this, no track is drawn."""
JOIN_M = 10.0
"""A vehicle that came as near as this to where its new route starts has begun it."""
OFF_GROUND_M = 1.0
"""Higher than this over its pad a vehicle has taken off."""
OVERTAKEN_S = 60.0
"""A position older than the one before it by less than this was overtaken on the way; by more, the clock restarted."""


@dataclass(frozen=True, slots=True)
class SegmentRecord:
    """One segment, and who inspected it."""

    id: int
    a_m: Place
    b_m: Place
    inspected_by: str | None
    """None if it was left over."""
    inspected_s: float | None
    """None if it was left over, or if the positions that are on record do not show it."""
    name: str = ""
    """What its asset is called; empty where nobody said."""

    @property
    def display_name(self) -> str:
        """What people call it."""
        return self.name or str(self.id)


@dataclass(frozen=True, slots=True, eq=False)
class VehicleRecord:
    """One vehicle's flight as it was heard."""

    name: str
    layer: int
    """0 is the lowest."""
    pad_m: Place
    budget_pct: float
    reserve_pct: float
    track: FloatArray
    """(n, 4) float64: seconds, east, north, and height over its own home in metres."""
    battery: FloatArray
    """(m, 2) float64: seconds, and percent that remain."""
    fault: FaultRow | None
    """The last that was declared."""
    sea_m: FloatArray
    """(n,) float64: height of each of the track's places above mean sea level, as the vehicle said it."""
    reckoned: npt.NDArray[np.bool_] | None = None
    """(n,) bool: whether each of them came while GPS was lost; None where all are by GPS."""


@dataclass(frozen=True, slots=True)
class PlannedRoute:
    """One vehicle's route as a plan has it."""

    vehicle: str
    segments: tuple[int, ...]
    way_m: tuple[Place, ...]
    """Where it starts, both ends of every segment in the order of flight, and the depot."""
    energy: tuple[tuple[float, float], ...]
    """(seconds, percent used since the launch) at the start, at the end of every segment, and at the depot."""
    turns_m: tuple[tuple[Place, ...], ...] = ()
    """Where there are areas: the corners of each leg that is no inspection."""

    @property
    def places_m(self) -> FloatArray:
        """(k, 2) float64: everything that it leads through."""
        return np.array([*self.way_m, *(place for turns in self.turns_m for place in turns)])


@dataclass(frozen=True, slots=True)
class PlanRevision:
    """The first plan (0), or a re-plan that was put on board."""

    number: int
    decided_s: float
    """When it was there; 0 for the first plan."""
    routes: tuple[PlannedRoute, ...]
    """Of the vehicles that had something to fly."""
    uncovered: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class DecisionLine:
    """One line that the operator saw."""

    t_s: float
    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """A whole flight."""

    segments: tuple[SegmentRecord, ...]
    vehicles: tuple[VehicleRecord, ...]
    """From the lowest layer to the highest."""
    revisions: tuple[PlanRevision, ...]
    """The first plan first."""
    decisions: tuple[DecisionLine, ...]
    duration_s: float
    launched_unix_s: float
    """Seconds since 1970 at the launch; later times are the flight's, which in a simulation may pass faster."""
    areas: tuple[Area, ...] = ()
    """That flights kept out of."""
    never: tuple[tuple[str, str], ...] = ()
    """Names of segments that lie in an area or behind one, and why they could not be inspected."""

    @property
    def losses(self) -> tuple[tuple[VehicleRecord, FaultRow], ...]:
        """Vehicles that did not finish, in the order in which that was declared."""
        at_fault = [(vehicle, vehicle.fault) for vehicle in self.vehicles if vehicle.fault is not None]
        return tuple(sorted(at_fault, key=lambda pair: pair[1].detected_s))

    @property
    def uncovered_segments(self) -> tuple[SegmentRecord, ...]:
        """Segments that nobody inspected."""
        return tuple(segment for segment in self.segments if segment.inspected_by is None)

    @property
    def longest_route_s(self) -> float:
        """Duration of the first plan's longest route."""
        return max((route.energy[-1][0] for route in self.revisions[0].routes), default=0.0)


def build_launch_revision(content: PlanFile) -> PlanRevision:
    """Return the plan that a flight begins with."""
    instance = content.build_instance()
    routes = [build_planned_route(content, instance, route) for route in content.plan.routes if route.visits]
    return PlanRevision(0, 0.0, tuple(routes), list_uncovered_ids(content))


def build_planned_route(
    content: PlanFile, instance: Instance, route: Route, *, began_s: float = 0.0, used_pct: float = 0.0
) -> PlannedRoute:
    """Return one route of a plan file.

    Args:
        content: The plan file.
        instance: Its `instance()`.
        route: One of its routes.
        began_s: When the vehicle began it, in seconds since the launch.
        used_pct: What the vehicle had used by then.
    """
    vehicle = content.vehicles[route.vehicle]
    segments = [content.segments[segment_of(visit)] for visit in route.visits]
    way_m: list[Place] = [vehicle.start_m]
    for visit, segment in zip(route.visits, segments, strict=True):
        ends_m = (segment.a_enu_m[:2], segment.b_enu_m[:2])
        way_m += reversed(ends_m) if is_reversed(visit) else ends_m
    way_m.append(DEPOT_M)
    energy = [(0.0, 0.0)]
    for done, end_s in enumerate(completion_times_s(instance, route), start=1):
        energy.append((end_s, energy_use_pct(instance, route, done)))
    energy.append((route_duration_s(instance, route), route_energy_pct(instance, route)))
    return PlannedRoute(
        vehicle=vehicle.name,
        segments=tuple(segment.id for segment in segments),
        way_m=tuple(way_m),
        energy=tuple((began_s + t_s, used_pct + spent) for t_s, spent in energy),
        turns_m=tuple(_find_turns_m(content, route)),
    )


def _find_turns_m(content: PlanFile, route: Route) -> Iterator[tuple[Place, ...]]:
    """Yield the corners of every way between two inspections, and of those from the start and home."""
    if content.pricing is None or not content.areas:
        return
    vehicle = content.vehicles[route.vehicle]
    around = content.pricing.build_vehicle_moves(vehicle.name, around=True).columns
    base_m = content.pricing.bases[vehicle.name].place_m[:2]
    tracks_m = content.pricing.tracks_m[:, :, :2]
    here_m = np.array(vehicle.start_m if vehicle.airborne else base_m)
    for visit in route.visits:
        begin_m, end_m = tracks_m[segment_of(visit)][:: -1 if is_reversed(visit) else 1]
        yield tuple((float(east), float(north)) for east, north in around.way_m(here_m, begin_m))
        here_m = end_m
    yield tuple((float(east), float(north)) for east, north in around.way_m(here_m, np.array(base_m)))


def list_uncovered_ids(content: PlanFile) -> tuple[int, ...]:
    """Return the ids of the segments that a plan file does not cover."""
    return tuple(content.segments[index].id for index in content.plan.uncovered)


@dataclass(frozen=True, slots=True)
class AbandonedSegment:
    """A segment that a lost vehicle left."""

    segment: SegmentRecord
    left_by: str


def find_abandoned_segments(record: FlightRecord) -> tuple[AbandonedSegment, ...]:
    """Return what was planned for vehicles that were lost before they inspected it; `inspected_by` says who did.

    A segment that two vehicles left, one after the other, is there once, as the last one's.
    """
    segments = {segment.id: segment for segment in record.segments}
    left: dict[int, str] = {}
    for vehicle, fault in record.losses:
        for segment, planned_for in _map_planned_vehicles(record.revisions, fault.detected_s).items():
            if planned_for == vehicle.name and segments[segment].inspected_by != vehicle.name:
                left[segment] = vehicle.name
    return tuple(AbandonedSegment(segments[number], name) for number, name in sorted(left.items()))


def _map_planned_vehicles(revisions: Iterable[PlanRevision], until_s: float) -> dict[int, str]:
    """Return whose route each segment was on at a time."""
    planned: dict[int, str] = {}
    for revision in revisions:
        if revision.decided_s <= until_s:
            planned |= {segment: route.vehicle for route in revision.routes for segment in route.segments}
    return planned


def compute_used_pct(battery: FloatArray) -> FloatArray:
    """Return (m, 2) float64, seconds and percent used since the first of (m, 2) reports of what remains.

    Nothing is counted at a jump upwards: both autopilots' percentages are 100 again after a restart.
    """
    drops = -np.diff(battery[:, 1], prepend=battery[:1, 1])
    drops[drops < -SWAP_PCT] = 0.0
    return np.column_stack((battery[:, 0], np.cumsum(drops)))


def draw_at_pct(vehicle: VehicleRecord, t_s: float) -> float:
    """Return the percent that a vehicle had used at a time; 0 if its battery never reported."""
    if len(vehicle.battery) == 0:
        return 0.0
    account = compute_used_pct(vehicle.battery)
    return float(np.interp(t_s, account[:, 0], account[:, 1]))


def find_last_row(vehicle: VehicleRecord, t_s: float) -> int | None:
    """Return which row of its track says where a vehicle was by GPS last until a time; None if it was not heard."""
    by_gps = True if vehicle.reckoned is None else ~vehicle.reckoned
    heard = np.flatnonzero((vehicle.track[:, 0] <= t_s) & by_gps)
    return int(heard[-1]) if len(heard) else None


def take_off_time_s(track: FloatArray, after_s: float) -> float:
    """Return when a (n, 4) track is in the air for the first time after a time; that time itself if it never is."""
    up = track[(track[:, 0] >= after_s) & (track[:, 3] > OFF_GROUND_M)]
    return float(up[0, 0]) if len(up) else after_s


def route_join_time_s(track: FloatArray, start_m: Place, after_s: float) -> float:
    """Return when a (n, 4) track first passes a place after a time: where it first comes within `JOIN_M`, and nearest.

    If it never comes so near, the nearest that it comes; the time itself if nothing is on record after it.
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
    """Return when a line was first flown as `coverage` demands it, in either direction; None if it never was.

    Args:
        samples: A vehicle's positions with the time at which each arrived.
        line: The inspection track, in one of its directions.
        corridor_m: Largest distance from the track.
        speed_m_s: The inspection speed asked for.
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
            if step.done:
                return arrived_s
    return None
