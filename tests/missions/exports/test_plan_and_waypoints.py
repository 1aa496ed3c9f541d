"""QGroundControl's formats: as they are written, and every reason to refuse to."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from missions import (
    ARDUPILOT,
    PX4,
    Dialect,
    LocalFrame,
    MissionFileError,
    encode,
    find_mission_differences,
)
from missions.exports import format_qgc_plan, format_qgc_waypoints
from missions.fences import build_fence, build_fence_items, build_rally_items
from tests.missions.qgc_files import read_qgc_plan, read_waypoints
from tests.missions.test_encode import PATH

HOME = (49.6, 15.6, 450.0)


@pytest.mark.parametrize(("dialect", "firmware"), [(ARDUPILOT, 3), (PX4, 12)])
def test_a_plan_is_as_qgroundcontrol_writes_it(dialect: Dialect, firmware: int) -> None:
    document = json.loads(format_qgc_plan(encode(PATH, dialect).items, dialect, HOME))
    assert (document["fileType"], document["version"], document["mission"]["version"]) == ("Plan", 1, 2)
    assert document["mission"]["firmwareType"] == firmware
    assert document["mission"]["plannedHomePosition"] == [49.6, 15.6, 450.0]
    items = document["mission"]["items"]
    # Home is outside the items, and they count from 1.
    assert [item["doJumpId"] for item in items] == list(range(1, 11))
    assert items[0]["command"] == 22
    assert items[3]["params"][4:] == [49.602, 15.6, 32.0]
    assert items[3]["frame"] == 3
    assert items[3]["params"][3] is None if dialect is PX4 else items[3]["params"][3] == 0.0


def test_a_waypoints_file_is_as_mission_planner_writes_it() -> None:
    lines = format_qgc_waypoints(encode(PATH, ARDUPILOT).items, ARDUPILOT, HOME).splitlines()
    assert lines[0] == "QGC WPL 110"
    assert lines[1].split("\t") == [
        "0",
        "0",
        "0",
        "16",
        "0.0",
        "0.0",
        "0.0",
        "0.0",
        "49.6000000",
        "15.6000000",
        "450.0",
        "1",
    ]
    assert lines[3].split("\t")[2:8] == ["0", "178", "1.0", "8.0", "-1.0", "0.0"]
    assert len(lines) == 12


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
def test_both_formats_are_read_again(dialect: Dialect) -> None:
    items = tuple(replace(item, param4=90.0) for item in encode(PATH, dialect).items)
    flown, home = read_qgc_plan(format_qgc_plan(items, dialect, HOME))
    assert home == HOME
    assert len(flown) == 10
    lines = read_waypoints(format_qgc_waypoints(items, dialect, HOME))
    assert find_mission_differences(items, lines, dialect) == ()


def test_a_heading_that_is_left_open_has_no_word_in_a_waypoints_file() -> None:
    with pytest.raises(MissionFileError, match=r"^item 0: param4: expected a finite number, got nan$"):
        format_qgc_waypoints(encode(PATH, PX4).items, PX4, HOME)


@pytest.mark.parametrize("write", [format_qgc_plan, format_qgc_waypoints])
def test_no_figure_is_written_that_is_not_finite(write: Callable[..., str]) -> None:
    items = encode(PATH, ARDUPILOT).items
    for spoilt in (replace(items[3], z=math.nan), replace(items[3], param2=math.inf), replace(items[3], z=-math.inf)):
        with pytest.raises(MissionFileError, match=r"^item 3: (height|param2): expected a finite number, got"):
            write((*items[:3], spoilt, *items[4:]), ARDUPILOT, HOME)
    with pytest.raises(MissionFileError, match=r"^home: expected a finite place and height"):
        write(items, ARDUPILOT, (49.6, 15.6, math.nan))


def test_a_fence_and_rally_points_are_as_qgroundcontrol_writes_them() -> None:
    frame = LocalFrame(*HOME)
    fence = build_fence_items(build_fence([(0.0, 0.0), (200.0, 0.0)], 20.0, 50.0), frame)
    document = json.loads(format_qgc_plan(
        encode(PATH, PX4).items, PX4, HOME, fence=fence, rally=build_rally_items([(0.0, 0.0)], frame),
    ))  # fmt: skip
    assert document["geoFence"] == {
        "version": 2,
        "circles": [],
        "polygons": [
            {"version": 1, "inclusion": True, "polygon": [[one.x / 1e7, one.y / 1e7] for one in fence]},
        ],
    }
    assert document["rallyPoints"] == {"version": 2, "points": [[49.6, 15.6, 0.0]]}
