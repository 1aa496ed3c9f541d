"""Every order, and every message that is asked for, in numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    SendCommand,
)
from executor.protocols import commands
from missions import ARDUPILOT, PX4
from tests.executor.core.steps import rounded

ARM = commands.arm()

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the orders",
        lambda: [
            commands.arm(),
            commands.disarm(force=False),
            commands.disarm(force=True),
            commands.start_mission(),
            commands.change_speed(4.5),
            commands.set_message_interval(33, 4.0),
            commands.request_message(148),
            commands.run_prearm_checks(),
            commands.send_banner(),
            commands.set_mode(ARDUPILOT.modes.hold),
            commands.set_mode(PX4.modes.land),
            commands._build_command(1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
        ],
        [
            ARM,
            SendCommand(command=400),
            SendCommand(command=400, params=(0.0, 21196.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=300),
            SendCommand(command=178, params=(1.0, 4.5, -1.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=511, params=(33.0, 250000.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=512, params=(148.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=401),
            SendCommand(command=42428),
            SendCommand(command=176, params=(1.0, 17.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=176, params=(1.0, 4.0, 6.0, 0.0, 0.0, 0.0, 0.0)),
            SendCommand(command=1, params=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)),
        ],
    ),
    (
        "the messages that are asked for",
        lambda: [
            commands.GPS_RAW_INT,
            commands.ATTITUDE,
            commands.HEARTBEAT,
            commands.GLOBAL_POSITION_INT,
            commands.SYS_STATUS,
            commands.MISSION_CURRENT,
            commands.BATTERY_STATUS,
            commands.AUTOPILOT_VERSION,
            commands.EXTENDED_SYS_STATE,
        ],
        [24, 30, 0, 33, 1, 42, 147, 148, 245],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
