"""Descending to inspection height in flight: as soon as no other vehicle can be there, and never before."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from executor.core import fleet_step
from executor.core.context import Context, DayRules
from executor.core.interface.commands import Say, Upload
from executor.core.interface.events import UploadEnded
from executor.core.replanning.lower_to_inspection_height import LARGEST_LOSS, lower_one_vehicle
from executor.core.state.fleet_state import FleetState
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_state import Stage, build_onboard_mission
from missions.inspection_height import build_first_paths, segment_distances_m
from tests.executor.builders import with_facts
from tests.executor.core.replanning.test_replan_separation import (
    CONTEXTS,
    NAMES,
    NOW_S,
    flying_to,
    in_flight,
    nobody_meets,
    one_flies_on,
    uploads,
)
from tests.executor.core.vehicles import pack

ASKED_M = 15.0
SHARED = {"uav1": (0, 2), "uav2": (7, 5)}
"""Two spans each of one line; the second's last span ends where the first's last ends."""


def sharing(chosen: Context) -> FleetState:
    """Return two vehicles at the beginning of their missions."""
    paths = build_first_paths(chosen.setup, SHARED)
    boards = {
        name: build_onboard_mission(chosen, name, 0, paths[name], SHARED[name]) if name in SHARED else None
        for name in NAMES
    }
    state = fleet_step.build_initial_state(boards)
    for name in SHARED:
        state = state.put(flying_to(state.vehicles[name], 1))
    return replace(state, progress=replace(state.progress, launched_s=0.0))


def down(state: FleetState) -> FleetState:
    """Return the fleet with its first vehicle home."""
    board = state.vehicles["uav1"].assignment.board
    assert board is not None
    landed = with_facts(state.vehicles["uav1"], stage=Stage.LANDED, waypoint=len(board.path.waypoints))
    return state.put(landed)


@pytest.mark.parametrize("rises", [False, True])
def test_a_vehicle_at_a_shared_pylon_descends_once_the_other_has_left(rises: bool) -> None:
    chosen = CONTEXTS[rises]
    state = sharing(chosen)
    before = state.vehicles["uav2"].assignment.board
    assert before is not None
    assert segment_distances_m(chosen.setup, before.path, before.visits)[2] > ASKED_M
    assert lower_one_vehicle(chosen, state, NOW_S - 2.0)[1] == ()
    state, commands = lower_one_vehicle(chosen, down(state), NOW_S)
    said = [command.text for command in commands if isinstance(command, Say)]
    assert said == ["uav2: airspace at segment 2 is free; new mission at inspection height"]
    [upload] = uploads(commands)
    assert upload.vehicle == "uav2"
    assert upload.path.waypoints[:1] == before.path.waypoints[:1]
    assert segment_distances_m(chosen.setup, upload.path, SHARED["uav2"]) == {2: ASKED_M, 3: ASKED_M}
    # On board, it is no re-plan, and nothing is left to come down to.
    ended = UploadEnded("uav2", upload.revision, accepted=True, reason="", mixed=False)
    state, _ = fleet_step.step(chosen, state, ended, NOW_S)
    assert (state.replanning.replan, state.replanning.records) == (None, ())
    assert lower_one_vehicle(chosen, state, NOW_S + 2.0)[1] == ()


def test_an_upload_that_fails_is_not_begun_again() -> None:
    chosen = CONTEXTS[False]
    state, commands = lower_one_vehicle(chosen, down(sharing(chosen)), NOW_S)
    [upload] = uploads(commands)
    ended = UploadEnded("uav2", upload.revision, accepted=False, reason="refused", mixed=False)
    state, _ = fleet_step.step(chosen, state, ended, NOW_S)
    assert state.vehicles["uav2"].assignment.board is not None
    assert state.vehicles["uav2"].fault is None
    for after_s in (2.0, 5.0, 9.0):
        assert lower_one_vehicle(chosen, state, NOW_S + after_s)[1] == ()


@pytest.mark.parametrize("why", ["lossy", "poor", "recalled", "late", "returns_not", "evening"])
def test_it_stays_in_its_layer_where_that_is_better(why: str) -> None:
    chosen, state = CONTEXTS[False], down(sharing(CONTEXTS[False]))
    own = state.vehicles["uav2"]
    board = own.assignment.board
    assert board is not None
    match why:
        case "lossy":  # an upload that breaks off helps nobody
            bad = LinkQuality(lost=2 * LARGEST_LOSS, usual=0.0)
            state = state.put(replace(own, link=replace(own.link, quality=bad)))
        case "poor":
            state = state.put(with_facts(own, battery=pack(17.0, 17.0)))
        case "recalled":
            state = replace(state, progress=replace(state.progress, recalled=True))
        case "late":  # it is on that span already
            number = next(index for index, point in enumerate(board.path.waypoints) if point.visit == 1)
            state = state.put(with_facts(own, waypoint=number))
        case "evening":  # its hours end
            ended = ((0.0, NOW_S + 5.0),)
            chosen = replace(chosen, day=DayRules(0.0, {}, {"uav2": ended}), draws_pct_s=(0.05,))
        case _:
            setup = replace(chosen.vehicles["uav2"], returns=False)
            chosen = replace(chosen, vehicles={**chosen.vehicles, "uav2": setup})
    assert [one for one in lower_one_vehicle(chosen, state, NOW_S)[1] if isinstance(one, Upload)] == []


@settings(derandomize=True, deadline=None, max_examples=20, phases=[Phase.explicit, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1), rises=st.booleans())
def test_a_descent_in_flight_meets_no_vehicle(seed: int, rises: bool) -> None:
    chosen, rng = CONTEXTS[rises], random.Random(seed)
    state = in_flight(chosen, rng)
    for number in range(12):
        now_s = NOW_S + 2.0 * number
        state, commands = lower_one_vehicle(chosen, state, now_s)
        for upload in uploads(commands):
            nobody_meets(chosen, state, {upload.vehicle: upload.path})
            ended = UploadEnded(upload.vehicle, upload.revision, accepted=rng.random() < 0.8, reason="", mixed=False)
            state, _ = fleet_step.step(chosen, state, ended, now_s)
        nobody_meets(chosen, state, {})
        state = one_flies_on(state, rng, now_s)
