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
    """What the vehicle does when the ground station falls silent."""

    action: str
    """Parameter that chooses it; 0 is nothing on both autopilots."""
    action_return: int
    """Its value for a return home."""
    actions: Words
    timeout: str
    """Parameter: seconds of silence."""
    timeout_s: float
    """Its default."""
    pause: str | None
    """Parameter: seconds for which it holds before it acts; None if it acts at once."""
    pause_s: float
    """Its default."""
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
class BatteryFailsafe:
    """What the vehicle does on a low battery."""

    levels: tuple[BatteryLevel, ...]
    """From the first to the last."""
    capacity: str | None
    """Parameter: the full battery in mAh, where a threshold counts them."""


@dataclass(frozen=True, slots=True)
class Geofence:
    """The cylinder about home that a vehicle keeps to by itself; polygons are not parameters."""

    enabled_by: tuple[str, ...]
    """The fence stands if any of these parameters is not 0."""
    kinds: tuple[str, int, int] | None
    """Parameter, its bit for the height and its bit for the radius; None if a limit above 0 is enough."""
    height: str
    """Parameter: metres over home; 0 is no limit."""
    radius: str
    """Parameter: metres from home; 0 is no limit."""


_ARDUPILOT_LOW: Words = (
    (1, "lands"),
    (2, "returns"),
    (3, "returns"),  # by the way it came where it can
    (4, "returns"),  # by the way it came, else it lands
    (5, "terminates the flight"),
    (6, "returns"),  # or flies to a landing sequence, which our missions do not have
    (7, "brakes and lands"),
)

ARDUPILOT_LINK = GroundStationFailsafe(
    action="FS_GCS_ENABLE",
    action_return=1,  # measured: RTL
    actions=(
        (1, "returns"),
        (3, "returns"),  # by the way it came where it can
        (4, "returns"),  # by the way it came, else it lands
        (5, "lands"),
        (6, "returns"),  # or flies to a landing sequence, which our missions do not have
        (7, "brakes and lands"),
    ),
    timeout="FS_GCS_TIMEOUT",
    timeout_s=5.0,  # recorded parameters
    pause=None,
    pause_s=0.0,
    reacts_after_s=5.0,  # measured
    returns_after_s=5.0,  # measured
    exception=("FS_OPTIONS", 1 << 1),  # continue in AUTO (guide 3.3)
    station_sysid=("MAV_GCS_SYSID", "SYSID_MYGCS"),  # measured: that system's only, 255 by default; renamed in 4.7
)
ARDUPILOT_BATTERY = BatteryFailsafe(
    levels=(
        BatteryLevel("low", "BATT_FS_LOW_ACT", _ARDUPILOT_LOW, "BATT_LOW_MAH", ThresholdUnit.MAH, "BATT_LOW_VOLT"),
        BatteryLevel("critical", "BATT_FS_CRT_ACT", _ARDUPILOT_LOW, "BATT_CRT_MAH", ThresholdUnit.MAH, "BATT_CRT_VOLT"),
    ),
    capacity="BATT_CAPACITY",
)
ARDUPILOT_FENCE = Geofence(
    enabled_by=("FENCE_ENABLE", "FENCE_AUTOENABLE"),
    kinds=("FENCE_TYPE", 1 << 0, 1 << 1),
    height="FENCE_ALT_MAX",
    radius="FENCE_RADIUS",
)

PX4_LINK = GroundStationFailsafe(
    action="NAV_DLL_ACT",
    action_return=2,  # measured: AUTO.LOITER, then RTL
    actions=((1, "holds"), (2, "returns"), (3, "lands"), (5, "terminates the flight"), (6, "disarms")),
    timeout="COM_DL_LOSS_T",
    timeout_s=10.0,  # commander_params.c
    pause="COM_FAIL_ACT_T",
    pause_s=5.0,  # commander_params.c
    reacts_after_s=12.0,  # measured: AUTO.LOITER
    returns_after_s=17.0,  # measured: RTL, not cancelled when heartbeats return
    exception=("COM_DLL_EXCEPT", 1 << 0),  # missions are exempt (guide 3.3)
    station_sysid=(),
)
_PX4_LOW = "COM_LOW_BAT_ACT"
PX4_BATTERY = BatteryFailsafe(
    levels=(  # failsafe.cpp: the low level only warns; 3 is 'return, and land in an emergency'
        BatteryLevel(
            "critical",
            _PX4_LOW,
            ((1, "returns"), (2, "lands"), (3, "returns")),
            "BAT_CRIT_THR",
            ThresholdUnit.SHARE,
            None,
        ),
        BatteryLevel(
            "emergency",
            _PX4_LOW,
            ((1, "returns"), (2, "lands"), (3, "lands")),
            "BAT_EMERGEN_THR",
            ThresholdUnit.SHARE,
            None,
        ),
    ),
    capacity=None,
)
PX4_FENCE = Geofence(enabled_by=("GF_ACTION",), kinds=None, height="GF_MAX_VER_DIST", radius="GF_MAX_HOR_DIST")
