"""A base of real autopilots closes with one of them in the air, and a spare of the other base flies what it leaves."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import tomlkit

from executor.site import site_model
from executor.site.site_model import SiteModel
from tests.e2e.flights import log_lines
from tests.e2e.judge import wrongly_counted
from tests.ports import free_port
from tests.sitl.crew import Crew, flown, planned
from tests.sitl.flights import NAMES, Story, site_of
from tests.sitl.real import BOTH, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(2700)]

BUDGET_PCT = 12.0
"""Of each pack: thirteen segments take three sorties of one vehicle, and two of the other."""
NORTH, SOUTH, SPARE = NAMES
BASES = {"north": (0.0, 90.0, [NORTH, SPARE]), "south": (0.0, -90.0, [SOUTH])}
"""Where they are, in metres east and north of the depot, and who stands there."""


WORDS = ("no take-off from it until it is opened", "take-offs from it are allowed again")
"""Said when a base is closed, and opened."""


@dataclass
class Closing(Crew):
    """Closes a base on the first sortie from there, sends the spare out, and opens it again."""

    orders: dict[str, dict[str, Any]] = field(default_factory=dict)
    """What was asked for beside changed packs, and what was answered."""
    seen: dict[str, dict[str, Any]] = field(default_factory=dict)
    """How each vehicle was shown last."""
    while_closed: set[str] = field(default_factory=set)
    """What the one at the closed base was said to wait for."""

    async def look_after(self, vehicle: dict[str, Any]) -> None:
        """Do what a vehicle or its base needs."""
        name = vehicle["name"]
        self.seen[name] = vehicle
        landed = self.seen.get(SOUTH, {}).get("state") == "landed"
        if "close" not in self.orders:
            if name == SOUTH and vehicle["progress"]["phase"] == "inspect":
                self.orders["close"] = await self.wish("close", base="south")
                await self.change(SPARE)
        elif "open" not in self.orders and landed and name == SOUTH:
            self.while_closed.add(vehicle["turn"]["text"])
            if self.seen.get(SPARE, {}).get("state") == "flying":
                self.orders["open"] = await self.wish("open", base="south")
        if name != SOUTH or "open" in self.orders:
            await super().look_after(vehicle)


def with_bases(autopilot: Autopilot, port: int, folder: Path) -> tuple[dict[str, Any], SiteModel]:
    """Return a site of two bases and a spare, as tables, and read."""
    frame = site_model.load_site_model(site_of(autopilot, Story(radius_m=400.0)), folder).network.frame
    bases = []
    for name, (east_m, north_m, own) in BASES.items():
        lat_deg, lon_deg = frame.to_wgs84_deg(east_m, north_m)
        bases.append({"name": name, "lat_deg": lat_deg, "lon_deg": lon_deg, "vehicles": own})
    day = {"begin": "08:00", "end": "16:00", "vehicle": [{"name": SPARE, "spare": True}]}
    content = site_of(autopilot, Story(radius_m=400.0, page=port, tables={"day": day, "base": bases}))
    tables = content.model_dump(exclude_none=True, mode="json")
    for vehicle in tables["vehicle"]:
        vehicle["budget_pct"] = BUDGET_PCT
    return tables, site_model.load_site_model(content, folder)


@BOTH
def test_a_base_closes_and_a_spare_flies_what_it_leaves(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    port, story = free_port(), Story()
    tables, ground = with_bases(autopilot, port, tmp_path)
    site, day, run = tmp_path / "site.toml", tmp_path / "day.json", tmp_path / "run"
    site.write_text(tomlkit.dumps(tables))
    asyncio.run(planned(site, day))
    plan = json.loads(day.read_text())
    assert {one["vehicle"] for one in plan["routes"]} == {NORTH, SOUTH}, plan["routes"]
    assert sum(one["vehicle"] == SOUTH for one in plan["routes"]) >= 2, plan["routes"]
    wanted = Wanted(
        {name: ground.setup.pad_of(name) for name in NAMES},
        ground.network.frame,
        story.speedup,
        story.settings,
        frozenset(),
    )
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        crew = Closing(vehicles, httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}"))
        code, report = asyncio.run(flown(site, day, run, crew))
    said = [line["said"] for line in log_lines(run) if "said" in line]
    assert code == 0, said
    assert report["segments_inspected"] == report["segments_total"] == 13, said
    assert report["faults"] == [], said
    assert {name: answer["outcome"] for name, answer in crew.orders.items()} == {
        "close": "done", "open": "done",
    }, crew.orders  # fmt: skip
    assert [answer["outcome"] for answer in crew.answers] == ["accepted"] * len(crew.answers), crew.answers
    assert wrongly_counted(run, report) == [], said
    assert all(vehicle["landed"] for vehicle in report["vehicles"]), said
    assert crew.while_closed == {"its base is closed"}
    # The spare flew, and nobody took off from the closed base.
    closed_s, open_s = (
        next(line["t_s"] for line in log_lines(run) if words in line.get("said", "")) for words in WORDS
    )
    launched_s = next(line["t_s"] for line in log_lines(run) if line.get("event", {}).get("kind") == "LaunchOrdered")
    began = {
        name: [row["began_s"] + launched_s for row in report["sorties"] if row["vehicle"] == name] for name in NAMES
    }
    assert began[SPARE], report["sorties"]
    assert closed_s < min(began[SPARE]) < open_s
    assert not any(closed_s < at_s < open_s for at_s in began[SOUTH]), report["sorties"]
    assert sorted((row["vehicle"], row["pack"]) for row in report["sorties"] if row["pack"]) == sorted(crew.changed)
