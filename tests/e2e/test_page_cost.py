"""What the page costs: how old its state is with twenty vehicles, and what the flight's own loop pays for it."""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import httpx
import numpy as np
import pytest

from executor.adapters.eventlog import read_head
from executor.core.context import Context
from executor.core.interface.codes import Check
from executor.core.interface.commands import Level
from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage
from executor.flight import run_flight
from executor.flight.run_start import FlightRequest, write_run_start
from executor.site import site_model, site_planning
from executor.site.site_file import read_site
from planner import Cost
from tests.e2e.flights import called, said_in, site_file
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = [pytest.mark.campaign, pytest.mark.asyncio, pytest.mark.timeout(600)]

VEHICLES = 20
WATCHED_S = 40.0
LOOK_S = 0.01


@dataclass
class Watching:
    """Looks at the loop while everybody flies, then leaves."""

    lags_s: list[float] = field(default_factory=list)
    cpu_s: float = 0.0
    lasted_s: float = 0.0
    state: FleetState | None = None
    news: asyncio.Event = field(default_factory=asyncio.Event)

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        pass

    def show_checks(self, found: Sequence[Check]) -> None:
        pass

    async def ask(self, question: str) -> bool:
        return bool(question)

    def show(self, context: Context, state: FleetState, now_s: float) -> None:
        self.state = state
        self.news.set()

    def stop_drawing(self) -> None:
        pass

    def flying(self) -> bool:
        return self.state is not None and all(one.stage is Stage.FLYING for one in self.state.vehicles.values())

    async def look(self) -> None:
        began_s, cpu_s = time.monotonic(), time.process_time()
        while time.monotonic() - began_s < WATCHED_S:
            before_s = time.monotonic()
            await asyncio.sleep(LOOK_S)
            self.lags_s.append(time.monotonic() - before_s - LOOK_S)
        self.lasted_s, self.cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s


@dataclass(frozen=True)
class Read:
    """What a browser's side of the stream saw."""

    came_s: list[float]
    """When each state arrived."""
    ages_s: list[float]
    """How old each state was then."""
    size: int


def read(port: int, began_unix_s: float) -> Read:
    """Follow the stream, in a process of its own."""
    came_s, ages_s, size = list[float](), list[float](), 0
    until_s = time.monotonic() + WATCHED_S
    with httpx.Client(timeout=PATIENCE_S) as client, client.stream("GET", f"http://127.0.0.1:{port}/events") as stream:
        for line in stream.iter_lines():
            if line.startswith("data: "):
                state, size = json.loads(line[6:]), len(line)
                came_s.append(time.monotonic())
                ages_s.append(time.time() - began_unix_s - state["now_s"])
            if time.monotonic() > until_s:
                break
    return Read(came_s, ages_s, size)


async def flown(tmp_path: Path, *, page: bool, readers: int) -> tuple[Watching, list[Read]]:
    port = free_port()
    path, _ = site_file(tmp_path, pylons=2 * VEHICLES + 1, vehicles=VEHICLES, speedup=1.0, autopilot="px4")
    path.write_text(
        f"{path.read_text(encoding='utf-8')}[web]\nport = {port}\nenabled = {str(page).lower()}\n", encoding="utf-8"
    )
    site = read_site(path)
    ground = site_model.load_site_model(site, tmp_path)
    plan = site_planning.plan_site(ground, site_planning.PlanRequest(Cost.MINMAX, 2.0, 1, all_vehicles=True))
    order = FlightRequest(site, tmp_path, ground, plan, tmp_path / "run", lambda _: ())
    order.run.mkdir()
    write_run_start(order)
    watching = Watching()
    events, looking = order.run / "events.jsonl", list[Read]()
    async with called("simulate", str(path)) as simulated:
        await said_in(simulated.stdout, "uav20: system 20")
        flight = asyncio.create_task(run_flight.run_flight(order, watching))
        while not watching.flying():
            watching.news.clear()
            await watching.news.wait()
        began_unix_s = read_head(events).began_unix_s
        with ProcessPoolExecutor(max(1, readers), mp_context=multiprocessing.get_context("spawn")) as pool:
            following = [asyncio.wrap_future(pool.submit(read, port, began_unix_s)) for _ in range(readers)]
            await watching.look()
            looking = [await one for one in following]
        flight.cancel()
        await asyncio.gather(flight, return_exceptions=True)
    return watching, looking


def figures(watching: Watching, readers: Sequence[Read]) -> Mapping[str, float]:
    """Return what there is to say of one flight."""
    lags_ms = 1000 * np.array(watching.lags_s)
    known = {
        "cpu_pct": 100 * watching.cpu_s / watching.lasted_s,
        "lag_median_ms": float(np.median(lags_ms)),
        "lag_p99_ms": float(np.percentile(lags_ms, 99)),
        "lag_max_ms": float(lags_ms.max()),
    }
    if readers:
        gaps_s = np.concatenate([np.diff(one.came_s) for one in readers])
        ages_s = np.concatenate([np.array(one.ages_s) for one in readers])
        known |= {
            "state_bytes": float(readers[0].size),
            "arrives_old_ms": 1000 * float(np.percentile(ages_s, 99)),
            "oldest_shown_s": float(gaps_s.max() + ages_s.max()),
        }
    return MappingProxyType({name: round(value, 2) for name, value in known.items()})


async def test_what_the_page_costs(tmp_path: Path) -> None:
    found = {}
    for name, page, readers in (("without", False, 0), ("nobody looks", True, 0), ("five look", True, 5)):
        folder = tmp_path / name.replace(" ", "-")
        folder.mkdir()
        watching, looking = await flown(folder, page=page, readers=readers)
        found[name] = figures(watching, looking)
        assert all(len(reader.came_s) > WATCHED_S for reader in looking)
    print()
    for name, row in found.items():
        print(f"{name:14s}", dict(row))
