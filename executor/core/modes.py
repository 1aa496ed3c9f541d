"""Flight modes by what they mean to us."""

from __future__ import annotations

from missions import Dialect

_OTHER_NAMES = {
    # mode.h of ArduCopter
    "ardupilot": {0: "STABILIZE", 2: "ALT_HOLD", 5: "LOITER", 16: "POSHOLD", 18: "THROW", 21: "SMART_RTL"},
    # px4_custom_mode.h, sub << 24 | main << 16
    "px4": {1 << 16: "MANUAL", 2 << 16: "ALTCTL", 3 << 16: "POSCTL", 2 << 24 | 4 << 16: "AUTO.TAKEOFF"},
}


def is_mission_mode(dialect: Dialect, custom_mode: int) -> bool:
    """Return whether the vehicle flies the mission on board."""
    return custom_mode == dialect.modes.mission.custom_mode


def is_home_mode(dialect: Dialect, custom_mode: int) -> bool:
    """Return whether the vehicle comes home, or lands, by itself."""
    return custom_mode in {dialect.modes.return_home.custom_mode, dialect.modes.land.custom_mode}


def mode_name(dialect: Dialect, custom_mode: int) -> str:
    """Return a mode in words."""
    modes = dialect.modes
    ours = {
        modes.guided.custom_mode: "GUIDED",
        modes.hold.custom_mode: "HOLD",
        modes.mission.custom_mode: "MISSION",
        modes.return_home.custom_mode: "RETURN",
        modes.land.custom_mode: "LAND",
    }
    return ours.get(custom_mode) or _OTHER_NAMES[dialect.name].get(custom_mode) or f"number {custom_mode}"
