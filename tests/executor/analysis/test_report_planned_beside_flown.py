"""Planned against flown, worked out by hand from a few legs."""

from __future__ import annotations

import itertools
from types import MappingProxyType

import pytest

from executor.analysis.report import build_route_rows, error_pct
from executor.core.state.fleet_state import FleetState, FlightProgress
from executor.core.state.vehicle_parts import Assignment, FlownLeg, LegBoundary
from executor.core.state.vehicle_state import VehicleState
from missions import LegEstimate, Phase

KINDS = (Phase.TAKEOFF, Phase.TRANSIT, Phase.INSPECT, Phase.RETURN, Phase.LAND)


def legs_at(*moments: tuple[float, float | None] | None, revision: int = 0, first: int = 0) -> tuple[FlownLeg, ...]:
    """Return legs of 10 s and 1 % each, between these (seconds, percent given); None is not heard."""
    ends = [None if one is None else LegBoundary(*one) for one in moments]
    return tuple(
        FlownLeg(
            revision, number, KINDS[number], 7 if KINDS[number] is Phase.INSPECT else None, LegEstimate(10.0, 1.0),
            began, ended,
        )
        for number, (began, ended) in enumerate(itertools.pairwise(ends), start=first)
    )  # fmt: skip


def state_with(*legs: FlownLeg) -> FleetState:
    vehicle = VehicleState("uav1", assignment=Assignment(flown=legs))
    return FleetState(MappingProxyType({"uav1": vehicle}), progress=FlightProgress(launched_s=100.0))


def test_a_whole_route_is_held_against_its_plan() -> None:
    moments = [(105.0, 0.5), (117.0, 1.5), (127.0, 2.7), (137.0, 3.7), (147.0, 4.7), (160.0, 6.0)]
    [row] = build_route_rows(state_with(*legs_at(*moments)))
    assert (row.vehicle, row.revision, row.whole) == ("uav1", 0, True)
    assert (row.began_s, row.ended_s) == (5.0, 60.0)
    assert (row.planned_s, row.flown_s, row.time_error_pct) == (50.0, 55.0, 10.0)
    assert (row.planned_pct, row.flown_pct, row.energy_error_pct) == (5.0, 5.5, 10.0)
    assert [leg.phase for leg in row.legs] == ["takeoff", "transit", "inspect", "return", "land"]
    assert [leg.segment for leg in row.legs] == [None, None, 7, None, None]
    assert [leg.flown_s for leg in row.legs] == [12.0, 10.0, 10.0, 10.0, 13.0]
    assert [leg.flown_pct for leg in row.legs] == pytest.approx([1.0, 1.2, 1.0, 1.0, 1.3])


def test_each_mission_has_its_own_row() -> None:
    first = legs_at((105.0, 0.0), (115.0, 1.0), (125.0, 2.0))
    again = legs_at((125.0, 2.0), (140.0, 3.0), revision=1, first=2)
    one, two = build_route_rows(state_with(*first, *again))
    assert [(row.revision, row.whole, len(row.legs), row.time_error_pct) for row in (one, two)] == [
        (0, False, 2, 0.0), (1, False, 1, 50.0)
    ]  # fmt: skip


def test_a_leg_without_messages_is_unknown_and_the_route_is_not() -> None:
    [row] = build_route_rows(state_with(*legs_at((105.0, None), (115.0, None), None, (137.0, 4.0), (150.0, 5.0))))
    assert [leg.flown_s for leg in row.legs] == [10.0, None, None, 13.0]
    assert (row.planned_s, row.flown_s, row.flown_pct, row.energy_error_pct) == (40.0, 45.0, None, None)


def test_nothing_is_reported_of_legs_without_begin_or_end() -> None:
    assert build_route_rows(state_with()) == ()
    assert build_route_rows(state_with(*legs_at(None, None, (130.0, 1.0)))) == ()
    assert error_pct(1.0, 0.0) is None
