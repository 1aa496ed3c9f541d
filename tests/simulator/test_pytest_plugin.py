"""The plugin in a pytest of its own: it costs nothing until a fleet is asked for, and reports what was said."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.patience import PATIENCE_S

ROOT = Path(__file__).parents[2]
TESTS = """
import asyncio
import sys
import pytest

def test_nothing_is_imported_yet():
    assert not {"pymavlink", "numpy", "simulator.testing", "asyncio"} & set(sys.modules) - {"asyncio"}

@pytest.mark.simulated_fleet(vehicles=2, autopilot="ardupilot", stepped=True)
def test_the_mark_orders_the_fleet(simulated_fleet):
    assert [one.truth.mode for one in simulated_fleet] == ["STABILIZE"] * 2

def test_without_a_mark_it_is_one_vehicle(simulated_fleet):
    assert len(simulated_fleet) == 1

@pytest.mark.virtual_time
async def test_an_hour_passes_at_once(tmp_path):
    await asyncio.sleep(3000.0)
    assert asyncio.get_running_loop().time() == 3000.0

@pytest.mark.virtual_time(limit_s=60)
async def test_there_is_a_limit():
    await asyncio.sleep(61.0)

@pytest.mark.virtual_time
async def test_it_fails_in_flight():
    from pymavlink.dialects.v20 import ardupilotmega as mav
    from simulator.testing import fleet
    async with fleet() as flying:
        send = flying[0].open_link(lambda datagram: None)
        send(mav.MAVLink_mission_count_message(1, 1, 2).pack(mav.MAVLink(None, srcSystem=255)))
        await asyncio.sleep(2.0)
        assert False
"""


PAGE = ROOT / "docs" / "how-to" / "test-a-fleet.md"


def run_theirs(folder: Path, text: str) -> str:
    """Run tests of somebody else, and return what pytest says."""
    (folder / "test_theirs.py").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--strict-markers", "-W", "error", "-p", "no:cacheprovider",
         "-p", "simulator.pytest_plugin", "test_theirs.py"],
        cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    return done.stdout + done.stderr


def test_what_its_page_shows_runs(tmp_path: Path) -> None:
    shown = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert "2 passed" in run_theirs(tmp_path, "\n".join(shown))


def test_it_serves_tests_of_another_program(tmp_path: Path) -> None:
    said = run_theirs(tmp_path, TESTS)
    assert "2 failed, 4 passed" in said, said
    assert "FAILED test_theirs.py::test_there_is_a_limit - TimeoutError" in said
    assert "dialogue with the simulated fleet" in said
    assert "uav1: client 255 never sends item 0, which was asked for" in said
    assert "     0.00 s  uav1 -> 255     MISSION_REQUEST_INT 0" in said
