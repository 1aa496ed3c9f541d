"""The initial state of a battery, before any message."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from executor.core.battery.account import BatteryState
from executor.core.battery.charge_counter import ChargeCounter
from executor.core.battery.cusum import Drift
from tests.executor.builders import flat
from tests.executor.core.steps import rounded

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "a battery",
        lambda: flat(BatteryState()),
        {
            "first_pct": None,
            "first_ah": None,
            "remaining_pct": None,
            "least_pct": None,
            "reported_s": -math.inf,
            "modelled_pct": 0.0,
            "charge_state": 0,
            "history": (),
            "lowest_pct": None,
            "earlier_pct": 0.0,
            "estimate": None,
            "usual": 1.0,
            "began_s": None,
            "roughness_pct": 0.0,
            "drift": Drift(),
            "usual_long": 1.0,
            "slow": Drift(),
            "charge": ChargeCounter(),
            "still_pct": 0.0,
            "stood": False,
            "anew_s": -math.inf,
            "slack": 0.0,
        },
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
