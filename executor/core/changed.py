"""A changed copy of a frozen dataclass, ten times as fast as `dataclasses.replace`.

Every message makes a new state of its vehicle and of the fleet. Copying forty slots one by one costs more than all that
is decided; a dictionary is copied at once. So the states that change with every message have no slots.
"""

from __future__ import annotations

from typing import TypeVar

T = TypeVar("T")


def changed(value: T, **fields: object) -> T:
    """Return a copy of a frozen dataclass without slots and without checks, with some fields changed."""
    copy = object.__new__(type(value))
    copy.__dict__.update(value.__dict__, **fields)
    return copy
