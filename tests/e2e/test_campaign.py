"""Whole flights over the network behind the paper: every radius, dialect, fault and moment of the agreement.

Run by ./scripts/campaign; one flight takes about a minute.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.judge import wrongly_counted

NETWORK = Path(__file__).resolve().parents[3] / "shared" / "data" / "nechranice_graph.yaml"
RESERVE_PCT = 15.0
LAYER_M = 5.0

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not NETWORK.exists(), reason=f"the network behind the paper is not at {NETWORK}"),
]


@pytest.mark.parametrize("share_pct", [20, 50, 80])
@pytest.mark.parametrize("fault", ["silent", "battery-step=30", "drain=3"])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("radius_m", [500, 700, 1000])
def test_the_flight_ends_well(radius_m: int, autopilot: str, fault: str, share_pct: int, tmp_path: Path) -> None:
    run = tmp_path / "run"
    command = [
        sys.executable, "-m", "executor", "demo", "--json", "--run", str(run), "--speedup", "20",
        "--network", str(NETWORK), "--radius", str(radius_m), "--autopilot", autopilot,
        "--fault", f"uav2:{fault}@{share_pct}%",
    ]  # fmt: skip
    ended = subprocess.run(command, capture_output=True, text=True, timeout=280, check=False)

    assert ended.returncode in {0, 1}, ended.stderr
    assert "Traceback" not in ended.stderr
    report = json.loads(ended.stdout)
    assert report["finished"] or report["segments_uncovered"]
    assert report["segments_inspected"] + len(report["segments_uncovered"]) == report["segments_total"]
    assert wrongly_counted(run, report) == []
    assert report["min_separation_m"] >= LAYER_M
    silent = {fault["vehicle"] for fault in report["faults"] if fault["kind"] == "link"}
    for vehicle in report["vehicles"]:
        if vehicle["name"] not in silent:
            assert vehicle["landed"], vehicle
            assert vehicle["min_reserve_pct"] >= RESERVE_PCT, vehicle
    assert [entry["vehicle"] for entry in report["faults"]] in ([], ["uav2"])
