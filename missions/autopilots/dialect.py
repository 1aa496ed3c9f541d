"""Define how an autopilot differs from others, and its own behaviour: the fields of the data files in this package.

Parameters, values and meanings are from the references of ArduPilot and PX4.
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
"""Known values of a parameter, and the vehicle's action for each."""


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
    """A flight mode: its HEARTBEAT value and its MAV_CMD_DO_SET_MODE value."""

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
    """Hold position; safe without a remote control."""
    guided: ModeNumber
    return_home: ModeNumber
    land: ModeNumber
    other_ways_home: frozenset[int]
    """Other modes of autonomous return or landing."""
    manual: frozenset[int]
    """Stick modes, and modes that follow something other than a mission."""
    blind: frozenset[int]
    """Stick modes in which a failsafe leaves a vehicle that has lost its position."""
    other_names: Words
    """The autopilot's names of the other modes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnParameters:
    """Parameters that set the RTL height."""

    height: str
    """Parameter: least RTL height above home."""
    unit_m: float
    """One unit of ``height`` in metres."""
    descend_height: str | None = None
    """Parameter in metres: height at which it waits above home before landing, if the autopilot has one."""
    descend_wait: str | None = None
    """Parameter in seconds: waiting time there; 0 lands without a stop, so that the height does not matter."""
    cone: str
    """Parameter: cone around home within which it climbs less."""
    cone_off: float
    """Value of ``cone`` with which it always climbs to ``height``."""
    cone_least: float
    """Least effective value of ``cone``."""
    cone_unit: str


@dataclass(frozen=True, slots=True)
class TerrainRule:
    """A parameter that makes an autopilot follow the terrain on its own."""

    parameter: str
    on: frozenset[int]
    """Values that switch this on."""
    in_flight: bool
    """Whether it changes missions or returns in flight."""
    words: str
    """Effect, in words."""


@dataclass(frozen=True, slots=True)
class ShutterRule:
    """A parameter that an autopilot requires to take pictures."""

    parameter: str
    triggers: frozenset[Trigger]
    """Triggers that need it."""
    words: str
    """Effect, in words."""
    remedy: str
    """Recommended value, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundStationFailsafe:
    """The vehicle's action on loss of the ground station link."""

    action: str
    """Parameter of the action; 0 is no action on both autopilots."""
    action_return: int
    """Value for RTL."""
    actions: Words
    timeout: str
    """Parameter: seconds without a link until it acts."""
    timeout_s: float
    """Default of that parameter."""
    timeout_most_s: float
    """Greatest value that the reference allows."""
    pause: str | None = None
    """Parameter: seconds of hold before the action; None if it acts at once."""
    pause_s: float
    """Default of that parameter."""
    pause_most_s: float
    """Greatest value that the reference allows."""
    reacts_after_s: float
    """Seconds from the last heartbeat to the first reaction with the default time-out, on the vehicle's clock."""
    returns_after_s: float
    """Seconds from the last heartbeat to RTL, with the defaults."""
    exception: tuple[str, int]
    """Parameter and bit with which the vehicle continues its mission instead."""
    station_sysid: str | None = None
    """Parameter: system id of the station whose heartbeats count; None if any station's do."""


class ThresholdUnit(Enum):
    """Unit of a battery threshold."""

    SHARE = "share"
    """Share of a full battery, 0 to 1."""
    MAH = "mah"
    """Remaining charge in mAh."""


@dataclass(frozen=True, slots=True)
class BatteryLevel:
    """One level of a battery failsafe."""

    name: str
    action: str
    """Parameter of the action; 0 is no action on both autopilots."""
    actions: Words
    threshold: str
    """Parameter: charge below which it acts; 0 is never."""
    unit: ThresholdUnit
    voltage: str | None = None
    """Parameter: voltage below which it acts too, 0 is never; None if the autopilot has none."""
    since: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    """Values of ``action`` of newer firmware, with its major and minor version."""


@dataclass(frozen=True, slots=True)
class EarlyReturn:
    """A failsafe that acts as soon as the remaining flight time is only just enough for RTL."""

    action: str
    """Parameter of the action."""
    actions: Words
    nothing: tuple[int, ...]
    """Values for no action, or none before a level is reached."""
    without: str | None = None
    """Parameter of older firmware; a vehicle with it has no early return."""


@dataclass(frozen=True, slots=True)
class BatteryFailsafe:
    """The vehicle's action on a low battery."""

    levels: tuple[BatteryLevel, ...]
    """Battery levels, first to last."""
    early: tuple[EarlyReturn, ...]
    """Early returns, which act before the levels."""
    capacity: str | None = None
    """Parameter: battery capacity in mAh, if a threshold is in mAh."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Geofence:
    """The vehicle's own geofence: a cylinder around home, by parameters, and polygons by the mission protocol."""

    enabled_by: tuple[str, ...]
    """Parameters any of which enables the fence if not 0."""
    kinds: tuple[str, int, int] | None = None
    """Parameter, and its bits for height and radius; None if any limit above 0 is active."""
    height: str
    """Parameter: ceiling in metres above home; 0 is no limit."""
    radius: str
    """Parameter: radius in metres around home; 0 is no limit."""
    action: str
    """Parameter of the action on a breach; 0 is no action on both autopilots."""
    actions: Words
    named: tuple[tuple[str, int], ...]
    """Values of ``action`` for warn, hold, return and land of the site file."""
    polygons: int
    """Bit of ``kinds`` for uploaded polygons and circles; 0 if they need none."""
    enable: str | None = None
    """Parameter that enables the fence with 1; None if ``action`` does."""
    rally_limit: str | None = None
    """Parameter: range of usable rally points in km, 0 for no limit; None if all count."""
    checked_on_load: bool
    """Whether a fence that excludes home or the vehicle is dropped with a text, without a refusal."""


@dataclass(frozen=True, slots=True)
class OtherName:
    """A parameter's name in firmware without its first name."""

    name: str
    unit: float
    """Factor from the parameter's unit to this one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """Mission protocol dialect and behaviour of one autopilot."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    name: str
    """Name in site files and plans."""
    title: str
    """Name for display."""
    number: int
    """MAV_AUTOPILOT."""
    home_item: bool
    """Whether item 0 is a home slot whose content is ignored."""
    position_frame: Frame
    """Frame of items with a position, relative to home."""
    command_frame: Frame
    """Frame of items without a position."""
    takeoff_with_position: bool
    """Whether the take-off item carries the pad's latitude and longitude."""
    no_yaw: float
    """param4 for facing along the leg."""
    keeps_region: bool
    """Whether a region of interest reads back unchanged."""
    shutter: ShutterRule
    gimbal_rate: float
    """param3 and param4 of DO_GIMBAL_MANAGER_PITCHYAW for 'an angle, at no rate'."""
    stop_radius_m: float
    """param2 of a waypoint with a hold; 0 keeps the autopilot's acceptance radius."""
    pass_radius_m: float
    """param2 of a fly-through waypoint."""
    flag_first: int | None = None
    """Item of a first upload with ``current`` set; None for none."""
    max_items: int
    """Most items of a mission."""
    home_reads_back: bool
    """Whether item 0 reads back unchanged."""
    land_yaw_kept: bool
    """Whether param4 of a landing reads back unchanged."""
    commands_lose_frame: bool
    """Whether items without a position read back with frame 0."""
    height_step_m: float
    """Storage resolution of heights; 0 for float32."""
    reads_in_any_order: bool
    """Whether items can be requested in any order, several at a time."""
    says_checksum: bool
    """Whether it reports a list's checksum on acceptance and on request."""
    takes_mission_file: bool
    """Whether it takes the last part of a mission as a file over MAVFTP."""
    upload_is_atomic: bool
    """Whether a new list takes effect as a whole, at its last item."""
    upload_silence_s: float
    """Silence after which it abandons an upload."""
    transfer_freed_s: float
    """Silence after which it abandons another station's transfer; until then it is busy."""
    upload_warnings: frozenset[int]
    """MISSION_ACK types that do not end an upload."""
    current_counts_home: bool
    """Whether MISSION_CURRENT.total excludes home, so that the last seq equals it."""
    ends_in_other_mode: bool
    """Whether the landing at a mission's end has its own mode."""
    low_battery_acts: bool
    """Whether the text "Low battery" reports a failsafe; otherwise it is a warning."""
    rounds_twice: bool
    """Whether BATTERY_STATUS rounds the percentage, and SYS_STATUS rounds it up."""
    percent_middle: float
    """Mean of the true value above a reported whole percent: 0 if rounded, 0.5 if truncated."""
    pack_parameters: tuple[str, ...]
    """Parameters of its battery pack: capacity and cells."""
    own_streams_hz: Mapping[int, float]
    """Messages of this autopilot only, and their requested rates."""
    unasked_hz: Mapping[int, float]
    """Messages that it sends over a telemetry radio although nothing here reads them, and their rates; except those
    that people or other stations need."""
    start: tuple[StartStep, ...]
    modes: Modes
    return_parameters: ReturnParameters
    ground_station_failsafe: GroundStationFailsafe
    battery_failsafe: BatteryFailsafe
    geofence: Geofence
    terrain: tuple[TerrainRule, ...]
    """Its own terrain following; nothing here relies on it."""
    performance: Performance
    """Flight performance with default parameters."""
    tunings: tuple[Tuning, ...]
    """Parameters that change the performance."""
    other_names: Mapping[str, OtherName]
    """Other names of renamed parameters, by the name used here."""
    oldest_version: tuple[int, int]
    """Oldest supported version: major, minor."""
    newest_version: tuple[int, int]
    """Newest version whose parameters were checked against these tables: major, minor."""
    tested_version: str
    """Version that this dialect was measured with."""


_ADAPTER = TypeAdapter(Dialect)


def _read_dialect(name: str) -> Dialect:
    text = resources.files(__package__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return _ADAPTER.validate_python(tomllib.loads(text))


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
    """Return the dialect of a MAV_AUTOPILOT; None if unknown."""
    return next((dialect for dialect in AUTOPILOTS if dialect.number == number), None)


def list_other_names(dialect: Dialect, names: Iterable[str], present: Container[str] = ()) -> tuple[str, ...]:
    """Return the other names of those parameters that a vehicle does not have by their first name."""
    known = dialect.other_names
    return tuple(known[name].name for name in names if name in known and name not in present)


def find_name_on_board(dialect: Dialect, name: str, present: Container[str]) -> str:
    """Return the name of a parameter on the vehicle; the first name if it has neither."""
    other = dialect.other_names.get(name)
    return name if other is None or name in present or other.name not in present else other.name


def add_first_names(dialect: Dialect, values: Mapping[str, float]) -> dict[str, float]:
    """Return parameter values, adding those with another name by their first name and in its units.

    >>> add_first_names(ARDUPILOT, {"WP_SPD": 12.0})
    {'WPNAV_SPEED': 1200.0, 'WP_SPD': 12.0}
    """
    others = dialect.other_names.items()
    return {first: values[other.name] / other.unit for first, other in others if other.name in values} | dict(values)


def is_mission_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle is flying the mission on board."""
    return custom_mode == dialect.modes.mission.custom_mode


def is_home_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether the vehicle is in RTL, or landing, autonomously."""
    ours = {dialect.modes.return_home.custom_mode, dialect.modes.land.custom_mode}
    return custom_mode in ours | dialect.modes.other_ways_home


def is_manual_mode(dialect: Dialect, custom_mode: int | None) -> bool:
    """Return whether it needs a pilot: neither we, a mission nor a failsafe enters it for hands-off flight."""
    return custom_mode in dialect.modes.manual


def mode_name(dialect: Dialect, custom_mode: int) -> str:
    """Return the display name of a mode."""
    modes = dialect.modes
    ours = {
        modes.guided.custom_mode: "GUIDED",
        modes.hold.custom_mode: "HOLD",
        modes.mission.custom_mode: "MISSION",
        modes.return_home.custom_mode: "RTL",
        modes.land.custom_mode: "LAND",
    }
    return ours.get(custom_mode) or dict(modes.other_names).get(custom_mode) or f"number {custom_mode}"
