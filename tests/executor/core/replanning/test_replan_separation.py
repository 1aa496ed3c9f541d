"""Re-plans at the requested distance: no new mission conflicts with the path that any vehicle may still fly."""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from executor.core import fleet_step
from executor.core.context import Context
from executor.core.interface.codes import Ending
from executor.core.interface.commands import Command, Solve, Upload
from executor.core.interface.events import NewRoute, SolveEnded, UploadEnded
from executor.core.interface.messages import Heartbeat
from executor.core.preflight.onboard_failsafes import LinkFailsafe
from executor.core.replanning import replan_cycle, replan_separation, withdrawal
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState, build_onboard_mission
from executor.site import site_model
from missions import FlightPath, Network
from missions import Phase as LegPhase
from missions.geometry import leg_distances_m
from missions.inspection_height import (
    Airway,
    build_airway,
    build_first_paths,
    check_inspection_airspace,
    segment_distances_m,
)
from missions.setup import FlightSetup
from tests.executor.builders import ground_for, site_of, with_facts
from tests.executor.core.vehicles import AUTO, RTL, pack
from tests.missions.builders import network_of

NOW_S = 1000.0
LAYER_M = 5.0
NAMES = ("uav1", "uav2", "uav3", "uav4")
SPANS = 4


def context(*, rises: bool) -> Context:
    """Return four vehicles over four lines of four spans, that all return in silence."""
    ways = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    places = [(east * 80.0 * far, north * 80.0 * far) for east, north in ways for far in range(1, SPANS + 2)]
    first = [(SPANS + 1) * way for way in range(len(ways))]
    pairs = [(begin + span, begin + span + 1) for begin in first for span in range(SPANS)]
    heights = [(450.0 + 1.5 * (number % 5), 20.0) for number in range(len(places))] if rises else None
    return context_over(network_of(places, pairs, heights))


def context_over(network: Network) -> Context:
    """Return four vehicles over a network, that all return in silence."""
    site = site_of(NAMES, "ardupilot", inspection={"same_distance": True, "ceiling_m": 400.0})
    ground = ground_for(site, network)
    own = {name: LinkFailsafe(True, 5.0, "", returns=True) for name in NAMES}
    return site_model.build_context(ground, ground.setup, site_model.build_first_task(ground), own)


CONTEXTS = {rises: context(rises=rises) for rises in (False, True)}


def dealt(rng: random.Random, segments: list[int]) -> dict[str, tuple[int, ...]]:
    """Return routes over segments: along the lines, or in any order."""
    visits = [2 * segment for segment in segments]
    if rng.random() < 0.5:
        rng.shuffle(visits)
    cuts = sorted(rng.sample(range(len(visits) + 1), len(NAMES) - 1))
    parts = [tuple(visits[begin:end]) for begin, end in itertools.pairwise([0, *cuts, len(visits)])]
    return dict(zip(NAMES, parts, strict=True))


def flying_to(vehicle: VehicleState, waypoint: int, now_s: float = NOW_S, share: float = 0.0) -> VehicleState:
    """Return a vehicle that has flown a share of its way to a waypoint of its mission."""
    board = vehicle.assignment.board
    assert board is not None
    ends_m = [np.array([*board.places_m[end], board.path.waypoints[end].alt_rel_m]) for end in (waypoint - 1, waypoint)]
    *place, alt_m = (ends_m[0] + share * (ends_m[1] - ends_m[0])).tolist()
    facts = {
        "stage": Stage.FLYING, "heard_s": now_s, "heartbeat": Heartbeat(3, AUTO, True, 4), "heartbeat_s": now_s,
        "armed_once": True, "took_off": True, "battery": pack(90.0, 90.0), "waypoint": waypoint,
        "fix": PositionFix(now_s, now_s, (place[0], place[1]), alt_m, 450.0 + alt_m, (0.0, 0.0, 0.0)),
    }  # fmt: skip
    return with_facts(vehicle, **facts)


def in_flight(chosen: Context, rng: random.Random) -> FleetState:
    """Return a fleet in the midst of its missions."""
    routes = dealt(rng, list(range(4 * SPANS)))
    paths = build_first_paths(chosen.setup, routes)
    boards = {
        name: build_onboard_mission(chosen, name, 0, paths[name], routes[name]) if name in paths else None
        for name in NAMES
    }
    state = fleet_step.build_initial_state(boards)
    for name, board in boards.items():
        if board is None:
            continue
        waypoint = rng.randrange(1, len(board.path.waypoints) - 1)
        state = state.put(flying_to(state.vehicles[name], waypoint, share=rng.random()))
    return replace(state, progress=replace(state.progress, launched_s=0.0))


def one_flies_on(state: FleetState, rng: random.Random, now_s: float) -> FleetState:
    """Return a fleet of which one vehicle is some waypoints farther on its mission, or down at its end."""
    own = state.vehicles[rng.choice(NAMES)]
    board = own.assignment.board
    if board is None or own.stage is not Stage.FLYING:
        return state
    waypoint = min(own.assignment.waypoint + rng.randrange(4), len(board.path.waypoints))
    if waypoint == len(board.path.waypoints):
        return state.put(with_facts(own, stage=Stage.LANDED, waypoint=waypoint))
    return state.put(flying_to(own, waypoint, now_s))


def lose(state: FleetState, name: str, since_s: float = 120.0) -> FleetState:
    """Return the fleet with a vehicle that has been silent for some time."""
    fault = Fault(FaultKind.LINK, "silent", NOW_S - since_s, FaultCode.LINK_LOST)
    state = state.put(replace(state.vehicles[name], stage=Stage.LOST, fault=fault))
    replanning_ = replace(state.replanning, urgent=True, trigger=name, trigger_s=NOW_S - since_s)
    return replace(state, replanning=replanning_)


def is_low(chosen: Context, state: FleetState, name: str) -> bool:
    """Return whether a vehicle has some of its way below its layer left."""
    vehicle = state.vehicles[name]
    board = vehicle.assignment.board
    return board is not None and bool(
        build_airway(chosen.setup, board.path, vehicle.assignment.waypoint).has_wall.any()
    )


def with_somebody_low(chosen: Context) -> tuple[FleetState, str]:
    """Return a fleet in flight, and one of it that has some of its way below its layer left."""
    for seed in itertools.count():
        state = in_flight(chosen, random.Random(seed))
        for name in reversed(NAMES):
            if is_low(chosen, state, name):
                return state, name
    raise AssertionError


def answered(solve: Solve, rng: random.Random) -> SolveEnded:
    """Return routes of a solver that deals the open segments out to anybody who is not barred from them."""
    routes: dict[str, list[int]] = {one.vehicle: [] for one in solve.survivors}
    left = []
    for segment in solve.open_segments:
        able = [one.vehicle for one in solve.survivors if segment not in one.barred]
        if able:
            routes[rng.choice(able)].append(2 * segment + rng.randrange(2))
        else:
            left.append(segment)
    found = tuple(NewRoute(name, tuple(visits)) for name, visits in routes.items())
    return SolveEnded(solve.revision, found, tuple(left), 0.1, "")


def uploads(commands: tuple[Command, ...]) -> list[Upload]:
    return [command for command in commands if isinstance(command, Upload)]


def turning_back(setup: FlightSetup, vehicle: VehicleState, path: FlightPath) -> Airway:
    """Return the ways to where a path leads next, from anywhere on the leg under way."""
    board, fix, waypoint = vehicle.assignment.board, vehicle.motion.fix, vehicle.assignment.waypoint
    assert board is not None
    assert fix is not None
    if path.waypoints[:waypoint] != board.path.waypoints[:waypoint]:
        return Airway(vehicle.name, np.zeros((0, 2, 3)), np.zeros((0, 2)))
    here_m = np.array([*fix.place_m, setup.up_m(vehicle.name, fix.alt_rel_m)])
    end_m, goal_m = (build_airway(setup, one, waypoint).legs_m[0, 1] for one in (board.path, path))
    begins_m = here_m + np.linspace(0.0, 1.0, 100)[:, np.newaxis] * (end_m - here_m)
    legs_m = np.stack((begins_m, np.broadcast_to(goal_m, begins_m.shape)), axis=1)
    return Airway(vehicle.name, legs_m, np.zeros((len(legs_m), 2)))


def nobody_meets(chosen: Context, state: FleetState, new: dict[str, FlightPath]) -> None:
    """Hold what anybody may fly now, new missions that are on their way among it, against each other."""
    setup, taken, turns = chosen.setup, [], []
    for name, vehicle in state.vehicles.items():
        board = vehicle.assignment.board
        if board is None:
            continue
        rest = build_airway(setup, board.path, vehicle.assignment.waypoint)
        taken.append(rest.to_layer() if vehicle.stage is Stage.LOST else rest)
        if name in new:
            taken.append(build_airway(setup, new[name], vehicle.assignment.waypoint))
            turns.append(turning_back(setup, vehicle, new[name]))
        if vehicle.stage is Stage.FLYING:
            turns.append(turning_back(setup, vehicle, board.path))
    assert check_inspection_airspace(setup, [*taken, *turns]) == []
    for one, other in itertools.combinations(taken, 2):
        if one.vehicle != other.vehicle and len(one.legs_m) and len(other.legs_m):
            assert leg_distances_m(one.legs_m, other.legs_m).min() >= LAYER_M - 1e-3


@settings(derandomize=True, deadline=None, max_examples=20, phases=[Phase.explicit, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1), rises=st.booleans())
def test_after_any_re_plan_no_two_vehicles_meet(seed: int, rises: bool) -> None:
    chosen, rng = CONTEXTS[rises], random.Random(seed)
    state = in_flight(chosen, rng)
    flies = [name for name, vehicle in state.vehicles.items() if vehicle.stage is Stage.FLYING]
    nobody_meets(chosen, state, {})
    state, commands = replan_cycle.begin_replan(chosen, lose(state, rng.choice(flies)), NOW_S)
    solves = [command for command in commands if isinstance(command, Solve)]
    if not solves:
        return
    state, commands = replan_cycle.apply_solution(chosen, state, answered(solves[0], rng), NOW_S)
    new = {upload.vehicle: upload.path for upload in uploads(commands)}
    nobody_meets(chosen, state, new)
    # One mission after the other comes on board, or is refused; who has waited for it is given its own then.
    while new:
        name = rng.choice(sorted(new))
        del new[name]
        ended = UploadEnded(name, solves[0].revision, accepted=rng.random() < 0.8, reason="refused", mixed=False)
        state, _ = fleet_step.step(chosen, state, ended, NOW_S)
        nobody_meets(chosen, state, new)
        if state.replanning.replan is not None:
            state, commands = replan_cycle.begin_replan(chosen, state, NOW_S)
            new |= {upload.vehicle: upload.path for upload in uploads(commands)}
            nobody_meets(chosen, state, new)


def flying_by(chosen: Context, routes: Mapping[str, tuple[int, ...]], waypoints: dict[str, int]) -> FleetState:
    """Return a fleet in flight by routes, each just set out for a waypoint."""
    paths = build_first_paths(chosen.setup, routes)
    boards = {
        name: build_onboard_mission(chosen, name, 0, paths[name], routes[name]) if name in paths else None
        for name in NAMES
    }
    state = fleet_step.build_initial_state(boards)
    for name, waypoint in waypoints.items():
        state = state.put(flying_to(state.vehicles[name], waypoint))
    return replace(state, progress=replace(state.progress, launched_s=0.0))


@pytest.mark.parametrize("rises", [False, True])
def test_no_vehicle_is_sent_below_a_vehicle_that_climbs_from_the_line(rises: bool) -> None:
    """Its climb is under way, and not replaced by its new mission: that climbs there too."""
    chosen = CONTEXTS[rises]
    routes = {"uav1": (2,), "uav2": (10,), "uav4": (8 * SPANS - 2,)}
    state = flying_by(chosen, routes, {"uav1": 1, "uav2": 1, "uav4": 1})
    board = state.vehicles["uav4"].assignment.board
    assert board is not None
    climbs = 1 + max(number for number, point in enumerate(board.path.waypoints) if point.below_m > 0)
    state = state.put(flying_to(state.vehicles["uav4"], climbs))
    state, commands = replan_cycle.begin_replan(chosen, lose(state, "uav2"), NOW_S)
    [solve] = [command for command in commands if isinstance(command, Solve)]
    assert 4 * SPANS - 1 in {offer.vehicle: offer.barred for offer in solve.survivors}["uav1"]
    given = SolveEnded(solve.revision, (NewRoute("uav4", (10,)), NewRoute("uav1", (8 * SPANS - 1,))), (), 0.1, "")
    state, commands = replan_cycle.apply_solution(chosen, state, given, NOW_S)
    assert [upload.vehicle for upload in uploads(commands)] == ["uav4"]
    nobody_meets(chosen, state, {upload.vehicle: upload.path for upload in uploads(commands)})


def test_a_vehicle_recalled_from_its_return_is_routed_around_another_on_the_line() -> None:
    """No leg of its new mission comes near, nor does its way home; but straight from that to the next it would.

    It comes home from one line and is sent to another; between the two one above it inspects a third. Returns are
    stacked above a hill far away: else its straight way home from its new mission would be held against the third.
    """
    places = [(800.0, 200.0), (400.0, 200.0), (0.0, 200.0), (0.0, 300.0), (150.0, 125.0), (150.0, 165.0),
              (0.0, -100.0), (0.0, -200.0)]  # fmt: skip
    heights = [(450.0, 20.0)] * 7 + [(480.0, 20.0)]
    chosen = context_over(network_of(places, [(0, 1), (2, 3), (4, 5), (6, 7)], heights))
    state = flying_by(chosen, {"uav1": (0,), "uav4": (4,), "uav2": (6,)}, {"uav2": 1})
    uav1, uav4 = state.vehicles["uav1"].assignment.board, state.vehicles["uav4"].assignment.board
    assert uav1 is not None
    assert uav4 is not None
    home = next(number for number, point in enumerate(uav1.path.waypoints) if point.phase is LegPhase.RETURN)
    inspects = next(number for number, point in enumerate(uav4.path.waypoints) if point.phase is LegPhase.INSPECT)
    state = state.put(flying_to(state.vehicles["uav1"], home, share=0.5))
    state = state.put(flying_to(state.vehicles["uav4"], inspects))
    assert is_low(chosen, state, "uav4")
    state, commands = replan_cycle.begin_replan(chosen, lose(state, "uav2"), NOW_S)
    [solve] = [command for command in commands if isinstance(command, Solve)]
    given = SolveEnded(solve.revision, (NewRoute("uav1", (2,)),), (), 0.1, "")
    state, commands = replan_cycle.apply_solution(chosen, state, given, NOW_S)
    new = {upload.vehicle: upload.path for upload in uploads(commands)}
    nobody_meets(chosen, state, new)
    back = new["uav1"].waypoints[home]
    fix = state.vehicles["uav1"].motion.fix
    assert fix is not None
    assert chosen.setup.frame.to_local_m(back.lat_deg, back.lon_deg) == pytest.approx(fix.place_m, abs=1e-3)


def test_the_path_of_a_recalled_vehicle_to_its_new_mission_is_known() -> None:
    """The leg of its mission begins where the last one ended, where it has not been again."""
    chosen = CONTEXTS[False]
    state = flying_by(chosen, {"uav1": (2,), "uav2": (10,)}, {"uav1": 1, "uav2": 1})
    board = state.vehicles["uav1"].assignment.board
    assert board is not None
    for beside_m, legs in ((1.0, 0), (40.0, 1)):
        vehicle = flying_to(state.vehicles["uav1"], 2, share=0.5)
        fix = vehicle.motion.fix
        assert fix is not None
        here_m = (fix.place_m[0], fix.place_m[1] + beside_m)
        vehicle = with_facts(vehicle, fix=replace(fix, place_m=here_m))
        [one] = replan_separation.find_occupied_airways(chosen, replace(state, vehicles={"uav1": vehicle}), (), NOW_S)
        plain = build_airway(chosen.setup, board.path, 2)
        assert len(one.legs_m) == len(plain.legs_m) + legs
        if legs:
            assert one.over_ground_m[-1].tolist() == [
                pytest.approx(here_m), pytest.approx(plain.over_ground_m[0, 1].tolist())
            ]  # fmt: skip


@pytest.mark.parametrize(("mode", "leaves"), [(RTL, False), (AUTO, True)])
def test_a_vehicle_ordered_to_return_but_still_on_its_mission_has_not_left_the_line(mode: int, leaves: bool) -> None:
    """The order may have been lost: in its layer, between two parts of the line, it would go down to the next."""
    chosen = CONTEXTS[False]
    state = flying_by(chosen, {"uav1": (2,), "uav4": (26,), "uav2": (10,)}, {"uav1": 1, "uav2": 1})
    vehicle = flying_to(state.vehicles["uav4"], 1, share=0.5)
    vehicle = withdrawal.leave_plan(vehicle, Stage.RETURNING, NOW_S)
    vehicle = with_facts(vehicle, heartbeat=Heartbeat(3, mode, True, 4))
    state = state.put(vehicle)
    assert replan_separation.is_line_occupied(chosen, state, NOW_S + 1.0) is leaves
    later_s = NOW_S + replan_separation.CLIMB_TIMEOUT_S
    assert not replan_separation.is_line_occupied(chosen, state, later_s)
    taken = replan_separation.find_occupied_airways(chosen, state, (), later_s)
    assert any(one.vehicle == "uav4" and one.has_wall.any() for one in taken) is leaves


def given_a_low_part(chosen: Context) -> tuple[FleetState, int, float]:
    """Return a fleet of which uav4 is sent a mission with a part on the line, that plan, and how far that reaches."""
    state = flying_by(chosen, {"uav1": (2,), "uav4": (26,), "uav2": (10,)}, {"uav1": 1, "uav2": 1})
    board = state.vehicles["uav4"].assignment.board
    assert board is not None
    state = state.put(flying_to(state.vehicles["uav4"], len(board.path.waypoints) - 2))
    state, commands = replan_cycle.begin_replan(chosen, lose(state, "uav2"), NOW_S)
    [solve] = [command for command in commands if isinstance(command, Solve)]
    given = SolveEnded(solve.revision, (NewRoute("uav4", (8 * SPANS - 2,)),), (), 0.1, "")
    state, commands = replan_cycle.apply_solution(chosen, state, given, NOW_S)
    assert [upload.vehicle for upload in uploads(commands)] == ["uav4"]
    return state, solve.revision, float(chosen.setup.tracks_m[4 * SPANS - 1].min())


def reach_of(chosen: Context, state: FleetState, name: str) -> float:
    """Return how far south a vehicle's walls may reach by what it may fly."""
    taken = replan_separation.find_occupied_airways(chosen, state, (), NOW_S)
    walls_m = [one.over_ground_m[one.has_wall] for one in taken if one.vehicle == name]
    return min(float(wall_m.min()) for wall_m in walls_m if len(wall_m))


def test_the_airspace_of_a_mission_sent_to_a_withdrawn_vehicle_stays_closed() -> None:
    """Its upload may have ended well before it was lost, or before its pilot took it."""
    chosen = CONTEXTS[False]
    state, _, far_m = given_a_low_part(chosen)
    fault = Fault(FaultKind.LINK, "silent", NOW_S, FaultCode.LINK_LOST)
    state, _ = withdrawal.declare_fault(chosen, state, state.vehicles["uav4"], fault)
    assert reach_of(chosen, state, "uav4") == pytest.approx(far_m)
    assert replan_separation.is_line_occupied(chosen, state, NOW_S)


@pytest.mark.parametrize(
    ("code", "mixed", "stays"),
    [(Ending.NO_ANSWER, False, True), (Ending.NO_ANSWER, True, True), (Ending.DENIED, False, False)],
)
def test_what_may_be_on_board_after_an_upload_that_failed_stays_closed(code: Ending, mixed: bool, stays: bool) -> None:
    chosen = CONTEXTS[False]
    state, revision, far_m = given_a_low_part(chosen)
    ended = UploadEnded("uav4", revision, accepted=False, mixed=mixed, reason="it failed", code=code)
    state, _ = fleet_step.step(chosen, state, ended, NOW_S)
    sent_path = state.vehicles["uav4"].assignment.sent_path
    assert (sent_path is not None) is stays
    if stays and not mixed:  # with a mix of two it is brought home
        assert reach_of(chosen, state, "uav4") == pytest.approx(far_m)


def test_nothing_is_given_away_while_the_lost_one_may_be_on_the_line() -> None:
    chosen = CONTEXTS[False]
    state, lost = with_somebody_low(chosen)
    rises_s = replan_separation.line_clear_time_s(chosen.setup, chosen.pricing.models[lost], lost)
    soon, later = lose(state, lost, rises_s - 0.1), lose(state, lost, rises_s + 0.1)
    assert not [one for one in replan_cycle.begin_replan(chosen, soon, NOW_S)[1] if isinstance(one, Solve)]
    assert [one for one in replan_cycle.begin_replan(chosen, later, NOW_S)[1] if isinstance(one, Solve)]


def test_a_vehicle_without_a_gcs_failsafe_inspects_in_its_layer() -> None:
    chosen = CONTEXTS[False]
    vehicles = {**chosen.vehicles, "uav3": replace(chosen.vehicles["uav3"], returns=False)}
    routes = {name: tuple(2 * SPANS * way + 2 * span for span in range(SPANS)) for way, name in enumerate(NAMES)}
    paths = site_model.build_paths(chosen.setup, routes, vehicles)
    distances = {name: set(segment_distances_m(chosen.setup, paths[name], routes[name]).values()) for name in NAMES}
    assert distances == {"uav1": {15.0}, "uav2": {15.0}, "uav3": {15.0 + chosen.setup.layers.offset_m("uav3")},
                         "uav4": {15.0}}  # fmt: skip


def test_a_return_is_waited_for_until_it_is_seen_in_its_layer() -> None:
    chosen = CONTEXTS[False]
    state, name = with_somebody_low(chosen)
    vehicle = state.vehicles[name]
    fault = Fault(FaultKind.BATTERY, "low", NOW_S - 5.0, FaultCode.BATTERY_LOW)
    back = with_facts(replace(vehicle, stage=Stage.RETURNING, fault=fault), heartbeat=Heartbeat(3, RTL, True, 4))
    low, layer_m = vehicle.motion.fix, chosen.setup.layers.offset_m(name) + 15.0
    assert low is not None
    for up_m, waits in ((15.0, True), (layer_m, False)):
        up = state.put(with_facts(back, fix=replace(low, alt_rel_m=up_m)))
        assert replan_separation.is_line_occupied(chosen, up, NOW_S) is waits


@pytest.mark.parametrize(
    ("facts", "ago_s", "up_m", "straight"),
    [
        ({}, 0.0, 0.0, True),
        ({"stage": Stage.LOST}, 0.0, 0.0, False),
        ({"stage": Stage.PILOT}, 0.0, 0.0, False),
        ({"heartbeat": Heartbeat(3, AUTO, True, 4)}, 0.0, 0.0, False),
        ({"stale": True}, 0.0, 0.0, False),
        ({}, 10.0, 0.0, False),
        ({}, 0.0, -5.0, False),
    ],
)
def test_an_observed_return_closes_only_its_own_path(
    facts: dict[str, Any], ago_s: float, up_m: float, *, straight: bool
) -> None:
    """Its mission is over; who is not seen, or was taken by its pilot, may still fly all that is left of it."""
    chosen = CONTEXTS[False]
    state, name = with_somebody_low(chosen)
    vehicle = state.vehicles[name]
    fault = Fault(FaultKind.BATTERY, "low", NOW_S - 90.0, FaultCode.BATTERY_LOW)
    fix = vehicle.motion.fix
    assert fix is not None
    alt_m = chosen.setup.layers.offset_m(name) + 15.0 + up_m
    back = with_facts(
        replace(vehicle, fault=fault),
        **{
            "stage": Stage.RETURNING,
            "heartbeat": Heartbeat(3, RTL, True, 4),
            "fix": replace(fix, alt_rel_m=alt_m, at_s=NOW_S - ago_s),
            **facts,
        },
    )
    [taken] = [
        one
        for one in replan_separation.find_occupied_airways(chosen, state.put(back), (), NOW_S)
        if one.vehicle == name
    ]
    pad = chosen.setup.pad_of(name)
    way_m = [[*fix.place_m], [pad.east_m, pad.north_m]]
    assert (taken.over_ground_m.tolist() == [way_m]) is straight
    assert straight or len(taken.legs_m) > 1


@pytest.mark.parametrize("stage", [Stage.LOST, Stage.RETURNING])
def test_no_vehicle_waits_for_layers_only(stage: Stage) -> None:
    chosen = CONTEXTS[False]
    inspection = replace(chosen.setup.inspection, same_distance=False)
    usual = replace(chosen, setup=replace(chosen.setup, inspection=inspection))
    state = lose(in_flight(chosen, random.Random(3)), "uav4", 0.0)
    state = state.put(replace(state.vehicles["uav4"], stage=stage))
    assert not replan_separation.is_line_occupied(usual, state, NOW_S)


@pytest.mark.parametrize("returns", [True, False])
def test_a_lost_vehicle_counts_as_down_when_it_must_have_landed(returns: bool) -> None:
    chosen = CONTEXTS[False]
    state, name = with_somebody_low(chosen)
    setups = {**chosen.vehicles, name: replace(chosen.vehicles[name], returns=returns)}
    chosen = replace(chosen, vehicles=setups)
    vehicle = state.vehicles[name]
    board = vehicle.assignment.board
    assert board is not None
    rest_s = sum(leg.duration_s for leg in board.legs[vehicle.assignment.waypoint :])

    def may_be_there(since_s: float) -> bool:
        taken = replan_separation.find_occupied_airways(chosen, lose(state, name, since_s), (), NOW_S)
        return name in {one.vehicle for one in taken}

    assert may_be_there(replan_separation.DOWN_FACTOR * rest_s)
    # One that would not come home by itself may be anywhere, for as long as its battery lasts.
    assert (
        may_be_there(replan_separation.DOWN_FACTOR * (rest_s + 300.0) + replan_separation.DOWN_MARGIN_S) is not returns
    )
