"""What a crew reads of a re-plan."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.interface.events import Gain, SolveEnded
from executor.core.replanning import replan_cycle
from executor.core.replanning.replan_cycle import (
    announce_short_budgets,
    announce_solution,
    explain_orphan_segments,
    find_passed_segments,
)
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.stories import FLEET, story


@pytest.mark.parametrize(
    ("gain", "names", "words"),
    [
        (None, [], "new missions for no vehicle"),
        (Gain(5, 400.0, 0, 642.3, 600.0, ()), ["uav3", "uav1"],
         "5 segments recovered; longest route now 642 s; new missions for uav1, uav3"),
        (Gain(1, 90.0, 1, 642.3, 600.0, ()), ["uav1"],
         ("1 segment recovered, 1 segment taken over from the next flight; longest route now 642 s; "
          "new missions for uav1")),
        (Gain(1, 90.0, -2, 64.0, 60.0, ()), ["uav1"],
         ("1 segment recovered, 2 segments moved back to the next flight; longest route now 64 s; "
          "new missions for uav1")),
        (Gain(0, 120.0, 0, 64.0, 60.0, ()), ["uav1"],
         "120 m of the line recovered; longest route now 64 s; new missions for uav1"),
        (Gain(0, 5.0, 0, 54.0, 60.0, ()), ["uav1"], "longest route now 54 s instead of 60 s; new missions for uav1"),
        (Gain(0, 0.0, 0, 60.0, 60.0, ()), [], "no improvement over the missions on board; new missions for no vehicle"),
        (Gain(0, 0.0, 0, 60.0, 60.0, ()), ["uav1"],
         "duplicate segments removed; longest route now 60 s; new missions for uav1"),
        (Gain(0, 0.0, 0, 60.0, 60.0, ("uav1",)), ["uav1"],
         "limited by remaining battery; longest route now 60 s; new missions for uav1"),
    ],
)  # fmt: skip
def test_a_re_plan_says_what_it_gains(gain: Gain | None, names: list[str], words: str) -> None:
    event = SolveEnded(2, (), (), 0.314, "", gain)
    told = announce_solution(event, names).text
    assert told == f"re-plan 2 found in 0.31 s{'; ' if gain is None else ': '}{words}"


def test_a_vehicle_with_too_small_a_budget_is_named() -> None:
    assert (
        announce_short_budgets(Gain(0, 0.0, 0, 1.0, 1.0, ("uav2",))).text
        == "uav2: not enough battery for its whole mission"
    )


def test_only_flown_segments_can_be_not_proven() -> None:
    """uav1 has passed its first segment; uav2 never started."""
    flight = story()
    flight.run(lambda: flight.inspecting("uav1", 1))
    state = with_facts(flight.state, inspected={})
    grounded = replace(state.vehicles["uav2"], stage=Stage.GROUND)
    state = state.put(with_facts(grounded, waypoint=0))
    alone = replan_cycle.find_orphan_segments(FLEET.context, state)
    assert alone == {0, 2, 3}
    assert find_passed_segments(state) == {0}
    words = "inspection not proven: segment 0; assigned to no vehicle: segments 2, 3"
    assert explain_orphan_segments(FLEET.context, state, alone) == words
    ready = with_facts(state, orphans_since_s=flight.now_s - 60.0)
    begun, _ = replan_cycle.begin_replan(FLEET.context, ready, flight.now_s)
    assert begun.replanning.replan is not None
    assert begun.replanning.replan.solve.trigger == words
    assert begun.coverage.attempts == {0: 1}
