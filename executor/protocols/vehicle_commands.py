"""The commands that we give, as COMMAND_LONG."""

from __future__ import annotations

from dataclasses import replace

from executor.core.interface.messages import SendCommand
from missions import ModeNumber

DO_SET_MODE = 176
DO_CHANGE_SPEED = 178
MISSION_START = 300
COMPONENT_ARM_DISARM = 400
RUN_PREARM_CHECKS = 401
SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512
DO_SEND_BANNER = 42428
"""Of ArduPilot's own dialect."""

GPS_RAW_INT = 24
ATTITUDE = 30
RC_CHANNELS = 65
HEARTBEAT = 0
GLOBAL_POSITION_INT = 33
SYS_STATUS = 1
MISSION_CURRENT = 42
BATTERY_STATUS = 147
AUTOPILOT_VERSION = 148
EXTENDED_SYS_STATE = 245
CAMERA_IMAGE_CAPTURED = 263


def _build_command(number: int, *params: float) -> SendCommand:
    given = (*params, *(0.0 for _ in range(7 - len(params))))
    return SendCommand(number, (given[0], given[1], given[2], given[3], given[4], given[5], given[6]))


def set_mode(mode: ModeNumber) -> SendCommand:
    """Switch to a mode; param1 says that the numbers are the autopilot's own."""
    return _build_command(DO_SET_MODE, 1.0, float(mode.param2), float(mode.param3))


def arm() -> SendCommand:
    """Arm, with all checks."""
    return _build_command(COMPONENT_ARM_DISARM, 1.0)


def disarm(*, force: bool) -> SendCommand:
    """Stop the motors; without force only where the autopilot believes that it is on the ground."""
    forced = 21196.0  # of both autopilots: whatever they believe
    return _build_command(COMPONENT_ARM_DISARM, 0.0, forced if force else 0.0)


def start_mission() -> SendCommand:
    """Start or resume the mission; ArduPilot denies anything but zeros."""
    return _build_command(MISSION_START)


def change_speed(speed_m_s: float) -> SendCommand:
    """Set the ground speed (type 1) and leave the throttle alone (-1)."""
    return _build_command(DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)


def set_message_interval(message: int, hz: float) -> SendCommand:
    """Ask for a message at a rate."""
    return _build_command(SET_MESSAGE_INTERVAL, float(message), 1e6 / hz)


def request_message(message: int) -> SendCommand:
    """Ask for a message once."""
    return _build_command(REQUEST_MESSAGE, float(message))


def run_prearm_checks() -> SendCommand:
    """Let the vehicle say now why it cannot be armed."""
    return _build_command(RUN_PREARM_CHECKS)


def send_banner() -> SendCommand:
    """Let the vehicle say again what it says when it starts."""
    return _build_command(DO_SEND_BANNER)


def request_picture(component: int, sequence: int) -> SendCommand:
    """Ask a camera to say again that it took a picture."""
    return replace(_build_command(REQUEST_MESSAGE, CAMERA_IMAGE_CAPTURED, sequence), component=component)
