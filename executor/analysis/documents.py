"""Define report.json and vehicles.json as models, for both writing and reading.

All times are seconds since the take-off order.
"""

from __future__ import annotations

from operator import not_
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from executor.adapters.run_directory import (
    Document,
    Hundredths,
    Number,
    RunDirectory,
    Tenths,
    Thousandths,
    Whole,
    YesNo,
)
from executor.core.formatting import format_count
from executor.core.interface.codes import CheckCode, Severity
from executor.core.state.vehicle_state import FaultCode, FaultKind
from missions import DayPlanFile, read_day_plan
from missions.validation import is_none


class FaultRow(Document):
    """A vehicle that was declared lost."""

    vehicle: str
    kind: FaultKind
    code: FaultCode | None = None
    """None in documents older than the codes."""
    reason: str
    happened_s: Hundredths | None
    """Time of the injected fault; known in simulation only."""
    detected_s: Hundredths


class ReplanRow(Document):
    """A re-plan."""

    revision: Whole
    """Revision of the new plan: plan-001.json is 1."""
    trigger: str
    """Reason for the re-plan."""
    feasible: YesNo
    """Whether the re-plan covers every open segment."""
    solve_s: Thousandths
    """Real seconds that the solver took."""
    upload_s: Hundredths
    total_s: Hundredths
    """Seconds from the need to the missions verified on board."""
    uncovered: tuple[Whole, ...]
    """Ids of the segments that no vehicle can fly, without those that the first plan left over."""
    gained: Whole | None = None
    """Additional segments over the missions on board; None if the solver did not report it or has not ended."""
    gained_m: Tenths | None = None
    """Additional length inspected."""
    taken_up: Whole | None = None
    """Additional segments of those that the first plan left over; negative if it drops some of them."""
    longest_route_s: Tenths | None = None
    """Longest new route, each from where its vehicle becomes free."""
    carried_route_s: Tenths | None = None
    """Longest route of the missions on board, as far as the budgets last."""
    over_budget: tuple[str, ...] = ()
    """Vehicles whose budget does not last for their mission on board."""


class LastFix(Document):
    """Last GPS position of a vehicle, WGS 84."""

    lat_deg: Number
    lon_deg: Number
    alt_rel_m: Number
    """Height above its pad."""
    accuracy_m: Number | None = None
    ground_speed_m_s: Number
    """Ground speed at that place; the vehicle has flown on since."""
    at_s: Tenths


class LastPosition(Document):
    """Last reported position of a vehicle, WGS 84, for the search."""

    lat_deg: Number
    lon_deg: Number
    alt_rel_m: Number
    """Height above its pad."""
    at_s: Tenths
    known: str = ""
    """fix: by GPS. reckoned: GPS had been lost. unsaid: the vehicle reported no GPS state. Empty in older reports."""
    accuracy_m: Number | None = None
    """Position accuracy; a reckoned position may be off by more."""
    last_fix: LastFix | None = None
    """Last GPS fix before a reckoned position: where to search."""


class LinkRow(Document):
    """Traffic on one of several links of a vehicle."""

    connection: str
    frames_received: Whole
    frames_missing: Whole


class VehicleRow(Document):
    """Result of one vehicle."""

    name: str
    segments: tuple[Whole, ...]
    """Ids of the segments that it inspected."""
    energy_used_pct: Tenths
    landed: YesNo
    """Whether it has landed on its pad."""
    min_reserve_pct: Number | None
    """Lowest battery level reported."""
    state: str = ""
    """State in one word, as on the page."""
    last_position: LastPosition | None = None
    frames_received: Whole | None = None
    """MAVLink frames received from this vehicle."""
    frames_missing: Whole | None = None
    """Frames lost on the link, by sequence numbers."""
    frames_foreign: Whole | None = None
    """Frames on its connection that belong to no vehicle of the fleet."""
    frames_refused: dict[str, Whole] | None = None
    """Rejected frames, by reason."""
    links: tuple[LinkRow, ...] = ()
    """The same counts for each link of a vehicle with several."""
    type: str | None = None
    autopilot: str | None = None
    firmware: str | None = None


class CheckRow(Document):
    """Line of the checklist before the take-off."""

    severity: Severity
    code: CheckCode | None = None
    """None in documents older than the codes."""
    subject: str
    """Subject of the check: a vehicle, or another subject."""
    text: str


class ParameterRow(Document):
    """A parameter that was changed on board."""

    vehicle: str
    name: str
    old: Number
    new: Number
    restored: YesNo
    """Whether the old value was restored."""


class TerrainPart(Document):
    """Raster of ground heights, in metres."""

    source: str
    """Name of the terrain source."""
    digest: str
    """Digest of the data that was read."""
    vertical: str
    """Vertical reference of its heights."""
    uncertainty_m: Number
    """Error that 90 % of the heights stay within."""
    margin_m: Number
    """Margin that every leg keeps above that error."""
    most_raised_m: Number
    """Largest increase of a pylon's passing height because of nearby ground."""


class HeightsPart(Document):
    """Flown heights, in metres."""

    over: str
    """Reference of the heights."""
    flat: YesNo
    """Whether the ground is assumed to be flat."""
    least_over_tops_m: Number | None
    """Least height above pylon tops."""
    least_over_ground_m: Number | None
    most_over_ground_m: Number | None
    return_over_ground_m: Number
    """Height above ground of the highest RTL."""
    ceiling_m: Number
    terrain: Annotated[TerrainPart | None, Field(exclude_if=is_none)] = None
    """Terrain data, where a raster covers the ground."""


class AbsenceRow(Document):
    """Period in which the ground station was down."""

    until_s: Tenths
    pause_s: Tenths
    restarted: YesNo


class RadioRow(Document):
    """Load of a telemetry radio, from the take-off order on."""

    vehicles: tuple[str, ...]
    """Vehicles on this radio."""
    bytes_s: Number
    """Mean throughput, both directions."""
    most_bytes_s: Number
    capacity_bytes_s: Number
    """Capacity, from the site file or assumed."""
    round_trip_s: Number | None = None
    """Longest measured round trip."""
    lost: Number
    """Mean share of frames lost."""
    congested_s: Tenths
    weak_s: Tenths
    positions_hz: Number
    """Lowest position rate that was requested while streams were thinned."""


class InspectionRow(Document):
    """Flown values of a segment."""

    segment: Whole
    name: str = ""
    vehicle: str
    inspected_at_m: Annotated[Number | None, Field(exclude_if=is_none)] = None
    """Inspection height above pylon tops, or above the depot's ground, where vehicles leave their layers."""
    speed_mean_m_s: Hundredths
    speed_max_m_s: Hundredths | None
    deviation_mean_m: Hundredths
    """Mean deviation from the planned track."""
    deviation_max_m: Hundredths


class NotCountedRow(Document):
    """A run along a segment that does not count."""

    vehicle: str
    segment: Whole
    name: str
    reason: str


class SeenRow(Document):
    """Camera coverage that an asset requires, and its result."""

    segment: Whole
    name: str
    camera: str
    take: str
    """Kind: pictures, video, or the number of viewpoints."""
    state: str
    """State: seen, not seen, or not flown."""
    vehicle: str
    """Vehicle that has seen it; empty if none."""
    inspected_at_m: Annotated[Number | None, Field(exclude_if=is_none)] = None
    """Height above pylon tops where vehicles leave their layers; if higher, it was seen from above."""
    pictures: Whole
    """Number of pictures that count."""
    missing: str
    """Description of what no picture shows."""


class LegRow(Document):
    """Leg of a mission, from one waypoint to the next with the hold there, as planned and as flown."""

    waypoint: Whole
    """Waypoint at the end of the leg, from 0."""
    phase: str
    """Phase: takeoff, transit, inspect, return or land."""
    segment: Whole | None = None
    """Id of the segment being inspected or approached."""
    planned_s: Tenths
    flown_s: Tenths | None
    """Flown duration; None if its start or end was not received."""
    planned_pct: Thousandths
    """Planned energy, in percent of a full battery."""
    flown_pct: Thousandths | None
    """Energy by the battery's report; None if unknown."""


class RouteRow(Document):
    """Flown values of one vehicle's mission, and the plan's values for the same legs."""

    vehicle: str
    revision: Whole
    """Revision of the mission on board. Legs of a mission that a re-plan continued end at the change."""
    whole: YesNo
    """Whether it is a complete flight from take-off to landing."""
    began_s: Tenths
    ended_s: Tenths
    planned_s: Tenths
    flown_s: Tenths
    time_error_pct: Number | None
    """Excess of flown over planned time, in percent of the plan."""
    planned_pct: Hundredths
    """Planned energy, in percent of a full battery."""
    flown_pct: Hundredths | None
    energy_error_pct: Number | None
    legs: tuple[LegRow, ...]


class SortieRow(Document):
    """Flight of a vehicle from take-off to landing, where it had several."""

    vehicle: str
    number: Whole
    """Number among this vehicle's sorties, from 1."""
    pack: str
    """Id of its battery pack as entered by the crew; empty if none was."""
    began_s: Tenths
    ended_s: Tenths | None
    """Landing time; None if it did not land."""
    began_pct: Number | None
    """Battery level at the start, as reported."""
    ended_pct: Number | None
    rest_v: Number | None
    """Voltage of the pack at rest before the sortie."""
    segments: tuple[Whole, ...]
    """Ids of the segments that it inspected."""
    base: Annotated[str, Field(exclude_if=not_)] = ""
    """Base of take-off, on days whose sorties end at other bases."""
    lands: Annotated[str, Field(exclude_if=not_)] = ""
    """Base of landing, flown or planned."""


class EarlierRow(Document):
    """Earlier flight, whose remainder this flight flies."""

    run: str
    """Name of its run directory."""
    segments: tuple[Whole, ...]
    """Ids of the segments that it inspected."""
    sorties: Whole
    duration_s: Number
    faults: tuple[str, ...]
    """Vehicles with a declared fault."""
    day_plan: Annotated[str, Field(exclude_if=not_)] = ""
    """Id of the day plan whose sorties it flew."""
    day: Annotated[Whole, Field(exclude_if=not_)] = 0
    """Day of that plan, from 1."""


class UnreachableRow(Document):
    """A segment that no flight could inspect."""

    segment: Whole
    """Segment id, one of `segments_uncovered`."""
    name: str
    why: str


class FlightReport(Document):
    """Result of a flight. Times are seconds since the take-off order."""

    expected = "the report of a flight that is over"
    format: Literal["faultline-report/1"]
    segments_total: Whole
    segments_inspected: Whole
    segments_uncovered: tuple[Whole, ...]
    """Ids of the segments that were not inspected."""
    uncovered_names: tuple[str, ...] = ()
    """Asset names of these segments."""
    left_over: tuple[Whole, ...] = ()
    """Ids of those that the first plan left for the next flight."""
    unreachable: tuple[UnreachableRow, ...] = ()
    """Those that lie in or behind a no-fly area."""
    segment_names: dict[str, str] = Field(default={})
    """Names of all segments by id."""
    finished: YesNo
    """Whether every segment was inspected."""
    duration_s: Tenths
    """Seconds to the end of supervision."""
    faults: tuple[FaultRow, ...]
    replans: tuple[ReplanRow, ...]
    vehicles: tuple[VehicleRow, ...]
    checks: tuple[CheckRow, ...] = ()
    """Checklist before take-off."""
    parameters: tuple[ParameterRow, ...] = ()
    heights: HeightsPart | None = None
    absences: tuple[AbsenceRow, ...] = ()
    """Periods in which the ground station was down."""
    radios: Annotated[tuple[RadioRow, ...], Field(exclude_if=not_)] = ()
    """Telemetry radios, if any."""
    seen: tuple[SeenRow, ...] = ()
    """Camera coverage that assets asked for."""
    inferred: tuple[Whole, ...] = ()
    """Ids of segments that count by other evidence than positions, after the ground station was down."""
    min_separation_m: Hundredths | None
    """Least measured distance between two flying vehicles."""
    inspection_speed_m_s: Number | None = None
    """Requested inspection speed."""
    inspections: tuple[InspectionRow, ...] = ()
    not_counted: tuple[NotCountedRow, ...] = ()
    routes: tuple[RouteRow, ...] = ()
    """Planned and flown values of each mission and leg."""
    sorties: Annotated[tuple[SortieRow, ...], Field(exclude_if=not_)] = ()
    """Sorties in order of take-off, if packs were changed or a day was flown."""
    earlier: Annotated[tuple[EarlierRow, ...], Field(exclude_if=not_)] = ()
    """Earlier flights whose remainder this one flies, oldest first."""


class PadPart(Document):
    """Pad of a vehicle, with full precision: heights and layers are derived from it."""

    east_m: Number
    north_m: Number
    alt_m: Number
    """Altitude above mean sea level."""


class AskedVehicle(Document):
    """Answers of one vehicle before the flight."""

    name: str
    sysid: Whole | None = None
    type: str | None = None
    autopilot: str | None = None
    firmware: str | None = None
    remaining_pct: Number | None = None
    link_timeout_s: Number | None = None
    """Silence after which it is declared lost."""
    pad: PadPart | None = None
    """Surveyed pad; None in older run directories, where the site's pads hold."""
    gps_fix: Whole | None = None
    """GPS_FIX_TYPE of the pad's position; None if not reported."""
    gps_accuracy_m: Number | None = None
    """Accuracy of that position, as reported by the receiver."""
    parameters: dict[str, Number] = Field(default={})
    stations: tuple[tuple[Whole, Whole], ...] = ()
    """System and component of ground stations heard on its connection."""


class AskedVehicles(Document):
    """Vehicles queried before the flight, with their answers."""

    expected = "what vehicles reported before a flight"
    format: Literal["faultline-vehicles/1"] = "faultline-vehicles/1"
    vehicles: tuple[AskedVehicle, ...]
    checks: tuple[CheckRow, ...] = ()
    """Checklist."""
    earlier: Annotated[tuple[EarlierRow, ...], Field(exclude_if=not_)] = ()
    """Earlier flights whose remainder is flown."""
    counts_packs: Annotated[YesNo, Field(exclude_if=not_)] = False
    """Whether the packs at the bases are counted in flight; false in older run directories."""


def read_flown_day_plan(run: Path) -> DayPlanFile | None:
    """Return the day plan that a run directory was flown by; None for a single flight.

    Raises:
        MissionsError: it cannot be used.
    """
    path = RunDirectory(run).day_plan
    return read_day_plan(path) if path.exists() else None


def read_earlier_flights(run: Path) -> tuple[EarlierRow, ...]:
    """Return the flights up to that of a run directory, oldest first, from its report.

    Raises:
        LogError: there is no report, or it cannot be used.
        MissionsError: its day plan cannot be used.
    """
    report, day = FlightReport.read(RunDirectory(run).report), read_flown_day_plan(run)
    row = EarlierRow(
        run=run.resolve().name,
        segments=list_inspected_segments(report),
        sorties=len(report.sorties) or sum(1 for vehicle in report.vehicles if vehicle.energy_used_pct > 0.0),
        duration_s=report.duration_s,
        faults=tuple(dict.fromkeys(fault.vehicle for fault in report.faults)),
        day_plan="" if day is None else day.schedule_id,
        day=0 if day is None else day.first_day,
    )
    return (*report.earlier, row)


def list_inspected_segments(report: FlightReport) -> tuple[int, ...]:
    """Return the ids of the segments that a flight inspected."""
    return tuple(sorted(segment for vehicle in report.vehicles for segment in vehicle.segments))


def describe_total_inspected(report: FlightReport) -> str:
    """Return the total inspected by this flight and those before it; empty if it is the first."""
    if not report.earlier:
        return ""
    done = {*list_inspected_segments(report), *(segment for row in report.earlier for segment in row.segments)}
    total = len(done | set(report.segments_uncovered))
    return f"with {format_count(len(report.earlier), 'flight')} before it {len(done)} of {total} segments are inspected"
