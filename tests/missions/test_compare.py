"""Read-back items: what each autopilot is known to rewrite passes, anything else is told."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from missions import ARDUPILOT, PX4, Command, Dialect, Frame, MissionItem, differences, encode
from tests.missions.test_encode import PATH


def as_ardupilot_answers(item: MissionItem) -> MissionItem:
    """Rewrite an item as measured on ArduPilot: its own home, frame 0 of commands, a landing's yaw, centimetres."""
    if item.seq == 0:
        return replace(item, frame=Frame.GLOBAL, x=495990000, y=155990000, z=451.3)
    if item.command == Command.DO_CHANGE_SPEED:
        return replace(item, frame=0, param2=float(np.float32(item.param2)), current=False)
    yaw = 1.0 if item.command == Command.NAV_LAND else 0.0
    return replace(item, frame=3, z=math.trunc(item.z * 100.0 - 1e-6) / 100.0, param4=yaw, current=False)


def as_px4_answers(item: MissionItem) -> MissionItem:
    """Rewrite an item as PX4 does: float32 throughout, integer frames, the current flag where it is at."""
    single = {key: float(np.float32(getattr(item, key))) for key in ("param1", "param2", "param3", "param4", "z")}
    return replace(item, **single, current=item.seq == 3)  # type: ignore[arg-type]


def test_ardupilots_rewriting_is_no_difference() -> None:
    items = encode(PATH, ARDUPILOT).items
    assert differences(items, [as_ardupilot_answers(item) for item in items], ARDUPILOT) == ()


def test_px4s_rewriting_is_no_difference() -> None:
    items = encode(PATH, PX4).items
    assert differences(items, [as_px4_answers(item) for item in items], PX4) == ()


def test_what_ardupilot_rewrites_is_a_difference_on_px4() -> None:
    items = encode(PATH, PX4).items
    read_back = [replace(item, frame=0) if item.command == Command.DO_CHANGE_SPEED else item for item in items]
    assert differences(items, read_back, PX4) == tuple(
        f"item {seq} (DO_CHANGE_SPEED): frame sent 2, read back 0" for seq in (1, 4, 7)
    )
    moved_home = (replace(items[0], x=items[0].x + 50), *items[1:])
    assert differences(items, moved_home, PX4) == ("item 0 (NAV_TAKEOFF): x sent 496000000, read back 496000050",)


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("param1", 0.0, "param1 sent 1.0, read back 0.0"),
        ("x", 496020002, "x sent 496020000, read back 496020002"),
        ("y", 156000000 - 2, "y sent 156000000, read back 155999998"),
        ("z", 32.02, "z sent 32.0, read back 32.02"),
        ("z", math.nan, "z sent 32.0, read back nan"),
        ("param4", 90.0, r"param4 sent .*, read back 90.0"),
        ("autocontinue", False, "autocontinue sent True, read back False"),
        ("frame", Frame.GLOBAL, r"frame sent \d, read back 0"),
        ("command", 82, "command sent 16, read back 82"),
        ("seq", 99, r"seq sent \d, read back 99"),
    ],
)
def test_any_other_change_is_told(dialect: Dialect, key: str, value: float, told: str) -> None:
    mission = encode(PATH, dialect)
    seq = mission.arrival_seq(2)
    read_back = list(mission.items)
    read_back[seq] = replace(read_back[seq], **{key: value})  # type: ignore[arg-type]
    (text,) = differences(mission.items, read_back, dialect)
    assert text.startswith(f"item {seq} (NAV_WAYPOINT): ")
    assert re.search(told, text)


def test_a_list_of_another_length_is_told_as_that() -> None:
    items = encode(PATH, PX4).items
    assert differences(items, items[:-1], PX4) == ("10 items sent, 9 read back",)
