"""What counts already, and is looked at from nearer: by the nearer one, once that shows as much."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.imaging.asset_status import (
    PICTURE_TIMEOUT_S,
    find_missed_segments,
    judge_pictures,
    record_flown_segments,
    record_passed_pylons,
)
from executor.core.interface.commands import Level, Say
from executor.core.replanning.replan_cycle import find_orphan_segments
from executor.core.state.fleet_state import Coverage, FleetState
from executor.core.state.inspection_proof import SegmentPass
from executor.core.state.vehicle_state import build_onboard_mission
from missions import Phase, build_flight_path, continue_path
from missions.inspection_height import build_first_paths
from tests.executor.builders import with_facts
from tests.executor.core.replanning.test_replan_separation import CONTEXTS
from tests.executor.core.telemetry.test_camera_reports import NOW_S, flying, heard

HOW = SegmentPass(3.0, 3.1, 0.1, 0.2)
FROM_M, ASKED_M = 20.0, 15.0
PYLON = 2


def with_one_from_a_layer(segment: int, by: str, at_m: float = FROM_M) -> Coverage:
    return Coverage(
        inspected=MappingProxyType({segment: by}),
        inspected_at_m=MappingProxyType({segment: at_m}),
        inferred=frozenset({segment}),
    )


@pytest.mark.parametrize(
    ("counted_m", "by", "at_m"), [(FROM_M, "uav1", ASKED_M), (ASKED_M, "uav2", ASKED_M), (10.0, "uav2", 10.0)]
)
def test_a_span_that_counts_counts_by_the_nearer_of_two(counted_m: float, by: str, at_m: float) -> None:
    chosen = CONTEXTS[False]
    path = build_first_paths(chosen.setup, {"uav1": (0, 2)})["uav1"]
    state = fleet_step.build_initial_state({"uav1": build_onboard_mission(chosen, "uav1", 0, path, (0, 2))})
    state = replace(state, coverage=with_one_from_a_layer(0, "uav2", counted_m))
    state = record_flown_segments(chosen, state, "uav1", [(0, HOW)], NOW_S)
    assert (state.coverage.inspected[0], state.coverage.inspected_at_m[0]) == (by, at_m)
    # Nobody has to take it on evidence any more that all of it was flown.
    assert (state.coverage.flown.get(0), state.coverage.list_inferred_segments()) == (
        (HOW, frozenset()) if by == "uav1" else (None, {0})
    )


def around_again(*seen: int) -> tuple[Context, FleetState]:
    """Return a vehicle that flew around a pylon below its layer, with pictures from some of the viewpoints."""
    context, vehicle = flying(low=True)
    state = FleetState(vehicles={"uav1": vehicle}, coverage=with_one_from_a_layer(PYLON, "uav2", 45.0))
    for point in seen:
        state = heard(context, state.vehicles["uav1"], state, up_m=45.0, yaw_deg=0.0, point=point, sequence=point)
    board = vehicle.assignment.board
    assert board is not None
    before = with_facts(vehicle, waypoint=vehicle.assignment.waypoint - 1)
    return context, record_passed_pylons(context, state, before, NOW_S)


def test_a_pylon_counts_by_nearer_pictures_once_they_show_all_of_it() -> None:
    context, state = around_again(0, 1)
    # Until they are judged it counts as before, is nobody's to fly, and misses nothing.
    assert (state.coverage.inspected[PYLON], state.coverage.inspected_at_m[PYLON]) == ("uav2", 45.0)
    assert (PYLON in find_orphan_segments(context, state), find_missed_segments(context, state)) == (False, frozenset())
    state, commands = judge_pictures(context, state, NOW_S + 0.1)
    assert commands == ()
    assert (state.coverage.inspected[PYLON], state.coverage.inspected_at_m[PYLON]) == ("uav1", ASKED_M)
    assert set(state.coverage.caught[PYLON]) == {("rgb", 0.0), ("rgb", 1.0)}
    assert (state.coverage.caught_nearer, state.coverage.unseen, state.coverage.inferred) == ({}, {}, frozenset())


def test_nearer_pictures_that_lack_a_viewpoint_take_nothing_away() -> None:
    context, state = around_again(1)
    counted = state.coverage.inspected, state.coverage.inspected_at_m, state.coverage.caught
    state, commands = judge_pictures(context, state, NOW_S + PICTURE_TIMEOUT_S - 0.1)
    assert commands == ()
    state, commands = judge_pictures(context, state, NOW_S + PICTURE_TIMEOUT_S + 0.1)
    [line] = [command for command in commands if isinstance(command, Say)]
    assert line.level is Level.INFO
    assert (
        line.text == "uav1: pylon p1 counts as before, closer pictures are missing: rgb has no picture from viewpoint 1"
    )
    assert (state.coverage.inspected, state.coverage.inspected_at_m, state.coverage.caught) == counted
    assert (state.coverage.caught_nearer, state.coverage.unseen, state.coverage.not_seen) == ({}, {}, {})


@pytest.mark.parametrize(("seen", "by"), [((1,), None), ((0, 1), "uav1")])
def test_an_asset_reopened_in_the_meantime_counts_by_closer_pictures(seen: tuple[int, ...], by: str | None) -> None:
    """An operator asks for proof of what counts by evidence alone, while its nearer pictures are waited for."""
    context, state = around_again(*seen)
    state = replace(state, coverage=replace(state.coverage, inspected=MappingProxyType({})))
    state, commands = judge_pictures(context, state, NOW_S + PICTURE_TIMEOUT_S + 0.1)
    assert commands == ()
    assert state.coverage.inspected.get(PYLON) == by
    assert state.coverage.unseen == {}


@pytest.mark.parametrize("again", [False, True])
def test_a_pass_counts_from_where_the_vehicle_was_in_it(again: bool) -> None:
    """uav2's mission leads there from its layer first, and at the asked distance in the end."""
    chosen = CONTEXTS[False]
    first = build_flight_path(chosen.setup, "uav2", (4,))
    kept = 1 + next(number for number, point in enumerate(first.waypoints) if point.phase is Phase.INSPECT)
    path = continue_path(chosen.setup, first, kept, (4,), frozenset({2}))
    board = build_onboard_mission(chosen, "uav2", 1, path, (4, 4))
    lands = len(path.waypoints) - 1
    state = fleet_step.build_initial_state({"uav2": board})
    state = state.put(with_facts(state.vehicles["uav2"], waypoint=lands if again else kept - 1))
    state = record_flown_segments(chosen, state, "uav2", [(2, HOW)], NOW_S)
    above_m = 0.0 if again else chosen.setup.layers.offset_m("uav2")
    assert state.coverage.inspected_at_m[2] == ASKED_M + above_m


def test_a_first_inspection_waits_for_its_pictures() -> None:
    context, vehicle = flying(low=True)
    state = FleetState(vehicles={"uav1": vehicle})
    state = record_flown_segments(context, state, "uav1", [(PYLON, None)], NOW_S)
    assert state.coverage.unseen[PYLON].nearer_m is None
    assert find_missed_segments(context, state) == {PYLON}
