"""What ArduPilot and PX4 do differently, as data.

'Measured' is what the project found by experiment with ArduPilot Copter 4.7-dev and PX4 v1.17.0 in simulation;
'guide' is its field guide, which cites the autopilots' sources.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from missions.autopilots.failsafes import (
    ARDUPILOT_BATTERY,
    ARDUPILOT_FENCE,
    ARDUPILOT_LINK,
    PX4_BATTERY,
    PX4_FENCE,
    PX4_LINK,
    BatteryFailsafe,
    Geofence,
    GroundStationFailsafe,
)
from missions.items import Frame


class StartStep(Enum):
    """One step from a verified upload to flight."""

    GUIDED = "guided"
    """Switch to the mode in which the autopilot can be armed for a mission."""
    ARM = "arm"
    MISSION_START = "mission_start"
    """MAV_CMD_MISSION_START (300), all parameters 0."""
    MISSION_MODE = "mission_mode"
    """Switch to mission mode; the armed vehicle takes off."""


class SetCurrent(Enum):
    """How the item to fly next is chosen."""

    COMMAND = "command"
    """MAV_CMD_DO_SET_MISSION_CURRENT (224), acknowledged."""
    MESSAGE = "message"
    """MISSION_SET_CURRENT, answered by MISSION_CURRENT only."""


@dataclass(frozen=True, slots=True)
class ModeNumber:
    """A flight mode: what HEARTBEAT shows and what MAV_CMD_DO_SET_MODE takes."""

    custom_mode: int
    """HEARTBEAT.custom_mode."""
    param2: int
    """DO_SET_MODE param2; param1 is always 1."""
    param3: int = 0


def _ardupilot(number: int) -> ModeNumber:
    return ModeNumber(number, number)


def _px4(main: int, sub: int) -> ModeNumber:
    # custom_mode = sub << 24 | main << 16, while DO_SET_MODE takes the two apart (guide 1.9; px4_custom_mode.h).
    return ModeNumber(sub << 24 | main << 16, main, sub)


@dataclass(frozen=True, slots=True)
class Modes:
    """The modes that faultline commands or recognises."""

    mission: ModeNumber
    hold: ModeNumber
    """Stops where it is; safe without a remote control."""
    guided: ModeNumber
    return_home: ModeNumber
    land: ModeNumber


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
class Dialect:
    """One autopilot's way of speaking and behaving."""

    name: str
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
    item_requests_int: bool
    """Whether it asks for items with MISSION_REQUEST_INT, or with the older MISSION_REQUEST."""
    item_silence_s: float
    """It asks again for a missing item after this."""
    upload_silence_s: float
    """It gives an upload up after this."""
    upload_warnings: frozenset[int]
    """MISSION_ACK types during an upload that do not end it."""
    upload_busy: frozenset[int]
    """MISSION_ACK types that mean 'another transfer is under way': to be tried again."""
    reports_mission_id: bool
    """Whether ACK and MISSION_CURRENT carry an id of the list's content."""
    same_content_ignored: bool
    """Whether uploading the stored list again, with another ``current``, changes nothing."""
    current_flag_jumps: bool
    """Whether an item with ``current`` set is flown next when uploaded in flight."""
    current_counts_home: bool
    """Whether MISSION_CURRENT.total leaves home out, so that the last seq equals it."""
    set_current: SetCurrent
    speed_lost_on_mode_change: bool
    """Whether a DO_CHANGE_SPEED is forgotten when the mode changes."""
    must_request_telemetry: bool
    """Whether streams come only when asked for."""
    start: tuple[StartStep, ...]
    modes: Modes
    return_parameters: ReturnParameters
    ground_station_failsafe: GroundStationFailsafe
    battery_failsafe: BatteryFailsafe
    geofence: Geofence
    oldest_version: tuple[int, int]
    """Major and minor number; what is older was not looked at."""
    tested_version: str
    """What this dialect was measured with."""


ARDUPILOT = Dialect(
    name="ardupilot",
    home_item=True,  # guide 1.4: item 0 is accepted and ignored
    position_frame=Frame.GLOBAL_RELATIVE_ALT,  # what it reads back itself (AP_Mission.cpp, measured)
    command_frame=Frame.GLOBAL,  # measured: DO items come back with frame 0
    takeoff_with_position=False,  # AP_Mission.cpp: only the height of a take-off is used
    no_yaw=0.0,  # WP_YAW_BEHAVIOR decides; 0 is what comes back
    stop_radius_m=0.0,  # AP_Mission.cpp stores only the hold of a copter's waypoint; WPNAV_RADIUS decides
    pass_radius_m=0.0,
    flag_first=None,  # measured: current is ignored and comes back as 0
    max_items=700,  # boards with 16 kB of storage hold 724 items of 15 bytes
    home_reads_back=False,  # measured
    land_yaw_kept=False,  # AP_Mission.cpp: param4 of a landing comes back as 1 or -1
    commands_lose_frame=True,  # measured
    height_step_m=0.01,  # Location keeps centimetres
    upload_is_atomic=False,  # measured: a mixture of both lists is flown while it is uploaded
    item_requests_int=False,  # measured: MISSION_REQUEST (40), never _INT
    item_silence_s=1.0,  # measured
    upload_silence_s=8.0,  # measured: then ACK 15 and "Mission upload timeout"
    upload_warnings=frozenset({13}),  # measured: a duplicate item brings INVALID_SEQUENCE and the upload goes on
    upload_busy=frozenset({14}),  # measured: DENIED while another ground station uploads
    reports_mission_id=False,  # guide 1.4
    same_content_ignored=False,  # measured: each stored item restarts the leg
    current_flag_jumps=False,  # measured: the old index is kept
    current_counts_home=True,  # measured: total is count - 1
    set_current=SetCurrent.COMMAND,  # measured: 224 acts at once and is acknowledged
    speed_lost_on_mode_change=True,  # measured: back to WPNAV_SPEED
    must_request_telemetry=True,  # measured: only HEARTBEAT, TIMESYNC and STATUSTEXT come unasked
    start=(StartStep.GUIDED, StartStep.ARM, StartStep.MISSION_START),  # measured; arming in AUTO is refused
    modes=Modes(  # guide 1.9, mode.h
        mission=_ardupilot(3),
        hold=_ardupilot(17),  # BRAKE: LOITER sinks at 2.5 m/s without a remote control (measured)
        guided=_ardupilot(4),
        return_home=_ardupilot(6),
        land=_ardupilot(9),
    ),
    return_parameters=ReturnParameters(
        height="RTL_ALT",  # centimetres in all firmware up to the measured 4.7-dev (recorded parameters: 1500)
        unit_m=0.01,
        newer_height="RTL_ALT_M",  # 4.7.0 renames centimetre parameters and scales them to metres
        descend_height=None,  # RTL_ALT_FINAL 0 (default) lands without a stop
        descend_wait=None,
        cone="RTL_CONE_SLOPE",  # default 3: within a third of the height it climbs less
        cone_off=0.0,  # ArduPilot's manual: 0 disables the limit
        cone_least=0.5,  # mode_rtl.cpp: shallower cones are ignored
        cone_unit="",
    ),
    ground_station_failsafe=ARDUPILOT_LINK,
    battery_failsafe=ARDUPILOT_BATTERY,
    geofence=ARDUPILOT_FENCE,
    oldest_version=(4, 6),
    tested_version="Copter 4.7-dev",
)

PX4 = Dialect(
    name="px4",
    home_item=False,  # guide 1.4: seq 0 is the first real item
    position_frame=Frame.GLOBAL_RELATIVE_ALT_INT,  # what it reads back itself (mavlink_mission.cpp, integer mode)
    command_frame=Frame.MISSION,  # recorded flights
    takeoff_with_position=True,  # recorded flights; NaN would be flown from wherever it stands
    no_yaw=math.nan,  # recorded flights; 0 would be 'face north'
    stop_radius_m=1.0,  # its own NAV_ACC_RAD of 10 m would end an inspection 10 m early
    pass_radius_m=2.0,  # the columns' margin: corners are cut by less than this
    flag_first=0,  # measured trap: without it a next flight begins where the last one ended
    max_items=500,  # boards with little memory hold 500, others 2000 (dataman)
    home_reads_back=True,
    land_yaw_kept=True,
    commands_lose_frame=False,
    height_step_m=0.0,  # float32
    upload_is_atomic=True,  # guide 1.4: double buffer, swapped at the last item
    item_requests_int=True,  # measured
    item_silence_s=0.25,  # measured
    upload_silence_s=5.0,  # measured: "Operation timeout", without an ACK
    upload_warnings=frozenset(),
    upload_busy=frozenset({1}),  # measured: a second ground station gets ERROR
    reports_mission_id=True,  # measured: CRC32 in the ACK and in MISSION_CURRENT
    same_content_ignored=True,  # measured: ACK 0, use MISSION_SET_CURRENT then
    current_flag_jumps=True,  # measured
    current_counts_home=False,  # guide 1.4
    set_current=SetCurrent.MESSAGE,  # measured: 224 is unsupported
    speed_lost_on_mode_change=True,  # measured: reset by Hold -> Mission
    must_request_telemetry=False,  # measured: position, battery and status come by themselves
    start=(StartStep.ARM, StartStep.MISSION_MODE),  # measured: MISSION_START right after an ACK is denied
    modes=Modes(  # guide 1.9: main 4 (AUTO); sub 3 LOITER, 4 MISSION, 5 RTL, 6 LAND
        mission=_px4(4, 4),
        hold=_px4(4, 3),
        guided=_px4(4, 3),  # it needs no other mode before arming; AUTO.LOITER is its 'wait for orders'
        return_home=_px4(4, 5),
        land=_px4(4, 6),
    ),
    return_parameters=ReturnParameters(
        height="RTL_RETURN_ALT",  # rtl_params.c, metres
        unit_m=1.0,
        newer_height=None,
        descend_height="RTL_DESCEND_ALT",
        descend_wait="RTL_LAND_DELAY",  # rtl_direct.cpp: without a wait a multicopter lands from where it arrives
        cone="RTL_CONE_ANG",
        cone_off=0.0,  # PX4's manual: without a cone it returns at RTL_RETURN_ALT or above
        cone_least=1.0,  # whole degrees
        cone_unit="deg",
    ),
    ground_station_failsafe=PX4_LINK,
    battery_failsafe=PX4_BATTERY,
    geofence=PX4_FENCE,
    oldest_version=(1, 15),
    tested_version="PX4 1.17.0",
)


def dialect_for(name: str) -> Dialect:
    """Return the dialect of an autopilot, 'ardupilot' or 'px4'.

    Raises:
        ValueError: there is no such autopilot.
    """
    for dialect in (ARDUPILOT, PX4):
        if dialect.name == name:
            return dialect
    raise ValueError(f"autopilot: expected ardupilot or px4, got {name!r}")
