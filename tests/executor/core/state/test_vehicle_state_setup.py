"""What is reckoned with for a vehicle, by the pack that is in it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executor.core.replanning.survivors import build_survivor
from executor.core.state import legs
from executor.core.state.vehicle_parts import Turnaround
from executor.core.state.vehicle_state import VehicleState, current_setup_of
from tests.executor.core.steps import flight_of
from tests.executor.core.vehicles import FLEET, NOW_S, flying

CONTEXT = FLEET.context
PLAIN = replace(CONTEXT.vehicles["uav1"], budget_pct=60.0)
WORN = replace(PLAIN, budget_pct=35.0, reserve_pct=45.0)
PACKS = {"": PLAIN, "A7": WORN}
SCENE = replace(CONTEXT, vehicles={**CONTEXT.vehicles, "uav1": replace(WORN, packs=PACKS)})


def flown_with(label: str, swaps: int = 1, overstated_pct: float = 0.0) -> VehicleState:
    return replace(flying(), turn=Turnaround(label, swaps, overstated_pct))


@pytest.mark.parametrize(
    ("label", "swaps", "overstated_pct", "budget_pct", "reserve_pct"),
    [
        ("", 0, 0.0, 35.0, 45.0),
        ("A7", 1, 0.0, 35.0, 45.0),
        ("", 1, 0.0, 60.0, PLAIN.reserve_pct),
        ("B1", 2, 0.0, 60.0, PLAIN.reserve_pct),
        ("B1", 1, 20.0, 60.0, PLAIN.reserve_pct + 20.0),
        ("A7", 1, 20.0, 35.0, 65.0),
    ],
)
def test_the_pack_that_is_in_it_counts(
    label: str, swaps: int, overstated_pct: float, budget_pct: float, reserve_pct: float
) -> None:
    setup = current_setup_of(SCENE, flown_with(label, swaps, overstated_pct))
    assert (setup.budget_pct, setup.reserve_pct) == (budget_pct, reserve_pct)


def test_an_overstated_percentage_is_not_planned_with_and_doubted_in_flight() -> None:
    honest, overstated = flown_with("B1"), flown_with("B1", overstated_pct=70.0)
    offers = [build_survivor(SCENE, flight_of(one), one, NOW_S) for one in (honest, overstated)]
    budgets_pct = [None if offer is None else offer.most_pct for offer in offers]
    assert budgets_pct[0] is not None
    assert budgets_pct[1] is not None
    assert budgets_pct[0] > budgets_pct[1] + 50.0
    chances = [
        legs.landing_chance_below(SCENE, one, setup, setup.reserve_pct)
        for one in (honest, overstated)
        if (setup := current_setup_of(SCENE, one))
    ]
    assert chances[0] is not None
    assert chances[1] is not None
    assert chances[0] < 0.01
    assert chances[1] > 0.5
