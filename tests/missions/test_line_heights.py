"""Heights are known or claimed: what lacks is named, what no line can have is refused, and what helps is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from missions import Inspection, Network, NetworkError, Pylon, check_line_heights, plan_flight_setup, with_heights
from tests.missions.builders import FRAME, line_east, network_of

GOOD = [(450.0, 30.0), (455.0, 32.0), (460.0, 28.0), (452.0, 30.0)]
"""Over a depot at 450 m."""


def line(heights_m: Sequence[tuple[float | None, float | None]]) -> Network:
    """Return a line due east, pylons every 100 m."""
    places = [(100.0 * (index + 1), 0.0) for index in range(len(heights_m))]
    return network_of(places, [(n, n + 1) for n in range(len(heights_m) - 1)], heights_m)  # type: ignore[arg-type]


def changed(index: int, pylon: tuple[float | None, float | None]) -> Network:
    heights: list[tuple[float | None, float | None]] = [*GOOD]
    heights[index] = pylon
    return line(heights)


def third(network: Network, *values_m: float | None) -> Network:
    pylons = tuple(replace(pylon, third_m=value_m) for pylon, value_m in zip(network.pylons, values_m, strict=True))
    return replace(network, pylons=pylons)


def test_known_heights_stay_as_they_are() -> None:
    network = with_heights(line(GOOD), flat=False)
    assert network == line(GOOD)
    assert check_line_heights(network) == []


@pytest.mark.parametrize(
    ("network", "reason"),
    [
        (changed(2, (460.0, None)), r"expected height_m of every pylon, which 1 of 4 lacks: 'p2'; where the ground"),
        (changed(1, (None, 30.0)), r"expected elevation_m of every pylon, which 1 of 4 lacks: 'p1'; where the ground"),
        (
            line([(None, None)] * 5),
            r"elevation_m and height_m of every pylon, which 5 of 5 lack: 'p0', 'p1', 'p2', \.\.\.; .* claims so$",
        ),
        (
            third(line([(None, None)] * 2), 470.0, 480.0),
            r"'p0', 'p1' \(the third coordinate of 'p0', 470, is not used: the file does not state whether it is",
        ),
    ],
)
def test_what_lacks_heights_is_named(network: Network, reason: str) -> None:
    with pytest.raises(NetworkError, match=rf"^test network: heights: .*{reason}"):
        plan_flight_setup(network, ["uav1"], Inspection())


def test_a_claim_of_flat_ground_extends_the_depots_height() -> None:
    network = with_heights(line([(None, 30.0), (452.0, 31.0)]), flat=True)
    assert network.flat
    assert [pylon.elevation_m for pylon in network.pylons] == [450.0, 452.0]
    assert with_heights(network, flat=True) == network
    setup = plan_flight_setup(network, ["uav1"], Inspection())
    assert setup.layers.track_heights_m.tolist() == [[45.0, 48.0]]


def test_over_flat_ground_without_structures_flights_are_over_the_depots_ground() -> None:
    network = with_heights(line([(None, None)] * 3), flat=True)
    assert network.flat
    assert not network.has_heights
    assert plan_flight_setup(network, ["uav1"], Inspection()).layers.track_heights_m.max() == 15.0


def test_a_network_that_is_flat_by_its_format_needs_no_claim() -> None:
    assert not plan_flight_setup(line_east(), ["uav1"], Inspection()).network.has_heights


@pytest.mark.parametrize(
    ("network", "reason"),
    [
        (changed(1, (470.0, 30.0)), r"pylon 'p1': elevation_m: expected within 5 m of the depot's 450 m .*, got 470"),
        (line([(None, 30.0), (None, None)]), r"expected height_m of every pylon or of none, which 1 of 2 lacks: 'p1'"),
    ],
)
def test_a_claim_that_the_file_contradicts_is_refused(network: Network, reason: str) -> None:
    with pytest.raises(NetworkError, match=reason):
        with_heights(network, flat=True)


def test_third_coordinates_contradict_a_claim_when_they_rise() -> None:
    rising = third(line([(None, None)] * 3), 460.0, None, 560.0)
    with pytest.raises(NetworkError, match=r"third coordinates: .* got 460 at pylon 'p0' and 560 at pylon 'p2'$"):
        check_line_heights(with_heights(rising, flat=True))
    level = third(line([(None, None)] * 3), 495.0, 500.0, 490.0)
    assert check_line_heights(with_heights(level, flat=True)) == [
        "the third coordinates of the network's positions are not used"
    ]


@pytest.mark.parametrize(
    ("network", "reason"),
    [
        (changed(1, (0.0, 30.0)), r"pylon 'p1': elevation_m: .* got 0 beside pylon 'p[02]'"),
        (changed(1, (1493.0, 30.0)), r"pylon 'p1': elevation_m: .* got 1493 beside"),
        (changed(2, (380.0, 30.0)), r"pylon 'p2': elevation_m: .* got 380 beside"),
        (changed(1, (34.0, 455.0)), r"pylon 'p1': height_m: .* at most 400 m, got 455; .* swapped\?"),
        (changed(0, (450.0, 0.0)), r"pylon 'p0': height_m: .* at least 2 m, got 0; is it not known\?"),
        (line([(0.0, 30.0)] * 3), r"elevation_m: expected the ground above sea level, but it is 0 for all pylons"),
        (line([(e, 3.28 * h) for e, h in GOOD]), r"height_m: .* taller than 98\.4; are they feet, .*= 104\.96"),
        (line([(e - 450.0, h) for e, h in GOOD]), r"depot: alt_m: .* the depot is at 450 m, the ground of pylon 'p0'"),
        (third(line(GOOD), 700.0, 0.0, None, 480.0), r"pylon 'p0': elevation_m: .* third coordinate of .* is 700$"),
    ],
)  # fmt: skip
def test_heights_that_no_line_has_are_refused(network: Network, reason: str) -> None:
    with pytest.raises(NetworkError, match=reason) as caught:
        check_line_heights(with_heights(network, flat=False))
    assert "\n" not in str(caught.value)


def test_a_line_of_giants_is_flown_when_the_site_says_so() -> None:
    giants = line([(450.0, 101.0), (452.0, 105.0)])
    assert check_line_heights(giants, tallest_m=110.0) == []
    with pytest.raises(NetworkError, match=r"pylon 'p1': height_m: .* at most 104 m, got 105"):
        check_line_heights(giants, tallest_m=104.0)


def test_a_mountain_side_is_no_mistake() -> None:
    assert check_line_heights(line([(450.0, 30.0), (510.0, 30.0), (600.0, 30.0), (520.0, 30.0)])) == []


def test_a_depot_far_below_its_line_is_worth_a_look() -> None:
    [text] = check_line_heights(line([(530.0, 30.0), (535.0, 30.0)]))
    assert text.startswith("the depot is at 450 m, the ground of pylon 'p0', 100 m away, at 530 m: are both in metres")


def test_a_network_is_flat_only_if_stated() -> None:
    assert Network((Pylon("a", 49.6, 15.6), Pylon("b", 49.601, 15.6)), line_east(2).segments, FRAME).flat is False
