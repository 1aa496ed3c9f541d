"""Real autopilots trigger a camera that is wired to them, along spans and at the viewpoints of pylons.

ArduPilot says of each picture CAMERA_FEEDBACK, PX4 CAMERA_TRIGGER. All items for cameras are verified by read-back.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, Autopilot

EVERY_M = 10.0
SETTINGS: Mapping[str, Mapping[str, float]] = {
    "ardupilot": {"CAM1_TYPE": 1.0, "SERVO9_FUNCTION": 10.0},
    # Triggered by distance, on command; over MAVLink, as there are no pins.
    "px4": {"TRIG_MODE": 4.0, "TRIG_INTERFACE": 3.0},
}


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_spans_and_pylons_are_seen(autopilot: Autopilot, tmp_path: Path) -> None:
    tables = {
        "camera": [{"name": "rgb", "id": 1}],
        "look": [
            {"camera": "rgb", "every_m": EVERY_M},
            {"camera": "rgb", "of": "pylons", "pylons": ["V101-01"], "bearings_deg": [60, 120]},
        ],
    }
    done = flown(autopilot, Story(settings=SETTINGS[autopilot.name], radius_m=250.0, tables=tables), tmp_path)
    assert done.report["finished"], done.said
    assert {row["state"] for row in done.report["seen"]} == {"seen"}
    with (done.run / "images.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert {row["proof"] for row in rows} == {"feedback" if autopilot is ARDUPILOT else "trigger"}
    spans = [row for row in done.report["seen"] if row["take"] == "pictures"]
    assert all(row["pictures"] >= 9 for row in spans), json.dumps(spans)
    assert [row["viewpoint"] for row in rows if row["asset"] == "pylon V101-01"] in (
        ["viewpoint 1", "viewpoint 2"], ["viewpoint 2", "viewpoint 1"],
    )  # fmt: skip
