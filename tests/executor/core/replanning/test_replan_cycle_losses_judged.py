"""The vehicle with the previewed loss, and the segments to re-plan."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.commands import Solve, Survivor
from executor.core.replanning import replan_cycle
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import with_facts
from tests.executor.core.steps import (
    BATTERY_FAULT,
    SECOND,
    TAKEN,
    flight_of,
    plan_of,
    rounded,
)
from tests.executor.core.vehicles import FLEET, NOW_S, flying

CONTEXT = FLEET.context

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "losses worth a judgement",
        lambda: [
            replan_cycle.select_vehicles_to_judge(flight_of(flying(), SECOND, **given))
            for given in (
                {},
                {"replan": plan_of()},
                {"urgent": True},
                {"ordered": True},
                {"recalled": True},
                {"launched_s": None},
            )
        ],
        [("uav1", "uav2"), (), (), (), (), ()],
    ),
    (
        "losses not worth a judgement",
        lambda: [
            replan_cycle.select_vehicles_to_judge(flight_of(flying(**given)))
            for given in ({"stage": Stage.STARTING}, {"fault": BATTERY_FAULT}, {"stage": Stage.PILOT, "taken": TAKEN})
        ],
        [(), (), ()],
    ),
    (
        "problem after a loss",
        lambda: [
            replan_cycle.build_loss_problem(
                CONTEXT, flight_of(*vehicles, revision=4, inspected={5: "uav3"}), "uav1", NOW_S
            )
            for vehicles in (
                (flying(), SECOND),
                (flying(), with_facts(SECOND, held_s=5.0)),
                (flying(),),
                (flying(), with_facts(SECOND, excluded=True)),
            )
        ],
        [
            Solve(
                revision=4,
                open_segments=(0, 1, 3, 4),
                survivors=(
                    Survivor(
                        vehicle="uav2",
                        start_m=(400.0, -5.0),
                        budget_pct=72.6232,
                        consumption=0.999998,
                        airborne=True,
                        tail=(6,),
                        kept=3,
                        most_pct=73.6232,
                        start_up_m=15.0,
                        facing_m=(100.0, 0.0),
                    ),
                ),
                trigger="what if uav1 were lost",
            ),
            Solve(
                revision=4,
                open_segments=(0, 1, 3, 4),
                survivors=(
                    Survivor(
                        vehicle="uav2",
                        start_m=(400.0, -5.0),
                        budget_pct=72.6232,
                        consumption=0.999998,
                        airborne=True,
                        tail=(6,),
                        kept=3,
                        most_pct=73.6232,
                        start_up_m=15.0,
                        facing_m=(100.0, 0.0),
                    ),
                ),
                trigger="what if uav1 were lost",
            ),
            (0, 1, 2, 3, 4),
            (0, 1, 4),
        ],
    ),
    (
        "a loss that leaves nothing",
        lambda: replan_cycle.build_loss_problem(
            CONTEXT, flight_of(flying(), SECOND, given_up=frozenset(range(6))), "uav1", NOW_S
        ),
        (),
    ),
    (
        "inputs of a judgement",
        lambda: replan_cycle.build_judgement_key(
            flight_of(flying(held_s=5.0), revision=4, inspected={5: "uav3"}, given_up=frozenset({1, 2}))
        ),
        (4, 1, 2, (("uav1", "flying", False, False), ("uav2", "ground", True, False), ("uav3", "ground", True, False))),
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
