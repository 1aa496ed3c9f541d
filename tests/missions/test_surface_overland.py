"""Flights over mountains keep their margin: a few here, 200 plans and 200 re-plans in the campaign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from missions import (
    FlightPath,
    Phase,
    Waypoint,
    build_flight_path,
    check_clearance,
    check_network_clearance,
    check_separation,
    continue_path,
)
from missions.errors import ElevationError
from tests.terrain_judge import Case, case_of

MOST = 200
FEW = 8
NAMED = r"^mountain-\d+\.tif: no-data: expected the ground's height .* at 46\.\d+, 10\.\d+, \d+ m from pylon 'P\d+'$"
CENTIMETRE_M = 0.03
"""Items have heights in centimetres; a leg over degrees is that far off one over metres at most."""


def first_paths(case: Case) -> list[FlightPath]:
    names = case.setup.layers.vehicles
    return [build_flight_path(case.setup, name, route) for name, route in zip(names, case.routes, strict=True) if route]


def replanned(case: Case, paths: list[FlightPath]) -> list[FlightPath]:
    """Return what the others fly once one is lost somewhere on its way."""
    lost = paths[int(case.rng.integers(len(paths)))]
    left = list(case.routes[case.setup.layers.vehicles.index(lost.vehicle)])
    others = [path for path in paths if path is not lost]
    shares = np.array_split(case.rng.permutation(left), max(1, len(others)))
    answers = []
    for path, share in zip(others, shares, strict=True):
        ends = [n for n, point in enumerate(path.waypoints, start=1) if point.phase is Phase.INSPECT]
        keep = ends[int(case.rng.integers(len(ends)))]
        answers.append(continue_path(case.setup, path, keep, [int(one) ^ int(case.rng.integers(2)) for one in share]))
    return answers


def judged(case: Case, paths: list[FlightPath]) -> None:
    terrain = case.setup.terrain
    assert terrain is not None
    for path in paths:
        assert case.judge.least_over_m(case.setup, path) >= terrain.kept_m - CENTIMETRE_M
        assert case.judge.least_home_m(case.setup, path) >= terrain.kept_m - CENTIMETRE_M
    homes = case.setup.home_alt_m
    assert check_separation(paths, case.setup.inspection.layer_m, home_alt_m=homes) == []
    assert check_clearance(case.setup, paths) == []


def flown_and_replanned(seed: int, folder: Path) -> None:
    case = case_of(seed, folder)
    paths = first_paths(case)
    judged(case, paths)
    judged(case, replanned(case, paths))


@pytest.mark.parametrize("seed", range(FEW))
def test_the_margin_holds_on_every_leg_and_every_return(seed: int, tmp_path: Path) -> None:
    flown_and_replanned(seed, tmp_path)


def turned_back(case: Case, path: FlightPath) -> Iterator[FlightPath]:
    """Yield what a vehicle flies that turns anywhere on a leg of its way home, straight to its new mission."""
    for keep, end in enumerate(path.waypoints):
        if end.phase is not Phase.RETURN:
            continue
        begin = path.waypoints[keep - 1]
        turns = [_between(begin, end, share) for share in sorted(case.rng.uniform(size=2))]
        segment = int(case.rng.integers(len(case.setup.network.segments)))
        known_m = case.setup.frame.to_local_m(turns[0].lat_deg, turns[0].lon_deg)
        again = continue_path(case.setup, path, keep, [2 * segment], turn_m=known_m)
        yield FlightPath(path.vehicle, (*path.waypoints[:keep], *turns, *again.waypoints[keep:]))


def _between(begin: Waypoint, end: Waypoint, share: float) -> Waypoint:
    """Return a place on a leg."""
    lat_deg, lon_deg, alt_m = (
        one + share * (other - one)
        for one, other in (
            (begin.lat_deg, end.lat_deg), (begin.lon_deg, end.lon_deg), (begin.alt_rel_m, end.alt_rel_m)
        )
    )  # fmt: skip
    return replace(end, lat_deg=lat_deg, lon_deg=lon_deg, alt_rel_m=alt_m)


@pytest.mark.parametrize("seed", [1, 3])
def test_the_margin_holds_for_a_recall_from_the_return(seed: int, tmp_path: Path) -> None:
    case = case_of(seed, tmp_path)
    paths = first_paths(case)
    for number, path in enumerate(paths):
        others = [*paths[:number], *paths[number + 1 :]]
        for flown in turned_back(case, path):
            judged(case, [*others, flown])


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_the_margin_holds_on_200_plans_and_200_replans(tmp_path: Path) -> None:
    for seed in range(1000, 1000 + MOST):
        flown_and_replanned(seed, tmp_path)


def test_the_check_before_the_flight_covers_every_later_plan(tmp_path: Path) -> None:
    assert check_network_clearance(case_of(3, tmp_path).setup) == []


def test_a_leg_that_is_too_low_is_named_with_its_place(tmp_path: Path) -> None:
    case = case_of(1, tmp_path)
    (path, *_) = first_paths(case)
    low = [point if point.phase in {Phase.TAKEOFF, Phase.LAND} else _lower(point, 60.0) for point in path.waypoints]
    (line,) = check_clearance(case.setup, [FlightPath(path.vehicle, tuple(low))])
    assert line.startswith(f"{path.vehicle} on leg ")
    assert "over it expected" in line


def test_holes_are_refused_with_their_place_or_lie_beside_the_flights(tmp_path: Path) -> None:
    refused = 0
    for seed in range(40, 52):
        try:
            case = case_of(seed, tmp_path, holes=True)
        except ElevationError:
            refused += 1
            with pytest.raises(ElevationError, match=NAMED):
                case_of(seed, tmp_path, holes=True)
            continue
        judged(case, first_paths(case))
    assert 2 <= refused <= 10


def _lower(point: Waypoint, by_m: float) -> Waypoint:
    return replace(point, alt_rel_m=point.alt_rel_m - by_m)


def test_a_vehicle_that_flies_lower_than_its_pad_does_not_take_off_again(tmp_path: Path) -> None:
    case = case_of(4, tmp_path)
    for path in first_paths(case):
        ends = [n for n, point in enumerate(path.waypoints, start=1) if point.phase is Phase.INSPECT]
        for keep in ends:
            after = continue_path(case.setup, path, keep, [])
            assert [point.phase for point in after.waypoints].count(Phase.TAKEOFF) == 1
