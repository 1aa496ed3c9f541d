"""A vehicle that would fly into another's climb waits: over a ridge, with RTL heights above all layers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executor.core.context import Context
from executor.core.inflight.climb_conflicts import SLOW_M_S, Climb
from executor.core.interface.commands import ChangeSpeed, HandsOff, Level
from executor.core.interface.intents import Action
from executor.core.state.vehicle_state import Stage, build_onboard_mission
from executor.site import site_model
from missions import build_flight_path
from tests.executor.builders import Fleet, Routes, ground_for, site_of
from tests.fakes.flight import Story
from tests.missions.builders import network_of

ROUTES: Routes = {"uav1": (0, 2), "uav2": (8,), "uav3": (10,)}
"""uav1 inspects where uav3 passes in a layer two steps above it."""
GROUND_M = (450.0, 450.0, 450.0, 450.0, 450.0, 450.0, 470.0)
SPACING_M = 5.0
STARTS, PASSES = "uav3: slowing: uav1 ahead is climbing in RTL", "uav3: flies on at 8 m/s"


def over_a_ridge(autopilot: str = "ardupilot") -> Fleet:
    """Return a fleet over a line whose last pylon stands higher, so that returns are stacked above all layers."""
    count = len(GROUND_M)
    network = network_of(
        [(100.0 * (index + 1), 0.0) for index in range(count)],
        [(index, index + 1) for index in range(count - 1)],
        [(ground_m, 20.0) for ground_m in GROUND_M],
    )
    high: dict[str, object] = {"ceiling_m": 150.0, "return_ceiling_m": 200.0}
    ground = ground_for(site_of(tuple(ROUTES), autopilot, inspection=high), network)
    setup = ground.setup
    context = site_model.build_context(ground, setup, site_model.build_first_task(ground))
    boards = {
        name: build_onboard_mission(context, name, 0, build_flight_path(setup, name, visits), visits)
        for name, visits in ROUTES.items()
    }
    return Fleet(context, dict(boards))


def story(autopilot: str = "ardupilot", context: Context | None = None, east_m: float = 50.0) -> Story:
    """Return a flight in which uav3 has come so far: some 50 m behind uav1 and above it, and faster soon."""
    ready = over_a_ridge(autopilot)
    flight = Story(context or ready.context, dict(ready.boards))
    flight.launch()
    flight.run(lambda: flight.crafts["uav3"].place_m[0] > east_m)
    assert 40.0 < behind_m(flight) < 60.0
    assert flight.given(ChangeSpeed) == []
    return flight


def behind_m(flight: Story) -> float:
    return flight.crafts["uav1"].place_m[0] - flight.crafts["uav3"].place_m[0]


def returns(flight: Story) -> None:
    """Let uav1's pilot bring it home, as its autopilot does it."""
    craft = flight.crafts["uav1"]
    craft.climbs_m_s = flight.context.pricing.models["uav1"].performance.climb_m_s
    craft.go_home()


def nearest_m(flight: Story, seconds: float) -> float:
    """Return how near uav1 and uav3 come to each other in this time."""
    until_s, least_m = flight.now_s + seconds, math.inf
    while flight.now_s < until_s:
        flight.step()
        one, other = flight.crafts["uav1"], flight.crafts["uav3"]
        least_m = min(least_m, math.dist((*one.place_m, one.up_m), (*other.place_m, other.up_m)))
    return least_m


def speeds(flight: Story) -> list[ChangeSpeed]:
    return [one for one in flight.given(ChangeSpeed) if isinstance(one, ChangeSpeed)]


def test_without_it_they_would_meet() -> None:
    flight = story()
    flight.crafts["uav3"].deaf_to_speeds = True
    returns(flight)
    assert nearest_m(flight, 30.0) < SPACING_M


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_vehicle_that_would_fly_into_a_climb_is_slow_until_it_is_over(autopilot: str) -> None:
    flight = story(autopilot)
    returns(flight)
    assert nearest_m(flight, 60.0) >= SPACING_M
    assert [line for line in flight.said(Level.INFO) if line in {STARTS, PASSES}] == [STARTS, PASSES]
    assert speeds(flight) == [ChangeSpeed("uav3", SLOW_M_S), ChangeSpeed("uav3", 8.0)]
    assert flight.vehicle("uav3").orders.gives_way is None
    learned = flight.vehicle("uav3").assignment.learned
    flight.finish()
    assert set(flight.state.coverage.inspected) >= {4, 5}
    assert learned is None or learned.pace.transit < 1.1, "waiting for somebody is no pace of its own"


def test_an_order_that_is_lost_is_given_again() -> None:
    flight = story()
    flight.crafts["uav3"].deaf_to_speeds = True
    returns(flight)
    flight.run(lambda: len(speeds(flight)) == 2)
    flight.crafts["uav3"].deaf_to_speeds = False
    assert nearest_m(flight, 1.0) > SPACING_M
    flight.run(lambda: flight.crafts["uav3"].told_m_s == SLOW_M_S)
    flight.run(lambda: PASSES in flight.said())
    flight.crafts["uav3"].told_m_s = SLOW_M_S
    before = len(speeds(flight))
    flight.run(lambda: len(speeds(flight)) > before)
    assert speeds(flight)[-1] == ChangeSpeed("uav3", 8.0)
    assert flight.said().count(STARTS) == flight.said().count(PASSES) == 1, "once"


def test_a_vehicle_taken_by_a_person_gets_no_more_commands() -> None:
    flight = story()
    returns(flight)
    flight.run(lambda: bool(speeds(flight)))
    flight.crafts["uav3"].go_to(5)  # LOITER
    flight.run(lambda: HandsOff("uav3") in flight.given(HandsOff))
    told = len(speeds(flight))
    nearest_m(flight, 60.0)
    assert len(speeds(flight)) == told
    assert flight.vehicle("uav3").orders.gives_way is None


def test_a_vehicle_held_in_between_continues_at_the_speed_of_its_leg() -> None:
    flight = story()
    returns(flight)
    flight.run(lambda: bool(speeds(flight)))
    flight.ask(Action.HOLD, "uav3")
    nearest_m(flight, 60.0)
    assert flight.vehicle("uav3").orders.gives_way is None
    assert flight.vehicle("uav3").orders.held_s is not None
    told = len(speeds(flight))
    flight.ask(Action.RESUME, "uav3")
    flight.run(lambda: flight.inspecting("uav3", 5))
    assert len(speeds(flight)) == told


def test_a_vehicle_that_cannot_stop_in_time_flies_on() -> None:
    flight = story()
    flight.run(lambda: behind_m(flight) < 12.0)
    returns(flight)
    nearest_m(flight, 30.0)
    assert speeds(flight) == []


def test_a_descent_is_no_climb() -> None:
    flight = story()
    returns(flight)
    flight.crafts["uav1"].climbs_m_s = -1.0
    nearest_m(flight, 20.0)
    assert speeds(flight) == []


def test_a_vehicle_without_a_link_is_waited_for_if_its_failsafe_would_climb() -> None:
    ready = over_a_ridge()
    alone = replace(ready.context.vehicles["uav1"], failsafe_s=5.0, returns=True)
    flight = story(context=replace(ready.context, vehicles={**ready.context.vehicles, "uav1": alone}), east_m=20.0)
    flight.crafts["uav1"].mute = True
    flight.later(5.0, lambda: returns(flight))
    nearest_m(flight, 60.0)
    assert "uav3: slowing: uav1 ahead has no link and may climb in failsafe RTL" in flight.said()
    assert PASSES in flight.said()
    assert flight.stage("uav3") is Stage.FLYING


def test_a_vehicle_without_a_failsafe_rtl_is_not_waited_for() -> None:
    flight = story()
    flight.crafts["uav1"].mute = True
    nearest_m(flight, 30.0)
    assert speeds(flight) == []


def test_no_vehicle_waits_for_ever() -> None:
    flight = story()
    returns(flight)
    flight.run(lambda: bool(speeds(flight)))
    flight.crafts["uav1"].climbs_m_s = 0.01
    flight.run(lambda: PASSES in flight.said())
    assert flight.stage("uav3") is Stage.FLYING


@given(
    up_m=st.floats(0.0, 150.0),
    begins_m=st.floats(20.0, 60.0),
    rises_m_s=st.floats(1.7, 3.0),
    waits_s=st.floats(0.0, 6.0),
    after_s=st.floats(0.0, 100.0),
)
def test_no_conflict_outside_the_stated_time(
    up_m: float, begins_m: float, rises_m_s: float, waits_s: float, after_s: float
) -> None:
    top_m = 100.0
    climb = Climb("uav1", True, np.zeros((1, 2)), (begins_m, begins_m), top_m, (0.0, 6.0), (1.6, 3.1))
    from_s, to_s = climb.window_s(np.array([up_m]), SPACING_M)
    truly_m = min(top_m, begins_m + rises_m_s * max(0.0, after_s - waits_s))
    if abs(truly_m - up_m) < SPACING_M and truly_m < top_m:
        assert from_s[0] <= after_s <= to_s[0]
