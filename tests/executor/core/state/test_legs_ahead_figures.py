"""What is left to fly and to spend, in figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.kalman import Projection
from executor.core.state import legs
from executor.core.state.vehicle_parts import PositionFix
from executor.core.state.vehicle_state import Stage
from tests.executor.core.steps import (
    rounded,
)
from tests.executor.core.vehicles import FLEET, at, flying

CONTEXT = FLEET.context


def far(seconds: float) -> PositionFix:
    """Return where the end of the first inspection is so far away, at its speed."""
    return replace(at(), place_m=(200.0 - 3.0 * seconds, -5.0))


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the time to the end of a leg",
        lambda: [legs.time_to_reach_s(flying(waypoint=2, fix=far(10.0)), waypoint) for waypoint in (1, 2, 3)],
        [0.0, 11.4346, 49.545],
    ),
    (
        "the energy to the end of a leg",
        lambda: [legs.energy_to_reach_pct(flying(waypoint=2, fix=far(10.0)), waypoint) for waypoint in (1, 2, 3)],
        [0.0, 0.413082, 1.78984],
    ),
    (
        "no leg is longer than it is",
        lambda: [
            legs.time_to_reach_s(flying(waypoint=waypoint, fix=at(east_m=9000.0)), waypoint) for waypoint in (0, 1)
        ],
        [12.3, 24.9493],
    ),
    ("unknown position on its leg", lambda: legs.time_to_reach_s(flying(fix=None), 2), 38.1152),
    (
        "without a mission there is no way to go",
        lambda: [
            legs.time_to_reach_s(flying(board=None), 2),
            legs.energy_to_reach_pct(flying(board=None), 2),
            legs.energy_to_finish_pct(flying(board=None)),
        ],
        [0.0, 0.0, 0.0],
    ),
    (
        "the energy to finish",
        lambda: [
            legs.energy_to_finish_pct(flying()),
            legs.energy_to_finish_pct(flying(waypoint=5)),
        ],
        [5.03665, 1.05818],
    ),
    (
        "the energy to return",
        lambda: [
            legs.energy_to_return_pct(CONTEXT, flying(), CONTEXT.vehicles["uav1"]),
            legs.energy_to_return_pct(CONTEXT, flying(fix=None), CONTEXT.vehicles["uav1"]),
        ],
        [2.66429, None],
    ),
    (
        "charge left at the landing",
        lambda: legs.project_landing(CONTEXT, flying(), CONTEXT.vehicles["uav1"]),
        Projection(mean_pct=84.9277, sd_pct=1.65911),
    ),
    (
        "charge left at the landing of a returning vehicle",
        lambda: legs.project_landing(CONTEXT, flying(stage=Stage.RETURNING), CONTEXT.vehicles["uav1"]),
        Projection(mean_pct=87.3001, sd_pct=1.57404),
    ),
    (
        "charge left at the landing is unknown without a position",
        lambda: [
            legs.project_landing(CONTEXT, flying(stage=Stage.RETURNING, fix=None), CONTEXT.vehicles["uav1"]),
            legs.project_landing(CONTEXT, flying(battery=BatteryState()), CONTEXT.vehicles["uav1"]),
        ],
        [None, None],
    ),
    (
        "probability of landing below the reserve",
        lambda: [
            legs.landing_chance_below(CONTEXT, flying(**given), CONTEXT.vehicles["uav1"], floor_pct)
            for given in ({}, {"board": None}, {"battery": BatteryState()}, {"stage": Stage.RETURNING})
            for floor_pct in (60.0, 83.0, 86.0)
        ],
        [0.0, 0.122637, 0.740954, 0.0, 0.00314866, 0.204412, None, None, None, 0.0, 0.00314866, 0.204412],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
