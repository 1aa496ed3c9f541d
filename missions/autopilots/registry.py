"""All autopilots that are known: another one is a data file beside this, and a place in this list."""

from __future__ import annotations

import tomllib
from importlib import resources

from pydantic import TypeAdapter

from missions.autopilots.dialect import Dialect


def _read_dialects(*names: str) -> tuple[Dialect, ...]:
    files = (resources.files(__package__).joinpath(f"{name}.toml") for name in names)
    reader = TypeAdapter(Dialect)
    return tuple(reader.validate_python(tomllib.loads(file.read_text(encoding="utf-8"))) for file in files)


AUTOPILOTS = ARDUPILOT, PX4 = _read_dialects("ardupilot", "px4")


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
