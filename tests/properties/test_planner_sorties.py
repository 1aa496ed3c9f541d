"""What holds of every plan of sorties: checked by the definition, which shares nothing with the kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import Iterations, PlanError
from planner.sorties import (
    Objective,
    SortieInstance,
    SortieVehicle,
    count_packs_needed,
    evaluate_sorties,
    solve_sorties,
    subtract_quiet_times,
)
from tests.planner.sorties.builders import BROAD, DAY, TRAVEL, line_instance


@st.composite
def instances(draw: st.DrawFn) -> SortieInstance:
    """Return days of every kind: short packs, quiet hours, cameras, vehicles that stay at their base."""
    instance = line_instance(
        draw(st.integers(0, 10_000)), draw(st.integers(1, 14)),
        bases=draw(st.integers(1, 3)), vehicles=draw(st.integers(1, 4)),
        budget_pct=draw(st.sampled_from((25.0, 40.0, 80.0))),
        packs=draw(st.sampled_from((None, 0, 1, 2))), recharge_s=draw(st.sampled_from((None, 0.0, 400.0))),
        turnaround_s=draw(st.sampled_from((0.0, 90.0))), transfer=draw(st.booleans()),
        stagger_s=draw(st.sampled_from((0.0, 45.0))), travels=draw(st.sampled_from(((TRAVEL,), (TRAVEL, BROAD)))),
    )  # fmt: skip
    fleet = [replace(own, lands=(own.base,)) if draw(st.booleans()) else own for own in instance.vehicles]
    quiet = draw(st.sampled_from(((), ((600.0, 900.0),), ((0.0, 5000.0),))))
    fleet[0] = _quiet(fleet[0], quiet)
    able = instance.able.copy()
    able[-1, : draw(st.integers(0, 2))] = False
    wanted = instance.wanted.copy()
    wanted[draw(st.integers(0, len(wanted) - 1))] = draw(st.booleans())
    return replace(instance, vehicles=tuple(fleet), able=able, wanted=wanted)


def _quiet(own: SortieVehicle, quiet: tuple[tuple[float, float], ...]) -> SortieVehicle:
    return replace(own, windows=subtract_quiet_times(DAY, quiet))


@settings(max_examples=120, deadline=None)
@given(instances(), st.sampled_from(Objective), st.integers(0, 3))
def test_every_plan_holds(instance: SortieInstance, objective: Objective, seed: int) -> None:
    """Each segment once, packs never exceeded, hours, budgets, take-offs and cameras kept: or named as left over."""
    found = solve_sorties(instance, stop=Iterations(400), objective=objective, seed=seed)
    assert found.evaluation == evaluate_sorties(instance, found.plan)
    assert found.evaluation.violations == ()
    flown = {visit >> 1 for one in found.plan.routes for visit in one.visits}
    assert flown | set(found.plan.uncovered) == set(np.flatnonzero(instance.wanted))
    for base, need in zip(instance.bases, count_packs_needed(instance, found.plan.routes), strict=True):
        assert base.packs is None or need <= base.packs or base.recharge_s is not None


@settings(max_examples=20, deadline=None)
@given(instances(), st.integers(0, 3))
def test_the_same_seed_is_the_same_plan(instance: SortieInstance, seed: int) -> None:
    """Seed, starts and iterations decide the plan."""
    one, other = (solve_sorties(instance, stop=Iterations(300), seed=seed, starts=2) for _ in range(2))
    assert one.plan == other.plan


@settings(max_examples=30, deadline=None)
@given(instances(), st.data())
def test_what_is_wrong_with_a_plan_is_found(instance: SortieInstance, data: st.DataObject) -> None:
    """A plan that was spoilt does not hold any more."""
    found = solve_sorties(instance, stop=Iterations(300))
    if not found.plan.routes:
        return
    number = data.draw(st.integers(0, len(found.plan.routes) - 1))
    one = found.plan.routes[number]
    spoilt = data.draw(
        st.sampled_from((
            replace(one, start_s=one.start_s - 10_000.0), replace(one, start_s=one.start_s + 100_000.0),
            replace(one, visits=(*one.visits, one.visits[0] ^ 1)), replace(one, visits=(*one.visits, *one.visits)),
        ))
    )  # fmt: skip
    routes = (*found.plan.routes[:number], spoilt, *found.plan.routes[number + 1 :])
    if len(spoilt.visits) > len(one.visits):
        with pytest.raises(PlanError, match="a segment occurs twice"):
            replace(found.plan, routes=routes)
    else:
        assert evaluate_sorties(instance, replace(found.plan, routes=routes)).violations
