"""Real autopilots take off at one base and land at another, where their packs are changed, and fly back from there."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import tomlkit

from executor.site import site_model
from executor.site.day_plans import build_day_problem
from executor.site.site_file import check_site
from missions import DayPlanFile, Pad, check_plan, write_plan
from planner import Plan, Route, visit_of
from planner.sorties import Objective, evaluate_sorties
from tests.e2e.flights import log_lines
from tests.e2e.judge import wrongly_counted
from tests.e2e.tlog import messages
from tests.ports import free_port
from tests.sitl.crew import STARTED_REAL_S, Crew, flown
from tests.sitl.flights import NAMES, Story, site_of
from tests.sitl.real import BOTH, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(2700)]

ONE, OTHER = NAMES[:2]
BASES = {"north": (0.0, 90.0, [ONE]), "south": (0.0, -90.0, [OTHER])}
"""Where they are, in metres east and north of the depot, and who stands there in the morning."""
LOWER_M = 6.0
"""The southern base lies so much lower: heights count from another home there."""
TURNED_S = 900.0
BEGINS_S = 8 * 3600.0
NEAR_M = 3.0


@dataclass
class AtBothBases(Crew):
    """Changes packs where vehicles stand, which begin again there."""

    pads: Mapping[str, Mapping[str, Pad]] = field(default_factory=dict)

    async def look_after(self, vehicle: dict[str, Any]) -> None:
        """Change the pack of who waits for it, at the base where it says that it stands."""
        name, turn = vehicle["name"], vehicle["turn"]
        if turn is not None and turn["awaited"]:
            self.running[name].end()
            self.running[name].begin_again(self.pads[name][turn["base"]])
            await asyncio.sleep(STARTED_REAL_S)
            pack = f"P{len(self.changed) + 1}"
            self.answers.append(await self.wish("swap", vehicle=name, pack=pack))
            self.changed.append((name, pack))


def plan_between(ground: site_model.SiteModel) -> DayPlanFile:
    """Return a day on which each vehicle flies to the other base, and back."""
    problem = build_day_problem(ground)
    parts = [[visit_of(segment, reverse=False) for segment in part] for part in ((0, 1), (2, 3), (4, 5), (6,))]
    north, south = 0, 1
    routes = (
        Route(0, tuple(parts[0]), north, south, BEGINS_S), Route(0, tuple(parts[1]), south, north, BEGINS_S + TURNED_S),
        Route(1, tuple(parts[2]), south, north, BEGINS_S), Route(1, tuple(parts[3]), north, south, BEGINS_S + TURNED_S),
    )  # fmt: skip
    plan = Plan(routes)
    day = problem.with_plan(plan, evaluate_sorties(problem.build_instance(), plan), Objective.FINISH)
    assert check_plan(day) == []
    return day


@BOTH
def test_two_vehicles_change_places_and_come_back(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    port = free_port()
    story = Story(page=port, fence={"enabled": True}, tables={"day": {"begin": "08:00", "lands": "any"}})
    frame = site_model.load_site_model(site_of(autopilot, Story()), tmp_path).network.frame
    tables = site_of(autopilot, story).model_dump(exclude_none=True, mode="json")
    tables["vehicle"] = tables["vehicle"][:2]
    tables["base"] = []
    for name, (east_m, north_m, own) in BASES.items():
        lat_deg, lon_deg = frame.to_wgs84_deg(east_m, north_m)
        alt_m = frame.alt_m - (LOWER_M if name == "south" else 0.0)
        tables["base"].append({"name": name, "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m, "vehicles": own})
    site, day, run = tmp_path / "site.toml", tmp_path / "day.json", tmp_path / "run"
    site.write_text(tomlkit.dumps(tables))
    ground = site_model.load_site_model(check_site(tables, "test"), tmp_path)
    write_plan(day, plan_between(ground))
    stands = {name: ground.setup.pad_of(name) for name in (ONE, OTHER)}
    own_pads = {
        ONE: {"north": stands[ONE], **ground.day_pads[ONE]},
        OTHER: {"south": stands[OTHER], **ground.day_pads[OTHER]},
    }
    wanted = Wanted(stands, frame, story.speedup, story.settings, frozenset())
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        crew = AtBothBases(vehicles, httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}"), pads=own_pads)
        code, report = asyncio.run(flown(site, day, run, crew))
    said = [line["said"] for line in log_lines(run) if "said" in line]
    assert code == 0, said
    assert report["segments_inspected"] == report["segments_total"] == 7, said
    assert report["faults"] == [], said
    assert [answer["outcome"] for answer in crew.answers] == ["accepted"] * 2, crew.answers
    assert wrongly_counted(run, report) == [], said
    assert not [line for line in said if "away from its pad" in line], said
    assert sorted((row["vehicle"], row["number"], row["base"], row["lands"]) for row in report["sorties"]) == [
        (ONE, 1, "north", "south"), (ONE, 2, "south", "north"),
        (OTHER, 1, "south", "north"), (OTHER, 2, "north", "south"),
    ], report["sorties"]  # fmt: skip
    for name, flown_to in own_pads.items():  # each landed on its own pad of the other base, and not on a neighbour's
        places = [
            frame.to_local_m(fix.lat / 1e7, fix.lon / 1e7)
            for _, fix in messages(run / f"{name}.tlog", "GLOBAL_POSITION_INT")
        ]
        for pad in flown_to.values():
            assert min(((e - pad.east_m) ** 2 + (n - pad.north_m) ** 2) ** 0.5 for e, n in places) < NEAR_M
    kept = [f"{row['vehicle']} {row['name']}" for row in report["parameters"] if not row["restored"]]
    assert kept == [], [line["told"] for line in log_lines(run) if "told" in line]
