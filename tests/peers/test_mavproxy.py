"""MAVProxy's command line, in a process of its own, reads a mission from the simulated vehicles."""

from __future__ import annotations

import asyncio
import sys
from asyncio.subprocess import PIPE, STDOUT, Process
from pathlib import Path

import pytest

from missions.items import Command
from simulator.config import AutopilotKind
from simulator.testing import fleet
from tests.simulator.harness import numbered, on_wire, rtl, speed, takeoff, waypoint
from tests.simulator.station import Station

PATIENCE_S = 60
LISTING = "mission.txt"
ROUTE = (takeoff(), speed(5.0), waypoint(120, 0), waypoint(120, 60), rtl())


async def said(process: Process, words: bytes) -> None:
    """Read what MAVProxy prints until it says these words."""
    assert process.stdout is not None
    async with asyncio.timeout(PATIENCE_S):
        while words not in (line := await process.stdout.readline()):
            assert line, f"MAVProxy ended before it said {words!r}"


@pytest.mark.asyncio
@pytest.mark.parametrize("kind", list(AutopilotKind))
async def test_mavproxy_lists_the_mission(kind: AutopilotKind, tmp_path: Path) -> None:
    items = numbered((waypoint(0, 0, 0.0), *ROUTE) if kind is AutopilotKind.ARDUPILOT else ROUTE, current=0)
    async with fleet(autopilot=kind.value) as living:
        async with Station.calling(living[0].port) as station:
            assert await station.upload([on_wire(item) for item in items], sysid=1) == 0
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-u", str(Path(sys.executable).with_name("mavproxy.py")),
            f"--master={living[0].pymavlink}", "--default-modules=wp", "--state-basedir=.",
            cwd=tmp_path, stdin=PIPE, stdout=PIPE, stderr=STDOUT,
        )  # fmt: skip
        try:
            await said(process, b"online system 1")
            assert process.stdin is not None
            process.stdin.write(f"wp save {LISTING}\n".encode())
            await said(process, b"Saved")
        finally:
            process.kill()
            await process.communicate()
    rows = [row.split("\t") for row in (tmp_path / LISTING).read_text().splitlines()[1:]]
    assert [int(row[3]) for row in rows] == [int(item.command) for item in items]
    assert int(rows[-1][3]) == Command.NAV_RETURN_TO_LAUNCH
