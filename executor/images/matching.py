"""Match a folder of files to an index: each file's picture, and missing, duplicate, blurred or badly aimed pictures.

This is the only module that reads and writes the pictures' metadata, such as their position; it also writes the
customer's pages.

A file is matched to a picture by time and position, after estimating the camera clock's offset from the times
themselves. A card's files and a camera's pictures are two series of times that differ by one offset: minutes for a
wrong clock, hours for another time zone. At the right offset most of them coincide, as the pauses between spans are as
irregular as the line. If files hold positions, only pairs near each other count.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np

from executor.adapters.templates import render_template, write_page
from executor.images.index_files import AssetRow, ImageIndex, ImageRow
from missions.files import write_whole
from missions.geo import FloatArray, LocalFrame

SUFFIXES = frozenset({".jpg", ".jpeg", ".tif", ".tiff"})
GPS, DETAILS = 0x8825, 0x8769
MAKE, MODEL, ORIGINAL, SUBSECOND, OFFSET, EXPOSURE, SERIAL = 271, 272, 36867, 37521, 36881, 33434, 42033
APP1, START_OF_SCAN = 0xE1, 0xDA
EXIF_HEAD = b"Exif\0\0"
TOLERANCE_S = 1.0
"""Most seconds between the times of a pair: a camera may record whole seconds, and writes after the exposure."""
NEAR_M = 30.0
"""Most metres between two fixes, each from its own receiver."""
FARTHEST_S = 14 * 3600.0 + 600.0
"""Largest offset: the farthest time zones, and a clock that is ten minutes wrong."""
ZONE_S, WRONG_S, ZONE_DOUBT = 900.0, 450.0, 0.1
"""Time zones differ by quarters of an hour; the farther a clock is from one, the lower its score."""
BIN_S = 0.5
MOST_PAIRS = 4_000_000
"""Most pairs when searching for an offset; more are thinned out."""
BLUR_M = 0.02
"""Motion on the line during the exposure from which a picture counts as blurred."""
Key = tuple[str, str]
"""A vehicle and its camera."""
THUMBNAIL_PX = (320, 240)
QUALITY = 70
MOST = 60
"""Most thumbnails of one asset; the table lists all its pictures."""
SMALL_PX = (160, 120)
MOST_SMALL = 4
"""Most small thumbnails of one asset in report.html."""
MOST_SMALL_BYTES = 9_000_000
"""Most bytes of all small thumbnails: reports are sent by e-mail, which adds a third."""
BEGIN, END = "<!-- pictures -->", "<!-- end of pictures -->"
"""Markers around the pictures in report.html."""


@dataclass(frozen=True, slots=True)
class PictureFile:
    """One file of a card."""

    path: Path
    taken_s: float | None
    """Unix time by the camera's clock, taken as UTC if the file names no time zone."""
    lat_deg: float | None
    lon_deg: float | None
    camera: str
    """Make, model and serial number, as far as known."""
    exposure_s: float | None
    digest: str
    """Digest of its content: the same for a copy."""
    unreadable: str = ""
    """Reason why it cannot be read; empty if it can."""


def find_picture_files(folder: Path) -> Iterator[PictureFile]:
    """Yield all pictures below a folder, sorted by name.

    Raises:
        OSError: The folder cannot be read.
    """
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            yield read_picture(path)


def read_picture(path: Path) -> PictureFile:
    """Return a file's metadata; errors are noted in it, and nothing is raised."""
    from PIL import Image, UnidentifiedImageError

    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        with Image.open(path) as image:
            exif = image.getexif()
            details, gps = exif.get_ifd(DETAILS), exif.get_ifd(GPS)
        taken_s = _read_time(details)
        lat_deg, lon_deg = _read_degrees(gps, 2, 1, "S"), _read_degrees(gps, 4, 3, "W")
        camera = " ".join(
            str(part).strip("\0 ") for part in (exif.get(MAKE), exif.get(MODEL), details.get(SERIAL)) if part
        )
        return PictureFile(path, taken_s, lat_deg, lon_deg, camera, _to_number(details.get(EXPOSURE)), digest)
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError, TypeError, KeyError) as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        return PictureFile(path, None, None, None, "", None, "", f"expected a picture: {why}")


def _read_time(details: dict[int, object]) -> float | None:
    text = str(details.get(ORIGINAL) or "").strip("\0 ")
    try:
        local = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007 - its time zone is elsewhere, if anywhere
    except ValueError:
        return None
    fraction = re.sub(r"\D", "", str(details.get(SUBSECOND) or ""))
    part_s = float(f"0.{fraction}") if fraction else 0.0
    zone = re.fullmatch(r"([+-])(\d\d):(\d\d)", str(details.get(OFFSET) or "").strip("\0 "))
    away = timedelta()
    if zone is not None:
        away = timedelta(hours=int(zone[2]), minutes=int(zone[3])) * (-1 if zone[1] == "-" else 1)
    return local.replace(tzinfo=timezone(away)).timestamp() + part_s


def _to_number(value: object) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]  # the file may hold anything
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) else None


def _read_degrees(gps: dict[int, object], place: int, side: int, negative: str) -> float | None:
    parts = gps.get(place)
    if not isinstance(parts, tuple) or len(parts) != 3:
        return None
    numbers = [_to_number(part) for part in parts]
    if any(number is None for number in numbers):
        return None
    whole, minutes, seconds = (number or 0.0 for number in numbers)
    degrees = whole + minutes / 60.0 + seconds / 3600.0
    return -degrees if str(gps.get(side, "")).strip("\0 ").upper().startswith(negative) else degrees


def build_gps_tags(lat_deg: float, lon_deg: float, alt_m: float) -> dict[int, object]:
    """Return a position as EXIF tags."""
    return {
        0: b"\2\3\0\0",
        1: "N" if lat_deg >= 0 else "S",
        2: _to_sexagesimal(lat_deg),
        3: "E" if lon_deg >= 0 else "W",
        4: _to_sexagesimal(lon_deg),
        5: b"\1" if alt_m < 0 else b"\0",
        6: round(abs(alt_m), 2),
    }


def _to_sexagesimal(angle_deg: float) -> tuple[float, float, float]:
    left = round(abs(angle_deg) * 3600, 4)
    return float(left // 3600), float(left % 3600 // 60), round(left % 60, 4)


def write_place_exif(path: Path, lat_deg: float, lon_deg: float, alt_m: float) -> None:
    """Write the position of a picture into its file, without changing any pixel.

    Raises:
        OSError: It is no JPEG, or cannot be written.
    """
    from PIL import Image

    with Image.open(path) as image:
        if image.format != "JPEG":
            raise OSError(f"{path}: expected a JPEG")
        exif = image.getexif()
        exif.get_ifd(DETAILS)  # keep its content when it is written again
        exif.get_ifd(GPS).update(build_gps_tags(lat_deg, lon_deg, alt_m))
        block = exif.tobytes()
    write_whole(path, replace_exif(path.read_bytes(), block))


def replace_exif(jpeg: bytes, block: bytes) -> bytes:
    """Return a JPEG with another EXIF block, otherwise unchanged.

    Raises:
        OSError: It is no JPEG.
    """
    if jpeg[:2] != b"\xff\xd8":
        raise OSError("expected a JPEG")
    block = block if block.startswith(EXIF_HEAD) else EXIF_HEAD + block
    kept, at = [], 2
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF and jpeg[at + 1] != START_OF_SCAN:
        size = 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        segment = jpeg[at : at + size]
        if not (segment[1] == APP1 and segment[4:10] == EXIF_HEAD):
            kept.append(segment)
        at += size
    head = bytes((0xFF, APP1)) + (len(block) + 2).to_bytes(2, "big") + block
    return jpeg[:2] + head + b"".join(kept) + jpeg[at:]


def write_place_xmp(path: Path, lat_deg: float, lon_deg: float, alt_m: float) -> Path:
    """Write the position of a picture into a separate XMP file next to it, which photo software reads.

    Raises:
        OSError: It cannot be written.
    """
    beside = path.with_suffix(".xmp")
    content = render_template(
        "place.xmp", latitude=_format_minutes(lat_deg, "NS"), longitude=_format_minutes(lon_deg, "EW"),
        centimetres=round(abs(alt_m) * 100), below_sea=int(alt_m < 0),
    )  # fmt: skip
    write_whole(beside, content.encode())
    return beside


def _format_minutes(angle_deg: float, sides: str) -> str:
    degrees, minutes = divmod(abs(angle_deg) * 60, 60)
    return f"{degrees:.0f},{minutes:.6f}{sides[angle_deg < 0]}"


@dataclass(frozen=True, slots=True)
class PlacedTimes:
    """Times in ascending order, with positions if known."""

    times_s: FloatArray
    places_m: FloatArray
    """(n, 2) float64, NaN if unknown."""


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """Offset of a card's clock."""

    ahead_s: float
    """Seconds by which it is ahead."""
    pairs: list[tuple[int, int]]
    """Its files that then coincide with pictures, and these pictures, by their places in time."""
    score: float
    """Quality of the pairs: two cameras that fly alike have as many, but not as close ones."""


def build_placed_times(frame: LocalFrame, rows: list[tuple[float, float | None, float | None]]) -> PlacedTimes:
    """Return times with positions, from times, latitudes and longitudes."""
    places = [
        (np.nan, np.nan) if lat_deg is None or lon_deg is None else frame.to_local_m(lat_deg, lon_deg)
        for _, lat_deg, lon_deg in rows
    ]
    times = np.array([row[0] for row in rows], dtype=np.float64)
    return PlacedTimes(times, np.array(places, dtype=np.float64).reshape(-1, 2))


def find_clock_offset(card: PlacedTimes, pictures: PlacedTimes) -> ClockOffset | None:
    """Return the offset at which most files coincide with pictures; None if none do."""
    apart_s = _compute_differences_s(card, pictures)
    apart_s = apart_s[np.abs(apart_s) <= FARTHEST_S]
    if not len(apart_s):
        return None
    low_s = float(apart_s.min())
    counts = np.bincount(((apart_s - low_s) / BIN_S).astype(np.int64))
    pairs = counts + np.append(counts[1:], 0)
    middle_s = low_s + (int(pairs.argmax()) + 1) * BIN_S
    near = apart_s[np.abs(apart_s - middle_s) <= BIN_S]
    ahead_s = float(np.median(near))
    together = match_times(card, pictures, ahead_s)
    apart_s = np.array([card.times_s[file] - ahead_s - pictures.times_s[picture] for file, picture in together])
    wrong = ZONE_DOUBT * min(1.0, abs((ahead_s + ZONE_S / 2) % ZONE_S - ZONE_S / 2) / WRONG_S)
    return ClockOffset(ahead_s, together, float((1.0 - np.abs(apart_s) / TOLERANCE_S).sum()) * (1.0 - wrong))


def _compute_differences_s(card: PlacedTimes, pictures: PlacedTimes) -> FloatArray:
    """Return the time of each file minus that of each picture, for possible pairs."""
    thin = max(1, int(np.ceil(len(card.times_s) * len(pictures.times_s) / MOST_PAIRS)))
    times_s, places_m = card.times_s[::thin], card.places_m[::thin]
    apart_s = times_s[:, np.newaxis] - pictures.times_s
    apart_m = np.hypot(*np.moveaxis(places_m[:, np.newaxis] - pictures.places_m, 2, 0))
    return np.asarray(apart_s[~(apart_m > NEAR_M)])


def match_times(card: PlacedTimes, pictures: PlacedTimes, ahead_s: float) -> list[tuple[int, int]]:
    """Return all coinciding (file, picture) pairs, each file and picture at most once, closest in time first."""
    times_s = card.times_s - ahead_s
    candidates: list[tuple[float, int, int]] = []
    for file, at_s in enumerate(times_s):
        first = int(np.searchsorted(pictures.times_s, at_s - TOLERANCE_S))
        last = int(np.searchsorted(pictures.times_s, at_s + TOLERANCE_S))
        for picture in range(first, last):
            apart_m = float(np.hypot(*(card.places_m[file] - pictures.places_m[picture])))
            if not apart_m > NEAR_M:
                candidates.append((abs(float(pictures.times_s[picture] - at_s)), file, picture))
    taken_files: set[int] = set()
    taken_pictures: set[int] = set()
    pairs = []
    for _, file, picture in sorted(candidates):
        if file not in taken_files and picture not in taken_pictures:
            taken_files.add(file)
            taken_pictures.add(picture)
            pairs.append((file, picture))
    return sorted(pairs)


@dataclass(frozen=True, slots=True)
class FileMatch:
    """A file and its picture."""

    file: PictureFile
    image: ImageRow
    ahead_s: float
    """Seconds by which the camera's clock is ahead."""


@dataclass(frozen=True, slots=True)
class MemoryCard:
    """Files written by one camera."""

    name: str
    files: tuple[PictureFile, ...]
    key: Key | None = None
    """Vehicle and camera of the files; None if they coincide with no camera's pictures."""
    offset: ClockOffset | None = None

    @property
    def timed(self) -> list[tuple[float, PictureFile]]:
        """Files with a known time, in order of time."""
        known = [(file.taken_s, file) for file in self.files if file.taken_s is not None]
        return sorted(known, key=lambda pair: pair[0])


@dataclass(frozen=True, slots=True)
class Matching:
    """Matches of a folder with an index."""

    matches: tuple[FileMatch, ...]
    cards: tuple[MemoryCard, ...]
    missing: tuple[ImageRow, ...]
    """Pictures without a file."""
    doubled: tuple[tuple[Path, Path], ...]
    """A file, and another with the same content."""
    strange: tuple[Path, ...]
    """Files that are no picture of this flight."""
    unreadable: tuple[tuple[Path, str], ...]
    blurred: tuple[FileMatch, ...] = ()
    misaimed: tuple[ImageRow, ...] = ()
    """Pictures that do not count, with their flaws."""
    unseen: tuple[AssetRow, ...] = field(default=())
    """Assets with missing pictures."""

    @property
    def is_complete(self) -> bool:
        """Return whether every picture has a file, and every asset was seen."""
        return not self.missing and not self.unseen


def match_files(index: ImageIndex, files: Sequence[PictureFile], folder: Path) -> Matching:
    """Match files to an index."""
    readable = [file for file in files if not file.unreadable]
    once, doubled = _remove_duplicates(readable)
    groups: dict[Key, list[ImageRow]] = {}
    for row in index.images:
        groups.setdefault((row.vehicle, row.camera), []).append(row)
    frame = _frame_of(index)
    pictures = {
        key: build_placed_times(frame, [(row.unix_s, row.lat_deg, row.lon_deg) for row in rows])
        for key, rows in groups.items()
    }
    cards = _assign_owners(_group_by_card(once, folder), pictures, frame)
    matches: list[FileMatch] = []
    for card in cards:
        if card.key is not None and card.offset is not None:
            timed, rows, found = card.timed, groups[card.key], card.offset
            matches += (FileMatch(timed[file][1], rows[picture], found.ahead_s) for file, picture in found.pairs)
    have = {id(match.image) for match in matches}
    used = {match.file.path for match in matches}
    return Matching(
        matches=tuple(matches),
        cards=tuple(cards),
        missing=tuple(row for row in index.images if id(row) not in have),
        doubled=tuple(doubled),
        strange=tuple(file.path for file in once if file.path not in used),
        unreadable=tuple((file.path, file.unreadable) for file in files if file.unreadable),
        blurred=tuple(match for match in matches if _is_blurred(match)),
        misaimed=tuple(row for row in index.images if row.flaw),
        unseen=tuple(row for row in index.assets if row.state != "seen"),
    )


def _remove_duplicates(files: Sequence[PictureFile]) -> tuple[list[PictureFile], list[tuple[Path, Path]]]:
    first: dict[str, PictureFile] = {}
    doubled = []
    for file in files:
        if file.digest in first:
            doubled.append((first[file.digest].path, file.path))
        else:
            first[file.digest] = file
    return list(first.values()), doubled


def _group_by_card(files: Sequence[PictureFile], folder: Path) -> list[MemoryCard]:
    """Return the files grouped by camera: one folder, make and serial number."""
    groups: dict[tuple[Path, str], list[PictureFile]] = {}
    for file in files:
        groups.setdefault((file.path.parent, file.camera), []).append(file)
    several = {place for place, _ in groups if sum(other == place for other, _ in groups) > 1}
    cards = []
    for (place, camera), own in groups.items():
        name = str(place.relative_to(folder)) if place != folder else "."
        cards.append(MemoryCard(f"{name} ({camera})" if place in several else name, tuple(own)))
    return cards


def _frame_of(index: ImageIndex) -> LocalFrame:
    first = index.images[0] if index.images else None
    return LocalFrame(0.0, 0.0) if first is None else LocalFrame(first.lat_deg, first.lon_deg)


def _assign_owners(cards: list[MemoryCard], pictures: dict[Key, PlacedTimes], frame: LocalFrame) -> list[MemoryCard]:
    """Assign each card to a camera, the best match first.

    A camera may have filled several cards; a card has pictures of one camera.
    """
    tried: list[tuple[float, int, Key, ClockOffset]] = []
    for number, card in enumerate(cards):
        files = build_placed_times(frame, [(taken_s, file.lat_deg, file.lon_deg) for taken_s, file in card.timed])
        for key, own in pictures.items():
            found = find_clock_offset(files, own) if len(files.times_s) else None
            # Any two series of times have some pairs at some offset.
            needed = max(1, min(len(files.times_s), len(own.times_s)) // 2)
            if found is not None and len(found.pairs) >= needed:
                tried.append((found.score, number, key, found))
    owned: dict[int, tuple[Key, ClockOffset]] = {}
    left = {key: len(own.times_s) for key, own in pictures.items()}
    for _, number, key, found in sorted(tried, key=lambda one: (-one[0], one[1], one[2])):
        if number not in owned and left[key] >= len(found.pairs) / 2:
            owned[number] = (key, found)
            left[key] -= len(found.pairs)
    return [
        MemoryCard(card.name, card.files, *owned[number]) if number in owned else card
        for number, card in enumerate(cards)
    ]


def _is_blurred(match: FileMatch) -> bool:
    exposure_s = match.file.exposure_s
    return exposure_s is not None and exposure_s * match.image.speed_m_s > BLUR_M


@dataclass(frozen=True, slots=True)
class ShownAsset:
    """An asset's data on pages."""

    name: str
    rows: tuple[AssetRow, ...]
    """Its requirements."""
    taken: int
    """Number of pictures that show it."""
    matches: tuple[FileMatch, ...]
    """Those pictures that have a file."""
    lacking: tuple[str, ...]
    """Missing parts, in words."""

    def make_thumbnails(self, most: int, size_px: tuple[int, int]) -> list[tuple[FileMatch, bytes | None]]:
        """Return its first pictures, each with its thumbnail."""
        return [(match, make_thumbnail(match.file.path, size_px)) for match in self.matches[:most]]


def write_assets_page(path: Path, index: ImageIndex, found: Matching) -> None:
    """Write assets.html: a page for each asset with its pictures, its requirements, and missing pictures.

    It is for the customer, and needs no network, script or other file, as thumbnails are embedded. Files without a
    thumbnail are listed by name. In print each asset begins a new page.

    Raises:
        OSError: It cannot be written.
    """
    assets = list_shown_assets(index, found)
    whole = sum(all(row.state == "seen" for row in asset.rows) for asset in assets)
    outcome = (
        f"{whole} of {len(assets)} assets were seen as requested; {len(found.matches)} of {len(index.images)} pictures"
    )
    page = render_template(
        "assets.html", outcome=outcome, complete=whole == len(assets) and not found.missing, assets=assets,
        most=MOST, size_px=THUMBNAIL_PX,
    )  # fmt: skip
    write_page(path, page)


def add_pictures_to_report(path: Path, index: ImageIndex, found: Matching) -> None:
    """Append small thumbnails of each asset to a flight's report.html, replacing older ones.

    Raises:
        OSError: It cannot be read or written.
    """
    if not path.is_file():
        return
    report = path.read_text(encoding="utf-8", errors="replace")
    before, _, rest = report.partition(BEGIN)
    after = rest.partition(END)[2] if rest else ""
    if not rest:
        before, closing, end = report.rpartition("</body>")
        after = closing + end
    left, shown = MOST_SMALL_BYTES, []
    for asset in list_shown_assets(index, found):
        thumbnails = asset.make_thumbnails(MOST_SMALL, SMALL_PX) if left > 0 else []
        left -= sum(len(content or b"") for _, content in thumbnails)
        shown.append((asset, thumbnails))
    pictures = render_template("report_pictures.html", shown=shown, width_px=SMALL_PX[0])
    write_page(path, f"{before.rstrip()}\n{BEGIN}\n{pictures}{END}\n{after.lstrip()}")


def list_shown_assets(index: ImageIndex, found: Matching) -> list[ShownAsset]:
    """Return the data of each asset that requires pictures."""
    return [_build_shown_asset(name, index, found) for name in dict.fromkeys(row.asset for row in index.assets)]


def _build_shown_asset(name: str, index: ImageIndex, found: Matching) -> ShownAsset:
    rows = tuple(row for row in index.assets if row.asset == name)
    gone = ", ".join(f"{row.vehicle} {row.camera} {row.sequence}" for row in found.missing if row.asset == name)
    return ShownAsset(
        name=name,
        rows=rows,
        taken=sum(row.asset == name for row in index.images),
        matches=tuple(match for match in found.matches if match.image.asset == name),
        lacking=(*(row.missing for row in rows if row.missing), *([f"no file of {gone}"] if gone else [])),
    )


def make_thumbnail(path: Path, size_px: tuple[int, int]) -> bytes | None:
    """Return a JPEG thumbnail of a picture; None if it cannot be read."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            image.thumbnail(size_px)
            content = io.BytesIO()
            image.convert("RGB").save(content, "JPEG", quality=QUALITY)
    except (OSError, ValueError, SyntaxError):
        return None
    return content.getvalue()
