from __future__ import annotations

import asyncio
import json
import shutil
import socket
from collections.abc import AsyncIterator, Iterator, Mapping
from pathlib import Path
from typing import Any

import httpx
import pytest

from executor.adapters.web.guard import cookie_name_for
from executor.plan_page import site_files
from executor.plan_page.site_store import SiteStore
from tests.executor.plan_page.opened import Opened, make_demo_site, opened
from tests.patience import PATIENCE_S

TOKEN = "field-laptop-42-of-north"  # noqa: S105 - shown to the server of these tests alone
SCRIPT = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A page over a part of the network that comes with faultline."""
    root = tmp_path_factory.mktemp("demo")
    with opened(root, make_demo_site(root)) as one:
        yield one


def test_a_site_is_understood(demo: Opened) -> None:
    workspace = demo.checked()
    assert workspace["problems"] == []
    assert (workspace["site"]["path"], workspace["saved"], workspace["save_error"]) == ("site.toml", True, None)
    assert [one["name"] for one in workspace["values"]["vehicle"]] == ["uav1", "uav2", "uav3"]
    network, ground = demo.get("/api/network"), demo.get("/api/ground")
    assert network["digest"] == workspace["network"]["digest"]
    assert len(network["segments"]) == workspace["network"]["segments"] > 10
    first = network["segments"][0]
    assert (first["name"], first["left_out"], first["unreachable"]) == ("V101.1", False, None)
    assert [one["vehicle"] for one in ground["pads"]] == ["uav1", "uav2", "uav3"]
    assert ground["depot"] == [49.5985, 15.6137]
    assert demo.get("/api/background")["format"] == "faultline-ground/1"


def test_edits_are_in_the_file_and_undone_there(demo: Opened) -> None:
    path = demo.root / "site.toml"
    before = path.read_text()
    edited = demo.set("inspection", "height_m", value=17)
    assert "height_m = 17 " in path.read_text()
    assert edited["values"]["inspection"]["height_m"] == 17
    assert (edited["undo"], edited["redo"]) == ("edit", None)
    undone = demo.post("/api/undo", revision=edited["revision"])
    assert (path.read_text(), undone["undo"], undone["redo"]) == (before, None, "edit")
    again = demo.post("/api/redo", revision=undone["revision"])
    assert "height_m = 17 " in path.read_text()
    demo.post("/api/undo", revision=again["revision"])


def test_an_outdated_tab_is_informed_and_gets_the_newest(demo: Opened) -> None:
    stale = demo.get("/api/workspace")["revision"]
    newest = demo.set("inspection", "height_m", value=18)
    refused = demo.post("/api/edits", 409, revision=stale, edits=[{"op": "unset", "path": ["inspection"]}])
    assert refused["error"].startswith("the site was changed elsewhere")
    assert refused["workspace"]["revision"] == newest["revision"]
    demo.post("/api/undo", 409, revision=stale)
    demo.post("/api/undo", revision=newest["revision"])


def test_what_is_wrong_is_reported_at_its_key_in_the_words_of_the_command_line(demo: Opened) -> None:
    wrong = demo.edit(
        {"op": "set", "path": ["vehicle", 0, "budget_pct"], "value": 175},
        {"op": "set", "path": ["vehicle", 1, "sysid"], "value": "two"},
        {"op": "add", "path": ["area"], "value": {"name": SCRIPT, "polygon": [[49.6, 15.6], [49.7, 15.7]]}},
    )
    assert {json.dumps(one["path"]): one["message"] for one in wrong["problems"]} == {
        '["vehicle", 0, "budget_pct"]': "expected less than or equal to 100, got 175",
        '["vehicle", 1, "sysid"]': "expected a whole number, got 'two'",
        '["area", 0, "polygon"]': "expected at least 3 items after validation, not 2, got [[49.6, 15.6], [49.7, 15.7]]",
    }
    assert demo.checked()["network"] is not None
    assert demo.get("/api/ground")["areas"][0]["name"] == SCRIPT
    undone = demo.post("/api/undo", revision=wrong["revision"])
    gone = demo.edit({"op": "set", "path": ["terrain", "files"], "value": "gone.tif"})
    [problem] = demo.checked()["problems"]
    assert problem["path"] == ["terrain", "files"]
    assert "gone.tif: file: expected a raster of heights" in problem["message"]
    assert demo.post("/api/undo", revision=gone["revision"])["values"] == undone["values"]


def test_areas_places_and_footprints_are_where_they_are(demo: Opened) -> None:
    ring = [[49.6100, 15.6000], [49.6110, 15.6000], [49.6110, 15.6020]]
    camera = {"name": "zoom", "focal_mm": 10.0, "sensor_mm": [12.0, 8.0]}
    edited = demo.edit(
        {"op": "add", "path": ["area"], "value": {"name": "mast", "polygon": ring, "margin_m": 12}},
        {
            "op": "add",
            "path": ["place"],
            "value": {"name": "P", "lat_deg": 49.6, "lon_deg": 15.62, "kind": "alternate"},
        },
        {"op": "add", "path": ["camera"], "value": camera},
        {"op": "add", "path": ["look"], "value": {"camera": "zoom", "every_m": 8.0}},
    )
    assert demo.checked()["problems"] == []
    ground = demo.get("/api/ground")
    [area], [place] = ground["areas"], ground["alternates"]
    assert (area["index"], area["kind"], area["margin_m"], area["from_file"]) == (0, "no-fly", 12.0, False)
    assert area["rings"][0] == [[pytest.approx(one, abs=1e-6) for one in corner] for corner in ring]
    assert place["place"] == [49.6, 15.62]
    assert {one["camera"] for one in ground["footprints"]} == {"zoom"}
    demo.post("/api/undo", revision=edited["revision"])
    demo.checked()


def test_the_schema_says_what_each_key_means(demo: Opened) -> None:
    schema = demo.get("/api/schema")
    budget = schema["$defs"]["VehicleTable"]["properties"]["budget_pct"]
    assert (budget["default"], budget["unit"]) == (75.0, "%")
    assert budget["description"] == "Most of a full battery that a route may use."


def test_what_another_program_writes_is_shown(demo: Opened) -> None:
    path = demo.root / "site.toml"
    before, revision = path.read_text(), demo.checked()["revision"]
    path.write_text(before + "# by hand\n")
    demo.post("/api/undo", 409, revision=revision)
    workspace = demo.get("/api/workspace")
    assert workspace["site"]["text"].endswith("# by hand\n")
    assert workspace["undo"] == "a change in another program"
    demo.post("/api/undo", revision=workspace["revision"])
    assert path.read_text() == before


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"revision": 1, "edits": []}, "edits: "),
        ({"revision": 1, "edits": [{"op": "delete", "path": ["a"]}]}, "edits.0.op: "),
        ({"revision": 1, "edits": [{"op": "set", "path": ["a"] * 20}]}, "edits.0.path: "),
        ({"revision": 1, "edits": [{"op": "set", "path": [-1]}]}, "edits.0.path.0"),
        ({"edits": [{"op": "set", "path": ["a"]}]}, "revision: "),
        (["no object"], ""),
    ],
)
def test_what_is_no_edit_is_refused_in_one_line(demo: Opened, body: Any, words: str) -> None:
    answer = demo.client.post("/api/edits", json=body)
    assert answer.status_code == 422
    assert answer.json()["error"].startswith(words)
    assert "\n" not in answer.json()["error"]


def test_an_edit_that_cannot_be_done_names_its_key(demo: Opened) -> None:
    refused = demo.set("vehicle", 9, "sysid", value=1, status=422)
    assert refused == {"error": "vehicle[9]: there is no such key or value in the file", "path": ["vehicle", 9]}


def test_no_file_outside_of_the_folder_is_opened(tmp_path: Path) -> None:
    root = tmp_path / "root"
    root.mkdir()
    make_demo_site(tmp_path)
    (root / "link.toml").symlink_to(tmp_path / "site.toml")
    with opened(root, make_demo_site(root)) as one:
        before = one.get("/api/workspace")["site"]
        for path in (
            "../site.toml", "/etc/passwd", "..%2fsite.toml", ".faultline/site.toml/edits.jsonl", "link.toml", "a\0b",
            "gone.kml", "../root/../site.toml", str(tmp_path / "site.toml"),
        ):  # fmt: skip
            assert one.open(path, 422)["error"].startswith("path: expected a file")
        assert one.get("/api/workspace")["site"] == before


def test_no_upload_leaves_the_folder(tmp_path: Path) -> None:
    with opened(tmp_path, None) as one:
        for name in ("../x.kml", "a/b.kml", ".hidden.kml", "", "site.toml", "a\\b.kml", "x" * 150, "a\nb"):
            answer = one.client.post("/api/upload", params={"name": name}, content=b"<kml/>")
            assert (answer.status_code, answer.json()["error"][:5]) == (422, "name:")
    assert list(tmp_path.iterdir()) == []


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{pylons}
<Placemark><name>{name}</name><LineString><coordinates>15.6,49.6 15.601,49.6 15.602,49.6</coordinates></LineString>
</Placemark></Document></kml>"""


def test_a_network_that_is_dropped_begins_a_site_and_scripts_in_its_names_stay_text(tmp_path: Path) -> None:
    name = SCRIPT.replace("<", "&lt;")
    pylons = "".join(
        f"<Placemark><name>{name}{at}</name><Point><coordinates>15.60{at},49.6</coordinates></Point></Placemark>"
        for at in range(3)
    )
    with opened(tmp_path, None) as one:
        assert one.get("/api/workspace")["site"] is None
        assert one.set("a", value=1, status=422)["error"] == "expected a site; none is open"
        content = KML.format(pylons=pylons, name=name).encode()
        answer = one.client.post("/api/upload", params={"name": "line.kml"}, content=content).json()
        assert (answer["uploaded"], answer["site"]["path"]) == ("line.kml", "site.toml")
        workspace = one.checked()
        [problem] = workspace["problems"]
        assert problem["path"] == ["depot"]
        assert problem["message"].startswith("line.kml: depot: expected where the vehicles stand")
        assert workspace["network"]["segments"] == 2
        network = one.client.get("/api/network")
        assert network.headers["content-type"] == "application/json"
        assert network.headers["x-content-type-options"] == "nosniff"
        assert SCRIPT in network.json()["pylons"][0]["name"]
        assert one.get("/api/ground")["depot"] is None, "nobody has said where it is"
        one.edit({"op": "set", "path": ["depot"], "value": {"lat_deg": 49.6, "lon_deg": 15.6, "alt_m": 400}})
        again = one.client.post("/api/upload", params={"name": "line.kml"}, content=content).json()
        assert (again["uploaded"], again["site"]["path"]) == ("line-2.kml", "line-2.toml")
        kept = one.client.post("/api/upload", params={"name": "areas.geojson", "use": "file"}, content=b"{}").json()
        assert (kept["uploaded"], kept["site"]["path"]) == ("areas.geojson", "line-2.toml")
        assert {one["path"] for one in one.get("/api/files")["files"]} == {
            "areas.geojson", "line.kml", "line-2.kml", "line-2.toml", "site.toml"
        }  # fmt: skip


def test_a_file_that_is_no_network_is_refused_and_not_kept(tmp_path: Path) -> None:
    with opened(tmp_path, None) as one:
        answer = one.client.post("/api/upload", params={"name": "line.kml"}, content=b"<html>")
        assert answer.status_code == 422
        assert "line.kml" in answer.json()["error"]
    assert list(tmp_path.iterdir()) == []


def test_a_network_of_a_hundred_megabytes_is_taken_and_a_larger_one_is_not(tmp_path: Path) -> None:
    def send(count: int) -> Iterator[bytes]:
        for _ in range(count):
            yield b" " * 1_000_000

    with opened(tmp_path, None) as one:
        named, length = {"name": "ground.tif", "use": "file"}, {"content-length": str(site_files.MOST_UPLOAD)}
        answer = one.client.post("/api/upload", params=named, content=send(100), headers=length)
        assert answer.status_code == 200
        assert (tmp_path / "ground.tif").stat().st_size == site_files.MOST_UPLOAD
        head = (
            f"POST /api/upload?name=x.tif HTTP/1.1\r\nhost: localhost\r\ncontent-length: {site_files.MOST_UPLOAD + 1}"
        )
        with socket.create_connection(("127.0.0.1", one.port), PATIENCE_S) as too_long:
            too_long.sendall(f"{head}\r\n\r\n".encode())
            said = too_long.recv(4096)
        assert said.startswith(b"HTTP/1.1 413")
    assert [one.name for one in tmp_path.iterdir()] == ["ground.tif"]


def test_what_a_killed_server_had_not_received_whole_is_removed_at_the_next_start(tmp_path: Path) -> None:
    async def receive(folder: Path) -> list[str]:
        """Begin an upload, look, and end as if nothing had come to an end."""

        async def content() -> AsyncIterator[bytes]:
            yield b"half"
            site_files.remove_drafts(folder)  # another server starts, and leaves it alone
            yield b"whole"

        path = await site_files.receive_file(folder, "line.kml", content())
        return [path.read_text()]

    assert asyncio.run(receive(tmp_path)) == ["halfwhole"]
    left = tmp_path / f".line.kml{site_files.DRAFT}"
    left.write_bytes(b"half")
    (tmp_path / "film.mkv.part").write_bytes(b"somebody else's")
    with opened(tmp_path, None):
        assert {one.name for one in tmp_path.iterdir()} == {"line.kml", "film.mkv.part"}


def test_a_plan_opens_the_site_next_to_it_and_a_site_another_one(tmp_path: Path) -> None:
    make_demo_site(tmp_path)
    (tmp_path / "plan.json").write_text('{"format": "faultline-plan/2"}')
    shutil.copy(tmp_path / "site.toml", tmp_path / "other.toml")
    with opened(tmp_path, None) as one:
        assert one.open("plan.json")["site"]["path"] == "site.toml"
        assert one.open("other.toml")["site"]["path"] == "other.toml"
        assert one.open("default")["site"]["path"] == "site-2.toml"
    with SiteStore(tmp_path / "site.toml"):
        pass


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"origin": "https://evil.example"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"origin": "null"}, 403),
        ({"host": "evil.example"}, 421),
        ({"content-type": "text/plain"}, 422),
    ],
)
def test_no_other_page_edits_a_site(demo: Opened, headers: Mapping[str, str], status: int) -> None:
    before = demo.get("/api/workspace")
    body = json.dumps({"revision": before["revision"], "edits": [{"op": "unset", "path": ["inspection"]}]})
    answer = demo.client.post("/api/edits", content=body, headers={"content-type": "application/json", **headers})
    assert answer.status_code == status
    assert answer.json()["error"]
    assert demo.get("/api/workspace")["revision"] == before["revision"]


def test_without_the_token_nothing_is_shown(tmp_path: Path) -> None:
    with opened(tmp_path, None, TOKEN) as one:
        for path in ("/", "/api/workspace", "/api/events", "/api/openapi.json", "/files/page.js"):
            assert one.client.get(path).status_code == 401
        assert one.client.post("/api/open", json={"path": "default"}).status_code == 401
        assert one.client.get(f"/?token={TOKEN}", follow_redirects=False).status_code == 303
        assert cookie_name_for(TOKEN) in one.client.cookies
        assert one.client.get("/api/workspace").status_code == 200
    assert list(tmp_path.iterdir()) == []


def test_a_report_is_shown_under_rules_of_its_own(demo: Opened) -> None:
    run = demo.root / "runs" / "20260101-080000"
    run.mkdir(parents=True)
    (run / "events.jsonl").touch()

    def fetch() -> httpx.Response:
        return demo.client.get("/api/report", params={"run": "runs/20260101-080000"})

    assert fetch().status_code == 404
    (run / "report.html").write_text("<style>p {}</style><p>flown</p><script>fetch('/api/undo')</script>")
    answer = fetch()
    assert "<p>flown</p>" in answer.text
    policy = answer.headers["content-security-policy"]
    assert "script-src" not in policy
    assert policy.startswith("sandbox allow-scripts; default-src 'none'; style-src 'unsafe-inline'")
    assert answer.headers["x-content-type-options"] == "nosniff"
    digest = f"sha256-{'A' * 43}="
    (run / "report.html").write_text(f"<meta content=\"default-src 'none'; script-src '{digest}'\"><p>flown</p>")
    assert fetch().headers["content-security-policy"] == f"{policy}; script-src '{digest}'"
    assert "script-src 'self'" in demo.client.get("/api/workspace").headers["content-security-policy"]
    assert demo.client.get("/api/report", params={"run": "../runs"}).status_code == 422


def test_a_second_tab_is_counted(demo: Opened) -> None:
    with demo.client.stream("GET", "/api/events") as first:
        lines = first.iter_lines()
        next(lines)
        assert demo.follow("tabs", 2)
    demo.follow("tabs", 1)


def test_the_api_says_what_there_is(demo: Opened) -> None:
    paths = demo.get("/api/openapi.json")["paths"]
    assert {"/api/workspace", "/api/edits", "/api/upload"} <= set(paths)
    assert all(
        method.get("summary") and method.get("description") for path in paths.values() for method in path.values()
    )
