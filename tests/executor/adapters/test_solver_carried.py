"""A re-plan against the missions on board: never worse, and segments that the first plan left over come last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from executor.adapters.solver import SolverSetup, build_replan_task, solve_for_survivors
from executor.core.interface.commands import Solve, Survivor
from executor.core.interface.events import SolveEnded
from executor.site import site_model
from missions import Network, Pricing
from planner import Plan, Route, build_onboard_plan, evaluate, rate_plan, segment_of
from planner.evaluate import Cost
from tests.executor.builders import ground_for, site_of
from tests.executor.tight import branching
from tests.missions.builders import line_east

NAMES = tuple(f"uav{number}" for number in range(5))


def priced(network: Network) -> Pricing:
    return site_model.build_pricing(ground_for(site_of(NAMES), network))


LINE = priced(line_east(7))
"""Six segments of 100 m; there and back from the depot to the end of the last one takes some 5 %."""


def solved(pricing: Pricing, problem: Solve) -> SolveEnded:
    return solve_for_survivors(SolverSetup(0.5, 1), problem, pricing, lambda: False, settled=500)


def flown(answer: SolveEnded) -> set[int]:
    assert answer.routes is not None
    return {segment_of(visit) for route in answer.routes for visit in route.visits}


def routes(answer: SolveEnded) -> dict[str, tuple[int, ...]]:
    assert answer.routes is not None
    return {route.vehicle: route.visits for route in answer.routes}


def one(
    budget_pct: float, tail: tuple[int, ...], *, name: str = "uav1", most_pct: float = 0.0, airborne: bool = True
) -> Survivor:
    return Survivor(name, (100.0, 0.0), budget_pct, 1.0, airborne, tail, 3, most_pct)


def random_problem(seed: int) -> tuple[Pricing, Solve]:
    """Return survivors in the air with tails that their budgets may not last for, and what a lost one leaves."""
    chance = np.random.default_rng(seed)
    pricing = priced(branching(20, seed))
    order, at = [int(segment) for segment in chance.permutation(20)], 0
    survivors = []
    for number in range(int(chance.integers(1, 5))):
        length = int(chance.integers(0, 5))
        tail = tuple(2 * segment + int(chance.integers(2)) for segment in order[at : at + length])
        at += length
        place = tuple(chance.uniform(-600, 600, 2).tolist())
        budget, most = chance.uniform(1, 25, 2)
        offer = Survivor(f"uav{number}", place, budget, chance.uniform(0.9, 1.3), True, tail, 3, max(budget, most))
        survivors.append(offer)
    left = tuple(sorted(order[at : at + int(chance.integers(0, 4))]))
    open_segments = set(order) - set(left) - set(order[at + 12 :])
    return pricing, Solve(1, tuple(sorted(open_segments)), tuple(survivors), "uav9: link", left)


@pytest.mark.parametrize("seed", range(60))
def test_no_answer_is_worse_than_what_is_carried(seed: int) -> None:
    pricing, problem = random_problem(seed)
    answer = solved(pricing, problem)
    task, tails = build_replan_task(pricing, problem)
    spare = {segment for segment, number in enumerate(task.segment_ids) if number in problem.left_over}
    carried = rate_plan(task.instance, build_onboard_plan(task.instance, tails).plan, spare)
    own = routes(answer)
    plan = Plan(tuple(Route(n, task.from_network(own[offer.vehicle])) for n, offer in enumerate(problem.survivors)))
    found = rate_plan(task.instance, plan, spare)
    assert found.segments >= carried.segments
    assert found.value >= carried.value - 1e-6
    if found.segments == carried.segments and found.value < carried.value + carried.grain:
        assert found.spare_segments >= carried.spare_segments
        if found.spare_segments == carried.spare_segments:
            assert found.longest_s <= carried.longest_s + 1e-6
    assert set(answer.uncovered) == set(problem.open_segments) - flown(answer)
    assert answer.gain is not None
    assert answer.gain.segments == found.segments - carried.segments
    energies = evaluate(task.instance, plan, Cost.MINMAX).energies_pct
    for route, vehicle, energy in zip(plan.routes, task.instance.vehicles, energies, strict=True):
        assert not route.visits or energy <= vehicle.budget_pct + 1e-6


def test_what_cannot_be_bettered_stays_on_board() -> None:
    survivors = (one(40.0, (2, 4)), one(40.0, (6, 8), name="uav2"))
    answer = solved(LINE, Solve(1, (1, 2, 3, 4), survivors, "asked for"))
    better = routes(answer)
    again = tuple(replace(offer, tail=better[offer.vehicle]) for offer in survivors)
    answer = solved(LINE, Solve(2, (1, 2, 3, 4), again, "asked for"))
    assert routes(answer) == better
    assert answer.gain is not None
    assert (answer.gain.segments, answer.gain.longest_s) == (0, answer.gain.carried_s)


def test_a_rounding_error_in_the_budget_removes_no_segment() -> None:
    """It carries segments 1 to 4; its budget is short of one, its battery is not."""
    carried = (2, 4, 6, 8)
    needs_pct = evaluate_pct(carried)
    answer = solved(LINE, Solve(1, (1, 2, 3, 4), (one(needs_pct - 0.5, carried, most_pct=needs_pct + 5.0),), "why"))
    assert routes(answer) == {"uav1": carried}
    assert answer.gain is not None
    assert answer.gain.short == ()


def test_a_drained_battery_is_named_and_its_route_is_cut() -> None:
    carried = (2, 4, 6, 8)
    needs_pct = evaluate_pct(carried)
    answer = solved(LINE, Solve(1, (1, 2, 3, 4), (one(needs_pct - 1.5, carried, most_pct=needs_pct - 0.5),), "why"))
    assert answer.uncovered
    assert answer.gain is not None
    assert answer.gain.short == ("uav1",)
    assert answer.gain.segments >= 0


def test_segments_left_over_go_to_vehicles_with_spare_budget() -> None:
    answer = solved(LINE, Solve(1, (1, 2, 3), (one(40.0, (2, 4, 6)),), "why", left_over=(4,)))
    assert flown(answer) == {1, 2, 3, 4}
    assert answer.gain is not None
    assert (answer.gain.segments, answer.gain.left_over) == (0, 1)


def test_what_the_first_plan_left_over_costs_no_other_segment() -> None:
    """Its budget lasts for segments 1 to 3, or for others with the one that was left over."""
    budget_pct = evaluate_pct((2, 4, 6)) + 0.1
    answer = solved(LINE, Solve(1, (1, 2, 3), (one(budget_pct, (2, 4)),), "why", left_over=(0, 4, 5)))
    assert flown(answer) == {1, 2, 3}
    assert answer.uncovered == ()
    assert answer.gain is not None
    assert (answer.gain.segments, answer.gain.left_over) == (1, 0)


def evaluate_pct(visits: tuple[int, ...]) -> float:
    """Return what a route from the first pylon takes."""
    problem = Solve(1, tuple(range(6)), (one(100.0, visits),), "why")
    task, tails = build_replan_task(LINE, problem)
    assert tails == [visits]
    plan = Plan((Route(0, visits),), tuple(n for n in range(6) if n not in {segment_of(visit) for visit in visits}))
    return evaluate(task.instance, plan, Cost.MINMAX).energies_pct[0]
