"""`faultline init`: a site file that can be used as it is written."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from executor.site import site_model
from executor.site.site_file import read_site
from missions import read_plan
from tests.executor.cli.test_main import Place, place
from tests.scripts.pages.test_schemas import validator

__all__ = ["place"]

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
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
    assert len(site_model.load_site_model(site, folder).network.segments) == 2
    assert '# heights = "flat"' in (folder / "site.toml").read_text()


@pytest.mark.parametrize(
    ("name", "segments"), [("nechranice_graph.yaml", 33), ("test_graph.yaml", 6)], ids=["nechranice", "test"]
)
def test_a_site_of_a_public_network_can_be_planned(place: Place, name: str, segments: int) -> None:
    if not (SHARED / name).exists():
        pytest.skip(f"the public network ../shared/data/{name} is not there")
    words = ("--depot", "50.345749,13.325244,300", "--radius", "700", "-o", place.path("new.toml"))
    code, out, _ = place.run("init", str(SHARED / name), *words)
    assert (code, f": {segments} segments, 3 vehicles; next: " in out) == (0, True)
    validator("site").validate(tomllib.loads(Path(place.path("new.toml")).read_text()))
    assert place.run("plan", place.path("new.toml"), "--seconds", "0.2", "-o", place.path("new.json"))[0] == 0
    assert len(read_plan(place.path("new.json")).segments) == segments


def test_a_site_that_is_there_is_kept(place: Place) -> None:
    before = Path(place.path("site.toml")).read_bytes()
    assert "exists already" in place.refused("init", "default", "-o", place.path("site.toml"))
    assert Path(place.path("site.toml")).read_bytes() == before


@pytest.mark.parametrize("depot", ["49.6", "north,east,up", "95,15,0", "nan,nan,nan", "49.6,15.6,450,1", ""])
def test_a_depot_that_is_none(place: Place, depot: str) -> None:
    assert "--depot: expected latitude and longitude" in place.refused("init", "default", "--depot", depot)
