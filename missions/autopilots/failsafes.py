"""What an autopilot does by itself, as data: which parameters say so, and what their values mean.

Values and meanings are those of ArduPilot's and PX4's own parameter references; 'measured' is what the project found by
experiment with ArduPilot Copter 4.7-dev and PX4 v1.17.0 in simulation.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

Words = tuple[tuple[int, str], ...]
"""A parameter's values and what the vehicle then does; a value that is not there is not known here."""


@dataclass(frozen=True, slots=True)
class GroundStationFailsafe:
    """What the vehicle does when it does not receive the ground station."""

    action: str
    """Parameter that chooses it; 0 is nothing on both autopilots."""
    action_return: int
    """Its value for a return home."""
    actions: Words
    timeout: str
    """Parameter: seconds without a link until it acts."""
    timeout_s: float
    """Its default."""
    timeout_most_s: float
    """The longest that its reference allows."""
    pause: str | None
    """Parameter: seconds for which it holds before it acts; None if it acts at once."""
    pause_s: float
    """Its default."""
    pause_most_s: float
    """The longest that its reference allows."""
    reacts_after_s: float
    """Silence from the last heartbeat to the first reaction with the default timeout, in the vehicle's time."""
    returns_after_s: float
    """Silence to the return, with the defaults."""
    exception: tuple[str, int]
    """Parameter, and the bit of it with which the vehicle flies its mission on all the same."""
    station_sysid: tuple[str, ...]
    """Parameter, by its newest name first: whose heartbeats count; empty if anybody's do."""


class ThresholdUnit(Enum):
    """What a battery threshold counts."""

    SHARE = "share"
    """Of a full battery, 0 to 1."""
    MAH = "mah"
    """Left in the battery."""


@dataclass(frozen=True, slots=True)
class BatteryLevel:
    """One level of a battery failsafe."""

    name: str
    action: str
    """Parameter that chooses what is done; 0 is nothing on both autopilots."""
    actions: Words
    threshold: str
    """Parameter: the charge below which it is done; 0 is never."""
    unit: ThresholdUnit
    voltage: str | None
    """Parameter: volts below which it is done too; None if the autopilot has none, 0 is never."""


@dataclass(frozen=True, slots=True)
class EarlyReturn:
    """A failsafe that acts as soon as the time left in the air is only just enough to come home."""

    action: str
    """Parameter that chooses what is done."""
    actions: Words
    nothing: tuple[int, ...]
    """Its values for no action."""
    since: tuple[int, int] | None
    """Major and minor number of the firmware from which on it does so; None where it does if it has the parameter."""


@dataclass(frozen=True, slots=True)
class BatteryFailsafe:
    """What the vehicle does on a low battery."""

    levels: tuple[BatteryLevel, ...]
    """From the first to the last."""
    early: tuple[EarlyReturn, ...]
    """What acts before them."""
    capacity: str | None
    """Parameter: the full battery in mAh, where a threshold counts them."""


@dataclass(frozen=True, slots=True)
class Geofence:
    """What a vehicle keeps to by itself: a cylinder about home, by parameters, and polygons by the mission protocol."""

    enabled_by: tuple[str, ...]
    """The fence stands if any of these parameters is not 0."""
    kinds: tuple[str, int, int] | None
    """Parameter, its bit for the height and its bit for the radius; None if a limit above 0 is enough."""
    height: str
    """Parameter: metres over home; 0 is no limit."""
    radius: str
    """Parameter: metres from home; 0 is no limit."""
    action: str
    """Parameter that chooses what the vehicle does at a breach; 0 is nothing on both autopilots."""
    actions: Words
    named: tuple[tuple[str, int], ...]
    """The values of ``action`` for what site files call warn, hold, return and land."""
    polygons: int
    """The bit of ``kinds`` for polygons and circles that were put on board; 0 if they need none."""
    enable: str | None
    """Parameter that switches the fence on with 1; None if ``action`` does."""
    checked_on_load: bool
    """Whether a fence that does not hold its home and the vehicle is dropped, with a text and no refusal."""
