"""Real autopilots with cameras: one that is wired to ArduPilot, and one that is not there at all.

PX4's simulator is built without its driver for wired cameras (camera_trigger): no picture can be had of it.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from tests.sitl.flights import Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, Autopilot

SERVO_CAMERA = {"CAM1_TYPE": 1.0, "SERVO9_FUNCTION": 10.0}


@pytest.mark.sitl
@pytest.mark.timeout(580)
def test_ardupilot_proves_spans_and_pylons_by_its_feedback(tmp_path: Path) -> None:
    tables = {
        "camera": [{"name": "rgb", "id": 1}],
        "look": [
            {"camera": "rgb", "every_m": 10.0},
            {"camera": "rgb", "of": "pylons", "pylons": ["V101-01"], "bearings_deg": [60, 120]},
        ],
    }
    done = flown(ARDUPILOT, Story(settings=SERVO_CAMERA, radius_m=250.0, tables=tables), tmp_path)
    assert done.report["finished"], done.said
    assert {row["state"] for row in done.report["seen"]} == {"seen"}
    with (done.run / "images.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert {row["proof"] for row in rows} == {"feedback"}
    spans = [row for row in done.report["seen"] if row["take"] == "pictures"]
    assert all(row["pictures"] >= 9 for row in spans), json.dumps(spans)
    assert [row["viewpoint"] for row in rows if row["asset"] == "pylon V101-01"] in (
        ["viewpoint 1", "viewpoint 2"], ["viewpoint 2", "viewpoint 1"],
    )  # fmt: skip


@pytest.mark.sitl
@pytest.mark.timeout(580)
@BOTH
def test_items_for_cameras_read_back_and_a_camera_that_is_not_there_is_found(
    autopilot: Autopilot, tmp_path: Path
) -> None:
    tables = {
        "camera": [{"name": "rgb", "id": 100, "gimbal": True}, {"name": "film", "id": 101}],
        "look": [
            {"camera": "rgb", "every_m": 10.0, "trigger": "interval"},
            {"camera": "film", "take": "video"},
            {"camera": "rgb", "of": "pylons", "bearings_deg": [60, 120]},
        ],
    }
    done = flown(autopilot, Story(radius_m=250.0, tables=tables), tmp_path)
    assert done.said.count("verified by read-back") == 3, done.said
    faults = {(row["vehicle"], row["kind"], row["code"]) for row in done.report["faults"]}
    assert faults == {(name, "payload", "camera_silent") for name in ("uav1", "uav2", "uav3")}, done.said
    assert all(row["landed"] for row in done.report["vehicles"])
    assert not done.report["segments_inspected"]
