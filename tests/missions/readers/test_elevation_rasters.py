"""Rasters of heights: what is read of them, what is refused in one line, and what a run keeps."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyproj.datadir
import pytest
import rasterio
from affine import Affine

from missions.errors import ElevationError
from missions.geo import FloatArray, LocalFrame
from missions.readers.elevation_rasters import (
    RasterOptions,
    locate_cells,
    read_elevation,
    read_kept_ground,
    write_kept_ground,
)
from missions.terrain import Elevation
from tests.mountains import LAT_DEG, LON_DEG, Mountain, write_raster

FRAME = LocalFrame(LAT_DEG, LON_DEG, 900.0)
SMOOTH = Mountain(gorge_m=0.0, step_m=0.0, relief_m=60.0)
AREA = ((-1500.0, -1500.0), (1500.0, 1500.0))


def reading(vertical: str = "egm96", uncertainty_m: float | None = 4.0) -> RasterOptions:
    return RasterOptions(FRAME, *AREA, vertical, uncertainty_m)


def places_m(count: int = 500) -> FloatArray:
    return np.random.default_rng(2).uniform(-1400, 1400, (count, 2))


def off_m(found: Elevation) -> float:
    places = places_m()
    return float(np.abs(found.interpolate_m(places) - SMOOTH.at_m(places[:, 0], places[:, 1])).max())


@pytest.mark.parametrize(("crs", "cell"), [("EPSG:4326", 1 / 3600), ("EPSG:32632", 30.0), ("EPSG:31254", 25.0),
                                           ("EPSG:3857", 40.0), ("EPSG:32633", 20.0)])  # fmt: skip
def test_places_are_found_in_every_reference_system(crs: str, cell: float, tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH, crs=crs, cell=cell)
    found = read_elevation([path], reading())
    assert off_m(found) < 4.0
    places = places_m()
    truth = SMOOTH.at_m(places[:, 0], places[:, 1])
    assert (found.highest_m(places) - truth).min() > -2.0
    assert (truth - found.lowest_m(places)).min() > -2.0


def test_only_the_area_is_read(tmp_path: Path) -> None:
    path = write_raster(
        tmp_path / "ground.tif", SMOOTH, crs="EPSG:32632", cell=10.0, bounds_m=(-6000, -6000, 6000, 6000)
    )
    (tile,) = read_elevation([path], reading()).tiles
    # 3 km of 12, with a lattice of a kilometre around it.
    assert max(tile.heights_m.shape) < 560


def test_a_raster_is_read_again_only_when_it_or_the_area_is_another_one(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH)
    first = read_elevation([path], reading())
    assert read_elevation([path], reading()) is first
    assert read_elevation([path], reading(uncertainty_m=9.0)).uncertainty_m == 9.0
    before = path.stat()
    write_raster(path, Mountain(gorge_m=0.0, step_m=0.0, relief_m=90.0))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + 1))
    assert read_elevation([path], reading()).digest != first.digest


def test_small_cells_are_combined_and_the_highest_kept(tmp_path: Path) -> None:
    spike = 30.0

    class Spiked(Mountain):
        def at_m(self, east_m: FloatArray, north_m: FloatArray) -> FloatArray:
            near = np.hypot(np.asarray(east_m) - 100.0, np.asarray(north_m) - 50.0) < 1.5
            return super().at_m(east_m, north_m) + spike * near

    path = write_raster(tmp_path / "lidar.tif", Spiked(gorge_m=0, step_m=0), crs="EPSG:32632", cell=1.0,
                        bounds_m=(-300, -300, 300, 300))  # fmt: skip
    found = read_elevation([path], RasterOptions(FRAME, (-200, -200), (200, 200), "egm96", 0.5))
    assert found.cell_m == pytest.approx(5.0, rel=0.01)
    at = np.array([[100.0, 50.0]])
    truth = Mountain(gorge_m=0, step_m=0).at_m(at[:, 0], at[:, 1])[0]
    assert found.highest_m(at)[0] > truth + spike - 1.0
    assert found.interpolate_m(at)[0] < truth + 0.6 * spike


def test_several_tiles_are_one_ground_without_a_seam(tmp_path: Path) -> None:
    west = write_raster(tmp_path / "a.tif", SMOOTH, bounds_m=(-4000, -4000, 0, 4000))
    east = write_raster(tmp_path / "b.tif", SMOOTH, bounds_m=(0, -4000, 4000, 4000))
    found = read_elevation([tmp_path], reading())
    assert len(found.tiles) == 2
    assert found.source == "2 rasters"
    assert off_m(found) < 4.0
    seam = np.column_stack((np.linspace(-60, 60, 241), np.zeros(241)))
    truth = SMOOTH.at_m(seam[:, 0], seam[:, 1])
    assert not np.isnan(found.interpolate_m(seam)).any()
    assert (found.highest_m(seam) - truth).min() > -1.0
    assert west != east


def test_a_finer_raster_goes_first_and_a_coarser_one_fills_its_holes(tmp_path: Path) -> None:
    write_raster(tmp_path / "coarse.tif", SMOOTH, crs="EPSG:32632", cell=60.0)
    write_raster(tmp_path / "fine.tif", SMOOTH, crs="EPSG:32632", cell=10.0, holes_m=((0.0, 0.0, 200.0),))
    found = read_elevation([tmp_path], reading())
    assert [round(tile.cell_m) for tile in found.tiles] == [10, 60]
    assert not np.isnan(found.interpolate_m(np.zeros((1, 2)))).any()


def test_a_hole_is_not_known(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH, holes_m=((300.0, -200.0, 120.0),))
    found = read_elevation([path], reading())
    at = np.array([[300.0, -200.0], [-800.0, 500.0]])
    assert np.isnan(found.interpolate_m(at)).tolist() == [True, False]
    assert np.isnan(found.highest_m(at)).tolist() == [True, False]


def hgt(path: Path, hole: bool = False) -> Path:
    """Write a tile of SRTM, 3 seconds of arc: 1201 rows of 1201 big-endian numbers, from the north-west."""
    about = pyproj.Proj(proj="aeqd", lat_0=LAT_DEG, lon_0=LON_DEG, ellps="WGS84")
    lon, lat = np.meshgrid(10.0 + np.arange(1201) / 1200, 47.0 - np.arange(1201) / 1200)
    east, north = about(lon, lat)
    heights = np.round(SMOOTH.at_m(np.asarray(east), np.asarray(north)))
    if hole:
        heights[np.hypot(np.asarray(east), np.asarray(north)) < 300.0] = -32768
    path.write_bytes(heights.astype(">i2").tobytes())
    return path


def test_srtm_tiles_are_known_by_their_names(tmp_path: Path) -> None:
    found = read_elevation([hgt(tmp_path / "N46E010.hgt")], reading("file", None))
    assert (found.vertical, found.uncertainty_m) == ("EGM96", 16.0)
    assert off_m(found) < 25.0
    assert np.median(np.abs(found.interpolate_m(places_m()) - SMOOTH.at_m(*places_m().T))) < 2.0


def test_the_void_of_srtm_is_not_known(tmp_path: Path) -> None:
    found = read_elevation([hgt(tmp_path / "N46E010.hgt", hole=True)], reading("file", None))
    assert np.isnan(found.interpolate_m(np.zeros((1, 2)))).all()


def test_glo30_is_known_by_its_name_and_its_geoid_costs_a_metre(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "Copernicus_DSM_COG_10_N46_00_E010_00_DEM.tif", SMOOTH)
    found = read_elevation([path], reading("file", None))
    assert (found.vertical, found.uncertainty_m) == ("EGM2008", 5.0)
    assert found.remarks == ("EGM2008 and the vehicles' sea level (EGM96) are taken for one: 1 m more uncertain",)


def test_a_file_says_itself_what_its_heights_are_counted_from(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH, crs="EPSG:32632+5773", cell=30.0)
    found = read_elevation([path], reading("file", 3.0))
    assert (found.vertical, found.uncertainty_m) == ("EGM96", 3.0)


def test_feet_are_metres(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH)
    with rasterio.open(path, "r+") as dataset:
        dataset.write(dataset.read(1) / np.float32(0.3048), 1)
        dataset.units = ("ft",)
    assert off_m(read_elevation([path], reading())) < 4.0


def geoid(path: Path, undulation_m: float) -> None:
    """Write a geoid of one height, in the format of NOAA: south, west, steps, rows, columns, then numbers."""
    head = struct.pack(">4d2i", 40.0, 5.0, 1.0, 1.0, 11, 11)
    path.write_bytes(head + np.full((11, 11), undulation_m, dtype=">f4").tobytes())


@pytest.fixture
def with_geoid(tmp_path: Path) -> Callable[[], None]:
    return lambda: geoid(tmp_path / "egm96_15.gtx", 48.5)


def test_heights_over_the_ellipsoid_need_a_geoid_and_nothing_is_fetched(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH, shift_m=48.5)
    with pytest.raises(ElevationError, match="no geoid to convert them by is installed") as refused:
        read_elevation([path], reading("ellipsoid"))
    assert "\n" not in str(refused.value)


def test_heights_over_the_ellipsoid_are_converted_where_there_is_a_geoid(
    tmp_path: Path, with_geoid: Callable[[], None]
) -> None:
    with_geoid()
    path = write_raster(tmp_path / "ground.tif", SMOOTH, shift_m=48.5)
    usual = pyproj.datadir.get_data_dir()
    pyproj.datadir.append_data_dir(str(tmp_path))
    try:
        found = read_elevation([path], reading("ellipsoid"))
    finally:
        pyproj.datadir.set_data_dir(usual)
    assert off_m(found) < 4.2
    assert found.uncertainty_m == pytest.approx(5.0, abs=0.01)


def test_what_a_run_keeps_is_the_same_ground_without_the_raster(tmp_path: Path) -> None:
    write_raster(tmp_path / "a.tif", SMOOTH, crs="EPSG:32632", cell=10.0, holes_m=((300.0, -200.0, 120.0),))
    write_raster(tmp_path / "b.tif", SMOOTH)
    found = read_elevation([tmp_path / "a.tif", tmp_path / "b.tif"], reading())
    write_kept_ground(tmp_path / "terrain.npz", found)
    again = read_elevation([tmp_path / "terrain.npz"], reading("file", None))
    assert again.digest == found.digest
    assert (again.source, again.vertical, again.uncertainty_m) == (found.source, found.vertical, found.uncertainty_m)
    places = places_m()
    for ask in ("interpolate_m", "highest_m", "lowest_m"):
        np.testing.assert_array_equal(getattr(again, ask)(places), getattr(found, ask)(places))
    with pytest.raises(ElevationError, match="depot: expected the ground around 47"):
        read_kept_ground(tmp_path / "terrain.npz", LocalFrame(47.0, LON_DEG))


def test_another_ground_has_another_digest(tmp_path: Path) -> None:
    one = read_elevation([write_raster(tmp_path / "a.tif", SMOOTH)], reading())
    other = read_elevation([write_raster(tmp_path / "b.tif", SMOOTH, shift_m=1.0)], reading())
    assert one.digest != other.digest


def test_without_rasterio_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH)
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    with pytest.raises(ElevationError, match=r"ground\.tif: a raster needs the extra terrain: pip install rasterio$"):
        read_elevation([path], reading())


def changed(path: Path, **profile: object) -> Path:
    """Write a raster again with something else in its head."""
    with rasterio.open(path) as dataset:
        kept, values = dataset.profile, dataset.read()
    kept.update(profile)
    with rasterio.open(path, "w", **kept) as dataset:
        dataset.write(np.repeat(values, kept["count"], axis=0).astype(kept["dtype"]))
    return path


def truncated(path: Path) -> Path:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def valued(path: Path, value: float) -> Path:
    with rasterio.open(path, "r+") as dataset:
        values = dataset.read(1)
        values[values.shape[0] // 2, values.shape[1] // 2] = value
        dataset.write(values, 1)
    return path


def united(path: Path, unit: str) -> Path:
    with rasterio.open(path, "r+") as dataset:
        dataset.units = (unit,)
    return path


def bytes_of(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


VRT = (
    b'<VRTDataset rasterXSize="2" rasterYSize="2"><VRTRasterBand band="1"><SimpleSource>'
    b"<SourceFilename>/vsicurl/http://127.0.0.1:9/a.tif</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>"
)
MALFORMED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "empty": (lambda path: bytes_of(path, b""), "content: expected a"),
    "text": (lambda path: bytes_of(path, b"heights: high\n"), "content: expected a"),
    "noise": (lambda path: bytes_of(path, np.random.default_rng(1).bytes(5000)), "content: expected a"),
    "a header alone": (lambda path: bytes_of(path, b"II*\x00\x08\x00\x00\x00"), "content: expected a"),
    "a list of other files": (lambda path: bytes_of(path, VRT), "content: expected a"),
    "half of it": (truncated, "content: expected a"),
    "three bands": (lambda path: changed(path, count=3), "bands: expected one, of heights, found 3"),
    "a picture": (lambda path: changed(path, dtype="uint8", nodata=None), "band 1: expected heights as whole numbers"),
    "complex numbers": (lambda path: changed(path, dtype="complex64"), "band 1: expected heights as whole numbers"),
    "no reference system": (lambda path: changed(path, crs=None), "crs: expected a coordinate reference system"),
    "metres of nothing": (
        lambda path: changed(path, crs='LOCAL_CS["mine",UNIT["metre",1]]'), "crs: expected a map grid or degrees",
    ),
    "elsewhere": (
        lambda path: changed(path, transform=Affine(1 / 3600, 0, 100.0, 0, -1 / 3600, 20.0)),
        "area: expected heights between",
    ),
    "no size of cells": (
        lambda path: changed(path, transform=Affine(0, 0, 10.4, 0, 0, 46.6)), "transform: expected where its cells lie",
    ),
    "a void that is not declared": (
        lambda path: valued(path, 32767.0), "expected metres above sea level from -500 to 9000, got 32767",
    ),
    "a depth": (lambda path: valued(path, -9999.0), "expected metres above sea level from -500 to 9000, got -9999"),
    "degrees as heights": (lambda path: united(path, "degree"), "band 1: expected heights in metres or feet"),
}  # fmt: skip


@pytest.mark.parametrize("kind", MALFORMED)
def test_a_malformed_raster_is_one_line_that_names_it(kind: str, tmp_path: Path) -> None:
    damage, expected = MALFORMED[kind]
    path = damage(write_raster(tmp_path / "ground.tif", SMOOTH))
    with pytest.raises(ElevationError) as refused:
        read_elevation([path], reading())
    line = str(refused.value)
    assert line.startswith(f"{path}: ")
    assert expected in line
    assert "\n" not in line
    assert len(line) < 400


KEPT: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "half": truncated,
    "another archive": lambda path: np.savez(path, heights=np.zeros(3)),
    "another format": lambda path: np.savez(path, about=np.array('{"format": "faultline-terrain/9"}')),
    "pickles": lambda path: np.savez(path, about=np.array([{"a": 1}], dtype=object), allow_pickle=True),
}


@pytest.mark.parametrize("kind", KEPT)
def test_what_a_run_kept_and_was_damaged_is_one_line(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "terrain.npz"
    write_kept_ground(path, read_elevation([write_raster(tmp_path / "a.tif", SMOOTH)], reading()))
    KEPT[kind](path)
    with pytest.raises(ElevationError, match=r"terrain\.npz: content: expected the ground that a run has kept"):
        read_elevation([path], reading())


def test_files_that_are_not_there_or_say_too_little_are_refused(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH)
    (tmp_path / "nothing").mkdir()
    for files, how, expected in (
        ([tmp_path / "no.tif"], reading(), "file: expected a raster of heights, or a folder of them; there is none"),
        ([tmp_path / "nothing"], reading(), "folder: expected rasters"),
        ([path], reading("file"), "vertical: expected what its heights are counted from"),
        ([path], reading("egm96", None), "uncertainty_m: expected the raster's own"),
    ):
        with pytest.raises(ElevationError) as refused:
            read_elevation(files, how)
        assert expected in str(refused.value)
        assert "\n" not in str(refused.value)


def test_a_lattice_finds_cells_as_exactly_as_a_transformation_of_each_place(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "ground.tif", SMOOTH, crs="EPSG:32632", cell=10.0)
    (tile,) = read_elevation([path], reading()).tiles
    with rasterio.open(path) as dataset:
        at = locate_cells(dataset, pyproj.CRS("EPSG:32632"), FRAME.many_to_wgs84_deg(places_m()))
        first = locate_cells(dataset, pyproj.CRS("EPSG:32632"), FRAME.many_to_wgs84_deg(np.zeros((1, 2))))
    moved = at - first - (tile.to_rows_columns(places_m()) - tile.to_rows_columns(np.zeros((1, 2))))
    assert np.abs(moved).max() < 0.01
