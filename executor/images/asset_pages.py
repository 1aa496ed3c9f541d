"""assets.html: a page for each asset with its pictures, what was asked of it, and what is missing; for the customer.

It needs no network, no script and no other file: the thumbnails are inside. On paper each asset begins a new page. The
flight's own report.html is given some small ones of each asset, and leads there.
"""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from executor.images.index_files import ImageIndex
from executor.images.index_rows import AssetRow, ImageRow
from executor.images.matching import FileMatch, Matching
from missions.files import write_whole

THUMBNAIL_PX = (320, 240)
QUALITY = 70
MOST = 60
"""Thumbnails of one asset; all of its pictures are in the table."""
SMALL_PX = (160, 120)
MOST_SMALL = 4
"""Small thumbnails of one asset in report.html."""
MOST_SMALL_BYTES = 12_000_000
"""Of them all: a report is sent by mail."""
BEGIN, END = "<!-- pictures -->", "<!-- end of pictures -->"
"""About what is put into report.html."""
_STYLE = """
:root { color-scheme: light dark; --ink: #1c1c1c; --paper: #ffffff; --rule: #cccccc; --faint: #5f5f5f; --good: #0b6b3a;
  --bad: #b01010; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --paper: #16181b; --rule: #44484e; --faint: #a6a6a6;
  --good: #6fd39b; --bad: #ff8a80; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 72rem;
  margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; border-bottom: 1px solid var(--rule); margin-top: 2.5rem; }
.good { color: var(--good); } .bad { color: var(--bad); }
p.facts, figcaption { color: var(--faint); font-size: .92rem; }
div.pictures { display: flex; flex-wrap: wrap; gap: .75rem; }
figure { margin: 0; width: 200px; } figure img { width: 100%; height: auto; display: block; border-radius: 4px; }
figure.flaw img { outline: 3px solid var(--bad); }
table { border-collapse: collapse; font-size: .92rem; } td, th { text-align: left; padding: .2rem .9rem .2rem 0;
  border-bottom: 1px solid var(--rule); }
@media print { section { break-before: page; } figure, tr { break-inside: avoid; } }
"""


def write_assets_page(path: Path, index: ImageIndex, found: Matching) -> None:
    """Write the page; a file that no thumbnail can be made of is named without one.

    Raises:
        OSError: it cannot be written.
    """
    write_whole(path, render_assets_page(index, found).encode("utf-8", errors="xmlcharrefreplace"))


def render_assets_page(index: ImageIndex, found: Matching) -> str:
    """Return the page."""
    assets = list(dict.fromkeys(row.asset for row in index.assets))
    seen = {name: [row for row in index.assets if row.asset == name] for name in assets}
    whole = sum(all(row.state == "seen" for row in rows) for rows in seen.values())
    head = f"{whole} of {len(assets)} assets were seen as asked; {len(found.matches)} of {len(index.images)} pictures"
    sections = "\n".join(_render_section(name, seen[name], index.images, found) for name in assets)
    kind = "good" if whole == len(assets) and not found.missing else "bad"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(head)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f'<h1 class="{kind}">{escape(head)} have a file.</h1>\n{_render_contents(seen)}\n{sections}\n</body>\n</html>\n'
    )


def add_pictures_to_report(path: Path, index: ImageIndex, found: Matching) -> None:
    """Put small thumbnails of each asset into a flight's report.html, in the place of older ones; nothing without one.

    Raises:
        OSError: it cannot be read or written.
    """
    if path.is_file():
        text = path.read_text(encoding="utf-8", errors="replace")
        write_whole(path, add_pictures(text, index, found).encode("utf-8", errors="xmlcharrefreplace"))


def add_pictures(report: str, index: ImageIndex, found: Matching) -> str:
    """Return a report with the pictures of each asset at its end."""
    before, _, rest = report.partition(BEGIN)
    after = rest.partition(END)[2] if rest else ""
    if not rest:
        before, closing, end = report.rpartition("</body>")
        after = closing + end
    left, parts = MOST_SMALL_BYTES, []
    for name in dict.fromkeys(row.asset for row in index.assets):
        rows = [row for row in index.assets if row.asset == name]
        matches = [match for match in found.matches if match.image.asset == name]
        figures = "".join(_render_figures(matches[:MOST_SMALL], SMALL_PX)) if left > 0 else ""
        figures = figures.replace("<figure", f'<figure style="width: {SMALL_PX[0]}px; margin: 0"')
        left -= len(figures)
        missing = "; ".join(row.missing for row in rows if row.missing)
        words = f"{len(matches)} of {sum(row.asset == name for row in index.images)} pictures have a file"
        words = f"{words}; missing: {missing}" if missing else words
        kind = "bad" if missing else "facts"
        parts.append(
            f'<h3><a href="assets.html#{escape(name)}">{escape(name)}</a></h3>\n<p class="{kind}">{escape(words)}</p>\n'
            f'<div style="display: flex; flex-wrap: wrap; gap: .5rem">{figures}</div>'
        )
    shown = "\n".join(parts)
    return f"{before.rstrip()}\n{BEGIN}\n<h2>Pictures by asset</h2>\n{shown}\n{END}\n{after.lstrip()}"


def _render_contents(seen: dict[str, list[AssetRow]]) -> str:
    rows = "".join(
        f'<tr><td><a href="#{escape(name)}">{escape(name)}</a></td><td>{escape(row.camera)}</td>'
        f'<td class="{"good" if row.state == "seen" else "bad"}">{escape(row.state)}</td>'
        f"<td>{escape(row.missing)}</td></tr>"
        for name, own in seen.items()
        for row in own
    )
    return f"<table><thead><tr><th>asset<th>camera<th>state<th>missing</tr></thead><tbody>{rows}</tbody></table>"


def _render_section(name: str, rows: Sequence[AssetRow], images: Sequence[ImageRow], found: Matching) -> str:
    asked = "; ".join(_describe_request(row) for row in rows)
    lacks = [row.missing for row in rows if row.missing]
    gone = [row for row in found.missing if row.asset == name]
    if gone:
        lacks.append(f"no file of {', '.join(f'{row.vehicle} {row.camera} {row.sequence}' for row in gone)}")
    matches = [match for match in found.matches if match.image.asset == name]
    own = sum(row.asset == name for row in images)
    missing = f'<p class="bad">Missing: {escape("; ".join(lacks))}</p>' if lacks else '<p class="good">Complete.</p>'
    more = f"<p>and {len(matches) - MOST} more</p>" if len(matches) > MOST else ""
    return (
        f'<section id="{escape(name)}">\n<h2>{escape(name)}</h2>\n<p class="facts">Asked: {escape(asked)}. '
        f"{own} pictures were taken, {len(matches)} have a file.</p>\n{missing}\n"
        f'<div class="pictures">{"".join(_render_figures(matches[:MOST]))}</div>{more}\n</section>'
    )


def _describe_request(row: AssetRow) -> str:
    every = f" every {row.every_m:g} m" if row.every_m else ""
    return f"{row.camera}: {row.take}{every}"


def _render_figures(matches: Sequence[FileMatch], size_px: tuple[int, int] = THUMBNAIL_PX) -> Iterator[str]:
    for match in matches:
        image = match.image
        words = f"{image.viewpoint}, {image.vehicle}, {match.file.path.name}"
        flaw = f" ({image.flaw})" if image.flaw else ""
        content = make_thumbnail(match.file.path, size_px)
        shown = "no thumbnail" if content is None else (
            f'<img src="data:image/jpeg;base64,{b64encode(content).decode("ascii")}" alt="{escape(words)}">'
        )  # fmt: skip
        kind = ' class="flaw"' if image.flaw else ""
        yield f"<figure{kind}>{shown}<figcaption>{escape(words + flaw)}</figcaption></figure>"


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
