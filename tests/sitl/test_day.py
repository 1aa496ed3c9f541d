"""Two sorties of real autopilots in one flight: the crew changes packs, and one is lost on its second sortie."""

from __future__ import annotations

import asyncio
import itertools
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import rasterio
import tomlkit
from affine import Affine

from executor.site import site_model
from missions import Network, Selection, default_network_path, import_network
from tests.e2e.flights import log_lines
from tests.e2e.judge import wrongly_counted
from tests.e2e.tlog import messages
from tests.ports import free_port
from tests.sitl.crew import Crew, flown, planned
from tests.sitl.flights import NAMES, VICTIM, Story, site_of
from tests.sitl.real import BOTH, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(2700)]

BUDGET_PCT = 12.0
"""Of each pack: thirteen segments take five sorties of three vehicles."""
ROUNDED_S = 0.1
"""The report's times are."""


@dataclass
class Losing(Crew):
    """One vehicle falls silent on its second sortie."""

    lost: bool = False

    async def look_after(self, vehicle: dict[str, Any]) -> None:
        """Do what a vehicle needs, or cut it off."""
        if vehicle["name"] == VICTIM and not self.lost and _inspects_on_its_second(vehicle):
            self.lost = True
            self.running[VICTIM].suspend()
        else:
            await super().look_after(vehicle)


def _inspects_on_its_second(vehicle: dict[str, Any]) -> bool:
    return (vehicle["turn"]["sortie"], vehicle["progress"]["phase"]) == (2, "inspect")


@BOTH
def test_lost_on_the_second_sortie(autopilot: Autopilot, tmp_path: Path) -> None:
    fly_a_day(autopilot, tmp_path, {})


@BOTH
def test_lost_on_the_second_sortie_over_terrain_next_to_a_closed_area(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    network = import_network(default_network_path(), Selection(), depot=None, radius_m=None).network
    write_ground(tmp_path / "ground.tif", network)
    corners = [network.frame.to_wgs84_deg(east_m, north_m) for east_m, north_m in corners_m(YARD_M)]
    terrain = {"files": "ground.tif", "vertical": "egm2008", "uncertainty_m": 1.0}
    run = fly_a_day(
        autopilot, tmp_path, {"terrain": terrain, "area": [{"name": "yard", "polygon": corners, "margin_m": 5.0}]}
    )
    west_m, south_m, east_m, north_m = YARD_M
    for name in NAMES:
        places = [network.frame.to_local_m(fix.lat / 1e7, fix.lon / 1e7)
                  for _, fix in messages(run / f"{name}.tlog", "GLOBAL_POSITION_INT")]  # fmt: skip
        inside = [place for place in places if west_m < place[0] < east_m and south_m < place[1] < north_m]
        assert places
        assert inside == [], (name, inside)


YARD_M = (-35.0, 200.0, 5.0, 240.0)
"""West, south, east and north of an area between the two lines: whoever changes from one to the other flies around."""


def corners_m(box_m: tuple[float, float, float, float]) -> tuple[tuple[float, float], ...]:
    west_m, south_m, east_m, north_m = box_m
    return (west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m)


def write_ground(path: Path, network: Network) -> None:
    """Write a raster of the ground between the pylons, by their distance, with a hill of 12 m where nothing stands."""
    known = np.array([(*network.frame.to_local_m(one.lat_deg, one.lon_deg), one.elevation_m) for one in network.pylons])
    cell, half = 1 / 3600 / 2, 60
    lat_deg, lon_deg = network.frame.lat_deg, network.frame.lon_deg
    heights = np.empty((2 * half, 2 * half), dtype=np.float32)
    for row in range(2 * half):
        for column in range(2 * half):
            place = lat_deg + (half - row - 0.5) * cell, lon_deg + (column + 0.5 - half) * cell
            east_m, north_m = network.frame.to_local_m(*place)
            weights = 1.0 / (np.hypot(known[:, 0] - east_m, known[:, 1] - north_m) + 1.0) ** 2
            hill_m = 12.0 * math.exp(-((east_m + 15.0) ** 2 + (north_m - 330.0) ** 2) / 40.0**2)
            heights[row, column] = float(weights @ known[:, 2] / weights.sum()) + hill_m
    transform = Affine(cell, 0.0, lon_deg - half * cell, 0.0, -cell, lat_deg + half * cell)
    with rasterio.open(
        path, "w", driver="GTiff", height=2 * half, width=2 * half, count=1, dtype="float32", crs="EPSG:4326",
        transform=transform, nodata=-32767.0,
    ) as raster:  # fmt: skip
        raster.write(heights, 1)


def fly_a_day(autopilot: Autopilot, tmp_path: Path, more: dict[str, object]) -> Path:
    """Fly two sorties of three vehicles, one of which is lost on its second; return the run directory."""
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    port = free_port()
    story = Story(radius_m=400.0, page=port, tables={"day": {"begin": "08:00", "end": "16:00"}, **more})
    content = site_of(autopilot, story)
    tables = content.model_dump(exclude_none=True, mode="json")
    for vehicle in tables["vehicle"]:
        vehicle["budget_pct"] = BUDGET_PCT
    site, day, run = tmp_path / "site.toml", tmp_path / "day.json", tmp_path / "run"
    site.write_text(tomlkit.dumps(tables))
    ground = site_model.load_site_model(content, tmp_path)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    asyncio.run(planned(site, day))
    plan = json.loads(day.read_text())
    assert sum(one["vehicle"] == VICTIM for one in plan["routes"]) >= 2, plan["routes"]
    wanted = Wanted(pads, ground.network.frame, story.speedup, story.settings, frozenset())
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        crew = Losing(vehicles, httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}"))
        code, report = asyncio.run(flown(site, day, run, crew))
    said = [line["said"] for line in log_lines(run) if "said" in line]
    assert crew.lost, said
    assert code == 0, said
    assert report["segments_inspected"] == report["segments_total"] == 13, said
    assert [fault["vehicle"] for fault in report["faults"]] == [VICTIM], said
    assert [answer["outcome"] for answer in crew.answers] == ["accepted"] * len(crew.answers), crew.answers
    unseen = [one for one in wrongly_counted(run, report) if one[1] not in report["inferred"]]
    assert unseen == [], said
    rest = [vehicle for vehicle in report["vehicles"] if vehicle["name"] != VICTIM]
    assert all(vehicle["landed"] for vehicle in rest), said
    # Each sortie after the first has the pack that the crew put in for it; they take off one after the other.
    flown_with = [(row["vehicle"], row["pack"]) for row in report["sorties"] if row["pack"]]
    assert sorted(flown_with) == sorted(crew.changed), report["sorties"]
    began = sorted(row["began_s"] for row in report["sorties"])
    assert min(later - earlier for earlier, later in itertools.pairwise(began)) >= plan["stagger_s"] - ROUNDED_S
    return run
