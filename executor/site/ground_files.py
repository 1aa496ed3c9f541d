"""The ground as a run directory keeps it: what the crew saw, so that it is there on resuming and in the report.

`ground.json` holds all but the pictures beside it. The page is given the same files.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from executor.errors import LogError
from executor.site.ground_view import GroundView
from executor.site.hillshade import Contour, Hillshade
from missions import LocalFrame, format_first_error
from missions.files import write_whole
from missions.readers.background_files import Background, Pixels, choose_grid_size

DOCUMENT, PHOTO, RELIEF = "ground.json", "ground-photo.webp", "ground-relief.png"
PHOTO_BYTES = 2_000_000
"""What a phone in the field fetches in half a minute."""
QUALITIES = (80, 65, 50)
MOST_HEIGHTS = 40_000
"""Heights that are sent to be asked for; between them is interpolated."""
LATTICE = 17
"""Latitudes and longitudes that are sent, on a side: between them, over 20 km, they are off by a few centimetres."""

Corner = tuple[float, float]
Count = Annotated[int, Field(ge=2, le=100_000)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ContourPart(_Part):
    """A line of one height, above mean sea level."""

    height_m: float
    places_m: tuple[Corner, ...]
    bold: bool


class GroundHeightsPart(_Part):
    """The ground's heights above mean sea level in the middles of cells; the northernmost row first."""

    rows: Count
    columns: Count
    metres: tuple[int | None, ...]
    """Row after row; null where nobody knows."""


class HillshadePart(_Part):
    """The shape of the ground."""

    file: str
    interval_m: float
    contours: tuple[ContourPart, ...]
    heights: GroundHeightsPart


class DegreesPart(_Part):
    """Where the local metres are: latitudes and longitudes of a lattice from corner to corner, the north first."""

    rows: Count
    columns: Count
    lat_deg: tuple[float, ...]
    lon_deg: tuple[float, ...]


class GroundDocument(_Part):
    """`ground.json`."""

    format: Literal["faultline-ground/1"] = "faultline-ground/1"
    low_m: Corner
    """South-western corner of what is shown, in metres east and north of the depot."""
    high_m: Corner
    attribution: str
    photo: str | None
    """The picture's file."""
    relief: HillshadePart | None
    degrees: DegreesPart


def encode_ground(view: GroundView, frame: LocalFrame) -> dict[str, bytes]:
    """Return the files of a ground by their names."""
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
    text = json.dumps(document.model_dump(mode="json"), separators=(",", ":"), allow_nan=False)
    return {DOCUMENT: text.encode(), **files}


def write_ground(run: Path, view: GroundView, frame: LocalFrame) -> None:
    """Write a ground into a run directory, if there is anything to be seen of it.

    Raises:
        OSError: it cannot be written.
    """
    if view.background is None and view.relief is None:
        return
    files = encode_ground(view, frame)
    for name in (*(name for name in files if name != DOCUMENT), DOCUMENT):
        write_whole(run / name, files[name])


def read_ground_files(run: Path) -> dict[str, bytes]:
    """Return the files of the ground that a run directory keeps; empty if it keeps none.

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


def read_ground(run: Path) -> GroundView | None:
    """Return the ground that a run directory keeps; None if it keeps none.

    Raises:
        LogError: one of its files cannot be used.
    """
    files = read_ground_files(run)
    if not files:
        return None
    document = _read_document(run)
    background = relief = None
    if document.photo is not None:
        pixels = _decode_image(run / document.photo, files[document.photo], "RGBA")
        background = Background(pixels, document.low_m, document.high_m, document.attribution)
    if document.relief is not None:
        shade = _decode_image(run / document.relief.file, files[document.relief.file], "LA")
        part = document.relief.heights
        metres = [np.nan if one is None else float(one) for one in part.metres]
        if len(metres) != part.rows * part.columns:
            raise LogError(f"{run / DOCUMENT}: relief.heights.metres: expected {part.rows * part.columns} heights")
        heights_m = np.array(metres, dtype=np.float32).reshape(part.rows, part.columns)
        contours = tuple(Contour(one.height_m, one.places_m, one.bold) for one in document.relief.contours)
        relief = Hillshade(heights_m, shade, document.low_m, document.high_m, document.relief.interval_m, contours)
    return GroundView(document.low_m, document.high_m, background, relief, document.attribution)


def _read_document(run: Path) -> GroundDocument:
    path = run / DOCUMENT
    try:
        document = GroundDocument.model_validate_json(path.read_bytes())
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        raise LogError(f"{path}: {format_first_error(error)}") from error
    if document.photo not in {None, PHOTO} or (document.relief is not None and document.relief.file != RELIEF):
        raise LogError(f"{path}: photo, relief.file: expected {PHOTO} and {RELIEF}, beside it")
    return document


def _build_relief_part(relief: Hillshade) -> HillshadePart:
    rows, columns = choose_grid_size(relief.low_m, relief.high_m, min(MOST_HEIGHTS, relief.heights_m.size), 0.0)
    i = np.minimum(
        ((np.arange(rows) + 0.5) / rows * relief.heights_m.shape[0]).astype(int), relief.heights_m.shape[0] - 1
    )
    j = np.minimum(
        ((np.arange(columns) + 0.5) / columns * relief.heights_m.shape[1]).astype(int), relief.heights_m.shape[1] - 1
    )
    metres = [None if np.isnan(one) else round(one) for one in relief.heights_m[np.ix_(i, j)].ravel().tolist()]
    return HillshadePart(
        file=RELIEF,
        interval_m=relief.interval_m,
        contours=tuple(
            ContourPart(height_m=one.height_m, places_m=one.places_m, bold=one.bold) for one in relief.contours
        ),
        heights=GroundHeightsPart(rows=rows, columns=columns, metres=tuple(metres)),
    )


def _build_degrees_part(view: GroundView, frame: LocalFrame) -> DegreesPart:
    easts = np.linspace(view.low_m[0], view.high_m[0], LATTICE)
    norths = np.linspace(view.high_m[1], view.low_m[1], LATTICE)
    at = frame.many_to_wgs84_deg(np.stack(np.meshgrid(easts, norths), axis=-1).reshape(-1, 2))
    lat_deg, lon_deg = (tuple(round(value, 8) for value in column.tolist()) for column in at.T)
    return DegreesPart(rows=LATTICE, columns=LATTICE, lat_deg=lat_deg, lon_deg=lon_deg)


def _compress_photo(pixels: Pixels) -> bytes:
    """Return a picture's file, small enough for a radio link: first less exact, then with fewer pixels."""
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


def _decode_image(path: Path, content: bytes, mode: str) -> Pixels:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=("WEBP", "PNG")) as image:
            return np.asarray(image.convert(mode), dtype=np.uint8)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise LogError(f"{path}: expected a picture: {error}") from error
