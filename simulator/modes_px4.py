"""PX4's flight modes, as far as they are simulated."""

from __future__ import annotations

from enum import IntEnum

MAIN_AUTO = 4


def encode_custom_mode(main: int, sub: int = 0) -> int:
    """Return the number that a heartbeat shows."""
    return sub << 24 | main << 16


class Mode(IntEnum):
    """custom_mode, as far as simulated."""

    ALTCTL = encode_custom_mode(2)
    POSCTL = encode_custom_mode(3)
    TAKEOFF = encode_custom_mode(4, 2)
    LOITER = encode_custom_mode(4, 3)
    MISSION = encode_custom_mode(4, 4)
    RETURN = encode_custom_mode(4, 5)
    LAND = encode_custom_mode(4, 6)


WORDS = {
    "POSCTL": Mode.POSCTL, "ALTCTL": Mode.ALTCTL, "HOLD": Mode.LOITER, "RTL": Mode.RETURN, "LAND": Mode.LAND,
    "MISSION": Mode.MISSION,
}  # fmt: skip
"""The modes that a person chooses."""
MISSION_MODES = frozenset({Mode.MISSION, Mode.TAKEOFF, Mode.LAND})
"""In which MISSION_CURRENT says 'active', as PX4 does."""
