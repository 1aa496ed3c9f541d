"""Index of a flight's pictures: every known picture, and every asset's requirements.

Its files are images.csv, images.geojson, and images.sqlite, to which the memory cards' files are matched.
"""

from __future__ import annotations

import csv
import io
import json
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from executor.adapters.run_directory import Document, RunDirectory
from executor.core.context import Context
from executor.core.imaging.asset_status import describe_unseen_parts
from executor.core.payload.camera_state import Picture
from executor.core.state.fleet_state import FleetState
from executor.errors import LogError
from missions.cameras import Trigger
from missions.files import write_document, write_whole

EXPECTED = "the index of a flight with cameras, which is written when it ends"


class ImageRow(Document):
    """One picture."""

    asset: str
    """Name of the span that it shows; empty if it shows none that requires it."""
    segment: int | None
    viewpoint: str
    """Distance along the span from its first pylon; at a pylon, which of its viewpoints."""
    vehicle: str
    camera: str
    sequence: int
    unix_s: float
    """Unix time by the ground station's clock; in a faster simulation, by the flight's own seconds."""
    camera_unix_s: float | None
    """Unix time by the camera's own clock, if reported."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    alt_rel_m: float
    pitch_deg: float | None
    yaw_deg: float | None
    speed_m_s: float
    proof: str
    """Message that proves that it was taken."""
    file: str
    """File name from the camera, if reported."""
    flaw: str
    """Reason why it does not count; empty if it does."""

    @property
    def time_iso(self) -> str:
        """Return the time of the picture as ISO 8601 in UTC."""
        return datetime.fromtimestamp(self.unix_s, UTC).isoformat(timespec="milliseconds")


class AssetRow(Document):
    """One span's requirements for one camera, and the result."""

    asset: str
    segment: int
    camera: str
    take: str
    """pictures, video, or the number of viewpoints."""
    every_m: float
    state: str
    """seen, not seen or not flown."""
    vehicle: str
    """Vehicle that has seen it; empty if none has."""
    pictures: int
    """Number of pictures that count; at a pylon, of viewpoints with a picture."""
    missing: str
    """Parts without a picture, in words."""
    line: tuple[tuple[float, float], tuple[float, float]]
    """Latitude and longitude of both pylons."""


_IMAGE = tuple(ImageRow.model_fields)
_ASSET = tuple(AssetRow.model_fields)


def build_image_rows(context: Context, state: FleetState, began_unix_s: float) -> list[ImageRow]:
    """Return all pictures of a flight, in order of time.

    Args:
        context: Context of the flight.
        state: Its state, at the end or before.
        began_unix_s: Unix time at which its log's time is 0.
    """
    rows = [
        _build_image_row(context, name, picture, began_unix_s)
        for name, vehicle in state.vehicles.items()
        for picture in vehicle.payload.pictures
    ]
    return sorted(rows, key=lambda row: (row.unix_s, row.vehicle, row.sequence))


def _build_image_row(context: Context, vehicle: str, picture: Picture, began_unix_s: float) -> ImageRow:
    return ImageRow.build_from(
        picture,
        asset="" if picture.segment is None else context.segment_name(picture.segment),
        viewpoint=_describe_viewpoint(picture),
        vehicle=vehicle,
        unix_s=began_unix_s + picture.at_s,
        camera_unix_s=picture.unix_s,
        proof=picture.source.value,
    )


def _describe_viewpoint(picture: Picture) -> str:
    if picture.points:
        return f"viewpoint {', '.join(str(number + 1) for number in picture.points)}"
    return "" if picture.along_m is None else f"{picture.along_m:.1f} m"


def build_asset_rows(context: Context, state: FleetState) -> Iterator[AssetRow]:
    """Yield every span's requirements in this flight, and the result."""
    looks = context.setup.looks
    network, past = context.setup.network, state.coverage.not_seen
    for segment in sorted(context.wanted & {*looks.spans, *looks.pylons}):
        by = state.coverage.inspected.get(segment, "")
        caught = state.coverage.caught.get(segment, ())
        lacks = describe_unseen_parts(context, segment, caught)
        ends = [network.pylons[end] for end in (network.segments[segment].a, network.segments[segment].b)]
        first, last = ((pylon.lat_deg, pylon.lon_deg) for pylon in ends)
        pylon = looks.pylons.get(segment)
        asked = [] if pylon is None else [(pylon.camera, f"{len(pylon.points)} viewpoints", 0.0)]
        asked += [
            (look.camera, "video" if look.trigger is Trigger.VIDEO else "pictures", look.every_m)
            for look in looks.spans.get(segment, ())
        ]
        for camera, take, every_m in asked:
            yield AssetRow(
                asset=context.segment_name(segment),
                segment=segment,
                camera=camera,
                take=take,
                every_m=every_m,
                state="seen" if by else "not seen" if caught or segment in past else "not flown",
                vehicle=by,
                pictures=sum(one == camera for one, _ in (caught if pylon is None else set(caught))),
                missing="; ".join(words for words in lacks if words.startswith(f"{camera} ")),
                line=(first, last),
            )


@dataclass(frozen=True, slots=True)
class ImageIndex:
    """All rows of a flight."""

    images: tuple[ImageRow, ...]
    assets: tuple[AssetRow, ...]


def build_image_index(context: Context, state: FleetState, began_unix_s: float) -> ImageIndex:
    """Return all rows of a flight; see `build_image_rows`."""
    return ImageIndex(tuple(build_image_rows(context, state, began_unix_s)), tuple(build_asset_rows(context, state)))


def write_index(run: Path, index: ImageIndex) -> None:
    """Write all three files, each whole or not at all.

    Raises:
        OSError: A file cannot be written.
    """
    directory = RunDirectory(run)
    write_whole(directory.images_csv, format_csv(index.images).encode())
    write_document(directory.images_geojson, build_geojson(index))
    _write_tables(directory.images_sqlite, index)


def format_csv(images: Iterable[ImageRow]) -> str:
    """Return the pictures as CSV."""
    rows = ((row.time_iso, *(_round_value(*field) for field in row)) for row in images)
    return _format_table(("time", *_IMAGE), rows)


def _format_table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows((columns, *rows))
    return text.getvalue()


def _round_value(name: str, value: object) -> object:
    if not isinstance(value, float):
        return "" if value is None else value
    return round(value, 7 if name in {"lat_deg", "lon_deg"} else 3)


def build_geojson(index: ImageIndex) -> dict[str, object]:
    """Return the pictures as points and the assets as lines."""
    points = [
        _build_feature(
            "Point", [row.lon_deg, row.lat_deg, row.alt_msl_m], {"kind": "image", "time": row.time_iso, **dict(row)}
        )
        for row in index.images
    ]
    lines = [
        _build_feature(
            "LineString",
            [[lon_deg, lat_deg] for lat_deg, lon_deg in row.line],
            {"kind": "asset", **row.model_dump(exclude={"line"})},
        )
        for row in index.assets
    ]
    return {"type": "FeatureCollection", "features": [*lines, *points]}


def _build_feature(kind: str, coordinates: object, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def _write_tables(path: Path, index: ImageIndex) -> None:
    fresh = path.with_name(f"{path.name}.new")
    fresh.unlink(missing_ok=True)
    with closing(sqlite3.connect(fresh)) as tables, tables:
        _write_table(tables, "image", _IMAGE, [tuple(dict(row).values()) for row in index.images])
        flat = [tuple({**dict(row), "line": json.dumps(row.line)}.values()) for row in index.assets]
        _write_table(tables, "asset", _ASSET, flat)
    fresh.replace(path)


def _write_table(
    tables: sqlite3.Connection, name: str, columns: Sequence[str], rows: Sequence[tuple[object, ...]]
) -> None:
    tables.execute(f"DROP TABLE IF EXISTS {name}")
    tables.execute(f"CREATE TABLE {name} ({', '.join(columns)})")
    marks = ", ".join("?" for _ in columns)
    tables.executemany(f"INSERT INTO {name} VALUES ({marks})", rows)  # noqa: S608 - all of these names are ours


def read_index(run: Path) -> ImageIndex:
    """Read the index of a run directory.

    Raises:
        LogError: One line that names the file and what was expected.
    """
    path = RunDirectory(run).images_sqlite
    if not path.is_file():
        raise LogError(f"{path}: no such file; expected {EXPECTED}")
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as tables:
            tables.row_factory = sqlite3.Row
            images = tables.execute(f"SELECT {', '.join(_IMAGE)} FROM image").fetchall()  # noqa: S608 - ours
            assets = tables.execute(f"SELECT {', '.join(_ASSET)} FROM asset").fetchall()  # noqa: S608
        return ImageIndex(
            tuple(ImageRow(**row) for row in images),
            tuple(AssetRow(**{**row, "line": json.loads(row["line"])}) for row in assets),
        )
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise LogError(f"{path}: {error}; expected {EXPECTED}") from error


def write_file_matches(run: Path, columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> None:
    """Write the matches of files to pictures, as the table ``file`` in the database, and to images-files.csv.

    Raises:
        OSError: They cannot be written.
        LogError: The index is no longer a valid database.
    """
    write_whole(RunDirectory(run).images_files, _format_table(columns, rows).encode())
    path = RunDirectory(run).images_sqlite
    try:
        with closing(sqlite3.connect(path)) as tables, tables:
            _write_table(tables, "file", columns, rows)
    except sqlite3.Error as error:
        raise LogError(f"{path}: {error}; expected {EXPECTED}") from error
