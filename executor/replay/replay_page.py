"""An HTML page for a replayed log: what would have been declared, on what evidence, with the timeline inside."""

from __future__ import annotations

from pathlib import Path

from executor.adapters.templates import render_template, write_page
from executor.replay.replay_result import LogReplay, RecordedTruth


def write_replay_page(replay: LogReplay, truth: RecordedTruth | None, picture: Path, path: Path) -> None:
    """Write the page; the picture goes into it."""
    write_page(path, render_template("replay.html", replay=replay, truth=truth, picture=picture.read_bytes()))
