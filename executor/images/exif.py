"""What a picture's file says of itself, and how it is told where it was taken; the only reader and writer of files."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

from executor.adapters.templates import render_template
from missions.files import write_whole

SUFFIXES = frozenset({".jpg", ".jpeg", ".tif", ".tiff"})
GPS, DETAILS = 0x8825, 0x8769
MAKE, MODEL, ORIGINAL, SUBSECOND, OFFSET, EXPOSURE, SERIAL = 271, 272, 36867, 37521, 36881, 33434, 42033
APP1, START_OF_SCAN = 0xE1, 0xDA
EXIF_HEAD = b"Exif\0\0"


@dataclass(frozen=True, slots=True)
class PictureFile:
    """One file of a card."""

    path: Path
    taken_s: float | None
    """Seconds since 1970 by the camera's clock; as if it stood at UTC where it does not say its zone."""
    zoned: bool
    """Whether it says its time zone."""
    lat_deg: float | None
    lon_deg: float | None
    camera: str
    """Make, model and serial number, as far as it says them."""
    exposure_s: float | None
    digest: str
    """Of its content: a copy has the same."""
    unreadable: str = ""
    """Why nothing could be read of it."""


def find_picture_files(folder: Path) -> Iterator[PictureFile]:
    """Yield all pictures below a folder, in the order of their names.

    Raises:
        OSError: the folder cannot be read.
    """
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            yield read_picture(path)


def read_picture(path: Path) -> PictureFile:
    """Return what a file says; whatever is wrong with it is said, and nothing is raised."""
    from PIL import Image, UnidentifiedImageError

    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        with Image.open(path) as image:
            exif = image.getexif()
            details, gps = exif.get_ifd(DETAILS), exif.get_ifd(GPS)
        taken_s, zoned = _read_time(details)
        lat_deg, lon_deg = _read_degrees(gps, 2, 1, "S"), _read_degrees(gps, 4, 3, "W")
        camera = " ".join(
            str(part).strip("\0 ") for part in (exif.get(MAKE), exif.get(MODEL), details.get(SERIAL)) if part
        )
        return PictureFile(path, taken_s, zoned, lat_deg, lon_deg, camera, _to_number(details.get(EXPOSURE)), digest)
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError, TypeError, KeyError) as error:
        why = " ".join(str(error).split())[:200] or type(error).__name__
        return PictureFile(path, None, False, None, None, "", None, "", f"expected a picture: {why}")


def _read_time(details: dict[int, object]) -> tuple[float | None, bool]:
    text = str(details.get(ORIGINAL) or "").strip("\0 ")
    if not text:
        return None, False
    try:
        local = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")  # noqa: DTZ007 - its zone stands elsewhere, if anywhere
    except ValueError:
        return None, False
    fraction = re.sub(r"\D", "", str(details.get(SUBSECOND) or ""))
    part_s = float(f"0.{fraction}") if fraction else 0.0
    zone = re.fullmatch(r"([+-])(\d\d):(\d\d)", str(details.get(OFFSET) or "").strip("\0 "))
    away = timedelta()
    if zone is not None:
        away = timedelta(hours=int(zone[2]), minutes=int(zone[3])) * (-1 if zone[1] == "-" else 1)
    return local.replace(tzinfo=timezone(away)).timestamp() + part_s, zone is not None


def _to_number(value: object) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]  # whatever a file holds
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
    """Return a place as EXIF has it."""
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
    """Write where a picture was taken into its file; not a pixel of it is touched.

    Raises:
        OSError: it is no JPEG, or cannot be written.
    """
    from PIL import Image

    with Image.open(path) as image:
        if image.format != "JPEG":
            raise OSError(f"{path}: expected a JPEG")
        exif = image.getexif()
        exif.get_ifd(DETAILS)  # it is written again with what it holds
        exif.get_ifd(GPS).update(build_gps_tags(lat_deg, lon_deg, alt_m))
        block = exif.tobytes()
    write_whole(path, replace_exif(path.read_bytes(), block))


def replace_exif(jpeg: bytes, block: bytes) -> bytes:
    """Return a JPEG with another EXIF block, all else as it was.

    Raises:
        OSError: it is no JPEG.
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
    """Write where a picture was taken into a file of its own beside it, which programs for pictures read.

    Raises:
        OSError: it cannot be written.
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
