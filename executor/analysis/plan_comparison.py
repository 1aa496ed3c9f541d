"""Planned beside flown: time and energy of every mission and of every leg, from what the state of a flight kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from types import MappingProxyType

from executor.analysis.documents import LegRow, RouteRow
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import FlownLeg, LegBoundary
from missions import Phase


def build_route_rows(state: FleetState, factors: Mapping[str, float] = MappingProxyType({})) -> tuple[RouteRow, ...]:
    """Return what every vehicle flew of each of its missions; times are seconds since the launch.

    Args:
        state: At the end of the flight.
        factors: The consumption that was planned with, by the vehicle's name, where it was known before.
    """
    launched_s = state.progress.launched_s or 0.0
    rows = []
    for vehicle in state.vehicles.values():
        for revision, legs in groupby(vehicle.assignment.flown, key=lambda leg: leg.revision):
            row = _build_route_row(
                vehicle.name, revision, [_scale_energy(leg, factors.get(vehicle.name, 1.0)) for leg in legs], launched_s
            )
            rows += [] if row is None else [row]
    return tuple(rows)


def _scale_energy(leg: FlownLeg, factor: float) -> FlownLeg:
    return replace(leg, planned=replace(leg.planned, energy_pct=factor * leg.planned.energy_pct))


def error_pct(flown: float | None, planned: float) -> float | None:
    """Return by how much more was flown than planned, in percent; None where that is not known.

    >>> error_pct(110.0, 100.0)
    10.0
    """
    return None if flown is None or planned <= 0.0 else round(100.0 * flown / planned - 100.0, 2)


def _build_route_row(vehicle: str, revision: int, legs: Sequence[FlownLeg], launched_s: float) -> RouteRow | None:
    """Return one mission's row; None if nobody heard when any of it began or ended."""
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
    return RouteRow(
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


def _build_leg_row(leg: FlownLeg) -> LegRow:
    began, ended = leg.began, leg.ended
    return LegRow.build_from(
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
