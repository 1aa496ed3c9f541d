"""Vehicles lost during days of sorties: what is left, until when a loss is made good, how many vehicles are enough."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planner import Iterations, PlanError
from planner.sorties import (
    Sortie,
    SortieInstance,
    SortiePlan,
    evaluate_sorties,
    fly_lives,
    solve_sorties,
    sortie_s,
    sortie_window,
    sorties_left,
    with_spares,
)
from planner.sorties.losses import finishes
from tests.planner.sorties.builders import line_instance


def short_day(seed: int = 3, end_s: float = 1_200.0, packs: int | None = None) -> tuple[SortieInstance, SortiePlan]:
    instance = line_instance(seed, 20, budget_pct=45.0, days=((0.0, end_s),), packs=packs)
    found = solve_sorties(instance, stop=Iterations(20_000), seed=1)
    assert found.evaluation.violations == ()
    assert not found.plan.uncovered
    return instance, found.plan


def lands_s(instance: SortieInstance, vehicle: int, one: Sortie) -> float:
    return one.start_s + sortie_s(instance, vehicle, one)


def test_what_a_lost_vehicle_has_on_board_is_flown_again_and_what_is_under_way_is_kept() -> None:
    instance, plan = short_day(packs=4)
    first = plan.sorties[0][0]
    at_s = lands_s(instance, 0, first) - 1.0
    left = sorties_left(instance, plan, {0: at_s}, at_s)
    assert left.kept[0] == ()
    assert left.broken[0] == (first,)
    assert all(left.instance.wanted[visit >> 1] for visit in first.visits)
    under_way = [one for one in plan.sorties[1] if one.start_s < at_s]
    assert left.kept[1] == tuple(under_way)
    assert not any(left.instance.wanted[visit >> 1] for one in under_way for visit in one.visits)
    assert left.instance.vehicles[1].ready_s >= lands_s(instance, 1, under_way[-1])
    packs = sum(len(base.charged_s or ()) for base in left.instance.bases)
    assert packs == 8 - 1 - len(under_way)


def test_after_its_landing_a_lost_vehicle_has_done_what_it_did() -> None:
    instance, plan = short_day()
    first = plan.sorties[0][0]
    at_s = lands_s(instance, 0, first) + 1.0
    left = sorties_left(instance, plan, {0: at_s}, at_s)
    assert left.kept[0] == (first,)
    assert not any(left.instance.wanted[visit >> 1] for visit in first.visits)


def test_a_re_plan_and_what_was_kept_are_a_whole_plan_of_the_day() -> None:
    instance, plan = short_day(end_s=4_000.0, packs=6)
    at_s = lands_s(instance, 0, plan.sorties[0][0]) - 1.0
    left = sorties_left(instance, plan, {0: at_s}, at_s)
    rest = solve_sorties(left.instance, stop=Iterations(2_000), initial=left.tails).plan
    whole = left.whole(rest)
    assert evaluate_sorties(instance, whole).violations == ()
    assert all(one.start_s < at_s for one in whole.sorties[0])
    assert all(one in whole.sorties[1] for one in left.kept[1])


def test_the_window_begins_after_the_last_sortie_whose_loss_nobody_makes_good() -> None:
    instance, plan = short_day(end_s=1_200.0)
    found = sortie_window(instance, plan)
    broken = [one for one in found if one.breaks is not None]
    assert broken, "a day so short does not survive every loss"
    for one in broken:
        assert one.breaks is not None
        own = plan.sorties[one.vehicle]
        assert one.from_s == lands_s(instance, one.vehicle, own[one.breaks])
        for number, sortie in enumerate(own):
            at_s = lands_s(instance, one.vehicle, sortie)
            if number >= one.breaks:
                assert finishes(sorties_left(instance, plan, {one.vehicle: at_s}, at_s), 0, 3_000, None) == (
                    number > one.breaks
                )


def test_on_a_long_day_any_vehicle_may_be_lost_at_any_time() -> None:
    instance, plan = short_day(end_s=10_000.0)
    assert all(one.breaks is None and one.from_s == 0.0 for one in sortie_window(instance, plan))


def test_more_spares_finish_more_often_and_nobody_fails_without_failures() -> None:
    instance, plan = short_day(end_s=1_500.0)
    certain = fly_lives(instance, plan, 1e6, 20)
    assert (certain.finished.estimate, certain.losses) == (1.0, 0.0)
    shares = [
        fly_lives(with_spares(instance, spares), plan, 0.5, 40, seed=2).finished.estimate for spares in ((), (0, 1))
    ]
    assert shares[0] < shares[1]
    assert certain.packs_for(0.95) == tuple(
        sum(one.base == base for own in plan.sorties for one in own) for base in range(2)
    )


def test_losses_of_others_than_there_are_are_refused() -> None:
    instance, plan = short_day()
    with pytest.raises(PlanError, match="2 vehicles"):
        sorties_left(instance, plan, {5: 1.0}, 1.0)
    with pytest.raises(PlanError, match="2 vehicles"):
        sorties_left(instance, replace(plan, sorties=()), {0: 1.0}, 1.0)
