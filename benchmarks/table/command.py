"""From the settings to the files of a table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from benchmarks.machine import machine
from benchmarks.progress import ShownProgress
from benchmarks.store import Store, write_result, write_text
from benchmarks.table.cells import Summary, summary_of
from benchmarks.table.make import Maker, make
from benchmarks.table.report import report
from benchmarks.table.settings import SOLVERS, TableSettings


def make_table(settings: TableSettings, out: Path, *, jobs: int, fresh: bool) -> tuple[Summary, ...]:
    """Make a table and write table.md, table.json and table.png; return its summary against each solver.

    Raises:
        BenchError: the directory cannot be written.
        missions.MissionsError: the network cannot be used.
    """
    store = Store(out / "table", fresh=fresh)
    with ShownProgress() as shown:
        cells = make(Maker(settings, store, jobs, shown.show_stage))
    about, summaries = machine(), tuple(summary_of(cells, solver.value) for solver in SOLVERS)
    network = "own" if settings.network is None else settings.network.name
    content = {
        "machine": about,
        "settings": {**asdict(settings), "network": network},
        "summary": [asdict(summary) for summary in summaries],
        "cells": [asdict(cell) for cell in cells],
    }
    write_result(out / "table.json", content)
    write_text(out / "table.md", report(cells, settings, about, "table.png"))
    # Imported here: loading takes a second.
    from benchmarks.table.picture import draw_table

    draw_table(cells, out / "table.png")
    return summaries
