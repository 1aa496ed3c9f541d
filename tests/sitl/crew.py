"""A day of real autopilots, and the crew that stands by their pads."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from tests.e2e.flights import called, ended
from tests.sitl.real import RealVehicle

LOOK_REAL_S = 0.5
STARTED_REAL_S = 3.0
"""After its power came back the crew says that another pack is in."""
PATIENCE_REAL_S = 2400.0


@dataclass
class Crew:
    """Stands by the pads: changes the pack of who waits for it, and says so on the page."""

    running: Mapping[str, RealVehicle]
    page: httpx.AsyncClient
    changed: list[tuple[str, str]] = field(default_factory=list)
    """Vehicles and the packs that were put in, in order."""
    answers: list[dict[str, Any]] = field(default_factory=list)

    async def attend(self) -> None:
        """Look after everybody until the page is gone."""
        while True:
            try:
                state = (await self.page.get("/state")).json()
            except httpx.TransportError:
                return
            for vehicle in state["vehicles"]:
                await self.look_after(vehicle)
            await asyncio.sleep(LOOK_REAL_S)

    async def look_after(self, vehicle: dict[str, Any]) -> None:
        """Do what a vehicle needs."""
        if vehicle["turn"] is not None and vehicle["turn"]["awaited"]:
            await self.change(vehicle["name"])

    async def change(self, name: str) -> None:
        """Change a pack, and say so."""
        self.running[name].end()
        self.running[name].begin_again()
        await asyncio.sleep(STARTED_REAL_S)
        pack = f"P{len(self.changed) + 1}"
        answer = await self.wish("swap", vehicle=name, pack=pack)
        if answer["code"] == "nothing_to_plan":
            return  # somebody else has taken up what was open
        self.answers.append(answer)
        self.changed.append((name, pack))

    async def wish(self, action: str, **of: str) -> dict[str, Any]:
        """Ask for something on the page; returns its answer."""
        wish = {"id": "-".join((action, *of.values())), "action": action, **of, "confirmed": True}
        answer: dict[str, Any] = (await self.page.post("/intents", json=wish)).json()
        return answer


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
