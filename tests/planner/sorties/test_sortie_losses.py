"""Vehicles lost during days of sorties: the remaining problem, and until when a loss can be absorbed."""

from __future__ import annotations

import pytest

from planner import Iterations, Plan, PlanError, Route
from planner.sorties import (
    SortieInstance,
    build_sorties_after_loss,
    evaluate_sorties,
    find_loss_windows,
    solve_sorties,
    sortie_duration_s,
)
from planner.sorties.sortie_losses import replan_sorties
from tests.planner.sorties.builders import short_day


def lands_s(instance: SortieInstance, one: Route) -> float:
    return one.start_s + sortie_duration_s(instance, one)


def test_what_a_lost_vehicle_has_on_board_is_flown_again_and_what_is_under_way_is_kept() -> None:
    instance, plan = short_day(packs=4)
    first = plan.routes_of(0)[0]
    at_s = lands_s(instance, first) - 1.0
    left = build_sorties_after_loss(instance, plan.routes, {0: at_s}, at_s)
    assert left.broken == (first,)
    assert all(left.instance.wanted[visit >> 1] for visit in first.visits)
    under_way = [one for one in plan.routes_of(1) if one.start_s < at_s]
    assert left.kept == tuple(under_way)
    assert not any(left.instance.wanted[visit >> 1] for one in under_way for visit in one.visits)
    assert left.instance.vehicles[1].ready_s >= lands_s(instance, under_way[-1])
    packs = sum(len(base.charged_s or ()) for base in left.instance.bases)
    assert packs == 8 - 1 - len(under_way)


def test_after_its_landing_a_lost_vehicle_has_done_what_it_did() -> None:
    instance, plan = short_day()
    first = plan.routes_of(0)[0]
    at_s = lands_s(instance, first) + 1.0
    left = build_sorties_after_loss(instance, plan.routes, {0: at_s}, at_s)
    assert [one for one in left.kept if one.vehicle == 0] == [first]
    assert not any(left.instance.wanted[visit >> 1] for visit in first.visits)


def test_a_re_plan_and_what_was_kept_are_a_whole_plan_of_the_day() -> None:
    instance, plan = short_day(end_s=4_000.0, packs=6)
    at_s = lands_s(instance, plan.routes_of(0)[0]) - 1.0
    left = build_sorties_after_loss(instance, plan.routes, {0: at_s}, at_s)
    rest = solve_sorties(left.instance, stop=Iterations(2_000), initial=left.tails).plan
    whole = Plan(tuple(sorted([*left.kept, *rest.routes], key=lambda one: (one.vehicle, one.start_s))), rest.uncovered)
    assert evaluate_sorties(instance, whole).violations == ()
    assert all(one.start_s < at_s for one in whole.routes_of(0))
    assert all(one in whole.routes for one in left.kept)


def test_the_window_begins_after_the_last_sortie_that_no_vehicle_can_replace() -> None:
    instance, plan = short_day(end_s=1_200.0)
    found = find_loss_windows(instance, plan)
    broken = [one for one in found if one.breaks is not None]
    assert broken, "a day so short does not survive every loss"
    for one in broken:
        assert one.breaks is not None
        vehicle = [own.name for own in instance.vehicles].index(one.vehicle)
        own = plan.routes_of(vehicle)
        assert one.from_s == lands_s(instance, own[one.breaks])
        for number, sortie in enumerate(own):
            at_s = lands_s(instance, sortie)
            if number >= one.breaks:
                left = build_sorties_after_loss(instance, plan.routes, {vehicle: at_s}, at_s)
                assert (not replan_sorties(left, 0, None).uncovered) == (number > one.breaks)


def test_on_a_long_day_any_vehicle_may_be_lost_at_any_time() -> None:
    instance, plan = short_day(end_s=10_000.0)
    assert all(one.breaks is None and one.from_s == 0.0 for one in find_loss_windows(instance, plan))


def test_losses_of_others_than_there_are_are_refused() -> None:
    instance, plan = short_day()
    with pytest.raises(PlanError, match="2 vehicles"):
        build_sorties_after_loss(instance, plan.routes, {5: 1.0}, 1.0)
    with pytest.raises(PlanError, match="2 vehicles"):
        build_sorties_after_loss(instance, [Route(2, (0,))], {0: 1.0}, 1.0)
