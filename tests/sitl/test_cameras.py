"""Real autopilots with cameras: one wired to ArduPilot, one of MAVSDK's server on PX4, and one that is not there.

PX4 takes single pictures of a MAVLink camera by its own driver (camera_trigger), with which it has to be built.
"""

from __future__ import annotations

import csv
import itertools
import json
import math
import tomllib
from pathlib import Path

import pytest

from executor.core.state.fleet_state import FleetState
from executor.core.state.vehicle_state import Stage, VehicleState
from executor.site import site_model
from executor.site.site_file import check_site
from tests.sitl.eye import Eye
from tests.sitl.flights import Flown, Story, flown
from tests.sitl.real import ARDUPILOT, BOTH, PX4, Autopilot, RealVehicle

TRIGGERS = {"TRIG_MODE": 4.0, "TRIG_INTERFACE": 3.0, "NAV_DLL_ACT": 2.0}
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


AROUND = {
    "camera": "rgb", "of": "pylons", "pylons": ["V102-02", "V104-02"], "bearings_deg": [60, 120], "both_sides": True,
    "distance_m": 16, "heights_m": [-4, 4], "target_m": -2, "roi": True,
}  # fmt: skip
"""Insulators from beside them, below the top and above it, with a camera that sits on the nose."""


def has_seen_one(vehicle: VehicleState, state: FleetState) -> bool:
    """Whether uav2 has seen something and is on its way to the next."""
    return vehicle.stage is Stage.FLYING and vehicle.name in state.coverage.inspected.values()


def pictures_of(done: Flown) -> dict[str, list[dict[str, str]]]:
    """Return the rows of the index that count, by asset."""
    with (done.run / "images.csv").open() as table:
        rows = [row for row in csv.DictReader(table) if not row["flaw"]]
    return {asset: [row for row in rows if row["asset"] == asset] for asset in {row["asset"] for row in rows}}


def check_pylons(done: Flown) -> None:
    """Hold what was seen of both pylons against what was asked: from where, how high, and each once."""
    ground = site_model.load_site_model(
        check_site(tomllib.loads((done.run / "site.toml").read_text()), "test"), done.run
    )
    found = pictures_of(done)
    said_m = {row["segment"]: row["inspected_at_m"] for row in done.report["seen"]}
    assert min(said_m[segment] for segment in ground.setup.looks.pylons) == ground.setup.inspection.height_m
    for segment, look in ground.setup.looks.pylons.items():
        rows = found[ground.network.segment_name(segment)]
        numbers = [[int(one) for one in row["viewpoint"].removeprefix("viewpoint ").split(", ")] for row in rows]
        assert sorted(itertools.chain(*numbers)) == list(range(1, 9)), rows
        for row, (first, *others) in zip(rows, numbers, strict=True):
            point = look.points[first - 1]
            assert not others or said_m[segment] > ground.setup.inspection.height_m  # one place only from its layer
            east_m, north_m = ground.network.frame.to_local_m(float(row["lat_deg"]), float(row["lon_deg"]))
            assert math.dist((east_m, north_m), point.place_m) < 3.0
            up_m = float(row["alt_msl_m"]) - ground.network.frame.alt_m
            over_m = said_m[segment] - ground.setup.inspection.height_m
            asked_m = ground.setup.layers.surface.height_m(*point.place_m) - point.below_m
            if over_m:  # who cannot come down says how far above the lowest viewpoint it looks from
                asked_m = ground.setup.layers.surface.height_m(*point.place_m) + over_m - look.deepest_m
            assert abs(up_m - asked_m) < 2.0, (row, asked_m)
            to_pylon = math.degrees(math.atan2(look.target_m[0] - east_m, look.target_m[1] - north_m))
            assert abs((float(row["yaw_deg"]) - to_pylon + 180.0) % 360.0 - 180.0) < look.aim_deg + 1.0, (row, to_pylon)


@pytest.mark.sitl
@pytest.mark.timeout(900)
def test_px4_proves_spans_and_pylons_by_the_words_of_a_camera_that_mavsdk_plays(tmp_path: Path) -> None:
    """uav2 is lost after its first asset: what it had not seen is seen by others, and nothing twice."""
    eyes = {name: Eye(number) for number, name in enumerate(("uav1", "uav2", "uav3"), start=1)}
    tables = {
        "inspection": {"same_distance": True},
        "camera": [{"name": "rgb", "id": 100}],
        "look": [{"camera": "rgb", "every_m": 10.0}, AROUND],
    }
    story = Story(
        RealVehicle.suspend, settings=TRIGGERS, radius_m=250.0, tables=tables, eyes=eyes, speedup=1.0, at=has_seen_one
    )  # fmt: skip
    done = flown(PX4, story, tmp_path)
    assert done.report["finished"], done.said
    assert done.report["replans"]
    check_pylons(done)
    for asset, rows in pictures_of(done).items():
        files = [(row["vehicle"], row["file"]) for row in rows]
        assert len(files) == len(set(files)), asset
        assert all(file == eyes[name].taken[int(file[3:8])].file_url for name, file in files)


@pytest.mark.sitl
@pytest.mark.timeout(580)
def test_ardupilots_feedback_proves_what_another_took_over_once_each(tmp_path: Path) -> None:
    """uav2 is lost after its first asset; nothing that it had seen is looked at again."""
    tables = {"camera": [{"name": "rgb", "id": 1}], "look": [{"camera": "rgb", "every_m": 10.0}]}
    story = Story(RealVehicle.suspend, settings=SERVO_CAMERA, radius_m=320.0, tables=tables, at=has_seen_one)
    done = flown(ARDUPILOT, story, tmp_path)
    assert done.report["finished"], done.said
    assert done.report["replans"]
    for row in done.report["seen"]:
        found = [one for one in pictures_of(done)[row["name"]] if one["vehicle"] == row["vehicle"]]
        assert len(found) == len({one["sequence"] for one in found}) == row["pictures"], row
        if row["vehicle"] == "uav2":
            assert {one["vehicle"] for one in pictures_of(done)[row["name"]]} == {"uav2"}


@pytest.mark.sitl
@pytest.mark.timeout(580)
def test_ardupilot_turns_its_nose_to_a_pylon_from_below_its_top(tmp_path: Path) -> None:
    tables = {"inspection": {"same_distance": True}, "camera": [{"name": "rgb", "id": 1}], "look": [AROUND]}
    # Who would not come home by itself when it hears nobody stays in its layer.
    settings = {**SERVO_CAMERA, "FS_GCS_ENABLE": 1.0}
    done = flown(ARDUPILOT, Story(settings=settings, radius_m=250.0, tables=tables), tmp_path)
    assert done.report["finished"], done.said
    check_pylons(done)
