"""assets.html: a page for each asset with its pictures, what was asked of it, and what is missing; for the customer.

It needs no network, no script and no other file: the thumbnails are inside. On paper each asset begins a new page. The
flight's own report.html is given some small ones of each asset, and leads there.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

from executor.adapters.templates import render_template, write_page
from executor.images.index_files import AssetRow, ImageIndex
from executor.images.matching import FileMatch, Matching

THUMBNAIL_PX = (320, 240)
QUALITY = 70
MOST = 60
"""Thumbnails of one asset; all of its pictures are in the table."""
SMALL_PX = (160, 120)
MOST_SMALL = 4
"""Small thumbnails of one asset in report.html."""
MOST_SMALL_BYTES = 9_000_000
"""Of them all: a report is sent by mail, in which they take a third more."""
BEGIN, END = "<!-- pictures -->", "<!-- end of pictures -->"
"""About what is put into report.html."""


@dataclass(frozen=True, slots=True)
class ShownAsset:
    """What pages show of an asset."""

    name: str
    rows: tuple[AssetRow, ...]
    """What was asked of it."""
    taken: int
    """How many pictures show it."""
    matches: tuple[FileMatch, ...]
    """Those of them that have a file."""
    lacking: tuple[str, ...]
    """What is missing, in words."""

    def make_thumbnails(self, most: int, size_px: tuple[int, int]) -> list[tuple[FileMatch, bytes | None]]:
        """Return its first pictures, each with its thumbnail."""
        return [(match, make_thumbnail(match.file.path, size_px)) for match in self.matches[:most]]


def write_assets_page(path: Path, index: ImageIndex, found: Matching) -> None:
    """Write the page; a file that no thumbnail can be made of is named without one.

    Raises:
        OSError: it cannot be written.
    """
    write_page(path, render_assets_page(index, found))


def render_assets_page(index: ImageIndex, found: Matching) -> str:
    """Return the page."""
    assets = list_shown_assets(index, found)
    whole = sum(all(row.state == "seen" for row in asset.rows) for asset in assets)
    outcome = (
        f"{whole} of {len(assets)} assets were seen as asked; {len(found.matches)} of {len(index.images)} pictures"
    )
    return render_template(
        "assets.html", outcome=outcome, complete=whole == len(assets) and not found.missing, assets=assets,
        most=MOST, size_px=THUMBNAIL_PX,
    )  # fmt: skip


def add_pictures_to_report(path: Path, index: ImageIndex, found: Matching) -> None:
    """Put small thumbnails of each asset into a flight's report.html, in the place of older ones; nothing without one.

    Raises:
        OSError: it cannot be read or written.
    """
    if path.is_file():
        write_page(path, add_pictures(path.read_text(encoding="utf-8", errors="replace"), index, found))


def add_pictures(report: str, index: ImageIndex, found: Matching) -> str:
    """Return a report with the pictures of each asset at its end."""
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
    return f"{before.rstrip()}\n{BEGIN}\n{pictures}{END}\n{after.lstrip()}"


def list_shown_assets(index: ImageIndex, found: Matching) -> list[ShownAsset]:
    """Return what there is to show of each asset that asked for pictures."""
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
    """Return a picture made small, as JPEG; None where it cannot be read."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            image.thumbnail(size_px)
            content = io.BytesIO()
            image.convert("RGB").save(content, "JPEG", quality=QUALITY)
    except (OSError, ValueError, SyntaxError):
        return None
    return content.getvalue()
