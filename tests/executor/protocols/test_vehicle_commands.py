"""The commands as the autopilots want them."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import SendCommand
from executor.protocols import vehicle_commands
from missions import ARDUPILOT, PX4, ModeNumber

ZEROS = (0.0,) * 7


@pytest.mark.parametrize(
    ("mode", "main", "sub"),
    [
        (ARDUPILOT.modes.guided, 4.0, 0.0),
        (ARDUPILOT.modes.return_home, 6.0, 0.0),
        (PX4.modes.mission, 4.0, 4.0),
        (PX4.modes.return_home, 4.0, 5.0),
    ],
)
def test_a_mode_is_given_in_the_autopilots_own_numbers(mode: ModeNumber, main: float, sub: float) -> None:
    assert vehicle_commands.set_mode(mode) == SendCommand(176, (1.0, main, sub, 0.0, 0.0, 0.0, 0.0))


def test_arming_is_not_forced() -> None:
    assert vehicle_commands.arm() == SendCommand(400, (1.0, *ZEROS[1:]))


def test_ardupilot_denies_a_mission_start_with_anything_but_zeros() -> None:
    assert vehicle_commands.start_mission() == SendCommand(300, ZEROS)


@pytest.mark.parametrize("interval_us", [1e6, 200_000.0, vehicle_commands.NEVER_US, vehicle_commands.UNASKED_US])
def test_an_interval_is_in_microseconds(interval_us: float) -> None:
    assert vehicle_commands.set_message_interval(33, interval_us) == SendCommand(511, (33.0, interval_us, *ZEROS[2:]))


def test_a_message_is_asked_for_by_its_number() -> None:
    assert vehicle_commands.request_message(148) == SendCommand(512, (148.0, *ZEROS[1:]))


def test_a_speed_is_over_ground_and_leaves_the_throttle_alone() -> None:
    assert vehicle_commands.change_speed(3.5) == SendCommand(178, (1.0, 3.5, -1.0, *ZEROS[3:]))


def test_the_motors_are_stopped_by_force_only_with_the_number_for_that() -> None:
    assert vehicle_commands.disarm(force=False) == SendCommand(400, ZEROS)
    assert vehicle_commands.disarm(force=True) == SendCommand(400, (0.0, 21196.0, *ZEROS[2:]))


def test_what_a_vehicle_is_asked_to_say() -> None:
    assert vehicle_commands.run_prearm_checks() == SendCommand(401, ZEROS)
    assert vehicle_commands.send_banner() == SendCommand(42428, ZEROS)
