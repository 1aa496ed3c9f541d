"""The operator leaves while real autopilots are being given new missions: each keeps a whole one, and flies it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import tomlkit

from executor.site import site_model
from tests.e2e.flights import called, ended, interrupt, log_lines, said_in
from tests.e2e.judge import wrongly_counted
from tests.sitl.flights import NAMES, SPEEDUP, VICTIM, Story, site_of
from tests.sitl.real import ARDUPILOT, BOTH, NO_FAILSAFE, Autopilot, RealVehicle, Wanted, running

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(900)]

SURVIVORS = tuple(name for name in NAMES if name != VICTIM)
SLOW_S = 0.7
"""Of a radio: an upload of a dozen items outlasts the five seconds within which a second Ctrl-C means RTL."""
PATIENCE_REAL_S = 120.0
ITEM = "MISSION_ITEM_INT"
CUT_M = 0.011

Items = list[tuple[int, int, int, float]]


def told(items: Sequence[Any]) -> Items:
    """Return of mission items what makes them this mission; ArduPilot's first is its home, and its own."""
    return [(one.command, one.x, one.y, one.z) for one in items if one.seq > 0]


def alike(one: Items, other: Items) -> bool:
    """Return whether two missions are the same; ArduPilot cuts heights to the centimetre."""
    pairs = zip(one, other, strict=False)
    return len(one) == len(other) and all(a[:3] == b[:3] and abs(a[3] - b[3]) < CUT_M for a, b in pairs)


def uploads(vehicle: RealVehicle) -> list[Items]:
    """Return the missions that were sent to a vehicle, as far as each came."""
    begun: list[dict[int, Any]] = []
    for message in vehicle.relayed.sent("MISSION_COUNT", ITEM):
        if message.mission_type != 0:
            continue
        if message.get_type() == "MISSION_COUNT":
            begun.append({})
        else:
            begun[-1][message.seq] = message
    return [told([items[seq] for seq in sorted(items)]) for items in begun if items]


async def left_in_an_upload(site: Path, run: Path, vehicles: dict[str, RealVehicle]) -> str:
    """Fly, lose one, and press Ctrl-C as the first item of a new mission goes up; returns what was said."""
    async with called("fly", str(site), "--yes", "--run", str(run)) as flight:
        await said_in(flight.stderr, *(f"{name}: flies its mission" for name in NAMES))
        await asyncio.sleep(60.0 / SPEEDUP)
        before = {name: len(vehicles[name].relayed.sent(ITEM)) for name in SURVIVORS}
        for name in SURVIVORS:
            vehicles[name].relayed.slow_s = SLOW_S
        vehicles[VICTIM].suspend()
        async with asyncio.timeout(PATIENCE_REAL_S):
            while all(len(vehicles[name].relayed.sent(ITEM)) == count for name, count in before.items()):  # noqa: ASYNC110 - a thread carries
                await asyncio.sleep(0.1)
        interrupt(flight)
        _, err = await ended(flight)
    return err


async def taken_up(run: Path) -> dict[str, Any]:
    """Take the flight up again, and return its report."""
    async with called("resume", str(run), "--yes", "--json") as process:
        out, err = await ended(process, 600.0)
    assert process.returncode == 0, err
    report: dict[str, Any] = json.loads(out)
    return report


@BOTH
def test_an_upload_at_the_end_of_supervision_leaves_a_whole_mission(autopilot: Autopilot, tmp_path: Path) -> None:
    if not autopilot.binary:
        pytest.skip(f"{autopilot.variable} does not name a simulator of {autopilot.name}")
    story = Story(settings=NO_FAILSAFE[autopilot], relayed=NAMES)
    content = site_of(autopilot, story)
    site, run = tmp_path / "site.toml", tmp_path / "run"
    site.write_text(tomlkit.dumps(content.model_dump(exclude_none=True, mode="json")))
    ground = site_model.load_site_model(content, tmp_path)
    pads = {pad.vehicle: pad for pad in ground.setup.pads}
    wanted = Wanted(pads, ground.network.frame, story.speedup, story.settings, frozenset(NAMES))
    with running(autopilot, Path(autopilot.binary), tmp_path / "sim", wanted) as vehicles:
        said = asyncio.run(left_in_an_upload(site, run, vehicles))
        board = {name: told(vehicles[name].other.mission(vehicles[name].sysid)) for name in SURVIVORS}
        sent = {name: uploads(vehicles[name]) for name in SURVIVORS}
        for name in SURVIVORS:
            vehicles[name].relayed.slow_s = 0.0
        report = asyncio.run(taken_up(run))
    # PX4 takes a mission whole or not at all; into ArduPilot's each item goes as it comes.
    waits = "supervision ends once the upload to" in said
    assert waits is (autopilot is ARDUPILOT), said
    which = {name: [alike(board[name], one) for one in sent[name]] for name in SURVIVORS}
    assert all(any(found) for found in which.values()), (which, board, sent, said)
    if waits:
        assert any(len(found) > 1 and found[-1] and not found[0] for found in which.values()), (which, said)
    lines = [line["said"] for line in log_lines(run) if "said" in line]
    assert report["segments_inspected"] == report["segments_total"], lines
    unseen = [one for one in wrongly_counted(run, report) if one[1] not in report["inferred"]]
    assert unseen == [], lines
    landed = {vehicle["name"]: vehicle["landed"] for vehicle in report["vehicles"]}
    assert all(landed[name] for name in SURVIVORS), lines
