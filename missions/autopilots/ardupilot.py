"""What ArduPilot does in its own way.

'Measured' is what the project found by experiment with ArduPilot Copter 4.7-dev in simulation;
'guide' is its field guide, which cites the autopilot's sources. Parameters are those of its own reference.
"""

from __future__ import annotations

from types import MappingProxyType

from missions.autopilots.dialect import (
    Dialect,
    ModeNumber,
    Modes,
    ReturnParameters,
    ShutterRule,
    StartStep,
    TerrainRule,
)
from missions.autopilots.failsafes import (
    BatteryFailsafe,
    BatteryLevel,
    Geofence,
    GroundStationFailsafe,
    ThresholdUnit,
    Words,
)
from missions.cameras import Trigger
from missions.items import Frame
from missions.performance import Performance, Ramp, Tuning


def _copter_mode(number: int) -> ModeNumber:
    return ModeNumber(number, number)


OTHER_MODES = MappingProxyType({
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 5: "LOITER", 7: "CIRCLE", 11: "DRIFT", 13: "SPORT", 14: "FLIP",
    15: "AUTOTUNE", 16: "POSHOLD", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS", 21: "SMART_RTL",
    22: "FLOWHOLD", 23: "FOLLOW", 24: "ZIGZAG", 26: "AUTOROTATE", 27: "AUTO_RTL", 28: "TURTLE",
})  # fmt: skip
"""mode.h of ArduCopter."""

_ARDUPILOT_LOW: Words = (
    (1, "land"),
    (2, "RTL"),
    (3, "SmartRTL or RTL"),
    (4, "SmartRTL or land"),
    (5, "flight termination"),
    (6, "RTL"),  # or flies to a landing sequence, which our missions do not have
    (7, "brake and land"),
)

ARDUPILOT_LINK = GroundStationFailsafe(
    action="FS_GCS_ENABLE",
    action_return=1,  # measured: RTL
    actions=(
        (1, "RTL"),
        (3, "SmartRTL or RTL"),
        (4, "SmartRTL or land"),
        (5, "land"),
        (6, "RTL"),  # or flies to a landing sequence, which our missions do not have
        (7, "brake and land"),
    ),
    timeout="FS_GCS_TIMEOUT",
    timeout_s=5.0,  # recorded parameters
    timeout_most_s=120.0,  # its range in Parameters.cpp
    pause=None,
    pause_s=0.0,
    pause_most_s=0.0,
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
    early=(),
    capacity="BATT_CAPACITY",
)
ARDUPILOT_FENCE = Geofence(
    enabled_by=("FENCE_ENABLE", "FENCE_AUTOENABLE"),
    kinds=("FENCE_TYPE", 1 << 0, 1 << 1),
    height="FENCE_ALT_MAX",
    radius="FENCE_RADIUS",
    action="FENCE_ACTION",
    # fence.cpp: more than 100 m outside it lands whatever the action is (measured)
    actions=((1, "RTL"), (2, "land"), (3, "SmartRTL or RTL"), (4, "brake"), (5, "SmartRTL or land")),
    named=(("warn", 0), ("hold", 4), ("return", 1), ("land", 2)),
    polygons=1 << 2,
    enable="FENCE_ENABLE",
    checked_on_load=False,
)

ARDUPILOT = Dialect(
    name="ardupilot",
    title="ArduPilot",
    number=3,
    home_item=True,  # guide 1.4: item 0 is accepted and ignored
    position_frame=Frame.GLOBAL_RELATIVE_ALT,  # what it reads back itself (AP_Mission.cpp, measured)
    command_frame=Frame.GLOBAL,  # measured: DO items come back with frame 0
    takeoff_with_position=False,  # AP_Mission.cpp: only the height of a take-off is used
    no_yaw=0.0,  # WP_YAW_BEHAVIOR decides; 0 is what comes back
    keeps_region=True,  # AP_Mission.cpp
    shutter=ShutterRule("CAM1_TYPE", frozenset(Trigger), "at all", "the CAM1_TYPE of its camera"),  # AP_Camera.cpp
    gimbal_rate=0.0,  # NaN does not survive: rates are kept in a byte each
    stop_radius_m=0.0,  # AP_Mission.cpp stores only the hold of a copter's waypoint; WPNAV_RADIUS decides
    pass_radius_m=0.0,
    flag_first=None,  # measured: current is ignored and comes back as 0
    max_items=700,  # boards with 16 kB of storage hold 724 items of 15 bytes
    home_reads_back=False,  # measured
    land_yaw_kept=False,  # AP_Mission.cpp: param4 of a landing comes back as 1 or -1
    commands_lose_frame=True,  # measured
    height_step_m=0.01,  # Location keeps centimetres
    upload_is_atomic=False,  # measured: a mixture of both lists is flown while it is uploaded
    # Measured: it asks for items with MISSION_REQUEST (40), never _INT, and again after 1 s.
    upload_silence_s=8.0,  # measured: then ACK 15 and "Mission upload timeout"
    transfer_freed_s=8.0,  # measured: the same silence ends any upload; until then other stations get DENIED (14)
    upload_warnings=frozenset({13}),  # measured: a duplicate item brings INVALID_SEQUENCE and the upload goes on
    # Guide 1.4: neither ACK nor MISSION_CURRENT says which list it is.
    # Measured: each stored item restarts the leg, the same one too; the old index is kept.
    current_counts_home=True,  # measured: total is count - 1
    ends_in_other_mode=False,  # measured: it lands in AUTO
    low_battery_acts=True,  # events.cpp up to 3.5: the text of the failsafe itself
    rounds_twice=False,
    percent_middle=0.5,  # AP_BattMonitor.cpp: cut off to an integer
    pack_parameters=("BATT_CAPACITY", "MOT_BAT_VOLT_MAX"),
    own_streams_hz={168: 0.5, 162: 0.5, 193: 1.0},  # WIND, FENCE_STATUS, EKF_STATUS_REPORT
    # Measured: 224 acts at once and is acknowledged.
    # Measured: a change of mode brings WPNAV_SPEED back.
    # Measured: only HEARTBEAT, TIMESYNC and STATUSTEXT come unasked.
    start=(StartStep.GUIDED, StartStep.ARM, StartStep.MISSION_START),  # measured; arming in AUTO is refused
    modes=Modes(  # guide 1.9, mode.h
        mission=_copter_mode(3),
        hold=_copter_mode(17),  # BRAKE: LOITER sinks at 2.5 m/s without a remote control (measured)
        guided=_copter_mode(4),
        return_home=_copter_mode(6),
        land=_copter_mode(9),
        other_ways_home=frozenset({21, 27}),  # SMART_RTL, and AUTO_RTL, which is reported in a landing sequence
        manual=frozenset({0, 1, 2, 5, 7, 11, 13, 14, 15, 16, 18, 22, 23, 24, 28}),
        blind=frozenset({2}),  # FS_EKF_ACTION 2
        other_names=OTHER_MODES,
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
    terrain=(  # mode_rtl.cpp, AC_WPNav.cpp: items relative to home are flown as they are
        TerrainRule("RTL_ALT_TYPE", frozenset({1}), in_flight=True, words="its RTL is not level, but over its own map"),
        TerrainRule("TERRAIN_FOLLOW", frozenset({1}), in_flight=True, words="its flights are over its own map"),
        TerrainRule("TERRAIN_ENABLE", frozenset({1}), in_flight=False, words="keeps a map that is not used"),
        TerrainRule("WPNAV_RFND_USE", frozenset({1}), in_flight=False, words="is for items over the ground alone"),
    ),
    performance=Performance(  # AC_WPNav.cpp, SCurve.cpp; 313 legs in simulation follow it within 0.1 s (median)
        # WPNAV_ACCEL 250 cm/s/s, WPNAV_JERK 1 m/s/s/s, twice ATC_INPUT_TC 0.15 s
        level=Ramp(acceleration_m_s2=2.5, jerk_m_s3=1.0, smooth_s=0.3),
        upright=Ramp(acceleration_m_s2=1.0, jerk_m_s3=1.0, smooth_s=0.3),  # WPNAV_ACCEL_Z 100 cm/s/s
        climb_m_s=2.5,  # WPNAV_SPEED_UP 250 cm/s
        descent_m_s=1.5,  # WPNAV_SPEED_DN 150 cm/s
        turn_s=0.9,  # measured: 0.45 s for a right angle
        turn_power=2.0,
        corner_s=2.8,  # measured at 8 m/s: 0.2, 1.4, 2.1 and 2.5 s for 30, 60, 90 and 150 degrees
        corner_power=1.0,
        settle_s=0.0,
        accept_m=0.0,  # the hold's clock starts where the curve ends
        hold_s=1.0,
        spool_s=6.3,  # measured, from MISSION_START to the next item; lift-off after 4 s
        take_off_m_s=2.5,  # WPNAV_SPEED_UP
        take_off_below_m=0.0,
        land_m_s=0.5,  # LAND_SPEED 50 cm/s
        land_below_m=11.6,  # LAND_ALT_LOW 1000 cm, and the way to that speed
        land_fast_m_s=1.5,  # LAND_SPEED_HIGH 0: WPNAV_SPEED_DN
        touch_s=2.7,  # measured: of it 2.4 s from the touch-down until it disarms
        home_m_s=10.0,  # RTL_SPEED 0: WPNAV_SPEED 1000 cm/s
        home_wait_s=5.0,  # RTL_LOIT_TIME 5000 ms
    ),
    tunings=(
        Tuning("WPNAV_ACCEL", 250.0, ("level.acceleration_m_s2",)),
        Tuning("WPNAV_JERK", 1.0, ("level.jerk_m_s3", "upright.jerk_m_s3")),
        Tuning("WPNAV_ACCEL_Z", 100.0, ("upright.acceleration_m_s2",)),
        Tuning("WPNAV_SPEED_UP", 250.0, ("climb_m_s", "take_off_m_s")),
        Tuning("WPNAV_SPEED_DN", 150.0, ("descent_m_s", "land_fast_m_s")),
        Tuning("LAND_SPEED", 50.0, ("land_m_s",)),
        Tuning("LAND_ALT_LOW", 1000.0, ("land_below_m",)),
        Tuning("WPNAV_SPEED", 1000.0, ("home_m_s",)),
        Tuning("RTL_SPEED", 1000.0, ("home_m_s",), alone=True),  # 0 is the speed of waypoints
    ),
    oldest_version=(4, 6),
    tested_version="Copter 4.7-dev",
)
