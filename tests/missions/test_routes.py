"""Routes as flights: phases, holds, tracks, heights, and re-plans that keep what is being flown."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from missions import (
    ARDUPILOT,
    FlightPath,
    FlightSetup,
    Inspection,
    Pad,
    Phase,
    SafetyError,
    Waypoint,
    build_flight_path,
    check_separation,
    column_radius_m,
    continue_path,
    encode,
    plan_flight_setup,
)
from missions.geometry import place_distances_m
from tests.missions.builders import FLEET, default_setup, line_east, network_of


def places_m(setup: FlightSetup, path: FlightPath) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return (w, 2) east and north of all waypoints."""
    return setup.frame.many_to_local_m(np.array([(point.lat_deg, point.lon_deg) for point in path.waypoints]))


def shape(path: FlightPath) -> list[tuple[str, bool, int | None]]:
    return [(point.phase.value, point.hold, point.visit) for point in path.waypoints]


def simple_setup() -> FlightSetup:
    """A line due east, flat heights, pads clear of every way."""
    pads = [Pad("uav1", 0.0, -40.0, 450.0), Pad("uav2", 0.0, 60.0, 450.0)]
    return plan_flight_setup(line_east(), ["uav1", "uav2"], Inspection(height_m=20.0), pads=pads)


def test_a_route_of_adjacent_segments() -> None:
    setup = simple_setup()
    path = build_flight_path(setup, "uav1", [0, 2])
    assert shape(path) == [
        ("takeoff", False, None),
        ("transit", True, 0),
        ("inspect", True, 0),
        ("inspect", True, 1),  # starts where the last one ended: no waypoint in between
        ("return", False, None),
        ("land", False, None),
    ]
    # To the right of due east is south.
    assert places_m(setup, path) == pytest.approx(
        np.array([[0, -40], [100, -5], [200, -5], [300, -5], [0, -40], [0, -40]]), abs=1e-6
    )
    assert [point.alt_rel_m for point in path.waypoints] == pytest.approx([20, 20, 20, 20, 20, 0])
    assert [point.speed_m_s for point in path.waypoints] == [2.5, 8.0, 3.0, 3.0, 8.0, 1.0]


def test_both_directions_fly_the_same_track() -> None:
    setup = simple_setup()
    there, back = build_flight_path(setup, "uav1", [2]), build_flight_path(setup, "uav1", [3])
    assert places_m(setup, there)[1:3] == pytest.approx(places_m(setup, back)[[2, 1]], abs=1e-6)


def test_segments_that_do_not_meet_have_a_transit_with_a_hold_between_them() -> None:
    path = build_flight_path(simple_setup(), "uav1", [0, 4])
    assert shape(path)[2:5] == [("inspect", True, 0), ("transit", True, 1), ("inspect", True, 1)]


def test_at_a_corner_the_tracks_do_not_meet() -> None:
    network = network_of([(100.0, 0.0), (200.0, 0.0), (200.0, 150.0)], [(0, 1), (1, 2)])
    pads = [Pad("uav1", 0.0, -40.0, 450.0)]
    setup = plan_flight_setup(network, ["uav1"], Inspection(), pads=pads)
    path = build_flight_path(setup, "uav1", [0, 2])
    # From (200, -5) to (205, 0): 7 m, so there is a waypoint.
    assert [point.phase for point in path.waypoints[2:5]] == [Phase.INSPECT, Phase.TRANSIT, Phase.INSPECT]


def test_a_vehicle_without_visits_stays_on_the_ground() -> None:
    assert build_flight_path(simple_setup(), "uav1", []) == FlightPath("uav1", ())


def test_heights_are_relative_to_the_vehicles_own_home() -> None:
    pads = [Pad("uav1", 0.0, -40.0, 450.0), Pad("uav2", 0.0, 60.0, 447.0)]
    setup = plan_flight_setup(line_east(), ["uav1", "uav2"], Inspection(height_m=20.0), pads=pads)
    path = build_flight_path(setup, "uav2", [0])
    assert [point.alt_rel_m for point in path.waypoints] == pytest.approx([29, 29, 29, 29, 0])


def test_the_second_vehicle_flies_one_layer_higher_everywhere() -> None:
    path = build_flight_path(simple_setup(), "uav2", [0, 4])
    assert {round(point.alt_rel_m, 6) for point in path.waypoints[:-1]} == {26.0}


def test_ways_go_around_the_columns_over_others_pads() -> None:
    pads = [Pad("uav1", 0.0, -60.0, 450.0), Pad("uav2", 50.0, -33.0, 450.0)]
    setup = plan_flight_setup(line_east(), ["uav1", "uav2"], Inspection(height_m=20.0), pads=pads)
    path = build_flight_path(setup, "uav1", [0])
    places = places_m(setup, path)
    legs = np.array(list(itertools.pairwise(places)))
    assert place_distances_m(legs, np.array([[50.0, -33.0]])).min() >= column_radius_m(5.0) - 1e-3
    assert shape(path)[1] == ("transit", False, 0)
    phases = [point.phase for point in path.waypoints]
    assert phases.count(Phase.TRANSIT) > 1
    assert all(not point.hold for point in path.waypoints if point.phase is Phase.RETURN)


def test_a_transit_over_terrain_follows_the_surface() -> None:
    setup = default_setup()
    path = build_flight_path(setup, "uav1", [2 * 5, 2 * 20 + 1, 2 * 11])
    places = places_m(setup, path)
    layers = setup.layers
    allowed_m = layers.tolerance_m + layers.surface.slope * 4.0 + 1e-3
    for index in range(1, len(places) - 1):
        share = np.linspace(0.0, 1.0, 40)
        ground = places[index - 1] + share[:, np.newaxis] * (places[index] - places[index - 1])
        before, after = path.waypoints[index - 1].alt_rel_m, path.waypoints[index].alt_rel_m
        off = np.abs(layers.surface.interpolate_m(ground) - (before + share * (after - before)))
        assert off.max() <= allowed_m
        assert allowed_m < 1.0


def test_an_unknown_visit_or_vehicle_is_refused() -> None:
    with pytest.raises(IndexError, match="visit 6: expected a segment below 3"):
        build_flight_path(simple_setup(), "uav1", [6])
    with pytest.raises(SafetyError, match="vehicle 'uav9'"):
        build_flight_path(simple_setup(), "uav9", [0])


def test_a_replanned_path_keeps_its_beginning_and_counts_on() -> None:
    setup = simple_setup()
    path = build_flight_path(setup, "uav1", [0, 2])
    replanned = continue_path(setup, path, 3, [5])
    assert replanned.waypoints[:3] == path.waypoints[:3]
    assert shape(replanned)[3:] == [
        ("transit", True, 1),
        ("inspect", True, 1),
        ("return", False, None),
        ("land", False, None),
    ]
    assert replanned.waypoints[-1] == path.waypoints[-1]


def test_a_replan_into_the_same_visits_is_the_same_flight() -> None:
    setup = default_setup()
    path = build_flight_path(setup, "uav2", [4, 6, 30, 9])
    keep = 1 + max(index for index, point in enumerate(path.waypoints) if point.visit == 1)
    again = continue_path(setup, path, keep, [30, 9])
    assert shape(again) == shape(path)
    assert places_m(setup, again) == pytest.approx(places_m(setup, path), abs=1e-4)
    heights = [[point.alt_rel_m for point in flight.waypoints] for flight in (again, path)]
    assert heights[0] == pytest.approx(heights[1], abs=1e-4)


def test_a_replan_without_visits_goes_home() -> None:
    setup = simple_setup()
    replanned = continue_path(setup, build_flight_path(setup, "uav1", [0, 2, 4]), 3, [])
    assert shape(replanned)[3:] == [("return", False, None), ("land", False, None)]


def test_a_replan_on_the_way_to_a_visit_gives_its_number_to_the_new_one() -> None:
    setup = simple_setup()
    replanned = continue_path(setup, build_flight_path(setup, "uav1", [0, 4]), 4, [2])
    assert shape(replanned)[3:6] == [("transit", True, 1), ("transit", True, 1), ("inspect", True, 1)]


def test_a_vehicle_on_its_return_can_be_sent_out_again() -> None:
    setup = simple_setup()
    path = build_flight_path(setup, "uav1", [0])
    replanned = continue_path(setup, path, len(path.waypoints) - 1, [2])
    assert [point.phase for point in replanned.waypoints[3:6]] == [Phase.RETURN, Phase.TRANSIT, Phase.INSPECT]
    assert [point.visit for point in replanned.waypoints[4:6]] == [1, 1]


def test_a_transit_replaces_a_return_even_to_where_it_begins() -> None:
    """Who flies home already goes on at the same number: with an inspection there it would not fly to its begin."""
    setup = simple_setup()
    path = build_flight_path(setup, "uav1", [0, 2])
    keep = [point.phase for point in path.waypoints].index(Phase.RETURN)
    back = continue_path(setup, path, keep, [3])
    assert [point.phase for point in back.waypoints[keep : keep + 2]] == [Phase.TRANSIT, Phase.INSPECT]
    assert encode(back, ARDUPILOT).waypoint_of.index(keep) == encode(path, ARDUPILOT).waypoint_of.index(keep)


@pytest.mark.parametrize(("north_m", "back"), [(-60.0, False), (25.0, True)])
def test_a_recalled_vehicle_flies_straight_or_first_to_where_it_was(north_m: float, back: bool) -> None:
    """Another's pad lies beside its way home, or between that and where it is sent, wherever it turns."""
    network = network_of([(300.0, 5.0), (200.0, 5.0), (200.0, 100.0), (300.0, 100.0)], [(0, 1), (2, 3)])
    pads = [Pad("uav1", 0.0, 0.0, 450.0), Pad("uav2", 120.0, north_m, 450.0)]
    setup = plan_flight_setup(network, ["uav1", "uav2"], Inspection(height_m=20.0), pads=pads)
    path = build_flight_path(setup, "uav1", [0])
    keep = [point.phase for point in path.waypoints].index(Phase.RETURN)
    again = continue_path(setup, path, keep, [2], turn_m=(90.0, 4.0))
    first, goal = places_m(setup, again)[[keep, shape(again).index(("inspect", True, 1)) - 1]]
    assert shape(again)[keep] == ("transit", True, 1)
    assert first == pytest.approx([90.0, 4.5], abs=1.0) if back else first == pytest.approx(goal)
    assert goal == pytest.approx([200.0, 95.0], abs=1e-3)
    assert encode(again, ARDUPILOT).waypoint_of.index(keep) == encode(path, ARDUPILOT).waypoint_of.index(keep)


@pytest.mark.parametrize("keep", [0, -1, 6, 7])
def test_a_landing_or_nothing_cannot_be_kept(keep: int) -> None:
    setup = simple_setup()
    path = build_flight_path(setup, "uav1", [0, 2])
    with pytest.raises(ValueError, match=f"keep is {keep}: expected 1 to 6 waypoints without the landing"):
        continue_path(setup, path, keep, [4])


def test_no_segment_is_flown_in_two_pieces_and_all_are_flown() -> None:
    setup = default_setup()
    count = len(setup.network.segments)
    path = build_flight_path(setup, "uav3", [2 * segment for segment in range(count)])
    inspections = [point for point in path.waypoints if point.phase is Phase.INSPECT]
    assert [point.visit for point in inspections] == list(range(count))
    before: list[Waypoint] = [
        path.waypoints[index - 1] for index, point in enumerate(path.waypoints) if point.phase is Phase.INSPECT
    ]
    assert all(point.hold for point in (*before, *inspections))
    lengths = [
        math.dist(setup.frame.to_local_m(a.lat_deg, a.lon_deg), setup.frame.to_local_m(b.lat_deg, b.lon_deg))
        for a, b in zip(before, inspections, strict=True)
    ]
    assert lengths == pytest.approx(setup.network.lengths_m, abs=0.5)


def test_a_whole_fleet_keeps_its_distance() -> None:
    setup = default_setup(5.0)
    paths = [build_flight_path(setup, name, range(2 * k, 66, 8)) for k, name in enumerate(FLEET)]
    assert check_separation(paths, 5.0, home_alt_m=setup.home_alt_m) == []
