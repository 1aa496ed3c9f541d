"""Real autopilots have after a flight every parameter that they had before it, after a death of the laptop, too."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from executor.site import site_model
from missions import add_first_names, dialect_for
from tests.e2e.flights import called, ended, said_in
from tests.sitl.flights import SPEEDUP, Story, site_of
from tests.sitl.real import ARDUPILOT, PX4, Autopilot, RealVehicle, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(1800)]

CREWS_OWN: Mapping[Autopilot, Mapping[str, float]] = {
    # What this crew has set, none of it a default; and they fly on unseen.
    ARDUPILOT: {"RTL_ALT": 1217.0, "RTL_CONE_SLOPE": 2.5, "FS_GCS_ENABLE": 0.0},
    PX4: {"RTL_RETURN_ALT": 33.25, "RTL_CONE_ANG": 25.0, "RTL_DESCEND_ALT": 12.5, "NAV_DLL_ACT": 0.0},
}
ITS_OWN = (
    "STAT_", "BARO", "COM_FLIGHT_UUID", "LND_FLIGHT_T", "SIM_", "MIS_TOTAL", "INS_GYR", "COMPASS_", "CAL_", "RC",
    "MOT_THST_HOVER", "EKF2_SENS_EN",
)  # fmt: skip
"""What autopilots set by themselves: times, pressures on the ground, calibrations, the number of mission items, the
throttle at which it hovers, the sensors that PX4 1.18's estimator has."""
RTL = ("RTL_",)
RESTORES = 60


def on_board(vehicles: Mapping[str, RealVehicle]) -> dict[str, dict[str, float]]:
    """Return every parameter of every vehicle that it does not set by itself."""
    return {
        name: {key: value for key, value in one.other.all(one.sysid).items() if not key.startswith(ITS_OWN)}
        for name, one in vehicles.items()
    }


def different(before: Mapping[str, Mapping[str, float]], after: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return what is not as it was; a NaN is itself."""
    return [
        f"{name} {key}: {value} -> {after[name].get(key)}"
        for name, parameters in before.items()
        for key, value in parameters.items()
        if repr(after[name].get(key)) != repr(value)
    ]


async def flown(site: Path, run: Path) -> dict[str, Any]:
    """Fly to the end; returns the report."""
    async with called("fly", str(site), "--yes", "--json", "--run", str(run)) as flight:
        out, err = await flight.communicate()
    assert flight.returncode == 0, err.decode()
    report: dict[str, Any] = json.loads(out)
    return report


async def killed(site: Path, run: Path) -> None:
    """Fly, and die in flight."""
    async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
        await said_in(flight.stderr, "uav1: flies its mission", "uav2: flies its mission", "uav3: flies its mission")
        await asyncio.sleep(30.0 / SPEEDUP)
        flight.kill()
        await flight.wait()


async def restored(run: Path) -> tuple[int, str]:
    """Ask for everything back once."""
    async with called("restore", str(run), "--yes") as process:
        _, err = await ended(process)
    assert process.returncode is not None
    return process.returncode, err


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4], ids=lambda one: one.name)
def test_after_a_flight_and_after_a_death(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    story = Story(settings=CREWS_OWN[autopilot])
    content = site_of(autopilot, story)
    site, run, again = tmp_path / "site.toml", tmp_path / "run", tmp_path / "again"
    site.write_text(tomlkit.dumps(content.model_dump(exclude_none=True, mode="json")))
    ground = site_model.load_site_model(content, tmp_path)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    wanted = Wanted(pads, ground.network.frame, story.speedup, story.settings, frozenset())
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        # Once they are ready they set nothing by themselves until they fly.
        asyncio.run(looked_at(site))
        before = on_board(vehicles)
        if autopilot is ARDUPILOT:  # which passes over a name that it does not know, in the file that it starts with
            for parameters in before.values():
                known = add_first_names(dialect_for(autopilot.name), parameters)
                assert {name: known[name] for name in CREWS_OWN[autopilot]} == pytest.approx(dict(CREWS_OWN[autopilot]))
        report = asyncio.run(flown(site, run))
        assert report["parameters"]
        assert all(row["restored"] for row in report["parameters"])
        assert different(before, on_board(vehicles)) == []
        asyncio.run(killed(site, again))
        changed = different(before, on_board(vehicles))
        assert changed
        assert all(line.split()[1].startswith(RTL) for line in changed), changed
        code, said = asyncio.run(restored(again))
        assert code == 1
        assert said.count("not restored: is armed") == len(vehicles)
        assert different(before, on_board(vehicles)) == changed, "nobody is touched in flight"
        for _ in range(RESTORES):
            code, said = asyncio.run(restored(again))
            if code == 0:
                break
        assert code == 0, said
        assert different(before, on_board(vehicles)) == []


async def looked_at(site: Path) -> None:
    """Wait until everybody is ready."""
    async with called("preflight", str(site), "--json") as process:
        out, err = await process.communicate()
    assert process.returncode == 0, (out, err)
