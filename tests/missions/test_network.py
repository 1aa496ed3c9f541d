"""Networks: what they derive, what they keep when a part is taken, and every reason to refuse one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from missions import Network, NetworkError, Pylon, Segment
from missions.network import part_within
from tests.missions.builders import FRAME, line_east, network_of


def test_positions_ends_and_lengths_are_local_metres() -> None:
    network = line_east(3)
    assert np.allclose(network.positions_m, [[100, 0], [200, 0], [300, 0]], atol=1e-6)
    assert np.allclose(network.ends_m, [[[100, 0], [200, 0]], [[200, 0], [300, 0]]], atol=1e-6)
    assert np.allclose(network.lengths_m, [100, 100], atol=1e-6)
    assert network.depot == (49.6, 15.6, 450.0)


def test_heights_are_known_only_if_all_are() -> None:
    places, pairs = [(0.0, 0.0), (100.0, 0.0)], [(0, 1)]
    assert network_of(places, pairs, [(450.0, 30.0), (451.0, 30.0)]).has_heights
    assert not network_of(places, pairs).has_heights
    known = network_of(places, pairs, [(450.0, 30.0), (451.0, 30.0)])
    one_missing = (known.pylons[0], replace(known.pylons[1], height_m=None))
    assert not Network(one_missing, known.segments, FRAME).has_heights


def test_a_part_is_renumbered_and_keeps_its_labels() -> None:
    network = network_of([(900, 0), (100, 0), (200, 0), (300, 0)], [(0, 3), (3, 2), (2, 1)])
    labelled = tuple(replace(segment, label=f"L{segment.id}") for segment in network.segments)
    part = Network(*part_within(network.pylons, labelled, FRAME, 500.0), FRAME)
    assert [(segment.id, segment.label) for segment in part.segments] == [(0, "L1"), (1, "L2")]
    assert [pylon.id for pylon in part.pylons] == ["p1", "p2", "p3"]
    assert np.allclose(part.ends_m[:, :, 0], [[300, 200], [200, 100]], atol=1e-6)


def test_both_pylons_must_be_nearer_than_the_radius() -> None:
    line = line_east(4)
    for radius_m, segments in ((400.1, 3), (399.9, 2), (150.0, 0)):
        assert len(part_within(line.pylons, line.segments, FRAME, radius_m)[1]) == segments


def _pylon(**changes: object) -> Pylon:
    return replace(Pylon("x", 49.601, 15.601), **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pylon", "reason"),
    [
        (_pylon(id=""), r"pylons\[1\]\.id: expected a name that is not empty"),
        (_pylon(id="p0"), r"pylon 'p0': id: expected a name that no other pylon has"),
        (_pylon(lat_deg=math.nan), r"pylon 'x': lat_deg: expected -90 to 90, got nan"),
        (_pylon(lat_deg=115.6), r"pylon 'x': lat_deg: expected -90 to 90, got 115.6; are .* swapped\?"),
        (_pylon(lon_deg=181.0), r"pylon 'x': lon_deg: expected -180 to 180, got 181.0$"),
        (_pylon(elevation_m=math.inf), r"pylon 'x': elevation_m: expected metres as a finite number, got inf"),
        (_pylon(height_m=-1.0), r"pylon 'x': height_m: expected 0 or more metres, got -1"),
        (_pylon(lat_deg=15.6, lon_deg=49.6), r"pylon 'x': position: expected within 200 km .* look swapped"),
        (_pylon(lat_deg=-49.6, lon_deg=-164.4), r"pylon 'x': position: expected within 200 km of the depot"),
        (_pylon(lat_deg=52.0), r"pylon 'x': position: expected within 200 km of the depot .* 267 km away; radius_m, "),
    ],
)
def test_a_broken_pylon_is_named(pylon: Pylon, reason: str) -> None:
    with pytest.raises(NetworkError, match=f"^line.yaml: {reason}") as caught:
        Network((Pylon("p0", 49.6, 15.6), pylon), (Segment(0, 0, 1),), FRAME, "line.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("segments", "reason"),
    [
        ((), r"segments: expected at least one, found none"),
        ((Segment(1, 0, 1),), r"segment 1: id: expected 0, its position, got 1"),
        ((Segment(0, 0, 3, "V1.1"),), r"segment V1\.1: b: expected a pylon index below 3, got 3"),
        ((Segment(0, -1, 2),), r"segment 0: a: expected a pylon index below 3, got -1"),
        ((Segment(0, 1, 1),), r"segment 0: length: expected two pylons apart, 'p1' and 'p1' are at the same place"),
        ((Segment(0, 0, 2),), r"segment 0: length: expected two pylons apart, 'p0' and 'p2' are at the same place"),
        (
            (Segment(0, 0, 1, "A"), Segment(1, 1, 0, "B")),
            r"segment B: pylons: expected a pair only once, 'p1' and 'p0' already are segment A",
        ),
    ],
)
def test_a_broken_segment_is_named(segments: tuple[Segment, ...], reason: str) -> None:
    pylons = (Pylon("p0", 49.6, 15.6), Pylon("p1", 49.601, 15.6), Pylon("p2", 49.6, 15.6))
    with pytest.raises(NetworkError, match=f"^line.yaml: {reason}"):
        Network(pylons, segments, FRAME, "line.yaml")


def test_a_network_without_pylons_is_refused() -> None:
    with pytest.raises(NetworkError, match=r"pylons: expected at least two, found none"):
        Network((), (), FRAME)
