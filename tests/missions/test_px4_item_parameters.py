"""PX4 from 1.18 on refuses an item or a command with a parameter that it does not use: its own table of these.

FAULTLINE_PX4_SOURCE names its source directory; older ones have no such table.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from executor.protocols import vehicle_commands
from missions import PX4, Inspection, build_flight_path, encode, plan_flight_setup
from missions.cameras import Camera, CameraTasks, PylonCameraTask, SpanCameraTask, Trigger, Viewpoint
from missions.fences import Fence, build_fence_items, build_rally_items
from missions.items import Frame, MissionItem
from tests.missions.builders import FRAME, line_east

TABLE = Path(os.environ.get("FAULTLINE_PX4_SOURCE", ""), "src/modules/mavlink/mavlink_command_params.hpp")
UNUSED_E7 = 2**31 - 1
pytestmark = pytest.mark.skipif(
    not TABLE.is_file(), reason="FAULTLINE_PX4_SOURCE: expected the source directory of PX4, 1.18 or newer"
)


@pytest.fixture
def used() -> dict[int, tuple[int, int]]:
    """Return the parameters that PX4 uses, one bit each, of an item and of a command."""
    rows = re.findall(r"\{\s*(\d+),\s*(0x\w+),\s*(0x\w+)\s*\}", TABLE.read_text(encoding="utf-8"))
    assert len(rows) > 30
    return {int(number): (int(item, 16), int(command, 16)) for number, item, command in rows}


def find_unused(mask: int, given: tuple[float, ...]) -> list[int]:
    """Return the parameters, from 1, that have a value and are not used."""
    return [n for n, value in enumerate(given, 1) if not mask & 1 << (n - 1) and not math.isnan(value) and value != 0.0]


def item_parameters(item: MissionItem) -> tuple[float, ...]:
    """Return an item's parameters as PX4 compares them: in a global frame, a place that says nothing is the largest."""
    places = [item.x, item.y]
    if item.frame != Frame.MISSION:
        places = [0 if one == UNUSED_E7 else one or 1 for one in places]
    return (item.param1, item.param2, item.param3, item.param4, *map(float, places), item.z)


def items_of_every_kind() -> Iterator[MissionItem]:
    """Yield the items of missions with every trigger, of a fence and of rally points."""
    setup = plan_flight_setup(line_east(5), ("uav1",), Inspection(flat=True))
    for camera in (Camera("rgb", 100, gimbal=True), Camera("rgb", 1)):
        for trigger in Trigger:
            span = () if trigger is Trigger.ONCE else (SpanCameraTask("rgb", trigger, 8.0),)
            points = (Viewpoint((140.0, -8.0), 63), Viewpoint((160.0, -8.0), -51))
            pylon = PylonCameraTask("rgb", points, 2.0, 20.0, (150.0, 0.0, 0.0), roi=True)
            tasks = CameraTasks(
                {"rgb": camera}, {"uav1": frozenset({"rgb"})}, dict.fromkeys(range(4), span), {1: pylon}
            )
            yield from encode(build_flight_path(replace(setup, looks=tasks), "uav1", (0, 2)), PX4).items
    yield from build_fence_items(Fence(((0.0, 0.0), (90.0, 0.0), (0.0, 90.0)), 60.0), FRAME)
    yield from build_rally_items([(10.0, 20.0)], FRAME)


def test_no_item_has_a_parameter_that_px4_does_not_use(used: dict[int, tuple[int, int]]) -> None:
    items = list(items_of_every_kind())
    assert {item.command for item in items} >= {16, 21, 22, 178, 206, 1000, 2000, 2500, 5001, 5100}
    for item in items:
        mask = used.get(item.command, (0x7F, 0x7F))[0]
        assert find_unused(mask, item_parameters(item)) == [], item


def test_no_command_has_a_parameter_that_px4_does_not_use(used: dict[int, tuple[int, int]]) -> None:
    modes = (PX4.modes.mission, PX4.modes.hold, PX4.modes.return_home, PX4.modes.land)
    commands = [
        vehicle_commands.arm(), vehicle_commands.disarm(force=False), vehicle_commands.disarm(force=True),
        vehicle_commands.change_speed(3.0), vehicle_commands.start_mission(),
        *(vehicle_commands.set_mode(mode) for mode in modes),
    ]  # fmt: skip
    for one in commands:
        assert find_unused(used.get(one.command, (0x7F, 0x7F))[1], one.params) == [], one
