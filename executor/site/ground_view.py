"""Draw the background of the map: relief, picture and attribution, and its files in a run directory.

`ground.json` holds everything but the pictures next to it. The page gets the same files.
"""

from __future__ import annotations

import io
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import Field

from executor.adapters.extras import Extra, describe_missing_extra, require_extra
from executor.adapters.run_directory import Document
from executor.errors import LogError
from executor.site.site_keys import MapTable
from executor.site.site_model import SiteModel
from missions import LocalFrame
from missions.files import write_whole
from missions.geo import FloatArray
from missions.readers.background_files import Background, Corner, PictureArea, Pixels, choose_grid_size, read_background

MOST_CELLS = 1_000_000
LEAST_CELL_M = 1.0
MOST_LINE_CELLS = 90_000
"""Most cells of the grid for contours; finer ones look no better and take longer to send."""
SUN_DEG, SUN_UP_DEG = 315.0, 45.0
"""Light from the north-west, as on maps; lit from below, hills look like hollows."""
GENTLE = 0.35
"""Least slope to which the relief's contrast is scaled."""
MOST_EXAGGERATION = 6.0
LINES = 14
"""Approximate number of contour lines between the lowest and the highest point."""
MOST_LINES = 300
STEPS_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
BOLD = 5
"""Every fifth contour line is drawn bold, with its height."""


class Heights(Protocol):
    """Source of ground heights."""

    @property
    def cell_m(self) -> float:
        """Size of the smallest cells."""

    def grid_m(self, easts_m: FloatArray, norths_m: FloatArray) -> FloatArray:
        """Return (norths, easts) heights above mean sea level; NaN where unknown."""


@dataclass(frozen=True, slots=True)
class Contour:
    """One contour line."""

    height_m: float
    places_m: tuple[tuple[float, float], ...]
    """East and north."""
    bold: bool


@dataclass(frozen=True, slots=True, eq=False)
class Hillshade:
    """Relief of an area, on a grid of square cells."""

    heights_m: npt.NDArray[np.float32]
    """(rows, columns) above mean sea level in the middles of cells, the northernmost row first."""
    shade: npt.NDArray[np.uint8]
    """(rows, columns, 2): lightness and opacity; transparent where heights are unknown."""
    low_m: Corner
    """South-western corner: outer edges of cells."""
    high_m: Corner
    interval_m: float
    contours: tuple[Contour, ...]


def compute_hillshade(
    known: Heights, low_m: Corner, high_m: Corner, contour_m: float | None = None
) -> Hillshade | None:
    """Return the relief of an area; None if no height of it is known."""
    rows, columns = choose_grid_size(low_m, high_m, MOST_CELLS, max(known.cell_m, LEAST_CELL_M))
    easts_m, norths_m = (
        _compute_cell_middles(low_m[0], high_m[0], columns),
        _compute_cell_middles(low_m[1], high_m[1], rows)[::-1],
    )
    heights_m = known.grid_m(easts_m, norths_m).astype(np.float32)
    if not np.isfinite(heights_m).any():
        return None
    step_m = ((high_m[0] - low_m[0]) / columns, (high_m[1] - low_m[1]) / rows)
    low, high = float(np.nanmin(heights_m)), float(np.nanmax(heights_m))
    interval_m = max(interval_for(high - low) if contour_m is None else contour_m, (high - low) / MOST_LINES)
    few = max(1, math.ceil(math.sqrt(heights_m.size / MOST_LINE_CELLS)))
    contours = _trace_contours(easts_m[::few], norths_m[::few], heights_m[::few, ::few], interval_m)
    return Hillshade(heights_m, shade_heights(heights_m, step_m), low_m, high_m, interval_m, contours)


def interval_for(relief_m: float) -> float:
    """Return the height between contour lines that suits an area's range of heights.

    >>> interval_for(6.0), interval_for(140.0), interval_for(2600.0)
    (0.5, 10.0, 200.0)
    """
    return next((step for step in STEPS_M if relief_m / step <= LINES), STEPS_M[-1])


def shade_heights(heights_m: npt.NDArray[np.float32], step_m: tuple[float, float]) -> npt.NDArray[np.uint8]:
    """Return (rows, columns, 2): lightness and opacity of every cell of a grid, its northernmost row first.

    Args:
        heights_m: Ground heights.
        step_m: Width and height of a cell.
    """
    north, east = np.gradient(heights_m.astype(np.float64), -step_m[1], step_m[0])
    slope = np.hypot(north, east)
    steep = float(np.nanpercentile(slope, 90)) if np.isfinite(slope).any() else 0.0
    more = min(MOST_EXAGGERATION, max(1.0, GENTLE / steep)) if steep > 0.0 else 1.0
    from_rad, up_rad = math.radians(SUN_DEG), math.radians(SUN_UP_DEG)
    # Cosine between the sun's direction and the ground's normal, both unit vectors.
    towards = more * (east * math.sin(from_rad) + north * math.cos(from_rad))
    light = (math.sin(up_rad) - math.cos(up_rad) * towards) / np.sqrt(1.0 + (more * slope) ** 2)
    known = np.isfinite(light)
    made = np.zeros((*heights_m.shape, 2), dtype=np.uint8)
    made[..., 0] = np.where(known, np.clip(light, 0.0, 1.0) * 255.0, 0.0)
    made[..., 1] = np.where(known, 255, 0)
    return made


def _trace_contours(
    easts_m: FloatArray, norths_m: FloatArray, heights_m: npt.NDArray[np.float32], interval_m: float
) -> tuple[Contour, ...]:
    from contourpy import LineType, contour_generator

    if min(heights_m.shape) < 2:
        return ()
    generator = contour_generator(
        easts_m, norths_m, np.ma.masked_invalid(heights_m), name="serial", line_type=LineType.Separate
    )
    first, last = math.ceil(np.nanmin(heights_m) / interval_m), math.floor(np.nanmax(heights_m) / interval_m)
    found = []
    for number in range(first, last + 1):
        for line in generator.lines(number * interval_m):
            places = tuple((round(float(e), 1), round(float(n), 1)) for e, n in np.asarray(line))
            found.append(Contour(round(number * interval_m, 2), places, number % BOLD == 0))
    return tuple(found)


def _compute_cell_middles(low: float, high: float, count: int) -> FloatArray:
    step = (high - low) / count
    return np.asarray(low + step * (np.arange(count) + 0.5), dtype=np.float64)


BESIDE_M = 300.0
BESIDE = 0.25
"""Margin of background around the line, as a share of its extent."""
MOST_PIXELS = 6_000_000
"""Most pixels of the picture: 1.5 m each for a line of 4 km."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundView:
    """Ground around a line: relief and picture, each optional."""

    low_m: Corner
    high_m: Corner
    background: Background | None = None
    relief: Hillshade | None = None
    attribution: str = ""


def build_ground_view(
    table: MapTable | None, base: Path, frame: LocalFrame, places_m: FloatArray, heights: Heights | None = None
) -> GroundView:
    """Return the ground around places, as a site configures it.

    Args:
        table: Map table of the site; None if there is none.
        base: Folder of the site file.
        frame: Local metres.
        places_m: (n, 2) places that must be on the map: pylons, pads.
        heights: Source of the ground's heights, if there is one.

    Raises:
        BackgroundError: the picture cannot be used.
        ExtraMissing: no library to read it is installed.
    """
    table = table or MapTable()
    low_m, high_m = compute_shown_area(places_m)
    view = GroundView(low_m, high_m)
    if table.background is not None:
        require_extra(Extra.MAPS, "[map] background")
        wanted = PictureArea(frame, low_m, high_m, MOST_PIXELS)
        background = read_background(base / table.background, wanted)
        by = background.attribution if table.attribution is None else table.attribution
        view = replace(view, background=background, attribution=by)
    if heights is not None and not describe_missing_extra(Extra.MAPS, "relief"):
        view = replace(view, relief=compute_hillshade(heights, low_m, high_m, table.contour_m))
    return view


def view_for(ground: SiteModel, base: Path) -> GroundView:
    """Return the ground around a site's line and pads.

    Raises:
        BackgroundError: the picture cannot be used.
        ExtraMissing: no library to read it is installed.
    """
    pads_m = np.array([(pad.east_m, pad.north_m) for pad in ground.setup.pads])
    places_m = np.concatenate((ground.network.positions_m, pads_m))
    heights = None if ground.terrain is None else ground.terrain.elevation
    return build_ground_view(ground.site.map, base, ground.network.frame, places_m, heights)


def compute_shown_area(places_m: FloatArray) -> tuple[Corner, Corner]:
    """Return the corners of the area shown around (n, 2) places and the depot."""
    shown = np.concatenate((places_m, np.zeros((1, 2))))
    low, high = shown.min(axis=0), shown.max(axis=0)
    beside_m = BESIDE_M + BESIDE * float((high - low).max())
    low, high = np.floor(low - beside_m), np.ceil(high + beside_m)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


DOCUMENT, PHOTO, RELIEF = "ground.json", "ground-photo.webp", "ground-relief.png"
PHOTO_BYTES = 2_000_000
"""Most bytes of the picture: half a minute of download for a phone in the field."""
QUALITIES = (80, 65, 50)
MOST_HEIGHTS = 40_000
"""Most heights sent to the page, which interpolates between them."""
LATTICE = 17
"""Points per side of the coordinate grid sent to the page; interpolation errs by centimetres over 20 km."""

Count = Annotated[int, Field(ge=2, le=100_000)]


class GroundHeightsPart(Document):
    """The ground's heights above mean sea level in the middles of cells; the northernmost row first."""

    rows: Count
    columns: Count
    metres: tuple[int | None, ...]
    """Heights row by row; null where unknown."""


class HillshadePart(Document):
    """The shape of the ground."""

    file: str
    interval_m: float
    contours: tuple[Contour, ...]
    heights: GroundHeightsPart


class DegreesPart(Document):
    """Where the local metres are: latitudes and longitudes of a lattice from corner to corner, the north first."""

    rows: Count
    columns: Count
    lat_deg: tuple[float, ...]
    lon_deg: tuple[float, ...]


class GroundDocument(Document):
    """`ground.json`."""

    expected = "the ground below a flight"
    format: Literal["faultline-ground/1"] = "faultline-ground/1"
    low_m: Corner
    """South-western corner, in metres east and north of the depot."""
    high_m: Corner
    attribution: str
    photo: str | None
    """File of the picture."""
    relief: HillshadePart | None
    degrees: DegreesPart


def encode_ground(view: GroundView, frame: LocalFrame) -> dict[str, bytes]:
    """Return the files of a background by name."""
    files: dict[str, bytes] = {}
    if view.background is not None:
        files[PHOTO] = _compress_photo(view.background.pixels)
    if view.relief is not None:
        files[RELIEF] = _encode_image(view.relief.shade, "PNG", optimize=True)
    document = GroundDocument(
        low_m=view.low_m,
        high_m=view.high_m,
        attribution=view.attribution,
        photo=None if view.background is None else PHOTO,
        relief=None if view.relief is None else _build_relief_part(view.relief),
        degrees=_build_degrees_part(view, frame),
    )
    text = json.dumps(document.to_plain(), separators=(",", ":"), allow_nan=False)
    return {DOCUMENT: text.encode(), **files}


def write_ground(run: Path, view: GroundView, frame: LocalFrame) -> None:
    """Write a background into a run directory, if there is anything to show.

    Raises:
        OSError: it cannot be written.
    """
    if view.background is None and view.relief is None:
        return
    files = encode_ground(view, frame)
    for name in (*(name for name in files if name != DOCUMENT), DOCUMENT):
        write_whole(run / name, files[name])


def read_ground_files(run: Path) -> dict[str, bytes]:
    """Return the background files in a run directory; empty if there are none.

    Raises:
        LogError: one of them cannot be used.
    """
    if not (run / DOCUMENT).exists():
        return {}
    document = _read_document(run)
    names = [name for name in (document.photo, None if document.relief is None else document.relief.file) if name]
    try:
        return {name: (run / name).read_bytes() for name in (DOCUMENT, *names)}
    except OSError as error:
        raise LogError(f"{error.filename}: cannot be read: {error.strerror}") from error


def _read_document(run: Path) -> GroundDocument:
    path = run / DOCUMENT
    document = GroundDocument.read(path)
    if document.photo not in {None, PHOTO} or (document.relief is not None and document.relief.file != RELIEF):
        raise LogError(f"{path}: photo, relief.file: expected {PHOTO} and {RELIEF}, next to it")
    heights = None if document.relief is None else document.relief.heights
    if heights is not None and len(heights.metres) != heights.rows * heights.columns:
        raise LogError(f"{path}: relief.heights.metres: expected {heights.rows * heights.columns} heights")
    return document


def _build_relief_part(relief: Hillshade) -> HillshadePart:
    rows, columns = choose_grid_size(relief.low_m, relief.high_m, min(MOST_HEIGHTS, relief.heights_m.size), 0.0)
    parts = zip((rows, columns), relief.heights_m.shape, strict=True)
    middles = [((np.arange(some) + 0.5) / some * every).astype(int) for some, every in parts]
    metres = [None if np.isnan(one) else round(one) for one in relief.heights_m[np.ix_(*middles)].ravel().tolist()]
    return HillshadePart(
        file=RELIEF,
        interval_m=relief.interval_m,
        contours=relief.contours,
        heights=GroundHeightsPart(rows=rows, columns=columns, metres=tuple(metres)),
    )


def _build_degrees_part(view: GroundView, frame: LocalFrame) -> DegreesPart:
    easts = np.linspace(view.low_m[0], view.high_m[0], LATTICE)
    norths = np.linspace(view.high_m[1], view.low_m[1], LATTICE)
    at = frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))
    lat_deg, lon_deg = (tuple(round(value, 8) for value in column.tolist()) for column in at.T)
    return DegreesPart(rows=LATTICE, columns=LATTICE, lat_deg=lat_deg, lon_deg=lon_deg)


def _compress_photo(pixels: Pixels) -> bytes:
    """Return a picture's file, small enough for a radio link: first with lower quality, then with fewer pixels."""
    found = b""
    while True:
        for quality in QUALITIES:
            found = _encode_image(pixels, "WEBP", quality=quality, method=2)
            if len(found) <= PHOTO_BYTES:
                return found
        pixels = pixels[::2, ::2]


def _encode_image(pixels: Pixels, kind: str, **options: object) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, kind, **options)
    return file.getvalue()
