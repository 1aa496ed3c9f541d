"""Flights over lines, on cases worked out by hand: what is too low is named, and how high the rest is."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from missions import (
    FlightPath,
    FlightSetup,
    Inspection,
    Pad,
    Phase,
    build_flight_path,
    check_ceiling,
    check_clearance,
    check_network_clearance,
    clearance,
    default_network_path,
    find_height_extremes,
    find_max_return_height,
    margin_m,
    max_return_height_m,
    min_height_over_tops_m,
    plan_flight_setup,
    read_network,
)
from tests.missions.builders import FLEET, default_setup, line_east, network_of, path_through

EAST = network_of([(100.0, 0.0), (300.0, 0.0)], [(0, 1)], [(450.0, 30.0), (450.0, 40.0)])
"""One span from 30 to 40 m over the depot's ground."""


def setup_of(network: object = EAST, **inspection: float) -> FlightSetup:
    pads = [Pad("uav1", 0.0, 0.0, 450.0)]
    return plan_flight_setup(network, ["uav1"], Inspection(**inspection), pads=pads)  # type: ignore[arg-type]


def through(*places_m: tuple[float, float, float]) -> FlightPath:
    return path_through("uav1", places_m)


def test_a_leg_that_crosses_a_line_is_held_against_the_wire_between_its_tops() -> None:
    setup = setup_of()
    assert margin_m(setup) == 10.0
    # Half way the line between the tops is 35 m high.
    assert check_clearance(setup, [through((0.0, -100.0, 46.0), (200.0, -100.0, 46.0), (200.0, 100.0, 46.0))]) == []
    [text] = check_clearance(setup, [through((0.0, -100.0, 40.0), (200.0, -100.0, 40.0), (200.0, 100.0, 40.0))])
    assert text.startswith("uav1 on leg 2 (transit) comes within ")
    assert "over the top of segment 0, 10 m over it expected" in text
    [text] = check_clearance(setup, [through((200.0, -9.0, 20.0), (200.0, -90.0, 20.0))])
    assert text.startswith("uav1 on leg 0 (takeoff) comes 35.0 m below the top of segment 0, 9 m beside it")
    assert text.endswith("; so do 1 more of its legs")


def test_a_climb_beside_a_line_keeps_ten_metres() -> None:
    assert check_clearance(setup_of(), [through((200.0, -10.5, 60.0), (200.0, -90.0, 60.0))]) == []


def test_a_leg_in_the_ground_is_named() -> None:
    network = network_of([(100.0, 0.0), (300.0, 0.0)], [(0, 1)], [(460.0, 30.0), (460.0, 30.0)])
    [text] = check_clearance(setup_of(network), [through((0.0, 40.0, 12.0), (200.0, 40.0, 12.0))])
    assert "comes within 2.0 m of the ground at segment 0, 5 m over it expected" in text


def test_nothing_is_known_of_flat_ground_without_structures() -> None:
    setup = setup_of(line_east(3))
    path = build_flight_path(setup, "uav1", [0, 2])
    assert (check_clearance(setup, [path]), check_network_clearance(setup), min_height_over_tops_m(setup, [path])) == (
        [],
        [],
        None,
    )
    heights = find_height_extremes(setup, [path])
    assert heights is not None
    assert [round(one.height_m, 6) for one in heights] == [15.0, 15.0]


def test_a_low_line_under_a_tall_one_is_refused_wherever_it_is_flown() -> None:
    crossing = network_of(
        [(100.0, 0.0), (300.0, 0.0), (200.0, -100.0), (200.0, 100.0)],
        [(0, 1), (2, 3)],
        [(450.0, 12.0), (450.0, 12.0), (450.0, 50.0), (450.0, 50.0)],
    )
    found = check_network_clearance(setup_of(crossing))
    assert found[0].startswith("the inspection of segment 0 comes 23.0 m below the top of segment 1")


def test_the_default_network_is_flown_with_the_margin_by_any_plan() -> None:
    setup = default_setup()
    paths = [build_flight_path(setup, name, range(2 * index, 66, 8)) for index, name in enumerate(FLEET)]
    assert (check_clearance(setup, paths), check_network_clearance(setup), check_ceiling(setup, paths)) == ([], [], [])
    least_m = min_height_over_tops_m(setup, paths)
    assert least_m is not None
    assert 13.5 < least_m <= 15.0
    heights = find_height_extremes(setup, paths)
    assert heights is not None
    assert heights[0].height_m > 40.0
    assert heights[1].height_m < 85.0
    assert heights[1].vehicle == "uav4"


@pytest.mark.parametrize(("radius_m", "highest_m"), [(700.0, 115.2), (None, 118.1)])
def test_four_vehicles_return_below_the_ceiling_of_the_default_network(
    radius_m: float | None, highest_m: float
) -> None:
    setup = plan_flight_setup(read_network(default_network_path(), radius_m=radius_m), FLEET, Inspection())
    assert find_max_return_height(setup).height_m == pytest.approx(highest_m, abs=0.1)
    assert check_ceiling(setup, []) == []


def test_returns_are_above_all_layers_but_the_highest_vehicles_own_and_apart() -> None:
    setup = default_setup()
    ups_m = [setup.layers.return_up_m(name) for name in FLEET]
    top_m = float(setup.layers.track_heights_m.max())
    assert ups_m[-1] == pytest.approx(top_m + setup.layers.offset_m("uav4"))
    # Nobody else's layer comes near to the highest vehicle's return, nor its layer to theirs.
    assert ups_m[-1] - (top_m + setup.layers.offset_m("uav3")) >= 6.0
    assert [a - b for a, b in pairwise(ups_m)] == pytest.approx([7.0] * 3)


def test_over_the_ceiling_is_named_with_what_helps() -> None:
    network = read_network(default_network_path(), radius_m=700.0)
    names = [f"uav{number}" for number in range(1, 7)]
    setup = plan_flight_setup(network, names, Inspection())
    [text] = check_ceiling(setup, [])
    assert text.startswith("the RTL of uav1 is level, 144 m over the ground near V105.5, above 120: fewer vehicles")
    assert text.endswith("less of the network make it lower; a higher inspection.return_ceiling_m needs a permit")
    lower = plan_flight_setup(network, names, replace(setup.inspection, ceiling_m=80.0))
    mission, _ = check_ceiling(lower, [build_flight_path(lower, "uav6", range(0, 66, 2))])
    assert mission.startswith("the mission of uav6 goes 97 m over the ground near V10")
    assert check_ceiling(plan_flight_setup(network, names, Inspection(ceiling_m=150.0)), []) == []
    assert check_ceiling(plan_flight_setup(network, names, Inspection(return_ceiling_m=150.0)), []) == []


def test_take_off_and_landing_are_no_flight_over_the_ground() -> None:
    setup = setup_of()
    path = build_flight_path(setup, "uav1", [0])
    assert [point.phase for point in path.waypoints][-1] is Phase.LAND
    heights = find_height_extremes(setup, [path])
    assert heights is not None
    assert heights[0].height_m >= 40.0
    assert find_height_extremes(setup, [FlightPath("uav1", ())]) is None


def test_a_return_may_be_as_high_as_the_ceiling_allows_over_the_lowest_ground() -> None:
    # The lowest ground within 700 m is 5.2 m below the depot's.
    assert max_return_height_m(default_setup(), "uav1") == pytest.approx(114.8)
    assert max_return_height_m(setup_of(line_east(3), return_ceiling_m=150.0), "uav1") == 150.0


def test_the_nearest_lines_of_a_long_path_are_those_of_all() -> None:
    chance = np.random.default_rng(7)
    places_m = np.round(chance.uniform(-4000.0, 4000.0, (60, 2)), 1)
    network = network_of([(east, north) for east, north in places_m.tolist()], list(pairwise(range(60))))
    walls = clearance.PowerLines(network, np.pad(network.ends_m, ((0, 0), (0, 0), (0, 2))), np.arange(59))
    for _ in range(50):
        path_m = chance.uniform(-4000.0, 4000.0, 2) + np.linspace(0.0, 1.0, 40)[:, np.newaxis] * chance.normal(
            0, 300, 2
        )
        close = walls.select_nearest(path_m)
        expected = walls.find_nearest(path_m)[0].argmin(axis=1)
        assert (close.segments[close.find_nearest(path_m)[0].argmin(axis=1)] == expected).all()
        assert len(close.segments) < 59
