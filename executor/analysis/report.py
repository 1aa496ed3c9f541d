"""What a flight came to, as report.json says it. All times are seconds since the launch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from executor.analysis.documents import (
    AbsenceRow,
    AskedVehicle,
    AskedVehicles,
    CheckRow,
    EarlierRow,
    FaultRow,
    FlightReport,
    HeightsPart,
    InspectionRow,
    LastFix,
    LastPosition,
    NotCountedRow,
    PadPart,
    ParameterRow,
    ReplanRow,
    SeenRow,
    SortieRow,
    UnreachableRow,
    VehicleRow,
)
from executor.analysis.plan_comparison import build_route_rows
from executor.core.context import Context
from executor.core.fleet_view import position_view, vehicle_state_word
from executor.core.interface.check_codes import Check
from executor.core.interface.ports import LinkCounts
from executor.core.preflight import mission_checks
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.state.fleet_state import FleetState, ReplanRecord
from executor.core.state.vehicle_position import is_home_by_own_estimate, is_over_pad
from executor.core.state.vehicle_state import Fault, Stage, VehicleState
from executor.core.telemetry import firmware
from executor.images.index_rows import build_asset_rows


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """A fault that a simulator ordered, when it really happened."""

    vehicle: str
    kind: str
    """link, battery, fence or interruption."""
    at_s: float
    """In the ground station's time."""


@dataclass(frozen=True, slots=True)
class PreflightRecord:
    """What was known before the flight."""

    facts: Mapping[str, VehicleFacts]
    """What each vehicle said."""
    checks: Sequence[Check]
    """The checklist."""
    earlier: tuple[EarlierRow, ...] = ()
    """Flights whose rest is flown."""
    kept: AskedVehicles | None = None
    """Of a flight that is taken up again: vehicles.json, which says what was known before it."""

    def build_check_rows(self) -> tuple[CheckRow, ...]:
        """Return the checklist as a document has it."""
        return tuple(map(CheckRow.build_from, self.checks)) if self.kept is None else self.kept.checks

    def firmware_of(self, name: str) -> dict[str, str | None]:
        """Return what a vehicle is and which firmware it has."""
        rows = () if self.kept is None else self.kept.vehicles
        known = next((row for row in rows if row.name == name), None)
        if known is not None:
            return {"type": known.type, "autopilot": known.autopilot, "firmware": known.firmware}
        return _describe_firmware(self.facts.get(name))


NOTHING_SAID = PreflightRecord(MappingProxyType({}), ())


def build_vehicle_answers(context: Context, said: PreflightRecord) -> AskedVehicles:
    """Return the content of vehicles.json: who was asked before the flight, and what each one answered."""
    return AskedVehicles(
        vehicles=tuple(
            AskedVehicle.build_from(
                facts,
                sysid=context.vehicles[name].sysid,
                **_describe_firmware(facts),
                link_timeout_s=context.vehicles[name].link_timeout_s,
                pad=PadPart.build_from(context.setup.pad_of(name)),
                gps_fix=None if facts.gps is None else facts.gps.fix,
                gps_accuracy_m=None if facts.gps is None else facts.gps.accuracy_m,
                parameters=dict(sorted(facts.parameters.items())),
                stations=tuple((station.system, station.component) for station in facts.stations),
            )
            for name, facts in said.facts.items()
        ),
        checks=tuple(map(CheckRow.build_from, said.checks)),
        earlier=said.earlier,
    )


def _describe_firmware(facts: VehicleFacts | None) -> dict[str, str | None]:
    if facts is None:
        return {}
    return {
        "type": firmware.describe_vehicle_type(facts.heartbeat.vehicle_type),
        "autopilot": firmware.describe_autopilot(facts.heartbeat.autopilot),
        "firmware": None if facts.version is None else str(facts.version),
    }


def build_report(
    context: Context,
    state: FleetState,
    ended_s: float,
    truths: Sequence[InjectedFault] = (),
    frames: Mapping[str, LinkCounts] = MappingProxyType({}),
    said: PreflightRecord = NOTHING_SAID,
    parameters: Sequence[ParameterRow] = (),
) -> FlightReport:
    """Return the content of report.json.

    Args:
        context: Of the flight.
        state: At its end.
        ended_s: The end, in the ground station's time.
        truths: What really happened, where a simulator knows it.
        frames: How many frames came from each vehicle, how many its sequence numbers say were lost on the way, and how
            many were not believed.
        said: What the vehicles said before the flight, and what was found then.
        parameters: What was changed on board, and whether it was given back.
    """
    began_s = state.progress.launched_s if state.progress.launched_s is not None else ended_s
    never = {one.segment for one in context.unreachable}
    uncovered = tuple(sorted((context.wanted - set(state.coverage.inspected)) | never))
    return FlightReport(
        format="faultline-report/1",
        segments_total=context.segments,
        segments_inspected=len(state.coverage.inspected),
        segments_uncovered=uncovered,
        uncovered_names=tuple(map(context.segment_name, uncovered)),
        left_over=tuple(sorted(state.coverage.left_over - set(state.coverage.inspected))),
        unreachable=tuple(
            UnreachableRow.build_from(one, name=context.segment_name(one.segment)) for one in context.unreachable
        ),
        segment_names={str(segment): context.segment_name(segment) for segment in sorted(context.wanted | never)},
        finished=not uncovered,
        duration_s=ended_s - began_s,
        faults=_build_fault_rows(state, began_s, truths),
        replans=tuple(_build_replan_row(record) for record in state.replanning.records if not record.sortie),
        vehicles=tuple(
            _build_vehicle_row(
                context, state, vehicle, frames.get(vehicle.name), said.firmware_of(vehicle.name), began_s
            )
            for vehicle in state.vehicles.values()
        ),
        checks=said.build_check_rows(),
        parameters=tuple(parameters),
        heights=_build_heights(context, state),
        absences=tuple(
            AbsenceRow.build_from(absence, until_s=absence.until_s - began_s) for absence in state.listening.absences
        ),
        seen=_build_seen_rows(context, state),
        inferred=tuple(sorted(state.coverage.list_inferred_segments())),
        min_separation_m=None if state.progress.separation is None else state.progress.separation.least_m,
        inspection_speed_m_s=context.inspection_speed_m_s,
        inspections=tuple(
            _build_inspection_row(context, state, segment)
            for segment in sorted(set(state.coverage.flown) & set(state.coverage.inspected))
        ),
        not_counted=tuple(
            NotCountedRow(vehicle=vehicle.name, segment=segment, name=context.segment_name(segment), reason=reason)
            for vehicle in state.vehicles.values()
            for segment, reason in vehicle.assignment.runs_broken
        ),
        sorties=build_sortie_rows(context, state, began_s),
        earlier=said.earlier if said.kept is None else said.kept.earlier,
        routes=build_route_rows(state, {name: setup.prior.factor for name, setup in context.vehicles.items()}),
    )


def build_sortie_rows(context: Context, state: FleetState, began_s: float) -> tuple[SortieRow, ...]:
    """Return every sortie, in the order of their take-offs; none of a flight of one each."""
    turns = {name: vehicle.turn for name, vehicle in state.vehicles.items()}
    if context.day is None and not any(turn.swaps for turn in turns.values()):
        return ()
    rows = []
    for name, turn in turns.items():
        own = {segment for segment, by in state.coverage.inspected.items() if by == name}
        for number, one in enumerate(turn.sorties):
            then = set(turn.sorties[number + 1].before) if number + 1 < len(turn.sorties) else own
            rows.append(
                SortieRow.build_from(
                    one,
                    vehicle=name,
                    began_s=one.began_s - began_s,
                    ended_s=None if one.ended_s is None else one.ended_s - began_s,
                    segments=tuple(sorted((then & own) - set(one.before))),
                )
            )
    return tuple(sorted(rows, key=lambda row: row.began_s))


def _build_replan_row(record: ReplanRecord) -> ReplanRow:
    gain, compared = record.gain, dict[str, object]()
    if gain is not None:
        compared = {
            "gained": gain.segments,
            "gained_m": gain.length_m,
            "taken_up": gain.left_over,
            "longest_route_s": gain.longest_s,
            "carried_route_s": gain.carried_s,
            "over_budget": gain.short,
        }
    return ReplanRow.build_from(record, total_s=record.ended_s - record.begun_s, **compared)


def _build_heights(context: Context, state: FleetState) -> HeightsPart:
    paths = [
        vehicle.assignment.board.path for vehicle in state.vehicles.values() if vehicle.assignment.board is not None
    ]
    return HeightsPart.model_validate(mission_checks.build_heights_document(context.setup, paths))


def _build_inspection_row(context: Context, state: FleetState, segment: int) -> InspectionRow:
    flown = state.coverage.flown[segment]
    return InspectionRow.build_from(
        flown,
        segment=segment,
        name=context.segment_name(segment),
        vehicle=state.coverage.inspected[segment],
        inspected_at_m=state.coverage.inspected_at_m.get(segment),
        speed_mean_m_s=flown.mean_m_s,
        speed_max_m_s=flown.max_m_s,
    )


def _build_fault_rows(state: FleetState, began_s: float, truths: Sequence[InjectedFault]) -> tuple[FaultRow, ...]:
    now = ((name, vehicle.fault) for name, vehicle in state.vehicles.items() if vehicle.fault is not None)
    return tuple(_build_fault_row(name, fault, began_s, truths) for name, fault in (*state.replanning.mended, *now))


def _build_seen_rows(context: Context, state: FleetState) -> tuple[SeenRow, ...]:
    at_m = state.coverage.inspected_at_m
    return tuple(
        SeenRow.build_from(row, name=row.asset, inspected_at_m=at_m.get(row.segment))
        for row in build_asset_rows(context, state)
    )


def _build_fault_row(name: str, fault: Fault, began_s: float, truths: Sequence[InjectedFault]) -> FaultRow:
    known = [t.at_s for t in truths if t.vehicle in {name, "all"} and t.kind == fault.kind.value]
    before = [at_s for at_s in known if at_s <= fault.detected_s]
    return FaultRow.build_from(
        fault,
        vehicle=name,
        happened_s=max(before) - began_s if before else None,
        detected_s=fault.detected_s - began_s,
    )


def _is_on_pad(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle stands on its pad; one that has landed there may lose GPS on the ground afterwards."""
    if vehicle.stage is Stage.LANDED:
        return is_home_by_own_estimate(context, vehicle)
    return vehicle.stage is Stage.GROUND and is_over_pad(context, vehicle)


def _build_vehicle_row(
    context: Context,
    state: FleetState,
    vehicle: VehicleState,
    counts: LinkCounts | None,
    known: Mapping[str, str | None],
    began_s: float,
) -> VehicleRow:
    battery = vehicle.power.battery
    return VehicleRow(
        name=vehicle.name,
        segments=tuple(sorted(segment for segment, name in state.coverage.inspected.items() if name == vehicle.name)),
        energy_used_pct=battery.given_pct,
        landed=_is_on_pad(context, vehicle),
        min_reserve_pct=battery.least_pct,
        state=vehicle_state_word(context, vehicle),
        last_position=_build_last_position(context, vehicle, began_s),
        frames_received=None if counts is None else counts.received,
        frames_missing=None if counts is None else counts.missing,
        frames_foreign=None if counts is None else counts.foreign,
        frames_refused=None if counts is None else dict(counts.refused),
        **known,
    )


def _build_last_position(context: Context, vehicle: VehicleState, began_s: float) -> LastPosition | None:
    fix = vehicle.motion.fix
    at = None if fix is None else position_view(context, vehicle, fix.at_s)
    if fix is None or at is None:
        return None
    last = at.last_fix
    return LastPosition.build_from(
        at,
        alt_rel_m=at.relative_alt_m,
        at_s=fix.at_s - began_s,
        last_fix=last and LastFix.build_from(last, alt_rel_m=last.relative_alt_m, at_s=fix.at_s - last.age_s - began_s),
    )
