"""Cost of a large raster and a large network: seconds and memory for reading the ground, a site, and a plan.

Each step runs in its own process, like a command, so that its memory is what that command needs.
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.errors import BenchError
from benchmarks.machine import machine, machine_line
from benchmarks.markdown import figure, markdown_page, markdown_table
from benchmarks.store import keep_result
from executor.adapters.extras import Extra, require_extra
from executor.simulated.simulated_fleet import LISTENING, build_vehicle_tables
from executor.site import site_model
from executor.site.site_file import check_site
from executor.site.site_planning import DEFAULT, plan_site
from missions.geo import FloatArray, LocalFrame

Axis = np.ndarray[tuple[int, ...], np.dtype[np.floating[Any]]]

LAT_DEG, LON_DEG = 46.6, 10.4
DEGREES = 1.0 / 3600.0
"""Size of a cell, as in Copernicus GLO-30."""
STRIP = 512
LINES = 40
SPAN_M = 150.0
VEHICLES = 100
SITE, RASTER, NETWORK = "site.toml", "Copernicus_DSM_COG_10_bench.tif", "lines.geojson"


@dataclass(frozen=True, slots=True)
class MeasuredStep:
    """One step in its own process."""

    name: str
    seconds: float
    processor_s: float
    """Processor time of all its threads, excluding other processes."""
    peak_mb: float
    """Peak resident memory of the process."""
    found: str
    """Result of the step, in words."""


def make_terrain(out: Path | None, *, spans: int, megacells: float, seconds: float) -> tuple[dict[str, object], str]:
    """Measure, and write terrain.md and terrain.json if requested.

    Args:
        out: Directory for the files.
        spans: Spans of the network.
        megacells: Millions of cells of the raster.
        seconds: Time of the solver.

    Raises:
        BenchError: a step did not end.
    """
    require_extra(Extra.TERRAIN, "bench terrain")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        side = round(1000.0 * math.sqrt(megacells))
        write_ground(folder / RASTER, side)
        write_lines(folder / NETWORK, spans)
        megabytes = (folder / RASTER).stat().st_size / 1e6
        steps = [_step(folder, kind, seconds) for kind in ("network", "site", "plan")]
    content: dict[str, object] = {
        "machine": machine(),
        "spans": spans,
        "cells": side * side,
        "raster_mb": round(megabytes),
        "steps": [asdict(step) for step in steps],
    }
    text = terrain_page(content, steps)
    if out is not None:
        keep_result("terrain", content, text, out)
    return content, text


def terrain_page(content: dict[str, object], steps: list[MeasuredStep]) -> str:
    """Return the page of the results."""
    made = content["machine"]
    rows = [
        (step.name, figure(step.seconds), figure(step.processor_s), figure(step.peak_mb, 0), step.found)
        for step in steps
    ]
    return markdown_page(
        "Large rasters and networks",
        machine_line(made) if isinstance(made, dict) else "",
        f"`faultline bench terrain`: {content['spans']} spans of {SPAN_M:g} m in {LINES} lines, {VEHICLES} vehicles "
        f"with large batteries, poles' heights from a raster of {content['cells']} cells of one second of arc (GeoTIFF "
        f"in tiles, {content['raster_mb']} MB on the disk). Each step is a separate process that starts from the "
        "files; processor time includes the start of the interpreter, and memory is the largest resident size, "
        "libraries included.",
        markdown_table(("step", "s", "processor, s", "peak MB", "result"), rows),
    )


def write_ground(path: Path, side: int) -> None:
    """Write a raster of hills, some rows at a time."""
    import rasterio
    from affine import Affine
    from rasterio.windows import Window

    west, north = LON_DEG - side / 2 * DEGREES, LAT_DEG + side / 2 * DEGREES
    east = np.arange(side) * (DEGREES * 76_500.0)
    with rasterio.open(
        path, "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs="EPSG:4326",
        transform=Affine(DEGREES, 0.0, west, 0.0, -DEGREES, north), nodata=-32767.0, tiled=True, blockxsize=512,
        blockysize=512, compress="deflate", predictor=3,
    ) as dataset:  # fmt: skip
        for first in range(0, side, STRIP):
            rows = min(STRIP, side - first)
            south = ((first + np.arange(rows)) * (DEGREES * 111_200.0))[:, np.newaxis]
            dataset.write(_hills_m(east, south).astype(np.float32), 1, window=Window(0, first, side, rows))


def _hills_m(east_m: Axis, south_m: Axis) -> FloatArray:
    up_m = 900.0 + 60.0 * np.sin(east_m / 900.0) * np.cos(south_m / 700.0)
    up_m = up_m + 35.0 * (1.0 - np.abs(np.sin((east_m + 0.6 * south_m) / 520.0)))
    return np.asarray(np.round(up_m + 8.0 * np.sin(east_m / 110.0 + south_m / 160.0), 1))


def write_lines(path: Path, spans: int) -> None:
    """Write lines from the depot in all directions, with a pole at the end of each span."""
    frame, rng = LocalFrame(LAT_DEG, LON_DEG), np.random.default_rng(1)
    features: list[object] = []
    counts = [len(part) for part in np.array_split(np.arange(spans), LINES)]
    for number, count in enumerate(counts):
        heading = 2 * math.pi * number / len(counts)
        turns = heading + np.cumsum(rng.uniform(-0.01, 0.01, count))
        steps = SPAN_M * np.column_stack((np.sin(turns), np.cos(turns)))
        first = 1500.0 * np.array([[math.sin(heading), math.cos(heading)]])
        places = frame.many_to_wgs84_deg(np.cumsum(np.concatenate((first, steps)), axis=0))[:, ::-1].round(7).tolist()
        features.append(_feature("LineString", places, {"name": f"line {number}"}))
        features += [_feature("Point", place, {"id": f"{number}-{pole}"}) for pole, place in enumerate(places)]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")


def _feature(kind: str, coordinates: object, properties: dict[str, str]) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def _step(folder: Path, kind: str, seconds: float) -> MeasuredStep:
    code = "import sys; from benchmarks.terrain import measure_steps; measure_steps(*sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", code, str(folder), kind, str(seconds)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise BenchError(f"bench terrain: {kind}: {done.stderr.strip().splitlines()[-1]}")
    return MeasuredStep(**json.loads(done.stdout.splitlines()[-1]))


def measure_steps(folder: str, kind: str, seconds: str) -> None:
    """Run one step in this process, and print it."""
    base, begun_s = Path(folder), time.perf_counter()
    site = check_site(_site(), SITE)
    if kind == "network":
        from missions import import_network

        known = import_network(base / NETWORK, depot=(LAT_DEG, LON_DEG, None)).network
        step, found = "the network alone", f"{len(known.segments)} spans"
    else:
        ground = site_model.load_site_model(site, base)
        layers = ground.setup.layers
        known_ground = "" if layers.known is None else f"{layers.known.highest.step_m:.0f} m between nodes of its floor"
        step = "with the ground: the whole site"
        cells = 0 if ground.terrain is None else sum(tile.heights_m.size for tile in ground.terrain.elevation.tiles)
        found = f"{cells} cells kept, {known_ground}, layers {layers.spacing_m:.1f} m apart"
        if kind == "plan":
            plan = plan_site(ground, replace(DEFAULT, seconds=float(seconds)))
            covered = len(plan.segments) - len(plan.plan.uncovered)
            step, found = f"the same, and a plan ({seconds} s of search)", f"{covered} spans planned"
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    done = MeasuredStep(step, time.perf_counter() - begun_s, time.process_time(), peak_mb, found)
    print(json.dumps(asdict(done)))


def _site() -> dict[str, object]:
    return {
        "depot": {"lat_deg": LAT_DEG, "lon_deg": LON_DEG},
        "network": {"file": NETWORK, "pylon_height_m": 30.0},
        "terrain": {"files": RASTER},
        "inspection": {"ceiling_m": 400.0, "return_ceiling_m": 900.0},
        "energy": {"capacity_ah": 400.0},
        "vehicle": build_vehicle_tables(LISTENING[:VEHICLES], "px4"),
    }
