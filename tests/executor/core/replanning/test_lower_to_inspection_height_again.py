"""Re-inspection at the requested distance: which vehicle, when, after others have left and after open segments."""

from __future__ import annotations

import random
from dataclasses import replace
from types import MappingProxyType

import pytest

from executor.core import fleet_step
from executor.core.context import Context, RelaunchPolicy
from executor.core.interface.commands import Command, Level, Say, Start
from executor.core.interface.events import IntentReceived, Tick, UploadEnded
from executor.core.interface.intents import Action, Intent
from executor.core.interface.messages import Heartbeat
from executor.core.replanning.lower_to_inspection_height import LARGEST_LOSS, LARGEST_PASS, SPARE_PCT, lower_one_vehicle
from executor.core.state.fleet_state import FleetState
from executor.core.state.link_quality import LinkQuality
from executor.core.state.vehicle_parts import PlannedSortie, PositionFix
from executor.core.state.vehicle_state import Fault, FaultCode, FaultKind, Stage, VehicleState, build_onboard_mission
from missions import Phase
from missions.inspection_height import build_first_paths, segment_distances_m, visit_distances_m
from planner import segment_of
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
from tests.executor.core.vehicles import AUTO, pack

ASKED_M = 15.0
FROM_M = 20.0
ROUTES = {"uav1": (0, 2), "uav2": (7, 5), "uav3": (8, 10)}
"""Two spans each; the first two share a pylon, so that uav2 inspects segment 2 from its layer."""


def going_home(chosen: Context, who: str = "uav2", share: float = 0.2) -> FleetState:
    """Return a fleet of which one is on its way home, and the others have landed; segment 2 counts from a layer."""
    paths = build_first_paths(chosen.setup, ROUTES)
    boards = {
        name: build_onboard_mission(chosen, name, 0, paths[name], ROUTES[name]) if name in ROUTES else None
        for name in NAMES
    }
    state = fleet_step.build_initial_state(boards)
    for name in ROUTES:
        board = boards[name]
        assert board is not None
        last = len(board.path.waypoints)
        if name != who:
            state = state.put(with_facts(state.vehicles[name], stage=Stage.LANDED, waypoint=last))
            continue
        leg = max(number for number, point in enumerate(board.path.waypoints) if point.phase is Phase.RETURN)
        state = state.put(on_leg(state.vehicles[name], leg, share))
    by = {segment_of(visit): name for name, visits in ROUTES.items() for visit in visits}
    distances = {segment: FROM_M if segment == 2 else ASKED_M for segment in by}
    coverage = replace(
        state.coverage, inspected=MappingProxyType(by), inspected_at_m=MappingProxyType(distances),
        given_up=frozenset(chosen.wanted) - set(by),
    )  # fmt: skip
    return replace(state, coverage=coverage, progress=replace(state.progress, launched_s=0.0))


def on_leg(vehicle: VehicleState, waypoint: int, share: float, now_s: float = NOW_S) -> VehicleState:
    """Return a vehicle that has flown a share of a leg."""
    vehicle, board = flying_to(vehicle, waypoint, now_s), vehicle.assignment.board
    assert board is not None
    begin, end = board.places_m[waypoint - 1], board.places_m[waypoint]
    place = (begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]))
    alt_m = board.path.waypoints[waypoint].alt_rel_m
    return with_facts(vehicle, fix=PositionFix(now_s, now_s, place, alt_m, 450.0 + alt_m, (0.0, 0.0, 0.0)))


def said(commands: tuple[Command, ...]) -> list[str]:
    return [command.text for command in commands if isinstance(command, Say)]


@pytest.mark.parametrize("rises", [False, True])
@pytest.mark.parametrize("who", ["uav1", "uav2", "uav3"])
def test_a_returning_vehicle_re_inspects_segments_inspected_from_a_layer(who: str, rises: bool) -> None:
    chosen = CONTEXTS[rises]
    state = going_home(chosen, who)
    before = state.vehicles[who].assignment.board
    assert before is not None
    state, commands = lower_one_vehicle(chosen, state, NOW_S)
    assert said(commands) == [f"{who}: re-inspects segment 2 at inspection height; new mission before it returns"]
    [upload] = uploads(commands)
    assert upload.vehicle == who
    kept = state.vehicles[who].assignment.waypoint
    assert upload.path.waypoints[:kept] == before.path.waypoints[:kept]
    ended = UploadEnded(who, upload.revision, accepted=True, reason="", mixed=False)
    state, _ = fleet_step.step(chosen, state, ended, NOW_S)
    board = state.vehicles[who].assignment.board
    assert board is not None
    assert segment_of(board.visits[-1]) == 2
    assert visit_distances_m(chosen.setup, board.path, board.visits)[-1] == ASKED_M
    # It is no re-plan, and what counts goes on counting meanwhile.
    assert (state.replanning.replan, state.replanning.records) == (None, ())
    assert state.coverage.inspected[2] == "uav2"
    assert lower_one_vehicle(chosen, state, NOW_S + 2.0)[1] == ()


@pytest.mark.parametrize("why", [
    "open", "another", "lossy", "poor", "recalled", "urgent", "tried", "far", "sortie", "fault", "as asked",
])  # fmt: skip
def test_it_flies_home_where_that_is_better(why: str) -> None:
    chosen, state = CONTEXTS[False], going_home(CONTEXTS[False])
    own = state.vehicles["uav2"]
    board = own.assignment.board
    assert board is not None
    match why:
        case "open":  # something else of its own is before it
            state = state.put(on_leg(own, 1, 0.2))
            open_too = {segment: by for segment, by in state.coverage.inspected.items() if segment != 3}
            state = replace(state, coverage=replace(state.coverage, inspected=MappingProxyType(open_too)))
        case "another":  # it has that before it already
            route = (4,)
            path = build_first_paths(chosen.setup, {"uav4": route})["uav4"]
            other = with_facts(state.vehicles["uav4"], board=build_onboard_mission(chosen, "uav4", 0, path, route))
            state = state.put(flying_to(other, 1))
        case "lossy":
            bad = LinkQuality(lost=2 * LARGEST_LOSS, usual=0.0)
            state = state.put(replace(own, link=replace(own.link, quality=bad)))
        case "poor":
            state = state.put(with_facts(own, battery=pack(18.0, 18.0)))
        case "recalled":
            state = replace(state, progress=replace(state.progress, recalled=True))
        case "urgent":
            state = replace(state, replanning=replace(state.replanning, urgent=True))
        case "tried":  # it flew there at the asked distance, and that was not proven
            longer = (*ROUTES["uav2"], 4)
            path = build_first_paths(chosen.setup, {"uav2": longer})["uav2"]
            assert segment_distances_m(chosen.setup, path, longer)[2] == ASKED_M
            last = max(number for number, point in enumerate(path.waypoints) if point.phase is Phase.RETURN)
            state = state.put(
                on_leg(with_facts(own, board=build_onboard_mission(chosen, "uav2", 0, path, longer)), last, 0.2)
            )
        case "far":  # it is over its pad
            state = state.put(on_leg(own, len(board.path.waypoints) - 1, 0.2))
        case "sortie":  # it is to come home for its next one
            ahead = (PlannedSortie((6,), 900.0),)
            state = state.put(replace(own, turn=replace(own.turn, ahead=ahead)))
        case "fault":
            fault = Fault(FaultKind.LINK, "silent", NOW_S - 200.0, FaultCode.LINK_LOST)
            state = state.put(replace(own, stage=Stage.LOST, fault=fault))
        case "as asked":
            at_m = dict.fromkeys(state.coverage.inspected_at_m, ASKED_M)
            state = replace(state, coverage=replace(state.coverage, inspected_at_m=MappingProxyType(at_m)))
    assert [line for line in said(lower_one_vehicle(chosen, state, NOW_S)[1]) if " again, " in line] == []


def test_it_keeps_more_than_its_reserve_and_the_way_back_counts() -> None:
    """The same battery takes it there from near, and not from farther along its way home."""
    chosen = CONTEXTS[False]

    def least_pct(share: float) -> float:
        for left_pct in (0.5 * half for half in range(20, 181)):
            state = going_home(chosen, share=share)
            state = state.put(with_facts(state.vehicles["uav2"], battery=pack(left_pct, left_pct)))
            if uploads(lower_one_vehicle(chosen, state, NOW_S)[1]):
                return left_pct
        raise AssertionError

    near, far = least_pct(0.1), least_pct(0.6)
    assert 18 + SPARE_PCT < near < far


def test_of_many_the_nearest_are_flown_first() -> None:
    chosen, state = CONTEXTS[False], going_home(CONTEXTS[False])
    everything = sorted(chosen.wanted)
    coverage = replace(
        state.coverage, given_up=frozenset(), inspected=MappingProxyType(dict.fromkeys(everything, "uav4")),
        inspected_at_m=MappingProxyType(dict.fromkeys(everything, FROM_M)),
    )  # fmt: skip
    state, commands = lower_one_vehicle(chosen, replace(state, coverage=coverage), NOW_S)
    assert len(uploads(commands)) == 1
    assert state.replanning.replan is not None
    given_again = [segment_of(visit) for visit in state.replanning.replan.solve.given]
    assert len(given_again) == LARGEST_PASS
    assert set(given_again[:2]) == {1, 2}


def all_landed(chosen: Context) -> FleetState:
    """Return a fleet on its pads, with battery left, of which segment 2 counts from a layer."""
    state = going_home(chosen)
    for name in ROUTES:
        own = state.vehicles[name]
        board = own.assignment.board
        assert board is not None
        pad_m = chosen.vehicles[name].pad_m
        facts = {
            "stage": Stage.LANDED, "heard_s": NOW_S, "heartbeat": Heartbeat(3, AUTO, False, 4), "heartbeat_s": NOW_S,
            "battery": pack(70.0, 70.0), "waypoint": len(board.path.waypoints), "armed_once": True, "took_off": True,
            "fix": PositionFix(NOW_S, NOW_S, pad_m, 0.0, 450.0, (0.0, 0.0, 0.0)),
        }  # fmt: skip
        state = state.put(with_facts(own, **facts))
    everything = {segment: state.coverage.inspected.get(segment, "uav3") for segment in chosen.wanted}
    at_m = dict.fromkeys(chosen.wanted, ASKED_M) | {2: FROM_M}
    coverage = replace(
        state.coverage, inspected=MappingProxyType(everything), inspected_at_m=MappingProxyType(at_m),
        given_up=frozenset(),
    )  # fmt: skip
    return replace(state, coverage=coverage)


def test_with_automatic_take_offs_one_takes_off_for_it_once_all_have_landed() -> None:
    chosen = replace(CONTEXTS[False], fly_again=RelaunchPolicy.AUTO)
    state = all_landed(chosen)
    state, commands = fleet_step.step(chosen, state, Tick(), NOW_S)
    [upload] = uploads(commands)
    who = upload.vehicle
    assert f"{who}: re-inspects segment 2 at inspection height; takes off after upload" in said(commands)
    assert (upload.airborne, state.progress.finished) == (False, False)
    state, commands = fleet_step.step(
        chosen, state, UploadEnded(who, upload.revision, accepted=True, reason="", mixed=False), NOW_S + 1.0
    )
    assert Start(who) in commands
    assert state.vehicles[who].stage is Stage.STARTING
    # The others stay where they are.
    state, commands = fleet_step.step(chosen, state, Tick(), NOW_S + 2.0)
    assert uploads(commands) == []


def test_no_vehicle_takes_off_for_it_while_others_fly() -> None:
    chosen = replace(CONTEXTS[False], fly_again=RelaunchPolicy.AUTO)
    state = going_home(chosen)
    flies = with_facts(state.vehicles["uav2"], battery=pack(18.0, 18.0))  # it has not enough left itself
    state = all_landed(chosen).put(flies)
    assert uploads(lower_one_vehicle(chosen, state, NOW_S)[1]) == []


def test_the_crew_is_asked_and_its_yes_is_what_starts_one() -> None:
    chosen = replace(CONTEXTS[False], fly_again=RelaunchPolicy.ASK)
    state, commands = fleet_step.step(chosen, all_landed(chosen), Tick(), NOW_S)
    assert uploads(commands) == []
    [line] = said(commands)
    assert {command.level for command in commands if isinstance(command, Say)} == {Level.WARNING}
    assert line.startswith(
        "uav1 and uav2 and uav3 can re-inspect 1 segment at inspection height (segment 2). Are their pads "
    )
    assert (state.crew.offer is not None and state.crew.offer.again, state.progress.finished) == (True, False)
    yes = IntentReceived(Intent("yes", Action.INCLUDE, "uav3", "page", confirmed=True))
    state, commands = fleet_step.step(chosen, state, yes, NOW_S + 1.0)
    assert said(commands) == ["page asks: include uav3; included; re-inspecting segments at inspection height"]
    state, sent = ticked(chosen, state, NOW_S + 2.0, NOW_S + 30.0)
    [upload] = uploads(sent)
    assert (upload.vehicle, upload.airborne, state.progress.finished) == ("uav3", False, False)


def test_without_confirmation_the_flight_ends_and_everything_still_counts() -> None:
    chosen = replace(CONTEXTS[False], fly_again=RelaunchPolicy.ASK, offer_s=20.0)
    state, sent = ticked(chosen, all_landed(chosen), NOW_S, NOW_S + 30.0)
    assert uploads(sent) == []
    late = "no vehicle was cleared for take-off within 20 s; 1 segment was inspected above inspection height only"
    assert late in said(sent)
    assert state.progress.finished
    assert state.coverage.inspected[2] == "uav2"


@pytest.mark.parametrize("fly_again", [RelaunchPolicy.NEVER, RelaunchPolicy.ASK])
def test_no_offer_without_a_capable_vehicle(fly_again: RelaunchPolicy) -> None:
    chosen = replace(CONTEXTS[False], fly_again=fly_again)
    state = all_landed(chosen)
    if fly_again is RelaunchPolicy.ASK:
        for name in ROUTES:
            state = state.put(with_facts(state.vehicles[name], battery=pack(24.0, 24.0)))
    state, commands = fleet_step.step(chosen, state, Tick(), NOW_S)
    assert (state.crew.offer, state.progress.finished) == (None, True)
    assert uploads(commands) == []


def ticked(chosen: Context, state: FleetState, from_s: float, until_s: float) -> tuple[FleetState, tuple[Command, ...]]:
    """Let time pass, with everybody heard all along."""
    commands: list[Command] = []
    for number in range(int(until_s - from_s) + 1):
        now_s = from_s + number
        for name in ROUTES:
            own = state.vehicles[name]
            fix = own.motion.fix
            assert fix is not None
            state = state.put(with_facts(own, heard_s=now_s, heartbeat_s=now_s, fix=replace(fix, at_s=now_s)))
        state, more = fleet_step.step(chosen, state, Tick(), now_s)
        commands.extend(more)
    return state, tuple(commands)


@pytest.mark.parametrize("rises", [False, True])
def test_a_re_inspection_meets_no_vehicle(rises: bool) -> None:
    """Held over random fleets in the midst of random missions, of which some do fly again."""
    chosen, given_again = CONTEXTS[rises], 0
    for seed in range(12):
        rng = random.Random(seed)
        state = in_flight(chosen, rng)
        for number in range(16):
            now_s = NOW_S + 2.0 * number
            state, commands = lower_one_vehicle(chosen, flown_by_now(chosen, state), now_s)
            given_again += any(" re-inspects " in line for line in said(commands))
            for upload in uploads(commands):
                nobody_meets(chosen, state, {upload.vehicle: upload.path})
                taken = rng.random() < 0.8
                ended = UploadEnded(upload.vehicle, upload.revision, accepted=taken, reason="", mixed=False)
                state, _ = fleet_step.step(chosen, state, ended, now_s)
            nobody_meets(chosen, state, {})
            state = one_flies_on(state, rng, now_s)
    assert given_again > 0


def flown_by_now(chosen: Context, state: FleetState) -> FleetState:
    """Return the state in which all that is behind vehicles counts, from where they were then."""
    inspected, at_m = dict(state.coverage.inspected), dict(state.coverage.inspected_at_m)
    for name, vehicle in state.vehicles.items():
        board = vehicle.assignment.board
        if board is None:
            continue
        ahead = {point.visit for point in board.path.waypoints[vehicle.assignment.waypoint :]}
        for number, here_m in enumerate(visit_distances_m(chosen.setup, board.path, board.visits)):
            segment = segment_of(board.visits[number])
            if number not in ahead and here_m < at_m.get(segment, 1000.0):
                inspected[segment], at_m[segment] = name, here_m
    coverage = replace(state.coverage, inspected=MappingProxyType(inspected), inspected_at_m=MappingProxyType(at_m))
    return replace(state, coverage=coverage)
