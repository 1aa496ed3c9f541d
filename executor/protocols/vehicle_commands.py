"""Build our commands as COMMAND_LONG, and run the dialogue of a command and its acknowledgement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from executor.core.interface.codes import Ending
from executor.core.interface.messages import CommandAck, Message, Outgoing, SendCommand
from executor.protocols.machine import Accepted, DialogueMachine, Rejected, TimedOut
from missions import ModeNumber

DO_SET_MODE = 176
DO_CHANGE_SPEED = 178
MISSION_START = 300
COMPONENT_ARM_DISARM = 400
RUN_PREARM_CHECKS = 401
GET_MESSAGE_INTERVAL = 510
SET_MESSAGE_INTERVAL = 511
REQUEST_MESSAGE = 512
DO_SEND_BANNER = 42428
"""MAV_CMD of ArduPilot's own dialect."""

AUTOPILOT_VERSION = 148
CAMERA_IMAGE_CAPTURED = 263


def _build_command(number: int, *params: float) -> SendCommand:
    given = (*params, *(0.0 for _ in range(7 - len(params))))
    return SendCommand(number, (given[0], given[1], given[2], given[3], given[4], given[5], given[6]))


def set_mode(mode: ModeNumber) -> SendCommand:
    """Switch mode; param1 marks the numbers as the autopilot's own."""
    return _build_command(DO_SET_MODE, 1.0, float(mode.param2), float(mode.param3))


def arm() -> SendCommand:
    """Arm, with all checks."""
    return _build_command(COMPONENT_ARM_DISARM, 1.0)


def disarm(*, force: bool) -> SendCommand:
    """Disarm; without force only if the autopilot detects that it is on the ground."""
    forced = 21196.0  # both autopilots: disarm in any state
    return _build_command(COMPONENT_ARM_DISARM, 0.0, forced if force else 0.0)


def start_mission() -> SendCommand:
    """Start or resume the mission; ArduPilot denies anything but zeros."""
    return _build_command(MISSION_START)


def change_speed(speed_m_s: float) -> SendCommand:
    """Set the ground speed (type 1); leave the throttle unchanged (-1)."""
    return _build_command(DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)


NEVER_US, UNASKED_US = -1.0, 0.0
"""Stop a message; restore its default rate."""


def set_message_interval(message: int, interval_us: float) -> SendCommand:
    """Request a message at an interval."""
    return _build_command(SET_MESSAGE_INTERVAL, float(message), interval_us)


def ask_interval(message: int) -> SendCommand:
    """Request the interval of a message."""
    return _build_command(GET_MESSAGE_INTERVAL, float(message))


def request_message(message: int) -> SendCommand:
    """Request a message once."""
    return _build_command(REQUEST_MESSAGE, float(message))


def run_prearm_checks() -> SendCommand:
    """Request the vehicle's reasons against arming now."""
    return _build_command(RUN_PREARM_CHECKS)


def send_banner() -> SendCommand:
    """Request the vehicle's start-up texts again."""
    return _build_command(DO_SEND_BANNER)


def request_picture(component: int, sequence: int) -> SendCommand:
    """Request a camera's report of a picture again."""
    return replace(_build_command(REQUEST_MESSAGE, CAMERA_IMAGE_CAPTURED, sequence), component=component)


PERIOD_S = 1.0
TRIES = 5
IN_PROGRESS_S = 10.0
"""Most seconds that a vehicle may work on a command acknowledged as in progress."""
RESULT_NAMES = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled"}
"""MAV_RESULT in words."""
_CODES = {
    1: Ending.TEMPORARILY_REJECTED, 2: Ending.DENIED, 3: Ending.UNSUPPORTED, 4: Ending.FAILED, 6: Ending.CANCELLED,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CommandDialogue(DialogueMachine):
    """State of one command."""

    command: SendCommand
    what: str
    """The command in words, for reasons."""
    tries: int = 0
    refusal: str = ""
    """Vehicle's last reason for a temporary rejection."""
    sent_s: float = 0.0
    """Time of the first send."""

    def begin(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send the command."""
        return replace(self, tries=1, sent_s=now_s, deadline_s=now_s + self.period_s), (self.command,)

    @property
    def period_s(self) -> float:
        """Time-out for an answer: one second, or more on a slower link."""
        return max(PERIOD_S, self.round_trip.waits_s)

    def _take(self, message: Message, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Take the acknowledgement; retry 'temporarily rejected' at the deadline."""
        match message:
            case CommandAck(command, result) if command == self.command.command:
                match result:
                    case 0:
                        once = self.tries == 1 and not self.refusal
                        trip = self.round_trip.record_round_trip(now_s - self.sent_s) if once else self.round_trip
                        return replace(self._finish(Accepted()), round_trip=trip), ()
                    case 1:
                        return replace(self, refusal=RESULT_NAMES[result]), ()
                    case 5:
                        return replace(self, deadline_s=now_s + IN_PROGRESS_S), ()
                    case _:
                        reason = RESULT_NAMES.get(result, f"result {result}")
                        code = _CODES.get(result, Ending.UNKNOWN_RESULT)
                        return self._finish(Rejected(f"{self.what}: {reason}", code)), ()
            case _:
                return self, ()

    def _expire(self, now_s: float) -> tuple[Self, tuple[Outgoing, ...]]:
        """Send it again with the next confirmation number, or give up."""
        if self.tries >= TRIES:
            if self.refusal:
                return self._finish(Rejected(f"{self.what}: {self.refusal}", Ending.TEMPORARILY_REJECTED)), ()
            return self._finish(TimedOut(f"{self.what}: no acknowledgement")), ()
        state = replace(self, tries=self.tries + 1, deadline_s=now_s + self.period_s)
        return state, (replace(self.command, confirmation=self.tries),)
