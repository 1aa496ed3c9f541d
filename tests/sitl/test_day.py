"""Two sorties of real autopilots in one flight: the crew changes packs, and one is lost on its second sortie."""

from __future__ import annotations

import asyncio
import itertools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import tomli_w

from executor.site import site_model
from tests.e2e.flights import log_lines
from tests.e2e.judge import wrongly_counted
from tests.ports import free_port
from tests.sitl.crew import Crew, flown, planned
from tests.sitl.flights import VICTIM, Story, site_of
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
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    port = free_port()
    story = Story(radius_m=400.0, page=port, tables={"day": {"begin": "08:00", "end": "16:00"}})
    content = site_of(autopilot, story)
    tables = content.model_dump(exclude_none=True, mode="json")
    for vehicle in tables["vehicle"]:
        vehicle["budget_pct"] = BUDGET_PCT
    site, day, run = tmp_path / "site.toml", tmp_path / "day.json", tmp_path / "run"
    site.write_text(tomli_w.dumps(tables))
    ground = site_model.load_site_model(content, tmp_path)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    asyncio.run(planned(site, day))
    plan = json.loads(day.read_text())
    assert sum(one["vehicle"] == VICTIM for one in plan["sorties"]) >= 2, plan["sorties"]
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
