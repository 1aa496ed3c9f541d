"""What a dialogue is made of, as data: a step is a few acts, and what is heard until the next step is its answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from missions import MissionItem

Value = int | float | bytes
ALL = 1 << 30


@dataclass(frozen=True, slots=True)
class Say:
    """Send one message, and listen."""

    name: str
    fields: Mapping[str, Value] = field(default_factory=dict)
    system: int | None = None
    """Whom it is for; None is the vehicle."""
    component: int = 1
    other: bool = False
    """Whether another ground station says it."""
    listen_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Upload:
    """Announce a mission and answer what the vehicle asks for."""

    name: str
    items: tuple[MissionItem, ...]
    flag: int | None = None
    """The item that has ``current`` set."""
    instead: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    """Asked for this item, these are sent."""
    answers: int = ALL
    """So many requests are answered; then silence."""
    floats: bool = False
    """Whether MISSION_ITEM is sent, whatever was asked for."""
    listen_s: float = 1.0
    """From the last that was said, until the next act."""


@dataclass(frozen=True, slots=True)
class Download:
    """Ask for the mission on board."""

    floats: bool = False
    """Whether it is asked for with the older MISSION_REQUEST."""
    compare: tuple[MissionItem, ...] = ()
    """What was sent: the fields that come back changed are named."""


class What(Enum):
    """What can be waited for."""

    READY = "ready to be armed"
    ITEM = "the item is the current one"
    FAST = "it flies"
    STILL = "it stands in the air"
    HIGH = "it is above a height in metres"
    DISARMED = "the motors are off"


@dataclass(frozen=True, slots=True)
class Until:
    """Wait until something is so; it must be within the limit."""

    what: What
    value: float = 0.0
    limit_s: float = 150.0
    narrate: bool = False
    """Whether every change of mode, motors and landed state on the way belongs to the answer."""


@dataclass(frozen=True, slots=True)
class Look:
    """Read back the state, after a pause; and the mission on board if asked."""

    after_s: float = 0.0
    download: bool = False


Act = Say | Upload | Download | Until | Look


@dataclass(frozen=True, slots=True)
class Step:
    """One step."""

    name: str
    acts: tuple[Act, ...]


@dataclass(frozen=True, slots=True)
class Chapter:
    """Steps that follow each other with a vehicle that has just been switched on."""

    name: str
    steps: tuple[Step, ...]
