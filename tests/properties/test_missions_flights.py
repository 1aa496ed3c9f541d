"""Flights of any routes: prefixes of re-plans stay, and the promised distance holds whatever is flown."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from missions import (
    ARDUPILOT,
    PX4,
    Dialect,
    FlightPath,
    FlightSetup,
    Inspection,
    Phase,
    SafetyError,
    build_flight_path,
    check_separation,
    continue_path,
    encode,
    plan_flight_setup,
)
from tests.missions.builders import FLEET, arrival_seq, default_setup, network_of

SEGMENTS = 33


def visits(segments: st.SearchStrategy[int]) -> st.SearchStrategy[list[int]]:
    return st.lists(
        st.builds(lambda s, r: 2 * s + r, segments, st.integers(0, 1)), max_size=4, unique_by=lambda v: v // 2
    )


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
@settings(derandomize=True, deadline=None, max_examples=40)
@given(data=st.data())
def test_items_of_what_is_kept_do_not_depend_on_what_follows(dialect: Dialect, data: st.DataObject) -> None:
    setup = default_setup()
    anywhere = st.integers(0, SEGMENTS - 1)
    first = data.draw(visits(anywhere).filter(bool), label="first")
    then, instead = data.draw(visits(anywhere), label="then"), data.draw(visits(anywhere), label="instead")
    path = build_flight_path(setup, "uav2", [*first, *then])
    keep = data.draw(st.integers(1, len(path.waypoints) - 1), label="keep")
    replanned = continue_path(setup, path, keep, instead)
    old, new = encode(path, dialect), encode(replanned, dialect)
    length = arrival_seq(old, keep - 1) + 1
    assert new.items[:length] == old.items[:length]
    assert new.waypoint_of[:length] == old.waypoint_of[:length]
    done = sum(point.phase is Phase.INSPECT for point in path.waypoints[:keep])
    numbers = [point.visit for point in replanned.waypoints if point.phase is Phase.INSPECT]
    assert numbers == list(range(done + len(instead)))


def parts(routes: list[int], count: int) -> list[list[int]]:
    return [routes[vehicle::count] for vehicle in range(count)]


@pytest.mark.parametrize("layer_m", [3.0, 5.0, 10.0])
@settings(derandomize=True, deadline=None, max_examples=12)
@given(order=st.permutations(range(SEGMENTS)), turned=st.integers(0, 2**SEGMENTS - 1), keep=st.integers(1, 20))
def test_any_routes_and_any_replan_keep_the_promised_distance(
    layer_m: float, order: list[int], turned: int, keep: int
) -> None:
    setup = default_setup(layer_m)
    routes = parts([2 * segment + (turned >> segment & 1) for segment in order], len(FLEET))
    paths = [build_flight_path(setup, name, route) for name, route in zip(FLEET, routes, strict=True)]
    assert check_separation(paths, layer_m) == []
    # The last vehicle is lost and flies on; the others take over its visits, each from somewhere on its way.
    others = [continue_path(setup, path, keep, routes[-1][index::3]) for index, path in enumerate(paths[:-1])]
    assert check_separation([*others, paths[-1]], layer_m) == []


@st.composite
def rough_setups(draw: st.DrawFn) -> FlightSetup:
    """Draw pylons anywhere around the depot, at any heights: lines cross and climb as no real ones do."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    count = draw(st.integers(4, 10))
    angles, reach = rng.uniform(0, 2 * np.pi, count), rng.uniform(80.0, 600.0, count)
    places = list(zip((reach * np.cos(angles)).tolist(), (reach * np.sin(angles)).tolist(), strict=True))
    heights = list(zip(rng.uniform(445, 475, count).tolist(), rng.uniform(10, 60, count).tolist(), strict=True))
    pairs = [pair for pair in itertools.combinations(range(count), 2) if rng.random() < 0.3]
    assume(bool(pairs))
    try:
        return plan_flight_setup(
            network_of(places, pairs, heights), FLEET[:3], Inspection(layer_m=draw(st.floats(2.0, 12.0)))
        )
    except SafetyError:
        # Lines over the whole depot leave no room for pads.
        assume(False)
        raise


@settings(derandomize=True, deadline=None, max_examples=40)
@given(setup=rough_setups(), shuffle=st.randoms(use_true_random=False))
def test_the_distance_holds_over_rough_ground_and_crossing_lines(setup: FlightSetup, shuffle: random.Random) -> None:
    order = list(range(2 * len(setup.network.segments)))
    shuffle.shuffle(order)
    names = setup.layers.vehicles
    # Two vehicles may even be over the same segments.
    paths: list[FlightPath] = [build_flight_path(setup, name, order) for name in names]
    assert check_separation(paths, setup.layers.layer_m) == []
