"""Plans that leave segments over, flown: no re-plan without a loss, and none takes segments off a mission."""

from __future__ import annotations

import pytest

from planner import segment_of
from tests.executor.tight import SEGMENTS, story_of, tight_plan


@pytest.mark.parametrize("again", ["auto", "ask"])
@pytest.mark.parametrize("seed", range(10))
def test_a_plan_that_leaves_segments_out_is_flown_as_it_is(seed: int, again: str) -> None:
    ready, plan, solver = tight_plan(seed, fly_again=again, offer_s=5.0)
    planned = {segment_of(visit) for route in plan.routes for visit in route.visits}
    assert plan.uncovered
    flight = story_of(ready, solver)
    assert flight.state.coverage.left_over == set(plan.uncovered)
    flight.finish()
    assert flight.solves() == []
    assert set(flight.state.coverage.inspected) == planned
    assert len(planned) + len(plan.uncovered) == SEGMENTS


@pytest.mark.parametrize("seed", range(8))
def test_a_loss_takes_nothing_from_what_the_others_carry(seed: int) -> None:
    ready, plan, solver = tight_plan(seed, budget_pct=20.0, fly_again="never")
    flight = story_of(ready, solver)
    lost = max(plan.routes, key=lambda route: len(route.visits))
    name = f"uav{lost.vehicle + 1}"
    flight.run(lambda: len(flight.vehicle(name).remaining_visits()) < len(lost.visits))
    flight.crafts[name].mute = True
    flight.finish()
    others = {segment_of(visit) for route in plan.routes if route is not lost for visit in route.visits}
    by_it = {segment for segment, by in flight.state.coverage.inspected.items() if by == name}
    assert len(flight.state.coverage.inspected) >= len(others | by_it)
    assert len(flight.state.replanning.records) == 1
    for record in flight.state.replanning.records:
        assert record.gain is not None
        assert record.gain.segments >= 0
        assert record.gain.length_m >= 0
        assert record.gain.short == ()
    assert all(craft.battery_pct >= ready.context.vehicles[one].reserve_pct for one, craft in flight.crafts.items())
