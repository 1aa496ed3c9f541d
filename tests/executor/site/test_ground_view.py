"""What a site says of maps: read around the line, or refused in one line before anything else is done."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from executor.errors import SiteError
from executor.site.ground_view import BESIDE_M, MOST_PIXELS, build_ground_view, compute_shown_area
from executor.site.site_file import check_site
from executor.site.site_keys import MapTable
from missions.errors import BackgroundError
from tests.executor.grounds import Hills
from tests.missions.builders import FRAME
from tests.missions.readers.pictures import write_mbtiles, write_tiff

PLACES_M = np.array([(100.0, 0.0), (400.0, 50.0)])
LEAST = {
    "network": {"file": "default"},
    "vehicle": [{"name": "uav1", "connection": "udpin://127.0.0.1:14551", "sysid": 1, "autopilot": "px4"}],
}


def test_the_area_holds_the_depot_and_the_line_with_room_around_them() -> None:
    low_m, high_m = compute_shown_area(PLACES_M)
    assert low_m == (-400.0, -400.0)
    assert high_m == (800.0, 450.0)
    assert compute_shown_area(np.zeros((1, 2))) == ((-BESIDE_M, -BESIDE_M), (BESIDE_M, BESIDE_M))


def test_without_anything_said_nothing_lies_below(tmp_path: Path) -> None:
    for table in (None, MapTable()):
        view = build_ground_view(table, tmp_path, FRAME, PLACES_M)
        assert (view.background, view.relief, view.attribution) == (None, None, "")


def test_a_picture_and_heights_are_read_around_the_line(tmp_path: Path) -> None:
    write_tiff(tmp_path / "ortho.tif", FRAME, tags={"TIFFTAG_COPYRIGHT": "Land survey"})
    view = build_ground_view(MapTable(background="ortho.tif", contour_m=25.0), tmp_path, FRAME, PLACES_M, Hills())
    assert view.background is not None
    assert view.relief is not None
    assert view.background.pixels.size <= 4 * MOST_PIXELS
    assert (view.background.low_m, view.background.high_m) == (view.low_m, view.high_m) == compute_shown_area(PLACES_M)
    assert view.relief.interval_m == 25.0
    assert view.attribution == "Land survey"


def test_the_site_overrides_the_attribution_of_a_picture(tmp_path: Path) -> None:
    write_mbtiles(tmp_path / "area.mbtiles", FRAME, facts={"format": "png", "attribution": "somebody"})
    table = MapTable(background="area.mbtiles", attribution="© Crew")
    assert build_ground_view(table, tmp_path, FRAME, PLACES_M).attribution == "© Crew"


def test_a_picture_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BackgroundError, match=r"missing\.tif: file: expected a GeoTIFF or MBTiles; there is none$"):
        build_ground_view(MapTable(background="missing.tif"), tmp_path, FRAME, PLACES_M)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"background": ""}, "map.background: "),
        ({"background": 3}, "map.background: "),
        ({"contour_m": 0}, "map.contour_m: "),
        ({"contour_m": "fine"}, "map.contour_m: "),
        ({"tiles": "https://example.org"}, "map.tiles: "),
    ],
)
def test_what_a_site_cannot_say_of_maps(content: dict[str, object], words: str) -> None:
    with pytest.raises(SiteError) as refusal:
        check_site({**LEAST, "map": content}, "site.toml")
    assert str(refusal.value).startswith(f"site.toml: {words}")
    assert "\n" not in str(refusal.value)
