"""`faultline init`: a site file that can be used as it is written."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from executor.site import assembly
from executor.site.config import read_site
from tests.executor.cli.test_main import Place, place

__all__ = ["place"]

GRAPH = 'pylons_position = "0 0 0; 100 0 0; 200 0 0;"\nconnections_indexes = "2; 1 3; 2;"\n'


def test_a_site_to_begin_with_can_be_planned(place: Place) -> None:
    site = Path(place.path("new.toml"))
    code, out, _ = place.run("init", "default", "--radius", "500", "--vehicles", "2", "-o", str(site))
    assert (code, out) == (0, f"{site}: 21 segments, 2 vehicles; next: faultline plan {site}\n")
    assert [table.name for table in read_site(site).vehicle] == ["uav1", "uav2"]
    assert place.run("plan", str(site), "--seconds", "0.2")[0] == 0


def test_without_a_name_it_is_printed(place: Place) -> None:
    code, out, err = place.run("init", "default")
    assert (code, err) == (0, "")
    assert tomllib.loads(out)["network"] == {"file": "default"}
    assert '# heights = "flat"' not in out
    assert max(map(len, out.splitlines())) <= 120


def test_a_graph_file_needs_a_depot(place: Place) -> None:
    graph, folder = Path(place.path("line.graph")), Path(place.path("sites"))
    graph.write_text(GRAPH)
    folder.mkdir()
    reason = place.refused("init", str(graph), "-o", str(folder / "site.toml"))
    assert "depot: expected lat_deg, lon_deg and alt_m" in reason
    assert reason.endswith("--depot LAT,LON,ALT says where it is")
    place.run("init", str(graph), "--depot", "49.6,15.6,450", "-o", str(folder / "site.toml"))
    site = read_site(folder / "site.toml")
    assert site.network.file == "../line.graph"
    assert len(assembly.ground_of(site, folder).network.segments) == 2
    assert '# heights = "flat"' in (folder / "site.toml").read_text()


def test_a_site_that_is_there_is_kept(place: Place) -> None:
    before = Path(place.path("site.toml")).read_bytes()
    assert "exists already" in place.refused("init", "default", "-o", place.path("site.toml"))
    assert Path(place.path("site.toml")).read_bytes() == before


@pytest.mark.parametrize("depot", ["49.6", "north,east,up", "95,15,0", "nan,nan,nan", "49.6,15.6,450,1", ""])
def test_a_depot_that_is_none(place: Place, depot: str) -> None:
    assert "--depot: expected latitude and longitude" in place.refused("init", "default", "--depot", depot)
