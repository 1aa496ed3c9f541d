"""From the settings to the files of a table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from executor.bench.machine import machine
from executor.bench.progress import ShownProgress
from executor.bench.store import Store, write_result, write_text
from executor.bench.table.cells import Summary, summary_of
from executor.bench.table.make import Maker, make
from executor.bench.table.report import report
from executor.bench.table.settings import SOLVERS, TableSettings


def make_table(settings: TableSettings, out: Path, *, jobs: int, fresh: bool) -> tuple[Summary, ...]:
    """Make a table and write table.md, table.json and table.png; return what it shows against each solver.

    Raises:
        BenchError: the directory cannot be written.
        missions.MissionsError: the network cannot be used.
    """
    store = Store(out / "table", fresh=fresh)
    with ShownProgress() as shown:
        cells = make(Maker(settings, store, jobs, shown.told))
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
    # Only here: it takes a second to load.
    from executor.bench.table.picture import draw_table

    draw_table(cells, out / "table.png")
    return summaries
