"""Locks in re-plans: they hold while their vehicle may fly, and are lifted once it is lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from executor.adapters.solver import SolverSetup, solve_for_survivors
from executor.core.context import Context, RelaunchPolicy
from executor.core.ground import takeoff_offers
from executor.core.interface.commands import Solve
from executor.core.replanning import lower_to_inspection_height, replan_cycle, survivors
from executor.core.state.vehicle_parts import Takeover
from executor.core.state.vehicle_state import Stage
from missions import Pricing
from planner import segment_of
from tests.executor.builders import Fleet, with_facts
from tests.executor.core.steps import BATTERY_FAULT, SECOND, flight_of, landed
from tests.executor.core.stories import EVERYTHING, FLEET, under_way
from tests.executor.core.vehicles import NOW_S, flying

LOCKED = {2: "uav2", 3: "uav2", 4: "uav3"}
"""What they fly as planned, but for one segment of uav3's."""


def with_locks(context: Context, **keys: Any) -> Context:
    return replace(context, pricing=replace(context.pricing, locked=LOCKED, **keys))


CONTEXT = with_locks(FLEET.context)
READY = Fleet(CONTEXT, FLEET.boards)


def barred(context: Context = CONTEXT, **uav2: Any) -> set[int]:
    """Return what uav1 is barred from while uav2 is so."""
    fleet = flight_of(flying(), with_facts(SECOND, **uav2))
    return set(survivors.find_barred_segments(context, fleet, fleet.vehicles["uav1"]))


@pytest.mark.parametrize(
    "uav2",
    [{}, {"held_s": NOW_S}, {"stage": Stage.GROUND}, {"stage": Stage.LANDED},
     {"stage": Stage.PILOT, "taken": Takeover(NOW_S - 10.0)}],
)  # fmt: skip
def test_what_another_one_alone_flies_is_kept_for_it(uav2: dict[str, Any]) -> None:
    assert barred(**uav2) == {2, 3, 4}


@pytest.mark.parametrize(
    "uav2",
    [{"fault": BATTERY_FAULT}, {"excluded": True}, {"stage": Stage.LOST}, {"stage": Stage.DOWN},
     {"stage": Stage.RETURNING}, {"stage": Stage.PILOT, "taken": Takeover(NOW_S - 90.0, given_away=True)}],
)  # fmt: skip
def test_it_is_open_to_all_once_that_vehicle_is_gone(uav2: dict[str, Any]) -> None:
    assert barred(**uav2) == {4}


def test_a_vehicle_that_does_not_fly_again_keeps_no_segments() -> None:
    never = replace(CONTEXT, fly_again=RelaunchPolicy.NEVER)
    assert barred(never, stage=Stage.LANDED) == {4}
    assert barred(never, stage=Stage.GROUND) == {2, 3, 4}


def test_no_vehicle_is_barred_from_its_own_segments_or_those_on_board() -> None:
    fleet = flight_of(flying(), SECOND)
    assert survivors.find_barred_segments(CONTEXT, fleet, fleet.vehicles["uav2"]) == {4}
    carries = with_facts(flying(), board=FLEET.boards["uav3"])  # as after uav3 was lost for a while
    assert survivors.find_barred_segments(CONTEXT, flight_of(carries, SECOND), carries) == {2, 3}
    assert replan_cycle.find_orphan_segments(CONTEXT, flight_of(carries, SECOND)) == {0, 1}


def test_without_locks_no_vehicle_is_barred() -> None:
    fleet = flight_of(flying(), SECOND)
    assert all(not survivors.find_barred_segments(FLEET.context, fleet, one) for one in fleet.vehicles.values())


def test_after_a_loss_others_fly_what_was_locked_to_the_lost() -> None:
    flight = under_way(READY)
    question = replan_cycle.build_loss_problem(flight.context, flight.state, "uav2", flight.now_s)
    flight.crafts["uav2"].mute = True
    flight.run(lambda: bool(flight.solves()))
    for problem in (question, flight.solves()[0]):
        assert isinstance(problem, Solve)
        assert {2, 3} <= set(problem.open_segments)
        assert {offer.vehicle: offer.barred for offer in problem.survivors} == {"uav1": (4,), "uav3": ()}
    flight.run(lambda: set(flight.state.coverage.inspected) == EVERYTHING)


def test_the_loss_of_another_one_lifts_no_lock() -> None:
    flight = under_way(READY)
    problem = replan_cycle.build_loss_problem(flight.context, flight.state, "uav1", flight.now_s)
    assert isinstance(problem, Solve)
    assert {offer.vehicle: offer.barred for offer in problem.survivors} == {"uav2": (4,), "uav3": (2, 3)}


def solved(problem: Solve, pricing: Pricing) -> dict[str, tuple[int, ...]]:
    answer = solve_for_survivors(SolverSetup(1.0, 1), problem, pricing, lambda: False)
    assert answer.routes is not None
    assert answer.uncovered == ()
    return {route.vehicle: route.visits for route in answer.routes}


def test_the_solver_respects_locks_and_directions() -> None:
    flight = under_way(READY)
    for turned in (False, True):
        context = with_locks(FLEET.context, directions={1: turned, 3: turned})
        for lost in ("uav1", "uav2"):
            problem = replan_cycle.build_loss_problem(context, flight.state, lost, flight.now_s)
            assert isinstance(problem, Solve)
            open_now = tuple(one for one in problem.open_segments if one != 2)  # uav2 is in the midst of it
            routes = solved(replace(problem, open_segments=open_now), context.pricing)
            for vehicle, visits in routes.items():
                keepers = {LOCKED.get(segment_of(visit), vehicle) for visit in visits}
                assert keepers <= {vehicle, lost}
                # What is on board of who flies on is flown as it is.
                assert {visit & 1 for visit in visits if segment_of(visit) in {1, 3}} <= {int(turned)}


def test_a_take_off_is_not_offered_for_what_another_one_alone_flies() -> None:
    stands = landed(stage=Stage.LANDED)
    reach = takeoff_offers.find_reachable_segments
    assert reach(CONTEXT, flight_of(stands, SECOND), stands, frozenset(EVERYTHING)) == {0, 1, 5}
    gone = with_facts(SECOND, fault=BATTERY_FAULT)
    assert reach(CONTEXT, flight_of(stands, gone), stands, frozenset(EVERYTHING)) == {0, 1, 2, 3, 5}


@pytest.mark.parametrize("turned", [False, True])
def test_a_second_look_is_flown_in_the_direction_that_is_locked(turned: bool) -> None:
    context = with_locks(FLEET.context, directions=dict.fromkeys(range(6), turned))
    visits = lower_to_inspection_height.build_nearest_visits(context, (0.0, 0.0), range(3))
    assert {visit & 1 for visit in visits} == {int(turned)}
