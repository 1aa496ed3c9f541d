"""A search that ends after a number of iterations finds the same plan on every computer."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.site.site_planning import DEFAULT, PlanSolver, plan_site
from missions import PlanFileError
from planner import Cost
from tests.executor.builders import ground_for, site_of
from tests.missions.builders import line_east

GROUND = ground_for(site_of(("uav1", "uav2")), line_east(7))


@pytest.mark.parametrize("cost", [None, Cost.MINCOMB], ids=["window", "mincomb"])
def test_the_time_is_only_its_limit(cost: Cost | None) -> None:
    wanted = replace(DEFAULT, cost=cost, usual=False, iterations=2000, starts=2, seconds=1000.0)
    one, other = plan_site(GROUND, wanted), plan_site(GROUND, replace(wanted, seconds=2000.0))
    assert (one.plan, one.window) == (other.plan, other.window)
    assert one.solved.seconds < 1000.0


def test_other_solvers_count_none() -> None:
    with pytest.raises(PlanFileError, match="--solver: expected search for --iterations, got exact"):
        replace(DEFAULT, cost=Cost.MINMAX, solver=PlanSolver.EXACT, iterations=100)
