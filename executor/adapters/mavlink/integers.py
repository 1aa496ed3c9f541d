"""Integer parameters in a field for floats: ArduPilot puts their value there, everybody else their bits."""

from __future__ import annotations

import struct

AUTOPILOT_ARDUPILOT = 3
INTEGER_TYPES = frozenset(range(1, 9))
"""MAV_PARAM_TYPE 1 to 8 are the integers."""


def from_wire(value: float, kind: int, autopilot: int | None) -> float:
    """Return the value of a parameter of MAV_PARAM_TYPE `kind`."""
    if _is_bitwise(kind, autopilot):
        return float(struct.unpack("<i", struct.pack("<f", value))[0])
    return float(value)


def to_wire(value: float, kind: int, autopilot: int | None) -> float:
    """Return what stands in the field for a value."""
    if _is_bitwise(kind, autopilot):
        return float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
    return value


def _is_bitwise(kind: int, autopilot: int | None) -> bool:
    """Return whether the bits of an integer stand where the float would; ArduPilot alone sends its value as a float."""
    return kind in INTEGER_TYPES and autopilot not in {None, AUTOPILOT_ARDUPILOT}
