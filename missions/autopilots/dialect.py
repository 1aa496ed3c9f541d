"""What one autopilot does otherwise than another, and by itself: the fields of the data files beside this module.

Parameters, values and meanings are those of ArduPilot's and PX4's own references.
"""

from __future__ import annotations

import tomllib
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib import resources

from pydantic import ConfigDict, TypeAdapter

from missions.cameras import Trigger
from missions.flight_model import Performance, Tuning
from missions.items import Frame

Words = tuple[tuple[int, str], ...]
"""A parameter's values and what the vehicle then does; a value that is not there is not known here."""


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
    other_names: Words
    """As the autopilot calls the modes that are none of ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnParameters:
    """How the height of a return is set."""

    height: str
    """Parameter: least height of the way home over the own home."""
    unit_m: float
    """One unit of ``height`` in metres."""
    descend_height: str | None = None
    """Parameter in metres: where it waits above home before it lands, if the autopilot has one."""
    descend_wait: str | None = None
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


@dataclass(frozen=True, slots=True, kw_only=True)
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
    pause: str | None = None
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
    station_sysid: str | None = None
    """Parameter: whose heartbeats count; None if anybody's do."""


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
    voltage: str | None = None
    """Parameter: volts below which it is done too; None if the autopilot has none, 0 is never."""
    since: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    """Values of ``action`` that only newer firmware knows, with its major and minor number."""


@dataclass(frozen=True, slots=True)
class EarlyReturn:
    """A failsafe that acts as soon as the time left in the air is only just enough to come home."""

    action: str
    """Parameter that chooses what is done."""
    actions: Words
    nothing: tuple[int, ...]
    """Its values for no action, or none before a level is reached."""
    without: str | None = None
    """A parameter of older firmware: a vehicle that has it does not do so."""


@dataclass(frozen=True, slots=True)
class BatteryFailsafe:
    """What the vehicle does on a low battery."""

    levels: tuple[BatteryLevel, ...]
    """From the first to the last."""
    early: tuple[EarlyReturn, ...]
    """What acts before them."""
    capacity: str | None = None
    """Parameter: the full battery in mAh, where a threshold counts them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Geofence:
    """What a vehicle keeps to by itself: a cylinder about home, by parameters, and polygons by the mission protocol."""

    enabled_by: tuple[str, ...]
    """The fence stands if any of these parameters is not 0."""
    kinds: tuple[str, int, int] | None = None
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
    enable: str | None = None
    """Parameter that switches the fence on with 1; None if ``action`` does."""
    rally_limit: str | None = None
    """Parameter: rally points farther away than so many kilometres do not count, 0 for all; None if all do."""
    checked_on_load: bool
    """Whether a fence that does not hold its home and the vehicle is dropped, with a text and no refusal."""


@dataclass(frozen=True, slots=True)
class OtherName:
    """What a parameter is called in firmware that does not have it by its first name."""

    name: str
    unit: float
    """One unit of the parameter in units of this one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One autopilot's way of speaking and behaving."""

    __pydantic_config__ = ConfigDict(extra="forbid")

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
    flag_first: int | None = None
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
    reads_in_any_order: bool
    """Whether items of a list can be asked for in any order, several at a time."""
    says_checksum: bool
    """Whether it says a checksum of a list as it takes it, and when it is asked for it."""
    takes_mission_file: bool
    """Whether it takes the last part of a mission as a file, over MAVFTP."""
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
    unasked_hz: Mapping[int, float]
    """Messages that it sends over a telemetry radio though nobody here reads them, and how often; what people or other
    stations must not miss is none of them."""
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
    other_names: Mapping[str, OtherName]
    """Of parameters that were renamed, by the name that is used here."""
    oldest_version: tuple[int, int]
    """Major and minor number; what is older was not looked at."""
    newest_version: tuple[int, int]
    """Major and minor number; parameters of what is newer were not held against these tables."""
    tested_version: str
    """What this dialect was measured with."""


def _read_dialect(name: str) -> Dialect:
    text = resources.files(__package__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return TypeAdapter(Dialect).validate_python(tomllib.loads(text))


AUTOPILOTS = ARDUPILOT, PX4 = _read_dialect("ardupilot"), _read_dialect("px4")


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


def list_other_names(dialect: Dialect, names: Iterable[str], present: Container[str] = ()) -> tuple[str, ...]:
    """Return the names in other firmware of those parameters that a vehicle does not have by their first."""
    known = dialect.other_names
    return tuple(known[name].name for name in names if name in known and name not in present)


def find_name_on_board(dialect: Dialect, name: str, present: Container[str]) -> str:
    """Return the name by which a vehicle has a parameter; the first where it has neither."""
    other = dialect.other_names.get(name)
    return name if other is None or name in present or other.name not in present else other.name


def add_first_names(dialect: Dialect, values: Mapping[str, float]) -> dict[str, float]:
    """Return values of parameters, those with another name also by their first and in its units.

    >>> add_first_names(ARDUPILOT, {"WP_SPD": 12.0})
    {'WPNAV_SPEED': 1200.0, 'WP_SPD': 12.0}
    """
    others = dialect.other_names.items()
    return {first: values[other.name] / other.unit for first, other in others if other.name in values} | dict(values)


def is_mission_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle flies the mission on board."""
    return custom_mode == dialect.modes.mission.custom_mode


def is_home_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle comes home, or lands, by itself."""
    ours = {dialect.modes.return_home.custom_mode, dialect.modes.land.custom_mode}
    return custom_mode in ours | dialect.modes.other_ways_home


def is_manual_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether somebody has to fly it: neither we, nor a mission, nor a failsafe leads there with hands off."""
    return custom_mode in dialect.modes.manual


def mode_name(dialect: Dialect, custom_mode: int) -> str:
    """Return a mode in words."""
    modes = dialect.modes
    ours = {
        modes.guided.custom_mode: "GUIDED",
        modes.hold.custom_mode: "HOLD",
        modes.mission.custom_mode: "MISSION",
        modes.return_home.custom_mode: "RTL",
        modes.land.custom_mode: "LAND",
    }
    return ours.get(custom_mode) or dict(modes.other_names).get(custom_mode) or f"number {custom_mode}"
