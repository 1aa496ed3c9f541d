"""What numbers in ArduPilot's logs mean: why a mode changed, what failed, who disarmed.

By ModeReason.h, AP_Logger.h and AP_Arming.h, whose numbers are the same since Copter 3.3; others are unknown.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from executor.core.interface.messages import Actor, OwnFailsafe

MODE_REASONS: Mapping[int, Actor] = MappingProxyType(
    dict.fromkeys((1, 18, 42, 53), Actor.PILOT)  # mode switch, toy mode, transmitter's telemetry, its other switches
    | dict.fromkeys((2, 32, 52), Actor.GROUND_STATION)  # a command, a script, a computer on board
    # radio, battery, station, EKF, GPS, fence, terrain, avoidance and back, terminated, crash, any, leak, back from the
    # fence, radio and back, dead reckoning, take-off
    | dict.fromkeys((3, 4, 5, 6, 7, 10, 11, 14, 15, 17, 19, 25, 29, 43, 48, 50, 51, 55), Actor.FAILSAFE)
    | dict.fromkeys(
        (8, 12, 13, 16, 41, 45), Actor.MISSION
    )  # its end, brake's, flip's, throw's, an item, out of AUTO_RTL
    | {9: Actor.PILOT}  # raised throttle ends a landing
)
"""ModeReason."""

RESOLVED = 0
ERRORS: Mapping[int, tuple[str, str]] = MappingProxyType({
    2: ("rc", "late frames of the receiver"),
    3: ("compass", "compass"),
    5: ("rc", "radio failsafe"),
    6: ("battery", "battery failsafe"),
    7: ("gps", "GPS failsafe"),
    8: ("ground station", "ground station failsafe"),
    9: ("fence", "fence breached"),
    11: ("gps", "GPS glitch"),
    12: ("crash", "crash"),
    16: ("ekf", "EKF variance"),
    17: ("ekf", "EKF failsafe"),
    18: ("other", "barometer"),
    19: ("other", "CPU failsafe"),
    20: ("other", "avoids an aircraft"),
    21: ("terrain", "terrain data"),
    23: ("terrain", "terrain failsafe"),
    25: ("motor", "thrust loss"),
    26: ("other", "sensors failsafe"),
    29: ("vibration", "vibration failsafe"),
    30: ("other", "internal error"),
    31: ("gps", "dead reckoning failsafe"),
})  # fmt: skip
"""LogErrorSubsystem, but for what is no failsafe: initialising, a mode that was refused, a flip, a lane of the EKF."""
LOSS_OF_CONTROL = 2
"""Of the crash check: it flies on where it should not, or tumbles."""
DISARMED_BY: Mapping[int, tuple[str, str]] = MappingProxyType({
    5: ("other", "terminated"),
    6: ("other", "CPU failsafe"),
    7: ("battery", "battery failsafe"),
    11: ("crash", "parachute"),
    12: ("crash", "Crash: Disarming"),
    15: ("fence", "fence breached"),
    16: ("rc", "radio failsafe"),
    18: ("ground station", "ground station failsafe"),
    19: ("terrain", "terrain failsafe"),
    21: ("terrain", "terrain failsafe"),
    24: ("ekf", "EKF failsafe"),
    33: ("gps", "dead reckoning failsafe"),
})  # fmt: skip
"""AP_Arming::Method, of ways to disarm that somebody must know of."""


def failsafe_of(subsystem: int, code: int) -> OwnFailsafe | None:
    """Return what an ERR says; None if it is no failsafe."""
    known = ERRORS.get(subsystem)
    if known is None:
        return None
    kind, words = known
    if kind == "crash" and code == LOSS_OF_CONTROL:
        words = "loss of control"
    return OwnFailsafe(kind, code != RESOLVED, words)


def disarm_cause_of(method: int) -> OwnFailsafe | None:
    """Return what disarmed it, if that was neither a person nor a landing."""
    known = DISARMED_BY.get(method)
    return None if known is None else OwnFailsafe(known[0], active=True, words=known[1])
