"""From cards to the index: flown by simulated vehicles, with real JPEGs, clocks that are wrong, and files that lack."""

from __future__ import annotations

import asyncio
import csv
import json
import shutil
from pathlib import Path

import pytest

from executor.cli.main import main
from executor.images.index_files import build_image_index, read_index, write_index
from executor.images.matching import find_picture_files, match_files, read_picture
from executor.simulated.simulated_fleet import SimulatedCards
from tests.stories.eyes import WIRED, Eyes
from tests.stories.story import Story

BEGAN_S = 1_790_000_000.0
LOOPTIME = pytest.mark.looptime(noop_cycles=2)


def exit_code(*arguments: str) -> str | int | None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


async def flown(folder: Path, run: Path, **made: object) -> Eyes:
    """Fly two vehicles with the same camera; their cards go to one folder, the index to a run directory."""
    sky = Eyes(Story("cards", (), fleet={"uav1": (0, 2), "uav2": (4, 6, 8)}), "ardupilot", [WIRED])
    await sky.fly()
    assert sky.flight is not None
    context = sky.flight.context
    cards = SimulatedCards(folder, BEGAN_S, **made)  # type: ignore[arg-type]
    for name, shots in sky.shots.items():
        for shot in shots:
            cards.write(name, shot)
    write_index(run, build_image_index(context, sky.state, BEGAN_S))
    return sky


@pytest.mark.asyncio
@LOOPTIME
@pytest.mark.parametrize(
    ("ahead_s", "places"),
    [
        ({"uav1": 0.0, "uav2": 0.0}, True),
        ({"uav1": 431.0, "uav2": -598.0}, True),
        ({"uav1": 7200.0 + 95.5, "uav2": -19800.0 - 300.0}, False),
    ],
    ids=["right", "minutes wrong", "other zones, no places"],
)
async def test_files_find_their_pictures(
    tmp_path: Path, ahead_s: dict[str, float], places: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, run = tmp_path / "cards", tmp_path / "run"
    run.mkdir()
    sky = await flown(folder, run, ahead_s=ahead_s, places=places)
    found = match_files(read_index(run), list(find_picture_files(folder)), folder)
    assert not found.missing
    assert not found.strange
    assert not found.doubled
    assert found.is_complete
    assert {card.name: card.key for card in found.cards} == {
        "uav1-rgb": ("uav1", "rgb"), "uav2-rgb": ("uav2", "rgb"),
    }  # fmt: skip
    for card in found.cards:
        assert card.offset is not None
        assert card.offset.ahead_s == pytest.approx(ahead_s[card.name[:4]], abs=0.6)
    for match in found.matches:
        assert int(match.file.path.stem[3:]) == match.image.sequence
        assert match.file.path.parent.name == f"{match.image.vehicle}-rgb"
    assert len(found.matches) == sum(map(len, sky.shots.values()))


@pytest.mark.asyncio
@LOOPTIME
async def test_the_command_says_what_is_missing_and_writes_places(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, run = tmp_path / "cards", tmp_path / "run"
    run.mkdir()
    await flown(folder, run, places=False)
    gone = folder / "uav1-rgb" / "DSC00003.JPG"
    gone.unlink()
    shutil.copy(folder / "uav2-rgb" / "DSC00002.JPG", folder / "uav2-rgb" / "copy.jpg")
    (folder / "uav1-rgb" / "torn.jpg").write_bytes(b"\xff\xd8\xff\xe0 no picture")

    assert (
        await asyncio.to_thread(exit_code, "images", str(folder), "--run", str(run), "--write", "exif", "--json") == 1
    )
    said = json.loads(capsys.readouterr().out)
    assert said["missing"] == [["uav1", "rgb", 3]]
    assert [Path(copy).name for _, copy in said["doubled"]] in (["copy.jpg"], ["DSC00002.JPG"])
    assert [Path(path).name for path, _ in said["unreadable"]] == ["torn.jpg"]
    assert said["placed"] == said["matched"]
    rows = {(row.vehicle, row.sequence): row for row in read_index(run).images}
    file = read_picture(folder / "uav1-rgb" / "DSC00002.JPG")
    assert file.lat_deg == pytest.approx(rows["uav1", 2].lat_deg, abs=1e-6)
    assert file.taken_s is not None  # what stood there before stays
    with (run / "images-files.csv").open() as table:
        states = {row["state"] for row in csv.DictReader(table)}
    assert {"matched", "missing"} <= states
    page = (run / "assets.html").read_text(encoding="utf-8")
    assert page.count("<section") == 5
    assert page.count("<img") == said["matched"]
    assert "no file of uav1 rgb 3" in page


@pytest.mark.asyncio
@LOOPTIME
async def test_the_report_shows_some_pictures_of_each_asset_once(tmp_path: Path) -> None:
    folder, run = tmp_path / "cards", tmp_path / "run"
    run.mkdir()
    await flown(folder, run)
    report = run / "report.html"
    report.write_text("<!DOCTYPE html>\n<html><body>\n<h1>All were inspected.</h1>\n</body>\n</html>\n")
    for _ in range(2):
        assert await asyncio.to_thread(exit_code, "images", str(folder), "--run", str(run), "--quiet") == 0
        page = report.read_text(encoding="utf-8")
        assert page.count("Pictures by asset") == 1
        assert page.count("<img") == 4 * 5
        assert page.count('<a href="assets.html#') == 5
        assert page.startswith("<!DOCTYPE html>\n<html><body>\n<h1>All were inspected.</h1>\n<!-- pictures -->")
        assert page.endswith("<!-- end of pictures -->\n</body>\n</html>\n")


@pytest.mark.asyncio
@LOOPTIME
async def test_the_index_is_a_table_a_map_and_a_database(tmp_path: Path) -> None:
    await flown(tmp_path / "cards", tmp_path)
    index = read_index(tmp_path)
    with (tmp_path / "images.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert [row["asset"] for row in rows] == [row.asset for row in index.images]
    assert rows[0]["time"].startswith("2026-09-21T")
    features = json.loads((tmp_path / "images.geojson").read_text())["features"]
    kinds = [feature["properties"]["kind"] for feature in features]
    assert (kinds.count("asset"), kinds.count("image")) == (5, len(rows))
    assert {row.state for row in index.assets} == {"seen"}


def test_a_run_without_an_index_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code("images", str(tmp_path), "--run", str(tmp_path)) == 2
    assert "images.sqlite: no such file; expected the index" in capsys.readouterr().err
