"""Routes that share a pylon: flown so that who inspects from its layer comes when the other has left."""

from __future__ import annotations

import pytest

from missions import FlightSetup, Inspection, dialect_for, flight_setup
from missions.asked import Routes
from missions.flight_model import FlightModel
from missions.order import MOST_VISITS, turned
from planner import SteadyWind
from tests.missions.builders import line_east

POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))
NAMES = ("uav1", "uav2")
AHEAD_S = 20.0


def setup_of() -> FlightSetup:
    """Return six spans east of two pads."""
    network = line_east(7)
    return flight_setup(network, NAMES, Inspection(same_distance=True, flat=network.flat))


def chosen(routes: Routes, *, may: bool = True) -> dict[str, tuple[int, ...]]:
    setup = setup_of()
    model = FlightModel(
        dialect_for("ardupilot").performance, POWER, setup.inspection.transit_speed_m_s, setup.inspection.speed_m_s
    )
    return turned(setup, routes, dict.fromkeys(NAMES, model), AHEAD_S, lambda _: may)


OUT, BACK = (6, 8, 10), (11, 9, 7)
"""The far half of the line: from the pylon that is shared with who flies the near half, or towards it."""
NEAR = (5, 3, 1)
"""The near half, from the shared pylon."""


def test_who_is_higher_comes_to_the_shared_pylon_last() -> None:
    assert chosen({"uav1": NEAR, "uav2": OUT}) == {"uav1": NEAR, "uav2": BACK}


def test_what_is_well_as_it_is_stays() -> None:
    assert chosen({"uav1": NEAR, "uav2": BACK}) == {"uav1": NEAR, "uav2": BACK}


def test_nothing_is_turned_that_makes_the_plan_worse() -> None:
    assert chosen({"uav1": NEAR, "uav2": OUT}, may=False) == {"uav1": NEAR, "uav2": OUT}


def test_who_shares_nothing_is_not_turned() -> None:
    routes = {"uav1": (0, 2), "uav2": (8, 10)}
    assert chosen(routes) == routes


@pytest.mark.parametrize("visits", [MOST_VISITS + 1])
def test_large_plans_are_left_as_they_are(visits: int) -> None:
    routes = {"uav1": tuple(range(0, 2 * visits, 2)), "uav2": ()}
    assert chosen(routes) == routes
