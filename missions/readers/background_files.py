"""Pictures of the ground: GeoTIFF and MBTiles, of any size; only what lies around the line, no finer than it is shown.

What is read is laid square into the local plane.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from missions.background import Background, PictureArea, PictureWindow, choose_grid_size
from missions.errors import BackgroundError
from missions.files import to_printable
from missions.readers import imagery, mbtiles
from missions.readers.geopackage import MAGIC

TIFF = (b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+")


def read_background(path: Path, wanted: PictureArea) -> Background:
    """Return what a file shows of an area.

    Raises:
        BackgroundError: one line that names the file, the place in it and what was expected.
    """
    if not path.is_file():
        raise BackgroundError(f"{path}: file: expected a GeoTIFF or MBTiles; there is none")
    with path.open("rb") as file:
        head = file.read(16)
    if head.startswith(TIFF):
        read = imagery.read_imagery(path, wanted)
    elif head.startswith(MAGIC):
        read = mbtiles.read_mbtiles(path, wanted)
    else:
        raise BackgroundError(f"{path}: content: expected a GeoTIFF or MBTiles, it begins like neither")
    return _warp_to_plane(path, read, wanted)


def _warp_to_plane(path: Path, read: PictureWindow, wanted: PictureArea) -> Background:
    """Return pixels laid into the local plane."""
    from rasterio import Affine
    from rasterio.enums import Resampling
    from rasterio.errors import RasterioError
    from rasterio.warp import reproject

    rows, columns = choose_grid_size(wanted.low_m, wanted.high_m, wanted.most_pixels, read.step_m)
    made = np.zeros((4, rows, columns), dtype=np.uint8)
    frame, (west, south), (east, north) = wanted.frame, wanted.low_m, wanted.high_m
    try:
        reproject(
            np.moveaxis(read.pixels, -1, 0), made, resampling=Resampling.bilinear,
            src_crs=read.crs.to_2d().to_wkt(), src_transform=read.transform,
            dst_crs=f"+proj=aeqd +lat_0={frame.lat_deg!r} +lon_0={frame.lon_deg!r} +datum=WGS84",
            dst_transform=Affine((east - west) / columns, 0.0, west, 0.0, (south - north) / rows, north),
        )  # fmt: skip
    except RasterioError as error:
        raise BackgroundError(
            f"{path}: crs: expected one that has places around the line: {to_printable(str(error))}"
        ) from error
    if not made[3].any():
        raise BackgroundError(f"{path}: area: expected a picture of the line's surroundings, it shows none of them")
    return Background(np.moveaxis(made, 0, -1).copy(), wanted.low_m, wanted.high_m, read.attribution)
