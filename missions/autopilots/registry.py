"""All autopilots that are known: another one is a module beside this, and a place in this list."""

from __future__ import annotations

from missions.autopilots.ardupilot import ARDUPILOT
from missions.autopilots.dialect import Dialect
from missions.autopilots.px4 import PX4

AUTOPILOTS: tuple[Dialect, ...] = (ARDUPILOT, PX4)


def dialect_for(name: str) -> Dialect:
    """Return the dialect of an autopilot by its name in a site file.

    Raises:
        ValueError: there is no such autopilot.
    """
    for dialect in AUTOPILOTS:
        if dialect.name == name:
            return dialect
    raise ValueError(f"autopilot: expected {' or '.join(dialect.name for dialect in AUTOPILOTS)}, got {name!r}")


def dialect_of(number: int) -> Dialect | None:
    """Return the dialect of a MAV_AUTOPILOT; None if it is not known."""
    return next((dialect for dialect in AUTOPILOTS if dialect.number == number), None)
