"""What PX4 does in its own way.

'Measured' is what the project found by experiment with PX4 v1.17.0 in simulation;
'guide' is its field guide, which cites the autopilot's sources. Parameters are those of its own reference.
"""

from __future__ import annotations

import math
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
    EarlyReturn,
    Geofence,
    GroundStationFailsafe,
    ThresholdUnit,
)
from missions.cameras import Trigger
from missions.items import Frame
from missions.performance import Performance, Ramp, Tuning


def _px4_mode(main: int, sub: int) -> ModeNumber:
    # custom_mode = sub << 24 | main << 16, while DO_SET_MODE takes the two apart (guide 1.9; px4_custom_mode.h).
    return ModeNumber(sub << 24 | main << 16, main, sub)


OTHER_MODES = MappingProxyType({
    1 << 16: "MANUAL", 2 << 16: "ALTCTL", 3 << 16: "POSCTL", 5 << 16: "ACRO", 6 << 16: "OFFBOARD",
    7 << 16: "STABILIZED", 10 << 16: "TERMINATION", 2 << 24 | 4 << 16: "AUTO.TAKEOFF",
    8 << 24 | 4 << 16: "AUTO.FOLLOW", 9 << 24 | 4 << 16: "AUTO.PRECLAND",
})  # fmt: skip
"""px4_custom_mode.h, sub << 24 | main << 16."""

PX4_LINK = GroundStationFailsafe(
    action="NAV_DLL_ACT",
    action_return=2,  # measured: AUTO.LOITER, then RTL
    actions=((1, "hold"), (2, "RTL"), (3, "land"), (5, "flight termination"), (6, "disarm")),
    timeout="COM_DL_LOSS_T",
    timeout_s=10.0,  # commander_params.c
    timeout_most_s=300.0,  # its range in commander_params.c
    pause="COM_FAIL_ACT_T",
    pause_s=5.0,  # commander_params.c
    pause_most_s=25.0,  # its range in commander_params.c
    reacts_after_s=12.0,  # measured: AUTO.LOITER
    returns_after_s=17.0,  # measured: RTL, not cancelled when heartbeats return
    exception=("COM_DLL_EXCEPT", 1 << 0),  # missions are exempt (guide 3.3)
    station_sysid=(),
)
_PX4_LOW = "COM_LOW_BAT_ACT"
PX4_BATTERY = BatteryFailsafe(
    # failsafe.cpp: the low level only warns; 3 is 'return, and land in an emergency'. 1.18 has 5 for the same without
    # its new early return, what comes after it 4 for 'return, and flight termination in an emergency' (PX4 28064).
    levels=(
        BatteryLevel(
            "critical",
            _PX4_LOW,
            ((1, "RTL"), (2, "land"), (3, "RTL"), (4, "RTL"), (5, "RTL")),
            "BAT_CRIT_THR",
            ThresholdUnit.SHARE,
            None,
        ),
        BatteryLevel(
            "emergency",
            _PX4_LOW,
            ((1, "RTL"), (2, "land"), (3, "land"), (4, "flight termination"), (5, "land")),
            "BAT_EMERGEN_THR",
            ThresholdUnit.SHARE,
            None,
        ),
    ),
    early=(  # up to 1.16 COM_FLTT_LOW_ACT is 3 by default, in 1.17 it is 0 (PX4 25267); 1.18 has it in the other
        EarlyReturn("COM_FLTT_LOW_ACT", ((1, "warning"), (3, "RTL")), (0,), since=None),
        EarlyReturn(_PX4_LOW, ((3, "RTL"),), (0, 1, 2, 4, 5), since=(1, 18)),
    ),
    capacity=None,
)
PX4_FENCE = Geofence(
    enabled_by=("GF_ACTION",),
    kinds=None,
    height="GF_MAX_VER_DIST",
    radius="GF_MAX_HOR_DIST",
    action="GF_ACTION",
    actions=((1, "warning"), (2, "hold"), (3, "RTL"), (4, "flight termination"), (5, "land")),
    named=(("warn", 1), ("hold", 2), ("return", 3), ("land", 5)),
    polygons=0,
    enable=None,
    checked_on_load=True,  # geofence.cpp, measured: ACK 0, then "Geofence invalid, doesn't contain ..."
)

STOP_RADIUS_M = 3.0
"""Of a waypoint with a hold. Farther from a leg's line than this it flies back to the line first (FlightTaskAuto.cpp):
with 1 m the estimate's wander alone made it do so, for 2 to 10 s on a third of the legs, with 2 m now and then."""

PX4 = Dialect(
    name="px4",
    title="PX4",
    number=12,
    home_item=False,  # guide 1.4: seq 0 is the first real item
    position_frame=Frame.GLOBAL_RELATIVE_ALT_INT,  # what it reads back itself (mavlink_mission.cpp, integer mode)
    command_frame=Frame.MISSION,  # recorded flights
    takeoff_with_position=True,  # recorded flights; NaN would be flown from wherever it stands
    no_yaw=math.nan,  # recorded flights; 0 would be 'face north'
    keeps_region=False,  # mavlink_mission.cpp: it takes DO_SET_ROI_LOCATION and cannot give it back
    shutter=ShutterRule(  # navigator_main.cpp: single pictures of MAVLink cameras too are its driver's (camera_trigger)
        "TRIG_MODE",
        frozenset({Trigger.DISTANCE, Trigger.ONCE}),
        "by distance and no single ones",
        "TRIG_MODE 4 and the TRIG_INTERFACE of its camera, 3 for MAVLink",
    ),
    gimbal_rate=math.nan,
    stop_radius_m=STOP_RADIUS_M,  # its own NAV_ACC_RAD of 10 m would end an inspection 10 m early
    pass_radius_m=2.0,  # the columns' margin: corners are cut by less than this
    flag_first=0,  # measured trap: without it a next flight begins where the last one ended
    max_items=500,  # boards with little memory hold 500, others 2000 (dataman)
    home_reads_back=True,
    land_yaw_kept=True,
    commands_lose_frame=False,
    height_step_m=0.0,  # float32
    upload_is_atomic=True,  # guide 1.4: double buffer, swapped at the last item
    # Measured: it asks for items with MISSION_REQUEST_INT, and again after 0.25 s.
    upload_silence_s=5.0,  # measured: "Operation timeout", without an ACK
    # mavlink_mission.h: MAVLINK_MISSION_PROTOCOL_TIMEOUT_DEFAULT, for uploads and downloads; until then others get
    # ERROR. A COUNT that comes meanwhile begins the time anew.
    transfer_freed_s=5.0,
    upload_warnings=frozenset(),
    # Measured: ACK and MISSION_CURRENT carry a CRC32 of the list; a list with the same one changes nothing (ACK 0).
    # Measured: an item with `current` set is flown next when it is uploaded in flight.
    current_counts_home=False,  # guide 1.4
    ends_in_other_mode=True,  # measured: AUTO.LAND
    low_battery_acts=False,  # batteryCheck.cpp: the low level only warns
    rounds_twice=True,  # recorded flights
    percent_middle=0.0,  # BATTERY_STATUS.hpp: roundf
    pack_parameters=("BAT1_CAPACITY", "BAT1_N_CELLS"),
    own_streams_hz={231: 0.5, 230: 1.0},  # WIND_COV, ESTIMATOR_STATUS; of its fence it says in texts alone
    # Measured: 224 is unsupported, MISSION_SET_CURRENT is answered by MISSION_CURRENT alone.
    # Measured: Hold -> Mission resets the speed.
    # Measured: position, battery and status come by themselves.
    start=(StartStep.ARM, StartStep.MISSION_MODE),  # measured: MISSION_START right after an ACK is denied
    modes=Modes(  # guide 1.9: main 4 (AUTO); sub 3 LOITER, 4 MISSION, 5 RTL, 6 LAND
        mission=_px4_mode(4, 4),
        hold=_px4_mode(4, 3),
        guided=_px4_mode(4, 3),  # it needs no other mode before arming; AUTO.LOITER is its 'wait for orders'
        return_home=_px4_mode(4, 5),
        land=_px4_mode(4, 6),
        other_ways_home=frozenset({9 << 24 | 4 << 16}),
        manual=frozenset({1 << 16, 2 << 16, 3 << 16, 5 << 16, 6 << 16, 7 << 16, 8 << 24 | 4 << 16}),
        blind=frozenset({2 << 16, 7 << 16}),  # failsafe.cpp: fallbacks without a position, without a height
        other_names=OTHER_MODES,
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
    terrain=(  # mc_pos_control_params.c
        TerrainRule("MPC_ALT_MODE", frozenset({1, 2}), in_flight=False, words="does so in the pilot's modes"),
    ),
    performance=Performance(  # PositionSmoothing.cpp, TrajMath.hpp; measured in PX4's own simulator
        level=Ramp(acceleration_m_s2=2.43, jerk_m_s3=1000.0),  # both ramps as one, with MPC_ACC_HOR 3, MPC_JERK_AUTO 4
        upright=Ramp(acceleration_m_s2=1.5, jerk_m_s3=4.0),  # with MPC_ACC_UP_MAX 4, MPC_ACC_DOWN_MAX 3
        climb_m_s=2.65,  # measured, of MPC_Z_V_AUTO_UP 3: its trajectory waits for a vehicle that swings
        descent_m_s=1.5,  # MPC_Z_V_AUTO_DN
        turn_s=4.6,  # measured: it moves on for a while, and its trajectory waits for it
        turn_power=2.0,
        corner_s=4.6,  # MPC_XY_TRAJ_P 0.5: it slows down to 3.3 m/s for 30, to 1.7 m/s for 90 degrees
        corner_power=0.5,
        turn_speed_power=1.5,
        pass_s=0.3,  # measured: the navigator's turn comes after the waypoint
        settle_s=1.25,  # measured
        accept_m=STOP_RADIUS_M,
        waits=0.028,  # measured: 2.83 to 2.92 of 3 m/s; MPC_XY_ERR_MAX 2 for a swing of 0.2 m each way
        hold_s=2.0,
        spool_s=8.3,  # COM_SPOOLUP_TIME 1, MPC_TKO_RAMP_T 3, and the last metres
        take_off_m_s=1.32,  # measured, of MPC_TKO_SPEED 1.5
        take_off_below_m=10.0,  # MPC_LAND_ALT1
        land_m_s=1.25,  # measured, of MPC_Z_VEL_MAX_DN 1.5
        land_below_m=0.0,
        land_fast_m_s=1.25,
        touch_s=8.4,  # the last 10 m are slower, down to MPC_LAND_SPEED 0.7; 2 s and more until it disarms
        home_m_s=5.0,  # MPC_XY_CRUISE
        home_wait_s=0.0,  # RTL_LAND_DELAY
    ),
    tunings=(
        Tuning("MPC_ACC_HOR", 3.0, ("level.acceleration_m_s2",)),
        Tuning("MPC_Z_V_AUTO_UP", 3.0, ("climb_m_s",)),
        Tuning("MPC_Z_V_AUTO_DN", 1.5, ("descent_m_s",)),
        Tuning("MPC_Z_VEL_MAX_DN", 1.5, ("land_m_s", "land_fast_m_s")),
        Tuning("MPC_TKO_SPEED", 1.5, ("take_off_m_s",)),
        Tuning("MPC_XY_CRUISE", 5.0, ("home_m_s",)),
    ),
    oldest_version=(1, 15),
    tested_version="PX4 1.17.0",
)
