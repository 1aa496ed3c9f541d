"""Graph files: what is read, and one line with file, place and expectation for what is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from missions import NetworkError, read_network

DEPOT = (50.345749, 13.325244, 300.0)
NECHRANICE = Path(__file__).resolve().parents[4] / "shared" / "data" / "nechranice_graph.yaml"
needs_nechranice = pytest.mark.skipif(
    not NECHRANICE.exists(), reason="the public network ../shared/data/nechranice_graph.yaml is not there"
)
GRAPH = """
regular_land_stations: "0 0 0;"
pylons_position: "100 0 0;
200 0 0;
200 150 0;"
connections_indexes: "2;
1 3;
2;"
"""


def graph_file(tmp_path: Path, text: str = GRAPH) -> Path:
    path = tmp_path / "line.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_graph_file_holds_metres_east_and_north(tmp_path: Path) -> None:
    network = read_network(graph_file(tmp_path), depot=DEPOT)
    assert [(segment.a, segment.b, segment.label) for segment in network.segments] == [(0, 1, "1-2"), (1, 2, "2-3")]
    assert np.allclose(network.positions_m, [[100, 0], [200, 0], [200, 150]], atol=1e-6)
    assert not network.has_heights
    assert network.pylons[0].elevation_m is None


def test_an_edge_listed_from_one_end_only_is_one_segment(tmp_path: Path) -> None:
    text = GRAPH.replace('"2;\n1 3;\n2;"', '"2;\n3;\n2;"')
    assert len(read_network(graph_file(tmp_path, text), depot=DEPOT).segments) == 2


def test_other_libconfig_spellings_are_read(tmp_path: Path) -> None:
    text = 'pylons_position = "0 10 0; " "50 10 0";\nconnections_indexes = "2;1";\n'
    assert read_network(graph_file(tmp_path, text), depot=DEPOT).lengths_m == pytest.approx([50.0])


def test_heights_of_a_graph_file_are_ground_over_the_depot(tmp_path: Path) -> None:
    network = read_network(graph_file(tmp_path, GRAPH.replace("200 150 0", "200 150 12.5")), depot=DEPOT)
    assert [pylon.elevation_m for pylon in network.pylons] == [300.0, 300.0, 312.5]


def test_offsets_in_a_grid_are_turned_by_its_convergence(tmp_path: Path) -> None:
    network = read_network(graph_file(tmp_path), depot=DEPOT, crs="EPSG:32633")
    east, north = network.positions_m[1]
    assert np.degrees(np.arctan2(north, east)) == pytest.approx(1.29, abs=0.01)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda t: t.replace("pylons_position", "pylons"), r"content: expected GeoJSON, or a graph file"),
        (lambda t: t.replace("connections_indexes", "neighbours"), r"connections_indexes: expected a string in quotes"),
        (
            lambda t: t.replace("200 0 0", "200 0"),
            r"pylons_position, row 2: expected three numbers 'x y z', got '200 0'",
        ),
        (lambda t: t.replace("200 0 0", "200 zero 0"), r"pylons_position, row 2: expected three numbers"),
        (lambda t: t.replace("200 0 0", "200 nan 0"), r"pylons_position, row 2: expected finite numbers"),
        (
            lambda t: t.replace("1 3;", "1 4;"),
            r"connections_indexes, row 2: expected pylon numbers from 1 to 3, got '4'",
        ),
        (
            lambda t: t.replace("1 3;", "1 x;"),
            r"connections_indexes, row 2: expected pylon numbers from 1 to 3, got 'x'",
        ),
        (lambda t: t.replace("1 3;", "2;"), r"connections_indexes, row 2: expected other pylons' numbers, got its own"),
        (lambda t: t.replace("1 3;\n", ""), r"connections_indexes: expected 3 rows, one a pylon, found 2"),
        (lambda t: t.replace("100 0 0;\n200 0 0;\n200 150 0;", ""), r"pylons_position: expected at least two rows"),
        (lambda t: t.replace("200 150 0", "200 0 0"), r"segment 2-3: length: expected two pylons apart"),
        (lambda t: t.replace("200 150 0", "250000 0 0"), r"pylon '3': position: expected within 200 km"),
    ],
)
def test_a_broken_graph_file_is_named(tmp_path: Path, change: Callable[[str], str], reason: str) -> None:
    path = graph_file(tmp_path, change(GRAPH))
    with pytest.raises(NetworkError, match=reason) as caught:
        read_network(path, depot=DEPOT)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_graph_file_needs_a_depot(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"line\.yaml: depot: expected lat_deg, lon_deg and alt_m"):
        read_network(graph_file(tmp_path))


def test_a_depot_at_a_pole_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"line\.yaml: depot: latitude 90.0 is out of range"):
        read_network(graph_file(tmp_path), depot=(90.0, 0.0, 0.0))


def test_an_unknown_grid_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"line\.yaml: crs: unknown coordinate reference system 'EPSG:1'"):
        read_network(graph_file(tmp_path), depot=DEPOT, crs="EPSG:1")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(NetworkError, match=r"none\.yaml: file: expected a readable network file: No such file"):
        read_network(tmp_path / "none.yaml", depot=DEPOT)


def test_a_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    path = tmp_path / "line.yaml"
    path.write_bytes(b"pylons_position \xff")
    with pytest.raises(NetworkError, match=r"line\.yaml: encoding: expected UTF-8 text, found other bytes at 16"):
        read_network(path, depot=DEPOT)


@needs_nechranice
@pytest.mark.parametrize(
    ("radius_m", "segments", "length_m"),
    [(500, 18, 3545.97), (700, 33, 7473.64), (1000, 48, 11402.45), (1200, 56, 14160.90), (2000, 81, 22341.07)],
)
def test_the_public_network_has_the_published_sizes(radius_m: float, segments: int, length_m: float) -> None:
    network = read_network(NECHRANICE, depot=DEPOT, radius_m=radius_m)
    assert len(network.segments) == segments
    assert network.lengths_m.sum() == pytest.approx(length_m, abs=0.01)


@needs_nechranice
def test_the_whole_public_network_is_read() -> None:
    network = read_network(NECHRANICE, depot=DEPOT)
    assert (len(network.pylons), len(network.segments)) == (1703, 1693)


def test_a_graph_file_is_flat_unless_its_z_say_otherwise(tmp_path: Path) -> None:
    assert read_network(graph_file(tmp_path), depot=DEPOT).flat
    assert read_network(graph_file(tmp_path), depot=DEPOT, radius_m=220.0).flat
    assert not read_network(graph_file(tmp_path, GRAPH.replace("200 150 0", "200 150 12.5")), depot=DEPOT).flat
