"""Items for cameras: what stands where in a mission, in both dialects, and that a re-plan keeps its beginning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missions import (
    ARDUPILOT,
    PX4,
    Command,
    Dialect,
    Inspection,
    build_flight_path,
    continue_path,
    encode,
    find_mission_differences,
    plan_flight_setup,
)
from missions.cameras import Camera, CameraTasks, PylonCameraTask, SpanCameraTask, Trigger, Viewpoint
from missions.items import PAYLOAD, MissionItem
from missions.setup import FlightSetup
from tests.missions.builders import line_east

BOTH = pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=lambda one: one.name)
GIMBAL = Camera("rgb", 100, gimbal=True)
WIRED = Camera("rgb", 1)


def setup_with(camera: Camera, *looks: SpanCameraTask, vehicles: tuple[str, ...] = ("uav1", "uav2")) -> FlightSetup:
    setup = plan_flight_setup(line_east(5), vehicles, Inspection(flat=True))
    every = dict.fromkeys(range(4), looks)
    return replace(setup, looks=CameraTasks({camera.name: camera}, {"uav1": frozenset({camera.name})}, every))


def commands(setup: FlightSetup, dialect: Dialect, visits: tuple[int, ...]) -> list[tuple[str, float]]:
    items = encode(build_flight_path(setup, "uav1", visits), dialect).items
    return [(Command(item.command).name, item.param1) for item in items if item.command in PAYLOAD]


@BOTH
def test_a_span_begins_and_ends_what_it_asks_for(dialect: Dialect) -> None:
    every = SpanCameraTask("rgb", Trigger.DISTANCE, 8.0)
    assert commands(setup_with(WIRED, every), dialect, (0,)) == [
        ("DO_SET_CAM_TRIGG_DIST", 8.0), ("DO_SET_CAM_TRIGG_DIST", 0.0),
    ]  # fmt: skip
    film = SpanCameraTask("rgb", Trigger.VIDEO)
    assert [name for name, _ in commands(setup_with(WIRED, film), dialect, (0,))] == [
        "VIDEO_START_CAPTURE", "VIDEO_STOP_CAPTURE",
    ]  # fmt: skip
    timed = SpanCameraTask("rgb", Trigger.INTERVAL, 9.0)
    items = encode(build_flight_path(setup_with(GIMBAL, timed), "uav1", (0,)), dialect).items
    [start] = [item for item in items if item.command == Command.IMAGE_START_CAPTURE]
    assert (start.param1, start.param2, start.param3) == (100.0, 3.0, 0.0)  # 9 m at 3 m/s


@BOTH
def test_a_gimbal_looks_at_the_line_whichever_way_it_is_flown(dialect: Dialect) -> None:
    setup = setup_with(GIMBAL, SpanCameraTask("rgb", Trigger.DISTANCE, 8.0))
    yaws = []
    for visit in (0, 1):
        items = encode(build_flight_path(setup, "uav1", (visit,)), dialect).items
        [pointing] = [item for item in items if item.command == Command.DO_GIMBAL_MANAGER_PITCHYAW]
        assert pointing.param1 == -72.0  # 15 m above and 5 m beside
        yaws.append(pointing.param2)
    assert yaws == [-90.0, 90.0]  # the track lies to the right of the line


@BOTH
def test_a_continued_mission_begins_as_the_one_on_board(dialect: Dialect) -> None:
    setup = setup_with(GIMBAL, SpanCameraTask("rgb", Trigger.DISTANCE, 8.0))
    path = build_flight_path(setup, "uav1", (0, 2, 4))
    kept = 1 + max(index for index, point in enumerate(path.waypoints) if point.visit == 0)
    before, after = (encode(one, dialect) for one in (path, continue_path(setup, path, kept, (7,))))
    last = max(seq for seq, waypoint in enumerate(before.waypoint_of) if waypoint is not None and waypoint < kept)
    same = before.items[: last + 2]  # with what ends the kept span
    assert same[-1].command == Command.DO_SET_CAM_TRIGG_DIST
    assert find_mission_differences(same, after.items[: last + 2], dialect) == ()
    assert find_mission_differences(before.items, before.items, dialect) == ()


def test_a_vehicle_without_the_camera_is_barred_from_what_asks_for_it() -> None:
    looks = setup_with(GIMBAL, SpanCameraTask("rgb", Trigger.DISTANCE, 8.0)).looks
    assert looks.find_barred_segments("uav1") == frozenset()
    assert looks.find_barred_segments("uav2") == frozenset(range(4))
    assert looks.find_barred_segments("uav1", {"rgb"}) == frozenset(range(4))


@BOTH
def test_without_looks_nothing_is_in_the_mission(dialect: Dialect) -> None:
    setup = plan_flight_setup(line_east(5), ("uav1",), Inspection(flat=True))
    assert commands(setup, dialect, (0, 2)) == []


def around(dialect: Dialect, camera: Camera) -> list[tuple[int, float, float]]:
    """Return command, param1 and param4 of the items of a pylon whose top is a region of interest."""
    setup = setup_with(camera)
    points = (Viewpoint((140.0, -8.0), 63), Viewpoint((160.0, -8.0), -51))
    look = PylonCameraTask(camera.name, points, 2.0, 20.0, (150.0, 0.0, 0.0), roi=True)
    setup = replace(setup, looks=replace(setup.looks, spans={}, pylons={1: look}))
    items = encode(build_flight_path(setup, "uav1", (2,)), dialect).items
    whole = [item for item in items if item.command in PAYLOAD or item.param1 == 2.0]
    return [(item.command, item.param1, item.param4) for item in whole]


@pytest.mark.parametrize("camera", [GIMBAL, WIRED], ids=["gimbal", "fixed"])
def test_ardupilot_turns_to_a_region_of_interest_and_away_again(camera: Camera) -> None:
    shot = Command.IMAGE_START_CAPTURE if camera is GIMBAL else Command.DO_DIGICAM_CONTROL
    stop = [Command.DO_SET_ROI_LOCATION, Command.NAV_WAYPOINT, shot, Command.DO_SET_ROI_NONE]
    assert [command for command, _, _ in around(ARDUPILOT, camera)] == stop * 2


@pytest.mark.parametrize("camera", [GIMBAL, WIRED], ids=["gimbal", "fixed"])
def test_px4_heads_for_a_region_of_interest_that_it_could_not_read_back(camera: Camera) -> None:
    found = around(PX4, camera)
    assert [heading for command, _, heading in found if command == Command.NAV_WAYPOINT] == [63.0, 309.0]
    pitches = [pitch for command, pitch, _ in found if command == Command.DO_GIMBAL_MANAGER_PITCHYAW]
    assert pitches == ([-50.0, -50.0] if camera is GIMBAL else [])
    assert not {command for command, _, _ in found} & {Command.DO_SET_ROI_LOCATION, Command.DO_SET_ROI_NONE}


def test_a_heading_comes_back_from_px4_within_what_is_allowed() -> None:
    """It keeps radians in float32 (mavlink_mission.cpp), and gives degrees back."""
    to_radians, to_degrees = np.float32(np.pi) / np.float32(180), np.float32(180) / np.float32(np.pi)
    sent = [MissionItem(seq, 6, Command.NAV_WAYPOINT, param4=float(seq)) for seq in range(360)]
    back = [replace(item, param4=float(np.float32(item.param4) * to_radians * to_degrees)) for item in sent]
    assert find_mission_differences(sent, back, PX4) == ()
