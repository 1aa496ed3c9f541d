"""Locks in the file of a re-plan: those given to the solver."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executor.flight.flight_recorder import name_locks
from executor.site import site_model
from missions import PlanFile, SolverRecord, make_plan_file, read_plan, write_plan
from planner import Cost, Plan, Route, build_remaining_problem
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import line_east

LOCKS = {0: "uav1", 3: "uav1", 1: "uav3"}
"""By segment; uav3 takes no part in the re-plan."""


@pytest.fixture(scope="module")
def replanned() -> PlanFile:
    """Return a re-plan as the solver was given it: who may not have what, and no lock."""
    ground = ground_for(site_of(("uav1", "uav2")), line_east(5))
    task = site_model.build_first_task(ground, (0, 2, 3))
    assert task.pricing is not None
    barred = {"uav1": frozenset({1}), "uav2": frozenset({0, 2})}
    told = replace(task, pricing=replace(task.pricing, barred=barred))
    plan = Plan((Route(0, (0, 2)), Route(1, ())), (2,))
    return make_plan_file(ground.network, told, ground.travel, plan, Cost.MINCOMB, SolverRecord("search", 1, 0.1))


def test_what_another_vehicle_alone_flies_is_locked_to_it(replanned: PlanFile, tmp_path: Path) -> None:
    found = name_locks(replanned, LOCKS, {})
    assert found.pricing is not None
    assert found.pricing.locked == {0: "uav1", 2: "uav1"}
    assert found.pricing.barred == {"uav1": {1}}
    write_plan(tmp_path / "plan-001.json", found)
    kept = read_plan(tmp_path / "plan-001.json").pricing
    assert kept is not None
    assert (kept.locked, kept.barred) == (found.pricing.locked, found.pricing.barred)
    assert name_locks(replanned, {}, {}) is replanned


def test_a_segment_on_board_another_vehicle_is_not_locked(replanned: PlanFile) -> None:
    assert replanned.pricing is not None
    carried = replace(replanned, pricing=replace(replanned.pricing, barred={"uav2": frozenset({0})}))
    found = name_locks(carried, LOCKS, {"uav2": frozenset({0})})
    assert found.pricing is not None
    assert found.pricing.locked == {0: "uav1"}
    assert found.pricing.barred == {"uav2": {0}}  # it has no camera for it either


def test_after_the_loss_of_its_vehicle_others_have_what_was_locked_to_it(replanned: PlanFile) -> None:
    left = []
    for content in (replanned, name_locks(replanned, LOCKS, {})):
        problem = build_remaining_problem(content.build_instance(), content.plan, 0, 0.0)
        left.append([problem.open_segments[number] for number in problem.warm.uncovered])
    assert left == [[0, 2], []]
