"""report.json and vehicles.json as models: who writes one and who reads one go by them.

All times are seconds since the order to take off.
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
    """None in what was written before there were codes."""
    reason: str
    happened_s: Hundredths | None
    """Where a simulator knows it."""
    detected_s: Hundredths


class ReplanRow(Document):
    """A re-plan."""

    revision: Whole
    """Of the plan that it brought: plan-001.json is 1."""
    trigger: str
    """What it was needed for."""
    feasible: YesNo
    """Whether every segment that was open is covered."""
    solve_s: Thousandths
    """In real time."""
    upload_s: Hundredths
    total_s: Hundredths
    """From the need to the missions verified on board."""
    uncovered: tuple[Whole, ...]
    """Ids of the segments that nobody can fly; without those that the first plan left over."""
    gained: Whole | None = None
    """How many more segments it covers than what was on board; None if the solver did not say, or has not ended."""
    gained_m: Tenths | None = None
    """How much longer they are together."""
    taken_up: Whole | None = None
    """How many more it covers of those that the first plan left over; negative if it gives some of them back."""
    longest_route_s: Tenths | None = None
    """Each from where its vehicle becomes free."""
    carried_route_s: Tenths | None = None
    """The longest of what was on board, as far as the budgets last."""
    over_budget: tuple[str, ...] = ()
    """Vehicles whose budgets do not last for all that they have on board."""


class LastFix(Document):
    """Where a vehicle was by GPS last, WGS 84."""

    lat_deg: Number
    lon_deg: Number
    alt_rel_m: Number
    """Over its pad."""
    accuracy_m: Number | None = None
    ground_speed_m_s: Number
    """There: it has flown on."""
    at_s: Tenths


class LastPosition(Document):
    """Where a vehicle was heard last, WGS 84, for who has to find it."""

    lat_deg: Number
    lon_deg: Number
    alt_rel_m: Number
    """Over its pad."""
    at_s: Tenths
    known: str = ""
    """fix: by GPS. reckoned: GPS was lost before. unsaid: it said nothing of its GPS. Empty in older reports."""
    accuracy_m: Number | None = None
    """By so much it may be off; a reckoned one by this or more."""
    last_fix: LastFix | None = None
    """Of one that is reckoned: where to look for it."""


class LinkRow(Document):
    """What came over one of several links of a vehicle."""

    connection: str
    frames_received: Whole
    frames_missing: Whole


class VehicleRow(Document):
    """What became of one vehicle."""

    name: str
    segments: tuple[Whole, ...]
    """Ids of what it inspected."""
    energy_used_pct: Tenths
    landed: YesNo
    """Whether it stands on its pad."""
    min_reserve_pct: Number | None
    """The lowest battery that was seen."""
    state: str = ""
    """In one word, as the page has it."""
    last_position: LastPosition | None = None
    frames_received: Whole | None = None
    """Of MAVLink, from this vehicle."""
    frames_missing: Whole | None = None
    """Lost on the way, by their sequence numbers."""
    frames_foreign: Whole | None = None
    """On its connection, of nobody's vehicle."""
    frames_refused: dict[str, Whole] | None = None
    """Not believed, by the reason."""
    links: tuple[LinkRow, ...] = ()
    """The same of each link, where it has several."""
    type: str | None = None
    autopilot: str | None = None
    firmware: str | None = None


class CheckRow(Document):
    """A line of the checklist before the take-off."""

    severity: Severity
    code: CheckCode | None = None
    """None in what was written before there were codes."""
    subject: str
    """A vehicle, or what else it is about."""
    text: str


class ParameterRow(Document):
    """A parameter that was changed on board."""

    vehicle: str
    name: str
    old: Number
    new: Number
    restored: YesNo
    """Whether it was given back."""


class TerrainPart(Document):
    """The raster that knew the ground, in metres."""

    source: str
    """Its name."""
    digest: str
    """Of what was read of it."""
    vertical: str
    """What its heights were counted from."""
    uncertainty_m: Number
    """Nine of ten heights are nearer than this to the truth."""
    margin_m: Number
    """That every leg keeps beside that."""
    most_raised_m: Number
    """How much higher than asked a pylon is passed, for the ground beside it."""


class HeightsPart(Document):
    """The heights that were flown, in metres."""

    over: str
    """What they are counted from."""
    flat: YesNo
    """Whether the ground is taken to be flat."""
    least_over_tops_m: Number | None
    """Over pylon tops."""
    least_over_ground_m: Number | None
    most_over_ground_m: Number | None
    return_over_ground_m: Number
    """The highest of the vehicles' own returns."""
    ceiling_m: Number
    terrain: Annotated[TerrainPart | None, Field(exclude_if=is_none)] = None
    """Where a raster knew the ground."""


class AbsenceRow(Document):
    """A time in which the ground station was not there."""

    until_s: Tenths
    pause_s: Tenths
    restarted: YesNo


class RadioRow(Document):
    """What a telemetry radio carried, from the order to take off on."""

    vehicles: tuple[str, ...]
    """That were behind it."""
    bytes_s: Number
    """In the mean, both ways."""
    most_bytes_s: Number
    capacity_bytes_s: Number
    """What it carries, as the site says or as is supposed."""
    round_trip_s: Number | None = None
    """The longest that was measured."""
    lost: Number
    """Share of frames, in the mean."""
    congested_s: Tenths
    weak_s: Tenths
    positions_hz: Number
    """How often its vehicles were asked to say where they are, where streams were thinned most."""


class InspectionRow(Document):
    """How a segment was flown."""

    segment: Whole
    name: str = ""
    vehicle: str
    inspected_at_m: Annotated[Number | None, Field(exclude_if=is_none)] = None
    """How high over the pylon tops, or the depot's ground, by its mission, where vehicles leave their layers."""
    speed_mean_m_s: Hundredths
    speed_max_m_s: Hundredths | None
    deviation_mean_m: Hundredths
    """From the planned track."""
    deviation_max_m: Hundredths


class NotCountedRow(Document):
    """A run along a segment that does not count."""

    vehicle: str
    segment: Whole
    name: str
    reason: str


class SeenRow(Document):
    """What an asset asked of a camera, and what became of it."""

    segment: Whole
    name: str
    camera: str
    take: str
    """pictures, video, or how many viewpoints."""
    state: str
    """seen, not seen or not flown."""
    vehicle: str
    """Who has seen it; empty if nobody has."""
    inspected_at_m: Annotated[Number | None, Field(exclude_if=is_none)] = None
    """As of an inspection: how high over the pylon tops, where vehicles leave their layers; more is from above."""
    pictures: Whole
    """How many count."""
    missing: str
    """What no picture shows, in words."""


class LegRow(Document):
    """A leg of a mission, from one waypoint to the next with the hold there, as planned and as flown."""

    waypoint: Whole
    """The one at its end, from 0."""
    phase: str
    """What it is for: takeoff, transit, inspect, return or land."""
    segment: Whole | None = None
    """Id of the segment that is inspected, or flown to."""
    planned_s: Tenths
    flown_s: Tenths | None
    """None where its begin or its end was not heard."""
    planned_pct: Thousandths
    """Of a full battery."""
    flown_pct: Thousandths | None
    """By what the battery reported; None where that is not known."""


class RouteRow(Document):
    """What was flown of one vehicle's mission, beside what the plan said of the same legs."""

    vehicle: str
    revision: Whole
    """Of the mission on board; the legs of one that a re-plan continued are those up to the change."""
    whole: YesNo
    """Whether it is a whole flight, from take-off to landing."""
    began_s: Tenths
    ended_s: Tenths
    planned_s: Tenths
    flown_s: Tenths
    time_error_pct: Number | None
    """By how much more was flown than planned, in percent of what was planned."""
    planned_pct: Hundredths
    """Of a full battery."""
    flown_pct: Hundredths | None
    energy_error_pct: Number | None
    legs: tuple[LegRow, ...]


class SortieRow(Document):
    """A flight of a vehicle from its take-off to its landing, where there were several."""

    vehicle: str
    number: Whole
    """Of this vehicle's, from 1."""
    pack: str
    """The id of its pack, as the crew said; empty if nobody did."""
    began_s: Tenths
    ended_s: Tenths | None
    """None where it did not land."""
    began_pct: Number | None
    """By its own report."""
    ended_pct: Number | None
    rest_v: Number | None
    """Of the pack at rest, before it."""
    segments: tuple[Whole, ...]
    """Ids of what it inspected."""
    base: Annotated[str, Field(exclude_if=not_)] = ""
    """Where it began, on a day whose sorties end at other bases."""
    lands: Annotated[str, Field(exclude_if=not_)] = ""
    """The base where it ended, or was to end."""


class EarlierRow(Document):
    """A flight before this one, which flies what it left."""

    run: str
    """Name of its run directory."""
    segments: tuple[Whole, ...]
    """Ids of what it inspected."""
    sorties: Whole
    duration_s: Number
    faults: tuple[str, ...]
    """Vehicles that were at fault."""
    day_plan: Annotated[str, Field(exclude_if=not_)] = ""
    """Names the plan of days whose sorties it flew."""
    day: Annotated[Whole, Field(exclude_if=not_)] = 0
    """Which day of that plan, from 1."""


class UnreachableRow(Document):
    """A segment that no flight could inspect."""

    segment: Whole
    """Its id, which is among `segments_uncovered`."""
    name: str
    why: str


class FlightReport(Document):
    """What a flight came to. Times are seconds since the order to take off."""

    format: Literal["faultline-report/1"]
    segments_total: Whole
    segments_inspected: Whole
    segments_uncovered: tuple[Whole, ...]
    """Ids of the segments left over."""
    uncovered_names: tuple[str, ...] = ()
    """The same by the names of the assets."""
    left_over: tuple[Whole, ...] = ()
    """Ids of those of them that the first plan left for the next sortie."""
    unreachable: tuple[UnreachableRow, ...] = ()
    """Those of them that lie in an area or behind one."""
    segment_names: dict[str, str] = Field(default={})
    """Every segment's name by its id."""
    finished: YesNo
    """Whether everything was inspected."""
    duration_s: Tenths
    """To the end of the supervision."""
    faults: tuple[FaultRow, ...]
    replans: tuple[ReplanRow, ...]
    vehicles: tuple[VehicleRow, ...]
    checks: tuple[CheckRow, ...] = ()
    """The checklist, as before the take-off."""
    parameters: tuple[ParameterRow, ...] = ()
    heights: HeightsPart | None = None
    absences: tuple[AbsenceRow, ...] = ()
    """Times in which the ground station itself was away."""
    radios: Annotated[tuple[RadioRow, ...], Field(exclude_if=not_)] = ()
    """Telemetry radios, where there were any."""
    seen: tuple[SeenRow, ...] = ()
    """What assets asked of cameras."""
    inferred: tuple[Whole, ...] = ()
    """Ids of segments that count by evidence, not by positions, after an absence."""
    min_separation_m: Hundredths | None
    """The least distance of any two flying vehicles that was measured."""
    inspection_speed_m_s: Number | None = None
    """That was asked for."""
    inspections: tuple[InspectionRow, ...] = ()
    not_counted: tuple[NotCountedRow, ...] = ()
    routes: tuple[RouteRow, ...] = ()
    """Planned beside flown, for each mission and each of its legs."""
    sorties: Annotated[tuple[SortieRow, ...], Field(exclude_if=not_)] = ()
    """In the order of their take-offs, where packs were changed, or a day of several was flown."""
    earlier: Annotated[tuple[EarlierRow, ...], Field(exclude_if=not_)] = ()
    """Flights before this one, which flies what they left; the first one first."""


class PadPart(Document):
    """Where a vehicle stood, to the last digit: heights and layers follow from it."""

    east_m: Number
    north_m: Number
    alt_m: Number
    """Above mean sea level."""


class AskedVehicle(Document):
    """What one vehicle answered before the flight."""

    name: str
    sysid: Whole | None = None
    type: str | None = None
    autopilot: str | None = None
    firmware: str | None = None
    remaining_pct: Number | None = None
    link_timeout_s: Number | None = None
    """How long it may be silent before it is declared lost."""
    pad: PadPart | None = None
    """None in an older directory: the pads are those that the site gives."""
    gps_fix: Whole | None = None
    """GPS_FIX_TYPE that its pad was known by; None where it did not say."""
    gps_accuracy_m: Number | None = None
    """By so much that may be off, by its receiver's word."""
    parameters: dict[str, Number] = Field(default={})
    stations: tuple[tuple[Whole, Whole], ...] = ()
    """System and component of the ground stations that were heard on its connection."""


class AskedVehicles(Document):
    """Who was asked before the flight, and what each one answered."""

    format: Literal["faultline-vehicles/1"] = "faultline-vehicles/1"
    vehicles: tuple[AskedVehicle, ...]
    checks: tuple[CheckRow, ...] = ()
    """The checklist."""
    earlier: Annotated[tuple[EarlierRow, ...], Field(exclude_if=not_)] = ()
    """Flights whose rest is flown."""
    counts_packs: Annotated[YesNo, Field(exclude_if=not_)] = False
    """Whether the packs of the bases are counted in flight; never in an older directory."""


def read_report(run: Path) -> FlightReport:
    """Return what the flight of a run directory came to.

    Raises:
        LogError: there is no report yet, or it cannot be used.
    """
    return FlightReport.read(RunDirectory(run).report, "the report of a flight that is over")


def read_vehicle_answers(run: Path) -> AskedVehicles:
    """Return what the vehicles of a run directory answered before the flight.

    Raises:
        LogError: it cannot be read.
    """
    return AskedVehicles.read(RunDirectory(run).vehicles, "what vehicles said before a flight")


def read_flown_day_plan(run: Path) -> DayPlanFile | None:
    """Return the day plan that a run directory was flown by; None for a single flight.

    Raises:
        MissionsError: it cannot be used.
    """
    path = RunDirectory(run).day_plan
    return read_day_plan(path) if path.exists() else None


def read_earlier_flights(run: Path) -> tuple[EarlierRow, ...]:
    """Return the flights up to that of a run directory, by its report, the first one first.

    Raises:
        LogError: there is no report, or it cannot be used.
        MissionsError: its day plan cannot be used.
    """
    report, day = read_report(run), read_flown_day_plan(run)
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
    """Return what this flight and those before it inspected together; empty where it is the first."""
    if not report.earlier:
        return ""
    done = {*list_inspected_segments(report), *(segment for row in report.earlier for segment in row.segments)}
    total = len(done | set(report.segments_uncovered))
    return f"with {format_count(len(report.earlier), 'flight')} before it {len(done)} of {total} segments are inspected"
