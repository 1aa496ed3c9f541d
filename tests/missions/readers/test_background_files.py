"""Pictures of the ground lie where they belong, whatever their file; what cannot be one is said in a line."""

from __future__ import annotations

import resource
import sqlite3
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio

from missions import LocalFrame
from missions.errors import BackgroundError
from missions.readers.background_files import Background, PictureArea, read_background
from tests.missions.builders import FRAME
from tests.missions.readers.pictures import STRIPE_M, Colours, encoded, write_mbtiles, write_tiff

LOW_M, HIGH_M = (-300.0, -200.0), (350.0, 300.0)
WANTED = PictureArea(FRAME, LOW_M, HIGH_M, 250_000)


def off_m(found: Background) -> float:
    """Return how far, at most, a pixel lies from where its colour says that it belongs."""
    rows, columns = found.pixels.shape[:2]
    easts = np.linspace(found.low_m[0], found.high_m[0], 2 * columns + 1)[1::2]
    norths = np.linspace(found.high_m[1], found.low_m[1], 2 * rows + 1)[1::2]
    east_m, north_m = np.meshgrid(easts, norths)
    said = (found.pixels[..., :2].astype(np.float64) / 250.0 - 0.5) * 2.0 * STRIPE_M
    return float(max(abs(said[..., 0] - east_m).max(), abs(said[..., 1] - north_m).max()))


@pytest.mark.parametrize("crs", ["EPSG:32633", "EPSG:4326", "EPSG:3857", "EPSG:5514"])
def test_a_geotiff_of_any_reference_system_lies_where_it_belongs(crs: str, tmp_path: Path) -> None:
    """Colours are whole numbers: each stands for 3.2 m."""
    cell = {"EPSG:4326": 4e-5, "EPSG:3857": 5.0}.get(crs, 4.0)
    found = read_background(write_tiff(tmp_path / "ortho.tif", FRAME, crs=crs, cell=cell), WANTED)
    assert found.pixels[..., 3].min() == 255
    assert off_m(found) < 4.5
    assert (found.low_m, found.high_m) == (LOW_M, HIGH_M)


@pytest.mark.parametrize(("kind", "side"), [("PNG", 256), ("WEBP", 512), ("JPEG", 256)])
def test_mbtiles_lie_where_they_belong(kind: str, side: int, tmp_path: Path) -> None:
    path = write_mbtiles(tmp_path / "area.mbtiles", FRAME, kind=kind, side=side)
    found = read_background(path, WANTED)
    assert found.pixels[..., 3].min() == 255
    assert off_m(found) < (15.0 if kind == "JPEG" else 4.5)


def test_of_mbtiles_the_zoom_is_taken_that_fits(tmp_path: Path) -> None:
    """At zoom 16 a pixel has 1.5 m, at 14 it has 6 m; what is not needed is not read."""
    path = write_mbtiles(tmp_path / "area.mbtiles", FRAME, zooms=(14, 16))
    fine = read_background(path, WANTED)
    assert fine.pixels.shape[1] == pytest.approx(650 / 1.55, rel=0.05)
    coarse = read_background(path, PictureArea(FRAME, LOW_M, HIGH_M, 2_000))
    assert coarse.pixels.shape[0] * coarse.pixels.shape[1] <= 2_100
    assert off_m(coarse) < 20.0
    with sqlite3.connect(path) as database:
        database.execute("UPDATE tiles SET tile_data = x'00' WHERE zoom_level = 16")
    database.close()
    assert read_background(path, PictureArea(FRAME, (-900.0, -900.0), (900.0, 900.0), 40_000)).pixels[..., 3].any()


def test_no_finer_grid_is_made_than_the_file_has_pixels(tmp_path: Path) -> None:
    found = read_background(write_tiff(tmp_path / "ortho.tif", FRAME, cell=10.0, size=200), WANTED)
    assert found.pixels.shape[1] == pytest.approx(65, abs=2)


def test_what_a_file_does_not_know_is_transparent(tmp_path: Path) -> None:
    found = read_background(write_tiff(tmp_path / "ortho.tif", FRAME, size=100), WANTED)
    opacity = found.pixels[..., 3]
    assert opacity[opacity.shape[0] // 2, opacity.shape[1] // 2] == 255
    assert opacity[0, 0] == 0
    assert 0.05 < (opacity > 0).mean() < 0.9
    holes = write_tiff(tmp_path / "holes.tif", FRAME, nodata=0, change=_hole)
    assert read_background(holes, WANTED).pixels[..., 3].min() == 0


def _hole(made: Colours) -> Colours:
    made = made.copy()
    made[180:220, 180:220] = 0
    return made


@pytest.mark.parametrize(
    "change",
    [
        lambda made: made[..., :1],
        lambda made: np.concatenate((made, np.full((*made.shape[:2], 1), 255, np.uint8)), axis=2),
        lambda made: made.astype(np.uint16) * 40,
    ],
    ids=["grey", "with opacity", "16 bits"],
)
def test_pictures_of_other_bands_are_shown(change: Callable[[Colours], Colours], tmp_path: Path) -> None:
    found = read_background(write_tiff(tmp_path / "ortho.tif", FRAME, change=change), WANTED)
    middle = found.pixels[found.pixels.shape[0] // 2]
    assert middle[-1, 0] > middle[0, 0] + 100  # red, or grey of red, rises to the east
    assert middle[0, 3] == 255


def test_the_attribution_is_read_without_markup(tmp_path: Path) -> None:
    facts = {"format": "png", "attribution": '&copy; <a href="http://example.org">Land survey</a>\n2026'}
    assert read_background(write_mbtiles(tmp_path / "a.mbtiles", FRAME, facts=facts), WANTED).attribution == (
        "© Land survey 2026"
    )
    tiff = write_tiff(tmp_path / "a.tif", FRAME, tags={"TIFFTAG_COPYRIGHT": "ČÚZK 2025"})
    assert read_background(tiff, WANTED).attribution == "ČÚZK 2025"


def test_a_large_picture_is_read_from_its_overviews_in_little_memory(tmp_path: Path) -> None:
    """A billion pixels, of which hardly any were written: an orthophoto of a county."""
    path, size, cell = tmp_path / "county.tif", 32_000, 0.2
    frame = LocalFrame(49.6, 15.6)
    write_tiff(tmp_path / "small.tif", frame, size=10)
    with rasterio.open(tmp_path / "small.tif") as small:
        x, y = small.bounds.left, small.bounds.top
    transform = rasterio.Affine(cell, 0.0, x - cell * size / 2, 0.0, -cell, y + cell * size / 2)
    options = {"width": size, "height": size, "count": 3, "dtype": "uint8", "crs": "EPSG:32633", "tiled": True}
    with rasterio.open(
        path, "w", driver="GTiff", compress="deflate", sparse_ok=True, transform=transform, **options
    ) as dataset:
        block = rasterio.windows.Window(16_000, 16_000, 512, 512)
        dataset.write(np.full((3, 512, 512), 200, np.uint8), window=block)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = read_background(path, PictureArea(FRAME, (-3000.0, -3000.0), (3000.0, 3000.0), 1_000_000))
    more_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1000
    assert found.pixels.shape[:2] == (1000, 1000)
    assert found.pixels[..., 0].max() > 150
    assert more_mb < 400


def _text(path: Path) -> None:
    path.write_text("a picture", encoding="utf-8")


def _cut(path: Path) -> None:
    write_tiff(path, FRAME, compress="deflate")
    path.write_bytes(path.read_bytes()[:3000])


def _no_crs(path: Path) -> None:
    write_tiff(path, FRAME)
    with rasterio.open(path) as dataset:
        read, profile = dataset.read(), dataset.profile
    with rasterio.open(path, "w", **{**profile, "crs": None}) as dataset:
        dataset.write(read)


def _no_places(path: Path) -> None:
    write_tiff(path, FRAME)
    with rasterio.open(path) as dataset:
        read, profile = dataset.read(), dataset.profile
    path.unlink()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path, "w", **{**profile, "transform": rasterio.Affine.identity()}) as dataset:
            dataset.write(read)


def _heights(path: Path) -> None:
    write_tiff(path, FRAME, change=lambda made: made[..., :1].astype(np.float32))


def _many_bands(path: Path) -> None:
    write_tiff(path, FRAME, change=lambda made: np.concatenate((made, made), axis=2))


def _elsewhere(path: Path) -> None:
    write_tiff(path, LocalFrame(50.6, 15.6))


def _empty(path: Path) -> None:
    write_tiff(path, FRAME, nodata=0, change=np.zeros_like)


def _vectors(path: Path) -> None:
    write_mbtiles(path, FRAME, facts={"format": "pbf"})


def _no_tiles(path: Path) -> None:
    write_mbtiles(path, FRAME, zooms=())


def _far_tiles(path: Path) -> None:
    write_mbtiles(path, LocalFrame(40.0, 10.0))


def _damaged_tile(path: Path) -> None:
    write_mbtiles(path, FRAME, spoil=lambda data: data[: len(data) // 2])


def _no_picture(path: Path) -> None:
    write_mbtiles(path, FRAME, spoil=lambda _: b"\x1f\x8b tile")


def _oblong(path: Path) -> None:
    write_mbtiles(path, FRAME, spoil=lambda _: encoded(np.zeros((256, 300, 3), np.uint8)))


def _other_database(path: Path) -> None:
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE poles (name text)")
    database.close()


def _odd_zoom(path: Path) -> None:
    write_mbtiles(path, FRAME, zooms=(14,))
    with sqlite3.connect(path) as database:
        database.execute("UPDATE tiles SET zoom_level = 99")
    database.close()


def _text_for_a_tile(path: Path) -> None:
    write_mbtiles(path, FRAME)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE tiles SET tile_data = 'picture'")
    database.close()


def _torn_database(path: Path) -> None:
    write_mbtiles(path, FRAME)
    path.write_bytes(path.read_bytes()[:5000])


MALFORMED: dict[str, tuple[Callable[[Path], object], str]] = {
    "nothing.tif": (lambda _: None, "file: expected a GeoTIFF or MBTiles; there is none"),
    "text.tif": (_text, "content: expected a GeoTIFF or MBTiles, it begins like neither"),
    "empty-file.mbtiles": (lambda path: path.write_bytes(b""), "it begins like neither"),
    "cut.tif": (_cut, "content: expected a whole GeoTIFF"),
    "no-crs.tif": (_no_crs, "crs: expected a coordinate reference system in the file, found none"),
    "no-places.tif": (_no_places, "transform: expected where its pixels lie"),
    "heights.tif": (_heights, "band 1: expected a picture of 8 or 16 bits, got float32: is it a raster of heights?"),
    "many-bands.tif": (_many_bands, "bands: expected one of grey, or three of colours, got 6"),
    "elsewhere.tif": (_elsewhere, "area: expected a picture of the line's surroundings, it lies elsewhere"),
    "empty.tif": (_empty, "area: expected a picture of the line's surroundings, it shows none of them"),
    "vectors.mbtiles": (_vectors, "content: expected a whole MBTiles of pictures (png, jpg or webp)"),
    "no-tiles.mbtiles": (_no_tiles, "tiles: expected zoom levels from 0 to 24, found none"),
    "odd-zoom.mbtiles": (_odd_zoom, "tiles: expected zoom levels from 0 to 24, found none"),
    "far.mbtiles": (_far_tiles, "area: expected a picture of the line's surroundings, it lies elsewhere"),
    "damaged.mbtiles": (_damaged_tile, "area: expected a picture of the line's surroundings, it shows none of them"),
    "no-picture.mbtiles": (_no_picture, "it shows none of them: empty, or damaged"),
    "text-for-a-tile.mbtiles": (_text_for_a_tile, "it shows none of them: empty, or damaged"),
    "oblong.mbtiles": (_oblong, "it shows none of them: empty, or damaged"),
    "other.mbtiles": (_other_database, "content: expected MBTiles: no such table: tiles"),
    "torn.mbtiles": (_torn_database, "content: expected MBTiles"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_what_is_no_background_is_reported_in_one_line_that_names_the_file(name: str, tmp_path: Path) -> None:
    write, words = MALFORMED[name]
    write(tmp_path / name)
    with pytest.raises(BackgroundError) as refusal:
        read_background(tmp_path / name, WANTED)
    text = str(refusal.value)
    assert text.startswith(f"{tmp_path / name}: ")
    assert words in text
    assert "\n" not in text
    assert len(text) < 400
