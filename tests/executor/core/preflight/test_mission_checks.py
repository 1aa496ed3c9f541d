"""At which distance is inspected, as the checklist says it, and what stops a flight."""

from __future__ import annotations

from executor.core.interface.codes import Severity
from executor.core.preflight.mission_checks import check_inspection_distances, describe_inspection_distances
from missions import Inspection, build_flight_path, plan_flight_setup
from missions.inspection_height import build_first_paths
from tests.missions.builders import FLEET, line_east

ROUTES = {"uav1": (0, 2, 4), "uav2": (10, 8, 6)}


def test_what_is_inspected_from_a_layer_is_named_with_its_distance() -> None:
    setup = plan_flight_setup(line_east(7), FLEET[:2], Inspection(same_distance=True))
    (line,) = check_inspection_distances(setup, list(build_first_paths(setup, ROUTES).values()), ROUTES)
    assert (line.severity, line.subject) == (Severity.OK, "distance")
    name = setup.network.segment_name(3)
    assert line.text == (
        "5 of 6 segments are inspected at the requested 15 m; from their own layers, unless the others have left by "
        "then "
        f"(flown again afterwards, as budgets allow): {name} at 21 m by uav2"
    )


def test_a_vehicle_that_would_cross_anothers_part_of_the_line_stops_the_flight() -> None:
    setup = plan_flight_setup(line_east(9), FLEET[:2], Inspection(same_distance=True))
    routes = {"uav1": (12,), "uav2": (4, 6)}
    paths = [build_flight_path(setup, "uav1", (12,)), build_flight_path(setup, "uav2", (4, 6), {2, 3})]
    stops = [one.text for one in check_inspection_distances(setup, paths, routes) if one.severity is Severity.STOP]
    assert len(stops) == 1
    assert "where uav2 goes down to the line, 5 m expected" in stops[0]


def test_with_a_layer_each_nothing_is_reported() -> None:
    setup = plan_flight_setup(line_east(7), FLEET[:2], Inspection())
    paths = list(build_first_paths(setup, ROUTES).values())
    assert check_inspection_distances(setup, paths, ROUTES) == []


def test_all_at_the_asked_distance_is_one_short_line() -> None:
    words = describe_inspection_distances(15.0, [("A", "uav1", 15.0), ("B", "uav2", 15.0)])
    assert words == "2 of 2 segments are inspected at the requested 15 m"
