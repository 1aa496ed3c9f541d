"""Flights whose ground station is killed with kill -9 at a random instant and called again, over UDP in real time.

The simulated vehicles live in the test's own process, so that a witness sees where they really are at every moment,
also while no ground station is there. The witness knows nothing of what the program believes.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from executor.simulated.simulated_fleet import fleet_of
from executor.site import site_model, site_planning
from executor.site.site_file import read_site
from missions import Pad, write_plan
from planner import Cost
from simulator.fleet import SimulatedVehicle
from simulator.testing import Fleet
from tests.e2e.flights import called, ended, notes, said_in, site_file
from tests.e2e.judge import passes, segments_of

SPEEDUP = 10.0
VEHICLES, PYLONS = 3, 7
LOOK_S = 0.3
"""Of the flight, between two looks of the witness."""
FLYING_M = 2.0
LAYER_M = 5.0
RESERVE_PCT = 15.0


@dataclass(slots=True)
class Witness:
    """Where everybody really was."""

    pads: Mapping[str, Pad]
    rows: dict[str, list[tuple[float, float, float, float]]] = field(default_factory=dict)
    """Seconds, east, north and height over the pad, while armed."""
    nearest_m: float = math.inf
    charge_pct: dict[str, float] = field(default_factory=dict)
    armed: dict[str, bool] = field(default_factory=dict)
    _looked_s: float = -math.inf

    def look(self, vehicles: Sequence[SimulatedVehicle]) -> None:
        """Note where everybody is."""
        now_s = vehicles[0].now_s
        if now_s < self._looked_s + LOOK_S:
            return
        self._looked_s = now_s
        up: list[tuple[float, float, float]] = []
        for vehicle in vehicles:
            frame, pad = vehicle.autopilot.frame, self.pads[vehicle.name]
            body = frame.body
            self.armed[vehicle.name], self.charge_pct[vehicle.name] = frame.armed, frame.battery.charge_pct
            if frame.armed:
                place = (pad.east_m + body.east_m, pad.north_m + body.north_m)
                self.rows.setdefault(vehicle.name, []).append((vehicle.now_s, *place, body.up_m))
                if body.up_m > FLYING_M:
                    up.append((*place, pad.alt_m + body.up_m))
        for one, other in itertools.combinations(up, 2):
            self.nearest_m = min(self.nearest_m, math.dist(one, other))


@dataclass(frozen=True, slots=True)
class Outcome:
    """A flight that was killed, as it ended."""

    run: Path
    witness: Witness
    lost: frozenset[str]
    """Vehicles that were made to fall silent."""
    moments: tuple[str, ...]
    """When the ground station was killed."""
    code: int
    report: Mapping[str, Any]

    def wrongs(self) -> list[str]:
        """Return everything that should not be."""
        report, witness = self.report, self.witness
        wrong = [f"segment {one} is lost" for one in report["segments_uncovered"]]
        if not report["finished"] or report["segments_inspected"] != report["segments_total"] or self.code != 0:
            wrong.append(
                f"{report['segments_inspected']} of {report['segments_total']} inspected, exit code {self.code}"
            )
        passed = self.passed()
        wrong += [
            f"segment {segment} was never flown by {vehicle['name']}"
            for vehicle in report["vehicles"]
            for segment in vehicle["segments"]
            if not passed[vehicle["name"], segment]
        ]
        if witness.nearest_m < LAYER_M - 0.5:
            wrong.append(f"{witness.nearest_m:.1f} m between two vehicles")
        for name, armed in witness.armed.items():
            if armed and name not in self.lost:
                wrong.append(f"{name} is still in the air")
            if witness.charge_pct[name] < RESERVE_PCT:
                wrong.append(f"{name} has {witness.charge_pct[name]:.0f} % left")
        wrong += [
            f"{fault['vehicle']} was given up: {fault['reason']}"
            for fault in report["faults"]
            if fault["vehicle"] not in self.lost
        ]
        return wrong + [note["said"] for note in notes(self.run) if "internal error" in note["said"]]

    def passed(self) -> dict[tuple[str, int], int]:
        """Return how often each vehicle flew along each segment from end to end, slowly enough."""
        segments = segments_of(self.run)
        ways = {name: np.array(rows) for name, rows in self.witness.rows.items()}
        return {
            (name, segment.id): passes(segment, ways[name]) if name in ways else 0
            for name in self.witness.pads
            for segment in segments.values()
        }

    def twice(self) -> list[int]:
        """Return segments that healthy vehicles flew more than once."""
        passed = self.passed()
        counts = {
            segment: sum(times for (name, one), times in passed.items() if one == segment and name not in self.lost)
            for _, segment in passed
        }
        return sorted(segment for segment, times in counts.items() if times > 1)

    def explained(self) -> bool:
        """Whether it was said that something nobody saw does not count."""
        return any("does not count" in note["said"] or "not proven" in note["said"] for note in notes(self.run))


async def flown(folder: Path, seed: int) -> Outcome:
    """Fly, with a loss or without, and kill the ground station once or twice at random instants."""
    chance = random.Random(seed)
    autopilot = chance.choice(["ardupilot", "px4"])
    lost = frozenset({"uav2"}) if chance.random() < 0.6 else frozenset[str]()
    faults = [f"uav2:silent@{chance.uniform(10, 80):.0f}%"] if lost else []
    site, _ = site_file(folder, pylons=PYLONS, vehicles=VEHICLES, speedup=SPEEDUP, autopilot=autopilot)
    ground = site_model.load_site_model(read_site(site), folder)
    plan = folder / "plan.json"
    write_plan(
        plan, site_planning.plan_site(ground, site_planning.PlanRequest(Cost.MINMAX, 0.3, seed, all_vehicles=True))
    )
    setup, run = ground.setup, folder / "run"
    witness = Witness({name: setup.pad_of(name) for name in ground.names})
    moments: list[str] = []
    fleet = fleet_of(ground, speedup=SPEEDUP, faults=faults, seed=seed, wind=1.0, failsafe=False)
    async with Fleet(fleet, watch=witness.look):
        call = ["fly", str(site), "--plan", str(plan), "--run", str(run)]
        for deaths in itertools.count():
            dies = deaths == 0 or (deaths == 1 and chance.random() < 0.4)
            async with called(*call, "--yes", *([] if dies else ["--json"])) as station:
                if dies:
                    moments.append(await _dies(station, chance, lost=bool(lost), first=deaths == 0))
                else:
                    out, err = await ended(station)
                    break
            await asyncio.sleep(chance.choice([0.05, 0.3, 1.0, 3.0, 10.0]) * chance.uniform(0.5, 1.5))
            call = ["resume", str(run)]
    assert station.returncode in {0, 1}, err
    return Outcome(run, witness, lost, tuple(moments), station.returncode, json.loads(out))


async def _dies(station: asyncio.subprocess.Process, chance: random.Random, *, lost: bool, first: bool) -> str:
    """Kill the ground station at a random instant; returns at which, empty if it had ended before."""
    moments: dict[str, tuple[tuple[str, ...], float]] = {
        "upload": (("waiting for",), 2.5),
        "take-off": (("page: ",), 2.5),
        "flight": (("page: ",), 25.0),
        "landing": (("landed with",), 3.0),
    }
    if lost:
        moments["re-plan"] = (("link lost for",), 1.5)
    moment = chance.choice(sorted(moments)) if first else "taken up"
    words, within_s = moments.get(moment, ((), 8.0))
    if words:
        await said_in(station.stderr, *words)
    dies_s = chance.uniform(0.0, within_s)
    try:
        async with asyncio.timeout(dies_s):
            await station.communicate()
    except TimeoutError:
        station.kill()
        await station.wait()
        return f"{moment} + {dies_s:.2f} s"
    return ""
