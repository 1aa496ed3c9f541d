"""Build report.json from a flight: results, and planned against flown. All times are seconds since the launch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from types import MappingProxyType

from executor.analysis import documents
from executor.core.context import Context
from executor.core.fleet_view import position_view, vehicle_state_word
from executor.core.inflight.channel_watch import list_channels
from executor.core.interface.codes import Check
from executor.core.interface.ports import LinkCounts
from executor.core.preflight import mission_checks
from executor.core.preflight.vehicle_checks import VehicleFacts
from executor.core.radio_budget import GLOBAL_POSITION_INT, list_streams_hz
from executor.core.state.fleet_state import FleetState, ReplanRecord
from executor.core.state.vehicle_parts import FlownLeg, LegBoundary
from executor.core.state.vehicle_position import is_home_by_own_estimate, is_over_pad
from executor.core.state.vehicle_state import Fault, Stage, VehicleState
from executor.core.telemetry import vehicle_identity
from executor.images.index_files import build_asset_rows
from missions import Phase


def build_route_rows(
    state: FleetState, factors: Mapping[str, float] = MappingProxyType({})
) -> tuple[documents.RouteRow, ...]:
    """Return the flown values of every vehicle's missions; times are seconds since the launch.

    Args:
        state: State at the end of the flight.
        factors: Planned consumption factors by vehicle name, where known before the flight.
    """
    launched_s = state.progress.launched_s or 0.0
    rows = []
    for vehicle in state.vehicles.values():
        factor = factors.get(vehicle.name, 1.0)
        for revision, legs in groupby(vehicle.assignment.flown, key=lambda leg: leg.revision):
            scaled = [
                replace(leg, planned=replace(leg.planned, energy_pct=factor * leg.planned.energy_pct)) for leg in legs
            ]
            row = _build_route_row(vehicle.name, revision, scaled, launched_s)
            rows += [] if row is None else [row]
    return tuple(rows)


def error_pct(flown: float | None, planned: float) -> float | None:
    """Return the excess of flown over planned, in percent; None if unknown.

    >>> error_pct(110.0, 100.0)
    10.0
    """
    return None if flown is None or planned <= 0.0 else round(100.0 * flown / planned - 100.0, 2)


def _build_route_row(
    vehicle: str, revision: int, legs: Sequence[FlownLeg], launched_s: float
) -> documents.RouteRow | None:
    """Return one mission's row; None if no start or no end of its legs was received."""
    heard = [number for number, leg in enumerate(legs) if leg.began is not None]
    ended = [number for number, leg in enumerate(legs) if leg.ended is not None]
    if not heard or not ended or heard[0] > ended[-1]:
        return None
    legs = legs[heard[0] : ended[-1] + 1]
    began, end = legs[0].began, legs[-1].ended
    if began is None or end is None:
        return None
    planned_s = sum(leg.planned.duration_s for leg in legs)
    planned_pct = sum(leg.planned.energy_pct for leg in legs)
    flown_s, flown_pct = end.at_s - began.at_s, _draw_pct(began, end)
    return documents.RouteRow(
        vehicle=vehicle,
        revision=revision,
        whole=legs[0].phase is Phase.TAKEOFF and legs[-1].phase is Phase.LAND,
        began_s=began.at_s - launched_s,
        ended_s=end.at_s - launched_s,
        planned_s=planned_s,
        flown_s=flown_s,
        time_error_pct=error_pct(flown_s, planned_s),
        planned_pct=planned_pct,
        flown_pct=flown_pct,
        energy_error_pct=error_pct(flown_pct, planned_pct),
        legs=tuple(map(_build_leg_row, legs)),
    )


def _build_leg_row(leg: FlownLeg) -> documents.LegRow:
    began, ended = leg.began, leg.ended
    return documents.LegRow.build_from(
        leg,
        phase=leg.phase.value,
        planned_s=leg.planned.duration_s,
        flown_s=None if began is None or ended is None else ended.at_s - began.at_s,
        planned_pct=leg.planned.energy_pct,
        flown_pct=_draw_pct(began, ended),
    )


def _draw_pct(began: LegBoundary | None, ended: LegBoundary | None) -> float | None:
    if began is None or ended is None or began.given_pct is None or ended.given_pct is None:
        return None
    return ended.given_pct - began.given_pct


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """Fault injected by a simulator, at its actual time."""

    vehicle: str
    kind: str
    """Kind: link, battery, fence or interruption."""
    at_s: float
    """Time on the ground station's clock."""


NOTHING_SAID = documents.AskedVehicles(vehicles=())


def build_vehicle_answers(
    context: Context,
    facts: Mapping[str, VehicleFacts],
    checks: Sequence[Check] = (),
    earlier: tuple[documents.EarlierRow, ...] = (),
) -> documents.AskedVehicles:
    """Return the content of vehicles.json: the vehicles queried before the flight, and their answers.

    Args:
        context: Context of the flight.
        facts: Answers of each vehicle.
        checks: The checklist.
        earlier: Earlier flights whose remainder is flown.
    """
    return documents.AskedVehicles(
        vehicles=tuple(
            documents.AskedVehicle.build_from(
                one,
                sysid=context.vehicles[name].sysid,
                type=vehicle_identity.describe_vehicle_type(one.heartbeat.vehicle_type),
                autopilot=vehicle_identity.describe_autopilot(one.heartbeat.autopilot),
                firmware=None if one.version is None else str(one.version),
                link_timeout_s=context.vehicles[name].link_timeout_s,
                pad=context.setup.pad_of(name),
                gps_fix=None if one.gps is None else one.gps.fix,
                gps_accuracy_m=None if one.gps is None else one.gps.accuracy_m,
                parameters=dict(sorted(one.parameters.items())),
                stations=tuple((station.system, station.component) for station in one.stations if not station.behind),
            )
            for name, one in facts.items()
        ),
        checks=tuple(map(documents.CheckRow.build_from, checks)),
        earlier=earlier,
        counts_packs=context.day is not None and bool(context.day.packs),
    )


def build_report(
    context: Context,
    state: FleetState,
    ended_s: float,
    truths: Sequence[InjectedFault] = (),
    frames: Mapping[str, LinkCounts] = MappingProxyType({}),
    said: documents.AskedVehicles = NOTHING_SAID,
    parameters: Sequence[documents.ParameterRow] = (),
) -> documents.FlightReport:
    """Return the content of report.json.

    Args:
        context: Context of the flight.
        state: State at its end.
        ended_s: The end, in the ground station's time.
        truths: Injected faults, known in simulation only.
        frames: Frames received from each vehicle, frames lost by its sequence numbers, and frames rejected.
        said: vehicles.json: the vehicles' answers before the flight, and the checklist.
        parameters: Parameters changed on board, and whether they were restored.
    """
    began_s = state.progress.launched_s if state.progress.launched_s is not None else ended_s
    never = {one.segment for one in context.unreachable}
    asked = {row.name: row for row in said.vehicles}
    hurt = ((name, vehicle.fault) for name, vehicle in state.vehicles.items() if vehicle.fault is not None)
    uncovered = tuple(sorted((context.wanted - set(state.coverage.inspected)) | never))
    return documents.FlightReport(
        format="faultline-report/1",
        segments_total=context.segments,
        segments_inspected=len(state.coverage.inspected),
        segments_uncovered=uncovered,
        uncovered_names=tuple(map(context.segment_name, uncovered)),
        left_over=tuple(sorted(state.coverage.left_over - set(state.coverage.inspected))),
        unreachable=tuple(
            documents.UnreachableRow.build_from(one, name=context.segment_name(one.segment))
            for one in context.unreachable
        ),
        segment_names={str(segment): context.segment_name(segment) for segment in sorted(context.wanted | never)},
        finished=not uncovered,
        duration_s=ended_s - began_s,
        faults=tuple(_build_fault_row(*one, began_s, truths) for one in (*state.replanning.mended, *hurt)),
        replans=tuple(_build_replan_row(record) for record in state.replanning.records if not record.sortie),
        vehicles=tuple(
            _build_vehicle_row(context, state, vehicle, frames.get(vehicle.name), asked.get(vehicle.name), began_s)
            for vehicle in state.vehicles.values()
        ),
        checks=said.checks,
        parameters=tuple(parameters),
        heights=_build_heights(context, state),
        absences=tuple(
            documents.AbsenceRow.build_from(one, until_s=one.until_s - began_s) for one in state.listening.absences
        ),
        radios=tuple(_build_radio_rows(context, state)),
        seen=_build_seen_rows(context, state),
        inferred=tuple(sorted(state.coverage.list_inferred_segments())),
        min_separation_m=state.progress.separation_m,
        inspection_speed_m_s=context.inspection_speed_m_s,
        inspections=tuple(
            _build_inspection_row(context, state, segment)
            for segment in sorted(set(state.coverage.flown) & set(state.coverage.inspected))
        ),
        not_counted=tuple(
            documents.NotCountedRow(
                vehicle=vehicle.name, segment=segment, name=context.segment_name(segment), reason=reason
            )
            for vehicle in state.vehicles.values()
            for segment, reason in vehicle.assignment.runs_broken
        ),
        sorties=build_sortie_rows(context, state, began_s),
        earlier=said.earlier,
        routes=build_route_rows(state, {name: setup.prior.factor for name, setup in context.vehicles.items()}),
    )


def _build_heights(context: Context, state: FleetState) -> documents.HeightsPart:
    boards = (vehicle.assignment.board for vehicle in state.vehicles.values())
    paths = [board.path for board in boards if board is not None]
    return documents.HeightsPart.model_validate(mission_checks.build_heights_document(context.setup, paths))


def _build_radio_rows(context: Context, state: FleetState) -> Iterator[documents.RadioRow]:
    for share in list_channels(context):
        known = state.channels.get(share.names[0])
        if known is None or known.totals.seconds <= 0.0:
            continue
        totals, dialect = known.totals, context.vehicles[share.names[0]].dialect
        carries_bytes_s = share.find_capacity_bytes_s(on_radio=True) or 0.0
        if share.bytes_s is None:
            carries_bytes_s = max(carries_bytes_s, totals.most_bytes_s)
        step = max(totals.most_step, share.choose_step(dialect, on_radio=True))
        yield documents.RadioRow.build_from(
            totals,
            vehicles=share.names,
            bytes_s=round(totals.bytes / totals.seconds),
            most_bytes_s=round(totals.most_bytes_s),
            capacity_bytes_s=round(carries_bytes_s),
            round_trip_s=totals.most_round_trip_s,
            lost=round(totals.lost_s / totals.seconds, 3),
            positions_hz=list_streams_hz(dialect, step)[GLOBAL_POSITION_INT],
        )


def _build_seen_rows(context: Context, state: FleetState) -> tuple[documents.SeenRow, ...]:
    at_m = state.coverage.inspected_at_m
    return tuple(
        documents.SeenRow.build_from(row, name=row.asset, inspected_at_m=at_m.get(row.segment))
        for row in build_asset_rows(context, state)
    )


def build_sortie_rows(context: Context, state: FleetState, began_s: float) -> tuple[documents.SortieRow, ...]:
    """Return every sortie in order of take-off; none for a flight with one sortie each."""
    turns = {name: vehicle.turn for name, vehicle in state.vehicles.items()}
    if context.day is None and not any(turn.swaps for turn in turns.values()):
        return ()
    rows = []
    for name, turn in turns.items():
        own = {segment for segment, by in state.coverage.inspected.items() if by == name}
        for number, one in enumerate(turn.sorties):
            then = set(turn.sorties[number + 1].before) if number + 1 < len(turn.sorties) else own
            rows.append(
                documents.SortieRow.build_from(
                    one,
                    vehicle=name,
                    began_s=one.began_s - began_s,
                    ended_s=None if one.ended_s is None else one.ended_s - began_s,
                    segments=tuple(sorted((then & own) - set(one.before))),
                    base=(base := one.base or _own_base(context, name)),
                    lands=base and (one.lands or base),
                )
            )
    return tuple(sorted(rows, key=lambda row: row.began_s))


def _own_base(context: Context, name: str) -> str:
    """Return a vehicle's base at the start of the day if its sorties lead to others; else an empty text."""
    return "" if context.day is None or name not in context.day.pads else context.day.bases[name]


def _build_replan_row(record: ReplanRecord) -> documents.ReplanRow:
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
    return documents.ReplanRow.build_from(record, total_s=record.ended_s - record.begun_s, **compared)


def _build_inspection_row(context: Context, state: FleetState, segment: int) -> documents.InspectionRow:
    flown = state.coverage.flown[segment]
    return documents.InspectionRow.build_from(
        flown,
        segment=segment,
        name=context.segment_name(segment),
        vehicle=state.coverage.inspected[segment],
        inspected_at_m=state.coverage.inspected_at_m.get(segment),
        speed_mean_m_s=flown.mean_m_s,
        speed_max_m_s=flown.max_m_s,
    )


def _build_fault_row(name: str, fault: Fault, began_s: float, truths: Sequence[InjectedFault]) -> documents.FaultRow:
    known = [t.at_s for t in truths if t.vehicle in {name, "all"} and t.kind == fault.kind.value]
    before = [at_s for at_s in known if at_s <= fault.detected_s]
    return documents.FaultRow.build_from(
        fault, vehicle=name, happened_s=max(before) - began_s if before else None, detected_s=fault.detected_s - began_s
    )


def _is_on_pad(context: Context, vehicle: VehicleState) -> bool:
    """Return whether a vehicle is on its pad; one that has landed there may lose GPS on the ground afterwards."""
    if vehicle.stage is Stage.LANDED:
        return is_home_by_own_estimate(context, vehicle)
    return vehicle.stage is Stage.GROUND and is_over_pad(context, vehicle)


def _build_vehicle_row(
    context: Context,
    state: FleetState,
    vehicle: VehicleState,
    counts: LinkCounts | None,
    asked: documents.AskedVehicle | None,
    began_s: float,
) -> documents.VehicleRow:
    battery = vehicle.power.battery
    return documents.VehicleRow.build_from(
        asked,
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
        links=()
        if counts is None
        else tuple(
            documents.LinkRow(connection=name, frames_received=one.received, frames_missing=one.missing or 0)
            for name, one in counts.by_connection.items()
        ),
    )


def _build_last_position(context: Context, vehicle: VehicleState, began_s: float) -> documents.LastPosition | None:
    fix = vehicle.motion.fix
    at = None if fix is None else position_view(context, vehicle, fix.at_s)
    if fix is None or at is None:
        return None
    last = at.last_fix
    return documents.LastPosition.build_from(
        at,
        alt_rel_m=at.relative_alt_m,
        at_s=fix.at_s - began_s,
        last_fix=last
        and documents.LastFix.build_from(last, alt_rel_m=last.relative_alt_m, at_s=fix.at_s - last.age_s - began_s),
    )
