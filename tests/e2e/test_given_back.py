"""Simulated vehicles have after a flight what they had before it, however the flight ends."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executor.simulated.simulated_fleet import fleet_of
from executor.site import site_model
from executor.site.site_file import read_site
from simulator.testing import Fleet
from tests.e2e.flights import called, ended, said_in, site_file

pytestmark = pytest.mark.asyncio

SPEEDUP = 20.0
AUTOPILOTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
CREWS_OWN: Mapping[str, Mapping[str, float]] = {
    "ardupilot": {"RTL_ALT": 1217.0, "RTL_CONE_SLOPE": 2.5},
    "px4": {"RTL_RETURN_ALT": 33.25, "RTL_CONE_ANG": 25.0, "RTL_DESCEND_ALT": 12.5, "RTL_LAND_DELAY": 3.0},
}
"""What this crew has set: none of it is a default."""


class OnPads:
    """Vehicles that live in the test's own process, so that it sees what is on board."""

    def __init__(self, fleet: Fleet, before: Mapping[str, float]) -> None:
        self.fleet, self.before = fleet, before

    @property
    def on_board(self) -> list[dict[str, float]]:
        """What each vehicle has now of what the crew has set."""
        return [{name: one.truth.parameters[name] for name in self.before} for one in self.fleet]

    @property
    def as_before(self) -> bool:
        return all(parameters == self.before for parameters in self.on_board)

    async def landed(self) -> None:
        """Wait until everybody is on the ground again."""
        await self.fleet.wait_for(lambda: not any(one.truth.armed for one in self.fleet))


@asynccontextmanager
async def on_pads(site: Path, autopilot: str, *faults: str, speedup: float = SPEEDUP) -> AsyncIterator[OnPads]:
    """Run the site's vehicles with what the crew has set."""
    before = CREWS_OWN[autopilot]
    ground = site_model.load_site_model(read_site(site), site.parent)
    sim = fleet_of(ground, speedup=speedup, faults=faults, seed=1, wind=1.0, failsafe=False)
    own = tuple(replace(one, parameters={**one.parameters, **before}) for one in sim.vehicles)
    async with Fleet(replace(sim, vehicles=own)) as fleet:
        yield OnPads(fleet, before)


async def restored(run: Path, *more: str) -> tuple[int, dict[str, Any]]:
    """Call `faultline restore`; returns its exit code and what it says as JSON."""
    async with called("restore", str(run), "--yes", "--json", *more) as process:
        out, err = await ended(process)
    assert process.returncode in {0, 1}, err
    return process.returncode, json.loads(out)


@AUTOPILOTS
async def test_after_a_flight(autopilot: str, tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP, autopilot=autopilot)
    run = tmp_path / "run"
    async with on_pads(site, autopilot) as fleet:
        async with called("preflight", str(site), "--json") as process:
            out, err = await ended(process)
        assert process.returncode == 0, err
        told = [check["text"] for check in json.loads(out)["checks"] if " -> " in check["text"]]
        assert fleet.as_before
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
            assert not fleet.as_before
            _, err = await ended(flight)
        assert flight.returncode == 0, err
        assert fleet.as_before
    report = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert [check["text"] for check in report["checks"] if " -> " in check["text"]] == told
    assert len(report["parameters"]) == len(told)
    for row in report["parameters"]:
        assert row["restored"]
        assert row["old"] == fleet.before[row["name"]] != row["new"]
    for name in ("uav1", "uav2"):
        [line] = [line for line in err.splitlines() if line.endswith(" restored") and f" {name}: " in line]
        assert all(f"{row['name']} {row['old']:g}" in line for row in report["parameters"] if row["vehicle"] == name)
    async with called("restore", str(run)) as process:
        assert (await ended(process))[0] == f"{run}: all parameters are restored\n"
    assert process.returncode == 0


@AUTOPILOTS
async def test_killed_and_restored_from_a_copy(autopilot: str, tmp_path: Path) -> None:
    """The laptop dies in flight; who is still in the air is left alone, and has its parameters again on its pad."""
    site, _ = site_file(tmp_path, pylons=6, vehicles=2, speedup=6.0, autopilot=autopilot)
    run, copy = tmp_path / "run", tmp_path / "copy"
    async with on_pads(site, autopilot, speedup=6.0) as fleet:
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
            async with called("restore", str(run), "--yes") as process:
                _, err = await ended(process)
            assert process.returncode == 2
            assert "another faultline flies this directory already" in err
            flight.kill()
            await flight.wait()
        shutil.copytree(run, copy)
        in_flight = fleet.on_board
        code, said = await restored(copy)
        assert (code, said["restored"], fleet.on_board) == (1, False, in_flight)
        assert not any(row["restored"] for row in said["parameters"])
        await fleet.landed()
        code, said = await restored(copy)
        assert (code, said["restored"]) == (0, True)
        assert fleet.as_before
        assert await restored(copy) == (0, said)
        assert await restored(run) == (0, said), "the record of the first directory is older, and true as well"


@AUTOPILOTS
@pytest.mark.parametrize("seed", range(2))
async def test_killed_while_they_are_set(autopilot: str, seed: int, tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP, autopilot=autopilot)
    run = tmp_path / "run"
    async with on_pads(site, autopilot, "all:loss=0.2@0s") as fleet:
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "to be set for the flight")
            await asyncio.sleep(0.05 * seed)
            flight.kill()
            await flight.wait()
        if (run / "parameters.json").exists():
            code, said = await restored(run)
            assert (code, said["restored"]) == (0, True)
        assert fleet.as_before


async def test_without_confirmation(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP)
    run = tmp_path / "run"
    async with on_pads(site, "ardupilot") as fleet:
        async with called("fly", str(site), "--run", str(run)) as flight:
            _, err = await ended(flight)
        assert flight.returncode == 2
        assert "not confirmed; nothing was changed on board" in err
        assert fleet.as_before
    async with called("restore", str(run), "--yes") as process:
        _, err = await ended(process)
    assert process.returncode == 2
    assert "no parameter was changed from here" in err


async def test_a_preflight_that_says_no_leaves_nothing_changed(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP, autopilot="px4")
    async with on_pads(site, "px4", "uav2:refuse-upload@0s") as fleet:
        async with called("fly", str(site), "--yes", "--run", str(tmp_path / "run")) as flight:
            _, err = await ended(flight)
        assert flight.returncode == 1
        assert "uav2: the mission is not on board" in err
        assert "uav1: RTL_RETURN_ALT 33.25, RTL_CONE_ANG 25, RTL_DESCEND_ALT 12.5 restored" in err
        assert fleet.as_before


async def test_a_resumed_flight_restores_what_its_first_process_changed(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP, autopilot="px4")
    run = tmp_path / "run"
    async with on_pads(site, "px4") as fleet:
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            await said_in(flight.stderr, "mission items on board")
            flight.kill()
            await flight.wait()
        async with called("resume", str(run), "--yes") as flight:
            await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission")
            flight.kill()
            await flight.wait()
        async with called("resume", str(run), "--yes", "--json") as flight:
            out, err = await ended(flight)
        assert flight.returncode == 0, err
        assert all(row["restored"] for row in json.loads(out)["parameters"])
        assert fleet.as_before


async def test_a_vehicle_that_is_lost_keeps_what_was_set_until_it_answers(tmp_path: Path) -> None:
    site, _ = site_file(tmp_path, pylons=4, vehicles=2, speedup=SPEEDUP)
    run = tmp_path / "run"
    async with on_pads(site, "ardupilot", "uav2:silent@30%") as fleet:
        async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
            _, err = await ended(flight)
        assert fleet.on_board[0] == fleet.before
        assert "uav2: RTL_ALT (was 1217), RTL_CONE_SLOPE (was 2.5) not restored: does not answer" in err
        assert f"uav2: to restore them: faultline restore {run}" in err
        report = json.loads((run / "report.json").read_text(encoding="utf-8"))
        assert {row["vehicle"] for row in report["parameters"] if not row["restored"]} == {"uav2"}
        assert (await restored(run))[0] == 1
