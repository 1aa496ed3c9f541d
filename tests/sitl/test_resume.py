"""The ground station is killed while real autopilots fly, and takes the flight up again."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from executor.site import site_model
from tests.e2e.flights import called, log_lines, said_in
from tests.e2e.judge import wrongly_counted
from tests.sitl.flights import SPEEDUP, Story, site_of
from tests.sitl.real import BOTH, NO_FAILSAFE, Autopilot, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

AWAY_S = 20.0
"""Of the flight, with nobody there."""


async def flown_with_a_death(site: Path, run: Path) -> dict[str, Any]:
    """Fly, kill the ground station in mid-flight, and take the flight up again; returns the report."""
    async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
        await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission", "uav3: flies its mission")
        await asyncio.sleep(60.0 / SPEEDUP)
        flight.kill()
        await flight.wait()
    await asyncio.sleep(AWAY_S / SPEEDUP)
    async with called("resume", str(run), "--yes", "--json") as process:
        out, err = await process.communicate()
    assert process.returncode == 0, err.decode()
    report: dict[str, Any] = json.loads(out)
    return report


@BOTH
def test_killed_in_flight(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    story = Story(settings=NO_FAILSAFE[autopilot])
    content = site_of(autopilot, story)
    site, run = tmp_path / "site.toml", tmp_path / "run"
    site.write_text(tomlkit.dumps(content.model_dump(exclude_none=True, mode="json")))
    ground = site_model.load_site_model(content, tmp_path)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    wanted = Wanted(pads, ground.network.frame, story.speedup, story.settings, frozenset())
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted):
        report = asyncio.run(flown_with_a_death(site, run))
    said = [line["said"] for line in log_lines(run) if "said" in line]
    assert report["finished"], said
    assert report["faults"] == [], said
    assert report["segments_inspected"] == report["segments_total"]
    assert [absence["restarted"] for absence in report["absences"]] == [True]
    unseen = [one for one in wrongly_counted(run, report) if one[1] not in report["inferred"]]
    assert unseen == [], said
    assert all(vehicle["landed"] for vehicle in report["vehicles"]), said
