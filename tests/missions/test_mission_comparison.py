"""Read-back items: what each autopilot is known to rewrite passes, anything else is told."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from missions import (
    ARDUPILOT,
    PX4,
    Command,
    Dialect,
    Frame,
    MissionItem,
    count_common_items,
    encode,
    find_mission_differences,
)
from tests.missions.builders import arrival_seq
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
    assert find_mission_differences(items, [as_ardupilot_answers(item) for item in items], ARDUPILOT) == ()


def test_px4s_rewriting_is_no_difference() -> None:
    items = encode(PATH, PX4).items
    assert find_mission_differences(items, [as_px4_answers(item) for item in items], PX4) == ()


def test_what_ardupilot_rewrites_is_a_difference_on_px4() -> None:
    items = encode(PATH, PX4).items
    read_back = [replace(item, frame=0) if item.command == Command.DO_CHANGE_SPEED else item for item in items]
    assert find_mission_differences(items, read_back, PX4) == tuple(
        f"item {seq} (DO_CHANGE_SPEED): frame sent 2, read back 0" for seq in (1, 4, 7)
    )
    moved_home = (replace(items[0], x=items[0].x + 50), *items[1:])
    assert find_mission_differences(items, moved_home, PX4) == (
        "item 0 (NAV_TAKEOFF): x sent 496000000, read back 496000050",
    )


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4])
@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("param1", 0.0, "param1 sent HOLD, read back 0.0"),
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
def test_any_other_change_is_reported(dialect: Dialect, key: str, value: float, told: str) -> None:
    mission = encode(PATH, dialect)
    seq = arrival_seq(mission, 2)
    read_back = list(mission.items)
    read_back[seq] = replace(read_back[seq], **{key: value})  # type: ignore[arg-type]
    (text,) = find_mission_differences(mission.items, read_back, dialect)
    assert text.startswith(f"item {seq} (NAV_WAYPOINT): ")
    assert re.search(told.replace("HOLD", str(dialect.performance.hold_s)), text)


def test_a_list_of_another_length_is_reported_as_such() -> None:
    items = encode(PATH, PX4).items
    assert find_mission_differences(items, items[:-1], PX4) == ("10 items sent, 9 read back",)


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
@pytest.mark.parametrize("key", ["x", "y"])
@pytest.mark.parametrize("moved", [-2, -1, 0, 1, 2])
def test_a_place_may_be_off_by_one_step_of_its_degrees(dialect: Dialect, key: str, moved: int) -> None:
    mission = encode(PATH, dialect)
    seq = arrival_seq(mission, 2)
    read_back = list(mission.items)
    read_back[seq] = replace(read_back[seq], **{key: getattr(read_back[seq], key) + moved})
    assert bool(find_mission_differences(mission.items, read_back, dialect)) == (abs(moved) > 1)


@pytest.mark.parametrize(
    ("dialect", "off_m", "told"),
    [
        (ARDUPILOT, 0.01, False),
        (ARDUPILOT, -0.01, False),
        (ARDUPILOT, 0.0102, True),
        (ARDUPILOT, -0.0102, True),
        (PX4, 2.0 * float(np.spacing(np.float32(32.0))), False),
        (PX4, 3.0 * float(np.spacing(np.float32(32.0))), True),
        (PX4, -0.01, True),
    ],
)
def test_a_height_may_be_cut_to_one_step_and_no_more(dialect: Dialect, off_m: float, told: bool) -> None:
    mission = encode(PATH, dialect)
    seq = arrival_seq(mission, 2)
    read_back = list(mission.items)
    read_back[seq] = replace(read_back[seq], z=read_back[seq].z + off_m)
    assert bool(find_mission_differences(mission.items, read_back, dialect)) == told


def test_a_number_may_be_off_by_two_steps_of_float32_and_no_more() -> None:
    step = float(np.spacing(np.float32(3.0)))
    for steps, told in ((-3, True), (-2, False), (0, False), (2, False), (3, True)):
        ours = MissionItem(1, Frame.MISSION, Command.DO_CHANGE_SPEED, 1.0, 3.0, -1.0)
        theirs = replace(ours, param2=3.0 + steps * step)
        assert bool(find_mission_differences([ours], [theirs], PX4)) == told, steps


def test_a_landings_yaw_is_ardupilots_own_and_px4s_is_ours() -> None:
    for dialect, told in ((ARDUPILOT, 0), (PX4, 1)):
        items = list(encode(PATH, dialect).items)
        (seq,) = (item.seq for item in items if item.command == Command.NAV_LAND)
        items[seq] = replace(items[seq], param4=77.0)
        assert len(find_mission_differences(encode(PATH, dialect).items, items, dialect)) == told


def test_an_unknown_command_is_reported_by_its_number() -> None:
    ours = replace(encode(PATH, PX4).items[0], command=4242)
    assert find_mission_differences([ours], [replace(ours, param1=ours.param1 + 1.0)], PX4)[0].startswith(
        "item 0 (4242): param1 "
    )


@pytest.mark.parametrize("dialect", [ARDUPILOT, PX4], ids=["ardupilot", "px4"])
def test_two_missions_are_alike_up_to_the_first_difference(dialect: Dialect) -> None:
    items = encode(PATH, dialect).items
    assert count_common_items(items, items, dialect) == len(items)
    assert count_common_items(items, items[:4], dialect) == count_common_items(items[:4], items, dialect) == 4
    assert count_common_items(items, [], dialect) == 0
    for seq in range(1, len(items)):
        other = [*items[:seq], replace(items[seq], autocontinue=not items[seq].autocontinue), *items[seq + 1 :]]
        assert count_common_items(items, other, dialect) == seq
