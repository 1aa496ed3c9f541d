"""Every order, and every message that is asked for, in numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.interface.messages import (
    SendCommand,
)
from executor.protocols import vehicle_commands
from missions import ARDUPILOT, PX4
from tests.executor.core.steps import rounded

ARM = vehicle_commands.arm()

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "the orders",
        lambda: [
            vehicle_commands.arm(),
            vehicle_commands.disarm(force=False),
            vehicle_commands.disarm(force=True),
            vehicle_commands.start_mission(),
            vehicle_commands.change_speed(4.5),
            vehicle_commands.set_message_interval(33, 250_000.0),
            vehicle_commands.request_message(148),
            vehicle_commands.run_prearm_checks(),
            vehicle_commands.send_banner(),
            vehicle_commands.set_mode(ARDUPILOT.modes.hold),
            vehicle_commands.set_mode(PX4.modes.land),
            vehicle_commands._build_command(1, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
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
    ("the message that is asked for", lambda: [vehicle_commands.AUTOPILOT_VERSION], [148]),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
