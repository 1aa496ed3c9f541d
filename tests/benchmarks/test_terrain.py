"""The bench of large rasters: what it writes is read, and what it measured is on its page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import rasterio

from benchmarks import terrain


def test_a_step_reads_what_was_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    terrain.write_ground(tmp_path / terrain.RASTER, 700)
    terrain.write_lines(tmp_path / terrain.NETWORK, 40)
    with rasterio.open(tmp_path / terrain.RASTER) as dataset:
        assert dataset.shape == (700, 700)
        assert 700.0 < dataset.read(1).min() < dataset.read(1).max() < 1100.0
    terrain.measure_steps(str(tmp_path), "network", "1")
    terrain.measure_steps(str(tmp_path), "site", "1")
    alone, site = (terrain.MeasuredStep(**json.loads(line)) for line in capsys.readouterr().out.splitlines())
    assert alone.found == "40 spans"
    assert site.found.split(" cells kept, 10 m between nodes of its floor, ")[0].isdigit()
    assert 0 < alone.peak_mb <= site.peak_mb
    text = terrain.terrain_page({"machine": None, "spans": 40, "cells": 490_000, "raster_mb": 1}, [alone, site])
    assert "40 spans of 150 m" in text
    assert "| the network alone |" in text
