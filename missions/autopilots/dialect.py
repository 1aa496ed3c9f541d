"""What one autopilot does otherwise than another, as data; each has a module of its own beside this one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from missions.autopilots.failsafes import BatteryFailsafe, Geofence, GroundStationFailsafe
from missions.cameras import Trigger
from missions.items import Frame
from missions.performance import Performance, Tuning


class StartStep(Enum):
    """One step from a verified upload to flight."""

    GUIDED = "guided"
    """Switch to the mode in which the autopilot can be armed for a mission."""
    ARM = "arm"
    MISSION_START = "mission_start"
    """MAV_CMD_MISSION_START (300), all parameters 0."""
    MISSION_MODE = "mission_mode"
    """Switch to mission mode; the armed vehicle takes off."""


@dataclass(frozen=True, slots=True)
class ModeNumber:
    """A flight mode: what HEARTBEAT shows and what MAV_CMD_DO_SET_MODE takes."""

    custom_mode: int
    """HEARTBEAT.custom_mode."""
    param2: int
    """DO_SET_MODE param2; param1 is always 1."""
    param3: int = 0


@dataclass(frozen=True, slots=True)
class Modes:
    """The modes that faultline commands or recognises."""

    mission: ModeNumber
    hold: ModeNumber
    """Stops where it is; safe without a remote control."""
    guided: ModeNumber
    return_home: ModeNumber
    land: ModeNumber
    other_ways_home: frozenset[int]
    """Modes besides those two in which it comes home, or lands, by itself."""
    manual: frozenset[int]
    """Modes of sticks, and those that follow somebody or something else than a mission."""
    blind: frozenset[int]
    """Modes of sticks in which a failsafe leaves it that does not know any more where it is."""
    other_names: Mapping[int, str]
    """As the autopilot calls the modes that are none of ours."""


@dataclass(frozen=True, slots=True)
class ReturnParameters:
    """How the height of a return is set."""

    height: str
    """Parameter: least height of the way home over the own home."""
    unit_m: float
    """One unit of ``height`` in metres."""
    newer_height: str | None
    """A later firmware's name of it, in metres."""
    descend_height: str | None
    """Parameter in metres: where it waits above home before it lands, if the autopilot has one."""
    descend_wait: str | None
    """Parameter in seconds: how long it waits there; 0 lands without a stop, and then that height does not matter."""
    cone: str
    """Parameter: the cone about home in which it climbs less."""
    cone_off: float
    """The value of ``cone`` that makes it always climb to ``height``."""
    cone_least: float
    """A smaller value means the same."""
    cone_unit: str


@dataclass(frozen=True, slots=True)
class TerrainRule:
    """A parameter by which an autopilot follows the ground by itself."""

    parameter: str
    on: frozenset[int]
    """Its values with which it does."""
    in_flight: bool
    """Whether missions or returns as they are flown here are others for it."""
    words: str
    """What it does then."""


@dataclass(frozen=True, slots=True)
class ShutterRule:
    """A parameter without which an autopilot takes no pictures."""

    parameter: str
    triggers: frozenset[Trigger]
    """What it is needed for."""
    words: str
    """The same."""
    remedy: str
    """What it should be."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """One autopilot's way of speaking and behaving."""

    name: str
    """In site files and plans."""
    title: str
    """As people write it."""
    number: int
    """MAV_AUTOPILOT."""
    home_item: bool
    """Whether item 0 is a slot for home, whose content is ignored."""
    position_frame: Frame
    """Of items with a place, relative to home."""
    command_frame: Frame
    """Of items without one."""
    takeoff_with_position: bool
    """Whether the take-off item carries the pad's latitude and longitude."""
    no_yaw: float
    """param4 for 'keep facing along the way'."""
    keeps_region: bool
    """Whether a region of interest in a mission comes back as it was sent."""
    shutter: ShutterRule
    gimbal_rate: float
    """param3 and param4 of DO_GIMBAL_MANAGER_PITCHYAW for 'an angle, at no rate'."""
    stop_radius_m: float
    """param2 of a waypoint with a hold; 0 leaves the autopilot's own acceptance radius."""
    pass_radius_m: float
    """param2 of a waypoint that is flown through."""
    flag_first: int | None
    """Which item of a first upload has ``current`` set; None for none."""
    max_items: int
    """More than this is not encoded."""
    home_reads_back: bool
    """Whether item 0 comes back as it was sent."""
    land_yaw_kept: bool
    """Whether param4 of a landing comes back as it was sent."""
    commands_lose_frame: bool
    """Whether items without a place come back with frame 0."""
    height_step_m: float
    """Heights are stored in steps of this; 0 for float32."""
    upload_is_atomic: bool
    """Whether a new list takes effect as a whole, at its last item."""
    upload_silence_s: float
    """It gives an upload up after this."""
    transfer_freed_s: float
    """Another ground station's transfer is over when nothing was heard of it for so long; until then it is busy."""
    upload_warnings: frozenset[int]
    """MISSION_ACK types during an upload that do not end it."""
    current_counts_home: bool
    """Whether MISSION_CURRENT.total leaves home out, so that the last seq equals it."""
    ends_in_other_mode: bool
    """Whether the landing at a mission's end is flown in a mode of its own."""
    low_battery_acts: bool
    """Whether "Low battery" is the text of a failsafe; else it says that it is time to come home."""
    rounds_twice: bool
    """Whether BATTERY_STATUS rounds the percentage, and SYS_STATUS rounds it up."""
    percent_middle: float
    """How far above a reported whole percent the middle of what it stands for lies: 0 rounded, 0.5 cut off."""
    pack_parameters: tuple[str, ...]
    """Which say what pack it has: the capacity that it counts by, its cells."""
    own_streams_hz: Mapping[int, float]
    """Messages that only this autopilot has, and how often they are asked for."""
    start: tuple[StartStep, ...]
    modes: Modes
    return_parameters: ReturnParameters
    ground_station_failsafe: GroundStationFailsafe
    battery_failsafe: BatteryFailsafe
    geofence: Geofence
    terrain: tuple[TerrainRule, ...]
    """How it follows the ground by itself; nothing here relies on it."""
    performance: Performance
    """How it flies missions by its own parameters' defaults."""
    tunings: tuple[Tuning, ...]
    """Which parameters change that."""
    oldest_version: tuple[int, int]
    """Major and minor number; what is older was not looked at."""
    tested_version: str
    """What this dialect was measured with."""
