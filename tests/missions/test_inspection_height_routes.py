"""Routes that share a pylon: changed so that the vehicle in its layer comes after the other has left."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions import FlightSetup, Inspection, dialect_for, plan_flight_setup
from missions.flight_model import FlightModel
from missions.inspection_height import MOST_VISITS, Routes, RouteTimetable, rearrange_routes
from planner import SteadyWind, segment_of
from tests.missions.builders import line_east

POWER = SteadyWind(0.0, 0.0, (0.0, 100.0), (0.05, 0.05))
NAMES = ("uav1", "uav2")
AHEAD_S = 20.0


def setup_of() -> FlightSetup:
    """Return six spans east of two pads."""
    network = line_east(7)
    return plan_flight_setup(network, NAMES, Inspection(same_distance=True, flat=network.flat))


SETUP = setup_of()
MODEL = FlightModel(
    dialect_for("ardupilot").performance, POWER, SETUP.inspection.transit_speed_m_s, SETUP.inspection.speed_m_s
)


def chosen(
    routes: Routes, *, may: bool = True, cost_of: Callable[[Routes], float] = lambda _: 1.0
) -> dict[str, tuple[int, ...]]:
    return rearrange_routes(SETUP, routes, dict.fromkeys(NAMES, MODEL), AHEAD_S, cost_of, lambda _: may)


def from_layers(routes: Routes) -> int:
    return len(RouteTimetable(SETUP, dict.fromkeys(NAMES, MODEL), AHEAD_S).find_layer_visits(routes))


OUT, BACK = (6, 8, 10), (11, 9, 7)
"""The far half of the line: from the pylon that is shared with who flies the near half, or towards it."""
NEAR = (5, 3, 1)
"""The near half, from the shared pylon."""


def test_the_higher_vehicle_reaches_the_shared_pylon_last() -> None:
    assert chosen({"uav1": NEAR, "uav2": OUT}) == {"uav1": NEAR, "uav2": BACK}


def test_what_is_well_as_it_is_stays() -> None:
    assert chosen({"uav1": NEAR, "uav2": BACK}) == {"uav1": NEAR, "uav2": BACK}


def test_nothing_is_turned_that_makes_the_plan_worse() -> None:
    assert chosen({"uav1": NEAR, "uav2": OUT}, may=False) == {"uav1": NEAR, "uav2": OUT}


def test_a_route_without_shared_pylons_is_not_reversed() -> None:
    routes = {"uav1": (0, 2), "uav2": (8, 10)}
    assert chosen(routes) == routes


def longest(routes: Routes) -> float:
    return max(map(len, routes.values()))


def test_of_two_changes_that_help_the_cheaper_one_is_made() -> None:
    """Turned, or with one segment less: here who flies four segments costs more."""
    few = chosen({"uav1": NEAR, "uav2": OUT}, cost_of=lambda routes: 1.0 + (routes["uav2"] == BACK))
    assert few != {"uav1": NEAR, "uav2": BACK}
    assert from_layers(few) == 0
    assert chosen({"uav1": NEAR, "uav2": OUT}, cost_of=longest) == {"uav1": NEAR, "uav2": BACK}


def test_what_is_too_dear_is_not_flown() -> None:
    routes = {"uav1": NEAR, "uav2": OUT}
    assert chosen(routes, cost_of=lambda _: math.inf) == routes


@settings(max_examples=25)
@given(st.permutations(range(6)), st.integers(1, 5), st.lists(st.booleans(), min_size=6, max_size=6))
def test_everything_is_flown_once_and_never_more_from_layers(order: list[int], cut: int, back: list[bool]) -> None:
    visits = [2 * segment + turned for segment, turned in zip(order, back, strict=True)]
    routes = {"uav1": tuple(visits[:cut]), "uav2": tuple(visits[cut:])}
    found = chosen(routes)
    assert sorted(map(segment_of, (*found["uav1"], *found["uav2"]))) == list(range(6))
    assert all(found.values()), "who flies goes on flying"
    assert from_layers(found) <= from_layers(routes)
    assert chosen(routes) == found


@pytest.mark.parametrize("visits", [MOST_VISITS + 1])
def test_large_plans_are_left_as_they_are(visits: int) -> None:
    routes = {"uav1": tuple(range(0, 2 * visits, 2)), "uav2": ()}
    assert chosen(routes) == routes
