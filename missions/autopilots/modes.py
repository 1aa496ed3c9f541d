"""Flight modes by what they mean to us."""

from __future__ import annotations

from missions import Dialect

_OTHER_NAMES = {
    # mode.h of ArduCopter
    "ardupilot": {
        0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 5: "LOITER", 7: "CIRCLE", 11: "DRIFT", 13: "SPORT", 14: "FLIP",
        15: "AUTOTUNE", 16: "POSHOLD", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
        22: "FLOWHOLD", 23: "FOLLOW", 24: "ZIGZAG", 26: "AUTOROTATE", 27: "AUTO_RTL", 28: "TURTLE",
    },
    # px4_custom_mode.h, sub << 24 | main << 16
    "px4": {
        1 << 16: "MANUAL", 2 << 16: "ALTCTL", 3 << 16: "POSCTL", 5 << 16: "ACRO", 6 << 16: "OFFBOARD",
        7 << 16: "STABILIZED", 10 << 16: "TERMINATION", 2 << 24 | 4 << 16: "AUTO.TAKEOFF",
        8 << 24 | 4 << 16: "AUTO.FOLLOW", 9 << 24 | 4 << 16: "AUTO.PRECLAND",
    },
}  # fmt: skip
_MANUAL = {
    "ardupilot": frozenset({0, 1, 2, 5, 7, 11, 13, 14, 15, 16, 18, 22, 23, 24, 28}),
    "px4": frozenset({1 << 16, 2 << 16, 3 << 16, 5 << 16, 6 << 16, 7 << 16, 8 << 24 | 4 << 16}),
}
"""Modes of sticks, and those that follow somebody or something else than a mission."""
_OTHER_WAYS_HOME = {
    "ardupilot": frozenset({21, 27}),  # SMART_RTL, and AUTO_RTL, which is reported in a landing sequence of a mission
    "px4": frozenset({9 << 24 | 4 << 16}),
}


def is_mission_mode(dialect: Dialect, custom_mode: int) -> bool:
    """Return whether the vehicle flies the mission on board."""
    return custom_mode == dialect.modes.mission.custom_mode


def is_home_mode(dialect: Dialect, custom_mode: int) -> bool:
    """Return whether the vehicle comes home, or lands, by itself."""
    ours = {dialect.modes.return_home.custom_mode, dialect.modes.land.custom_mode}
    return custom_mode in ours | _OTHER_WAYS_HOME[dialect.name]


def is_manual_mode(dialect: Dialect, custom_mode: int) -> bool:
    """Return whether somebody has to fly it: neither we, nor a mission, nor a failsafe leads there with hands off."""
    return custom_mode in _MANUAL[dialect.name]


def mode_name(dialect: Dialect, custom_mode: int) -> str:
    """Return a mode in words."""
    modes = dialect.modes
    ours = {
        modes.guided.custom_mode: "GUIDED",
        modes.hold.custom_mode: "HOLD",
        modes.mission.custom_mode: "MISSION",
        modes.return_home.custom_mode: "RTL",
        modes.land.custom_mode: "LAND",
    }
    return ours.get(custom_mode) or _OTHER_NAMES[dialect.name].get(custom_mode) or f"number {custom_mode}"
