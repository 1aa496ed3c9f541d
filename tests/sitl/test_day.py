"""Two sorties of real autopilots in one flight: the crew changes packs, and one is lost on its second sortie."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import tomli_w

from executor.site import assembly
from tests.e2e.flights import called, ended, log_lines
from tests.e2e.judge import wrongly_counted
from tests.ports import free_port
from tests.sitl.flights import VICTIM, Story, site_of
from tests.sitl.real import BOTH, Autopilot, RealVehicle, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(2700)]

BUDGET_PCT = 12.0
"""Of each pack: thirteen segments take five sorties of three vehicles."""
LOOK_REAL_S = 0.5
STARTED_REAL_S = 3.0
"""After its power came back the crew says that another pack is in."""
PATIENCE_REAL_S = 2400.0
ROUNDED_S = 0.1
"""The report's times are."""


@dataclass
class Crew:
    """Stands by the pads: changes the pack of who waits for it, and says so on the page."""

    running: Mapping[str, RealVehicle]
    page: httpx.AsyncClient
    changed: list[tuple[str, str]] = field(default_factory=list)
    """Vehicles and the packs that were put in, in order."""
    answers: list[dict[str, Any]] = field(default_factory=list)
    lost: bool = False

    async def attend(self) -> None:
        """Look after everybody until the page is gone."""
        while True:
            try:
                state = (await self.page.get("/state")).json()
            except httpx.TransportError:
                return
            for vehicle in state["vehicles"]:
                await self._look_after(vehicle)
            await asyncio.sleep(LOOK_REAL_S)

    async def _look_after(self, vehicle: dict[str, Any]) -> None:
        name, turn = vehicle["name"], vehicle["turn"]
        if name == VICTIM and not self.lost and _inspects_on_its_second(vehicle):
            self.lost = True
            self.running[name].suspend()
        elif turn is not None and turn["awaited"]:
            await self._change(name)

    async def _change(self, name: str) -> None:
        pack = f"P{len(self.changed) + 1}"
        self.running[name].end()
        self.running[name].begin_again()
        await asyncio.sleep(STARTED_REAL_S)
        wish = {"id": f"swap-{pack}", "action": "swap", "vehicle": name, "pack": pack, "confirmed": True}
        answer = (await self.page.post("/intents", json=wish)).json()
        if answer["code"] == "nothing_to_plan":
            return  # somebody else has taken up what was open
        self.answers.append(answer)
        self.changed.append((name, pack))


def _inspects_on_its_second(vehicle: dict[str, Any]) -> bool:
    return (vehicle["turn"]["sortie"], vehicle["progress"]["phase"]) == (2, "inspect")


async def planned(site: Path, day: Path) -> None:
    """Plan the day."""
    async with called("plan", str(site), "--day", "--seconds", "5", "-o", str(day)) as process:
        _, err = await ended(process)
    assert process.returncode == 0, err


async def flown(site: Path, day: Path, run: Path, crew: Crew) -> tuple[int | None, dict[str, Any]]:
    """Fly the day with its crew; returns the exit code and the report."""
    command = ("fly", str(day), "--site", str(site), "--yes", "--json", "--run", str(run))
    async with called(*command) as process, crew.page:
        reading = asyncio.create_task(process.communicate())
        for _ in range(600):
            try:
                await crew.page.get("/state")
            except httpx.TransportError:
                await asyncio.sleep(LOOK_REAL_S)
            else:
                break
        await crew.attend()
        async with asyncio.timeout(PATIENCE_REAL_S):
            out, err = await reading
    assert out, err.decode()
    return process.returncode, json.loads(out)


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
    ground = assembly.ground_of(content, tmp_path)
    pads = {pad.vehicle: pad for pad in assembly.setup_of(ground).pads}
    asyncio.run(planned(site, day))
    plan = json.loads(day.read_text())
    assert sum(one["vehicle"] == VICTIM for one in plan["sorties"]) >= 2, plan["sorties"]
    wanted = Wanted(pads, ground.network.frame, story.speedup, story.settings, frozenset())
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        crew = Crew(vehicles, httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}"))
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
