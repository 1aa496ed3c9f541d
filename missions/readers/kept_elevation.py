"""What a run keeps of the rasters that it was planned by: numpy's own format, read without any library of rasters."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np

from missions.errors import ElevationError
from missions.files import write_whole
from missions.geo import LocalFrame
from missions.terrain import Elevation, Tile

KEPT_SUFFIX = ".npz"
FORMAT = "faultline-terrain/1"
MOST_BYTES = 1_000_000_000
"""That an archive unpacks to: twice what reading keeps of the largest area."""
SAME_DEG = 1e-9
UNREADABLE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError)


def write_kept_ground(path: Path, elevation: Elevation) -> None:
    """Write what was read, so that the same ground is read again without the rasters.

    Raises:
        OSError: it cannot be written.
    """
    about = {
        "format": FORMAT,
        "lat_deg": elevation.frame.lat_deg,
        "lon_deg": elevation.frame.lon_deg,
        "source": elevation.source,
        "vertical": elevation.vertical,
        "uncertainty_m": elevation.uncertainty_m,
        "remarks": list(elevation.remarks),
        "tiles": [
            {
                "low_m": tile.low_m,
                "step_m": tile.step_m,
                "cell_m": tile.cell_m,
                "same": tile.highest_m is tile.heights_m,
            }
            for tile in elevation.tiles
        ],
    }
    parts: dict[str, np.ndarray] = {"about": np.array(json.dumps(about))}
    for number, tile in enumerate(elevation.tiles):
        parts[f"heights_{number}"] = tile.heights_m
        parts[f"lattice_{number}"] = tile.lattice
        if tile.highest_m is not tile.heights_m:
            parts[f"highest_{number}"] = tile.highest_m
    content = io.BytesIO()
    np.savez_compressed(content, allow_pickle=False, **parts)
    write_whole(path, content.getvalue())


def read_kept_ground(path: Path, frame: LocalFrame) -> Elevation:
    """Read what a run has kept.

    Args:
        path: The file.
        frame: Of the site, which must be the one that it was kept for.

    Raises:
        ElevationError: it is damaged, or of another depot.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
                raise ElevationError(f"{path}: content: expected it to unpack to at most {MOST_BYTES // 1_000_000} MB")
        with np.load(path, allow_pickle=False) as parts:
            about = json.loads(str(parts["about"]))
            if about["format"] != FORMAT:
                raise ValueError(f"format: expected {FORMAT!r}")
            tiles = tuple(_load_tile(parts, number, row) for number, row in enumerate(about["tiles"]))
            found = Elevation(
                frame=LocalFrame(float(about["lat_deg"]), float(about["lon_deg"])),
                tiles=tiles,
                source=str(about["source"]),
                vertical=str(about["vertical"]),
                uncertainty_m=float(about["uncertainty_m"]),
                remarks=tuple(str(one) for one in about["remarks"]),
            )
    except UNREADABLE as error:
        raise ElevationError(f"{path}: content: expected the ground that a run has kept, whole: {error}") from error
    off_deg = max(abs(found.frame.lat_deg - frame.lat_deg), abs(found.frame.lon_deg - frame.lon_deg))
    if off_deg > SAME_DEG:
        raise ElevationError(
            f"{path}: depot: expected the ground around {frame.lat_deg:.6f}, {frame.lon_deg:.6f}, got that around "
            f"{found.frame.lat_deg:.6f}, {found.frame.lon_deg:.6f}"
        )
    return found


def _load_tile(parts: np.lib.npyio.NpzFile, number: int, row: dict[str, object]) -> Tile:
    heights_m, lattice = parts[f"heights_{number}"].astype(np.float32), parts[f"lattice_{number}"].astype(np.float64)
    highest_m = heights_m if row["same"] else parts[f"highest_{number}"].astype(np.float32)
    if heights_m.ndim != 2 or heights_m.shape != highest_m.shape or not heights_m.size:
        raise ValueError(f"heights_{number}: expected rows and columns")
    if lattice.ndim != 3 or lattice.shape[2] != 2 or min(lattice.shape[:2]) < 2:
        raise ValueError(f"lattice_{number}: expected rows and columns of cells")
    low_m = row["low_m"]
    if not isinstance(low_m, list):
        raise TypeError("low_m: expected a list")
    return Tile(
        heights_m, highest_m, (float(low_m[0]), float(low_m[1])), float(str(row["step_m"])), lattice,
        float(str(row["cell_m"])),
    )  # fmt: skip
