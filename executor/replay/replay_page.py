"""An HTML page for a replayed log: what would have been declared, on what evidence, with the timeline inside."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from executor.replay.replay_result import LogReplay, RecordedTruth
from missions.files import write_whole

_STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #8884; }
img { width: 100%; height: auto; background: #fff; }
h2 { font-size: 1.15rem; margin-top: 2rem; }
"""


def write_replay_page(replay: LogReplay, truth: RecordedTruth | None, picture: Path, path: Path) -> None:
    """Write the page; the picture goes into it."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        f"<title>{escape(replay.path.name)}</title><style>{_STYLE}</style>",
        f"<h1>{escape(replay.path.name)}</h1>",
        f"<p>{replay.lasted_s / 60:.1f} minutes, {len(replay.vehicles)} vehicles.</p>",
        *(f"<p>{escape(note)}</p>" for note in replay.notes),
        f"<img alt='timeline' src='data:image/png;base64,{b64encode(picture.read_bytes()).decode()}'>",
        "<h2>Declared</h2>",
        _render_table(
            ("vehicle", "kind", "reason", "at (s)", "t_usec", "evidence"),
            [
                (vehicle.name, one.kind.value, one.reason, _format_s(replay, one.t_usec), one.t_usec, one.evidence)
                for vehicle in replay.vehicles
                for one in vehicle.declarations
            ],
        ),
        "<h2>Not well</h2>",
        _render_table(
            ("vehicle", "kind", "reason", "from (s)", "to (s)", "evidence"),
            [
                (
                    vehicle.name, one.kind.value, one.reason, _format_s(replay, one.from_usec),
                    _format_s(replay, one.to_usec),
                    one.evidence,
                )
                for vehicle in replay.vehicles
                for one in vehicle.degraded
            ],
        ),
    ]  # fmt: skip
    if truth is not None:
        rows = [(_format_s(replay, one.t_usec), one.what) for one in truth.events]
        parts += ["<h2>What really happened</h2>", _render_table(("at (s)", "what"), rows)]
    skipped = [(name.replace("_", " "), count) for name, count in replay.skipped.counts().items() if count]
    parts += ["<h2>Skipped</h2>", _render_table(("what", "how often"), skipped), "</html>"]
    write_whole(path, "\n".join(parts).encode())


def _format_s(replay: LogReplay, usec: int) -> str:
    return f"{(usec - replay.began_usec) / 1e6:.1f}"


def _render_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = ["<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows]
    if not lines:
        return "<p>Nothing.</p>"
    return "<table><tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>" + "".join(lines) + "</table>"
