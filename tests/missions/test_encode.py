"""Items of both dialects, one by one."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from missions import (
    ARDUPILOT,
    PX4,
    Command,
    Dialect,
    EncodedMission,
    EncodeError,
    FlightPath,
    Frame,
    MissionItem,
    Phase,
    Waypoint,
    encode,
    flag_current,
)
from tests.missions.builders import arrival_seq

PATH = FlightPath(
    "uav1",
    (
        Waypoint(Phase.TAKEOFF, 49.6, 15.6, 30.004, 2.5),
        Waypoint(Phase.TRANSIT, 49.601, 15.6, 31.0, 8.0, visit=0),
        Waypoint(Phase.TRANSIT, 49.602, 15.6000000449, 32.0, 8.0, hold=True, visit=0),
        Waypoint(Phase.INSPECT, 49.603, 15.6, 33.0, 3.0, hold=True, visit=0),
        Waypoint(Phase.INSPECT, 49.604, 15.6, 33.0, 3.0, hold=True, visit=1),
        Waypoint(Phase.RETURN, 49.6, 15.6, 30.0, 8.0),
        Waypoint(Phase.LAND, 49.6, 15.6, 0.0, 1.0),
    ),
)


def commands(mission: EncodedMission) -> list[int]:
    return [item.command for item in mission.items]


BODY = [
    Command.NAV_TAKEOFF,
    Command.DO_CHANGE_SPEED,
    Command.NAV_WAYPOINT,
    Command.NAV_WAYPOINT,
    Command.DO_CHANGE_SPEED,
    Command.NAV_WAYPOINT,
    Command.NAV_WAYPOINT,  # at the same speed: no speed item
    Command.DO_CHANGE_SPEED,
    Command.NAV_WAYPOINT,
    Command.NAV_LAND,
]


def test_px4_starts_with_its_take_off() -> None:
    mission = encode(PATH, PX4)
    assert commands(mission) == BODY
    assert mission.waypoint_of == (0, 1, 1, 2, 3, 3, 4, 5, 5, 6)
    assert [item.current for item in mission.items] == [True] + [False] * 9
    takeoff, speed, passing, stopping = mission.items[:4]
    assert (takeoff.frame, takeoff.x, takeoff.y, takeoff.z) == (Frame.GLOBAL_RELATIVE_ALT_INT, 496000000, 156000000, 30)
    assert math.isnan(takeoff.param4)
    assert speed == MissionItem(1, Frame.MISSION, Command.DO_CHANGE_SPEED, 1.0, 8.0, -1.0)
    assert (passing.param1, passing.param2) == (0.0, 2.0)
    assert (stopping.param1, stopping.param2) == (2.0, 3.0)


def test_ardupilot_starts_with_a_slot_for_home() -> None:
    mission = encode(PATH, ARDUPILOT)
    assert commands(mission) == [Command.NAV_WAYPOINT, *BODY]
    assert mission.waypoint_of == (None, 0, 1, 1, 2, 3, 3, 4, 5, 5, 6)
    assert not any(item.current for item in mission.items)
    home, takeoff, speed, passing, stopping = mission.items[:5]
    assert home == MissionItem(0, Frame.GLOBAL, Command.NAV_WAYPOINT, x=496000000, y=156000000)
    assert takeoff == MissionItem(1, Frame.GLOBAL_RELATIVE_ALT, Command.NAV_TAKEOFF, z=30.0)
    assert speed == MissionItem(2, Frame.GLOBAL, Command.DO_CHANGE_SPEED, 1.0, 8.0, -1.0)
    assert (passing.param1, passing.param2, passing.param4) == (0.0, 0.0, 0.0)
    assert (stopping.param1, stopping.param2) == (1.0, 0.0)
    assert mission.items[-1] == MissionItem(
        10, Frame.GLOBAL_RELATIVE_ALT, Command.NAV_LAND, x=496000000, y=156000000, z=0.0
    )


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
def test_items_are_numbered_and_rounded(dialect: Dialect) -> None:
    mission = encode(PATH, dialect)
    assert [item.seq for item in mission.items] == list(range(len(mission.items)))
    third = mission.items[arrival_seq(mission, 2)]
    assert (third.x, third.y, third.z) == (496020000, 156000000, 32.0)


def test_a_speed_item_serves_the_leg_behind_it() -> None:
    mission = encode(PATH, ARDUPILOT)
    assert mission.waypoint_of[5:8] == (3, 3, 4)
    assert [mission.items[seq].command == Command.DO_CHANGE_SPEED for seq in (5, 6, 7)] == [True, False, False]


def test_one_item_is_flagged_or_none() -> None:
    mission = flag_current(encode(PATH, PX4), 4)
    assert [item.seq for item in mission.items if item.current] == [4]
    assert not any(item.current for item in flag_current(mission, None).items)
    with pytest.raises(EncodeError, match=r"^uav1: current item 10: expected 0 to 9$"):
        flag_current(mission, 10)


def test_a_vehicle_on_the_ground_has_no_mission() -> None:
    with pytest.raises(EncodeError, match=r"^uav1: expected a path with waypoints"):
        encode(FlightPath("uav1", ()), PX4)


def test_a_path_starts_with_its_take_off() -> None:
    with pytest.raises(EncodeError, match=r"^uav1: waypoints\[0\]: expected a take-off, got transit$"):
        encode(FlightPath("uav1", PATH.waypoints[1:]), PX4)


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("lat_deg", math.nan, "lat_deg: expected a finite number, got nan"),
        ("alt_rel_m", math.inf, "alt_rel_m: expected a finite number, got inf"),
        ("speed_m_s", 0.0, r"speed_m_s: expected more than 0, got 0\.0"),
    ],
)
def test_a_figure_that_cannot_be_flown_is_named(key: str, value: float, reason: str) -> None:
    broken = replace(PATH.waypoints[1], **{key: value})  # type: ignore[arg-type]
    with pytest.raises(EncodeError, match=rf"^uav1: waypoints\[1\]\.{reason}$"):
        encode(FlightPath("uav1", (PATH.waypoints[0], broken)), PX4)


def test_a_mission_that_the_autopilot_cannot_hold_is_refused() -> None:
    path = FlightPath("uav1", (PATH.waypoints[0], *[PATH.waypoints[1]] * 600))
    with pytest.raises(EncodeError, match=r"^uav1: expected at most 500 items for px4, got 602$"):
        encode(path, PX4)
    assert len(encode(path, ARDUPILOT).items) == 603
