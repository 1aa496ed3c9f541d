"""PX4's flight modes, as far as they are simulated."""

from __future__ import annotations

from enum import IntEnum

MAIN_AUTO = 4


def custom_mode(main: int, sub: int = 0) -> int:
    """Return the number that a heartbeat shows."""
    return sub << 24 | main << 16


class Mode(IntEnum):
    """custom_mode, as far as simulated."""

    POSCTL = custom_mode(3)
    TAKEOFF = custom_mode(4, 2)
    LOITER = custom_mode(4, 3)
    MISSION = custom_mode(4, 4)
    RETURN = custom_mode(4, 5)
    LAND = custom_mode(4, 6)


MISSION_MODES = frozenset({Mode.MISSION, Mode.TAKEOFF, Mode.LAND})
"""In which MISSION_CURRENT says 'active', as PX4 does."""
