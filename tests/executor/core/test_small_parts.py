"""Small judgements at their limits: roundings, strangers, reasons, traces, failsafes, words."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core import words
from executor.core.battery.roundings import Roundings
from executor.core.hearing import firmware, plausible, speaker, strangers
from executor.core.hearing.speaker import Speaker
from executor.core.messages import (
    Attitude,
    Battery,
    DoubleHeard,
    Gps,
    Heartbeat,
    MissionCurrent,
    MissionReached,
    Position,
    StationHeard,
    SystemStatus,
    Wind,
)
from executor.core.preflight import failsafes, prearm
from executor.core.preflight.failsafes import (
    BatteryAction,
    BatteryRule,
    Cylinder,
    LinkFailsafe,
)
from executor.replay import result
from executor.replay.result import Trace
from missions import ARDUPILOT, PX4
from tests.executor.core.faults.test_watchpoints import NOW_S
from tests.executor.core.steps import rounded

ARDU = {"FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 7.0, "SYSID_MYGCS": 254.0}
PACK = {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1000.0, "BATT_LOW_VOLT": 14.4, "BATT_CAPACITY": 5000.0}
FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 80.0, "FENCE_RADIUS": 300.0}
STATIONS = frozenset(StationHeard(number, 190) for number in range(1, 8))


def trace(count: int, every_s: float) -> Trace:
    found = Trace()
    for number in range(count):
        found.add(result.ReplaySample(number * every_s, None, None, None, None, None, 0.0, 0.0, None, None))
    return found


ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "two roundings of one percentage",
        lambda: [
            Roundings(rounded, rounded_s, ceiled, ceiled_s).percent
            for rounded, rounded_s, ceiled, ceiled_s in (
                (96.0, 1.0, 96.0, 1.5),
                (96.0, 1.0, 97.0, 5.0),
                (96.0, 1.0, 97.0, 5.1),
                (96.0, 5.1, 97.0, 1.0),
                (96.0, 1.0, 98.0, 1.5),
                (96.0, 1.5, 98.0, 1.0),
                (96.0, 1.0, 95.0, 1.0),
                (97.0, 1.0, 96.5, 1.2),
            )
        ],
        [95.75, 96.25, 97.0, 96.0, 97.5, 96.0, 96.0, 96.0],
    ),
    (
        "strangers are named until they are many",
        lambda: [
            len(strangers.noted(STATIONS, one))
            for one in (StationHeard(1, 190), StationHeard(9, 190), DoubleHeard(3, ("a", "b")))
        ],
        [7, 8, 8],
    ),
    (
        "the last stranger that is named",
        lambda: [
            sorted(strangers.stranger_lines(known, strangers.noted(known, StationHeard(9, 190))))
            for known in (STATIONS, STATIONS - {StationHeard(1, 190)}, STATIONS | {StationHeard(8, 190)})
        ],
        [
            [("another ground station is on its link, system 9 component 190; further ones are not named")],
            ["another ground station is on its link, system 9 component 190"],
            [],
        ],
    ),
    (
        "two with one number",
        lambda: list(strangers.stranger_lines(frozenset(), frozenset({DoubleHeard(3, ("a", "b"))}))),
        ["system 3 speaks from a and b: two vehicles have the same sysid"],
    ),
    (
        "why it does not arm",
        lambda: [
            prearm.complaint(reasons_s, status, 100.0)
            for reasons_s, status in (
                ({}, None),
                ({"a": 65.0}, None),
                ({"a": 64.9}, None),
                ({"a": 99.0, "b": 99.0, "c": 99.0}, None),
                ({"a": 99.0, "b": 99.0, "c": 99.0, "d": 99.0, "e": 99.0}, None),
            )
        ],
        [
            "its own pre-arm checks fail, and it does not say why",
            "its own pre-arm checks fail: a",
            "its own pre-arm checks fail, and it does not say why",
            "its own pre-arm checks fail: a; b; c",
            "its own pre-arm checks fail: a; b; c; 2 more",
        ],
    ),
    (
        "which sensors are not healthy",
        lambda: [
            prearm.complaint({}, SystemStatus(None, None, bit, None), 100.0) for bit in (0, *prearm.SENSORS, 0x40, 0x3)
        ],
        [
            "its own pre-arm checks fail, and it does not say why",
            "its own pre-arm checks fail: not healthy: gyroscope",
            "its own pre-arm checks fail: not healthy: accelerometer",
            "its own pre-arm checks fail: not healthy: compass",
            "its own pre-arm checks fail: not healthy: barometer",
            "its own pre-arm checks fail: not healthy: GPS",
            "its own pre-arm checks fail: not healthy: remote control",
            "its own pre-arm checks fail: not healthy: geofence",
            "its own pre-arm checks fail: not healthy: attitude estimate",
            "its own pre-arm checks fail: not healthy: logging",
            "its own pre-arm checks fail: not healthy: battery",
            "its own pre-arm checks fail: not healthy: motors",
            "its own pre-arm checks fail, and it does not say why",
            "its own pre-arm checks fail: not healthy: gyroscope, accelerometer",
        ],
    ),
    (
        "which sensors there are",
        lambda: sorted(prearm.SENSORS),
        [1, 2, 4, 8, 32, 65536, 1048576, 2097152, 16777216, 33554432, 1073741824],
    ),
    (
        "what gives a reason",
        lambda: [
            prearm.reason_in(text)
            for text in (
                "PreArm: a",
                "Arm: b",
                "Preflight Fail: c",
                "Arming denied: d",
                "Arming denied! e",
                "PreArm:",
                "EKF3 active",
            )
        ],
        ["a", "b", "c", "d", "e", None, None],
    ),
    ("a trace keeps one in three seconds", lambda: len(trace(10, 1.0).samples), 4),
    (
        "a trace of a long flight",
        lambda: [
            (len(found.samples), found.every_s, found.samples[-1].at_s)
            for count in (4000, 4001, 4003)
            for found in (trace(count, 3.0),)
        ],
        [(4000, 3.0, 11997.0), (2001, 6.0, 12000.0), (2002, 6.0, 12006.0)],
    ),
    (
        "what a vehicle does without us",
        lambda: [
            failsafes.link_failsafe(ARDUPILOT, parameters)
            for parameters in (
                {},
                ARDU,
                ARDU | {"FS_GCS_ENABLE": 0.0},
                ARDU | {"FS_GCS_ENABLE": 5.0},
                ARDU | {"FS_GCS_ENABLE": 99.0},
                ARDU | {"FS_OPTIONS": 2.0},
                ARDU | {"FS_OPTIONS": 5.0},
                ARDU | {"FS_OPTIONS": 6.0},
            )
        ],
        [
            LinkFailsafe(acts=None, after_s=5.0, words="GCS failsafe not known: no answer for FS_GCS_ENABLE"),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: RTL after 7 s (FS_GCS_ENABLE=1)"),
            LinkFailsafe(
                acts=False,
                after_s=7.0,
                words=("no GCS failsafe (FS_GCS_ENABLE=0): without a link it flies its mission to the end"),
            ),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: land after 7 s (FS_GCS_ENABLE=5)"),
            LinkFailsafe(
                acts=True,
                after_s=7.0,
                words="GCS failsafe: unknown action after 7 s (FS_GCS_ENABLE=99)",
            ),
            LinkFailsafe(
                acts=False,
                after_s=7.0,
                words="no GCS failsafe in a mission (FS_GCS_ENABLE=1, but FS_OPTIONS=2)",
            ),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: RTL after 7 s (FS_GCS_ENABLE=1)"),
            LinkFailsafe(
                acts=False,
                after_s=7.0,
                words="no GCS failsafe in a mission (FS_GCS_ENABLE=1, but FS_OPTIONS=6)",
            ),
        ],
    ),
    (
        "what PX4 does without us",
        lambda: [
            failsafes.link_failsafe(PX4, parameters)
            for parameters in (
                {},
                {"NAV_DLL_ACT": 2.0},
                {"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 20.0, "COM_FAIL_ACT_T": 7.0},
                {"NAV_DLL_ACT": 0.0},
                {"NAV_DLL_ACT": 2.0, "COM_DLL_EXCEPT": 1.0},
            )
        ],
        [
            LinkFailsafe(acts=None, after_s=17.0, words="GCS failsafe not known: no answer for NAV_DLL_ACT"),
            LinkFailsafe(acts=True, after_s=17.0, words="GCS failsafe: RTL after 17 s (NAV_DLL_ACT=2)"),
            LinkFailsafe(acts=True, after_s=29.0, words="GCS failsafe: RTL after 29 s (NAV_DLL_ACT=2)"),
            LinkFailsafe(
                acts=False,
                after_s=17.0,
                words=("no GCS failsafe (NAV_DLL_ACT=0): without a link it flies its mission to the end"),
            ),
            LinkFailsafe(
                acts=False,
                after_s=17.0,
                words="no GCS failsafe in a mission (NAV_DLL_ACT=2, but COM_DLL_EXCEPT=1)",
            ),
        ],
    ),
    (
        "whose heartbeats count",
        lambda: [
            failsafes.counted_station(ARDUPILOT, parameters) for parameters in ({}, ARDU, ARDU | {"MAV_GCS_SYSID": 3.0})
        ],
        [None, ("SYSID_MYGCS", 254), ("MAV_GCS_SYSID", 3)],
    ),
    (
        "what is asked for",
        lambda: [failsafes.names(dialect) for dialect in (ARDUPILOT, PX4)],
        [
            (
                "FS_GCS_ENABLE",
                "FS_GCS_TIMEOUT",
                "FS_OPTIONS",
                "MAV_GCS_SYSID",
                "BATT_CAPACITY",
                "BATT_FS_LOW_ACT",
                "BATT_LOW_MAH",
                "BATT_LOW_VOLT",
                "BATT_FS_CRT_ACT",
                "BATT_CRT_MAH",
                "BATT_CRT_VOLT",
                "FENCE_ENABLE",
                "FENCE_AUTOENABLE",
                "FENCE_ALT_MAX",
                "FENCE_RADIUS",
                "FENCE_TYPE",
            ),
            (
                "NAV_DLL_ACT",
                "COM_DL_LOSS_T",
                "COM_FAIL_ACT_T",
                "COM_DLL_EXCEPT",
                "COM_LOW_BAT_ACT",
                "BAT_CRIT_THR",
                "BAT_EMERGEN_THR",
                "GF_ACTION",
                "GF_MAX_VER_DIST",
                "GF_MAX_HOR_DIST",
            ),
        ],
    ),
    (
        "what is asked for by its older name",
        lambda: [failsafes.older_names(ARDUPILOT, parameters) for parameters in ({}, {"MAV_GCS_SYSID": 3.0}, ARDU)],
        [("SYSID_MYGCS",), (), ()],
    ),
    (
        "what a vehicle does on a low battery",
        lambda: [
            failsafes.battery_rule(ARDUPILOT, parameters)
            for parameters in (
                {},
                {"BATT_LOW_MAH": 1000.0, "BATT_CRT_MAH": 500.0, "BATT_CAPACITY": 5000.0},
                PACK,
                PACK | {"BATT_FS_CRT_ACT": 1.0},
                PACK | {"BATT_FS_CRT_ACT": 1.0, "BATT_CRT_MAH": 500.0},
                PACK | {"BATT_CAPACITY": 0.0},
                PACK | {"BATT_LOW_VOLT": 0.0},
                PACK | {"BATT_LOW_MAH": 0.0},
                PACK | {"BATT_FS_LOW_ACT": 99.0},
                PACK | {"BATT_FS_LOW_ACT": 0.0},
                {"BATT_FS_LOW_ACT": 2.0},
                {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1.0},
                {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_VOLT": 1.0},
            )
        ],
        [
            BatteryRule(said=False, actions=()),
            BatteryRule(said=False, actions=()),
            BatteryRule(
                said=False,
                actions=(BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)"),),
            ),
            BatteryRule(
                said=True,
                actions=(BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)"),),
            ),
            BatteryRule(
                said=True,
                actions=(
                    BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)"),
                    BatteryAction(below_pct=10.0, words="land below 10 % (BATT_FS_CRT_ACT=1)"),
                ),
            ),
            BatteryRule(
                said=False,
                actions=(BatteryAction(below_pct=None, words="RTL below 1000 mAh or 14.4 V (BATT_FS_LOW_ACT=2)"),),
            ),
            BatteryRule(
                said=False, actions=(BatteryAction(below_pct=20.0, words="RTL below 20 % (BATT_FS_LOW_ACT=2)"),)
            ),
            BatteryRule(
                said=False, actions=(BatteryAction(below_pct=None, words="RTL below 14.4 V (BATT_FS_LOW_ACT=2)"),)
            ),
            BatteryRule(
                said=False,
                actions=(
                    BatteryAction(
                        below_pct=20.0,
                        words="unknown action below 20 % or 14.4 V (BATT_FS_LOW_ACT=99)",
                    ),
                ),
            ),
            BatteryRule(said=False, actions=()),
            BatteryRule(said=False, actions=()),
            BatteryRule(
                said=False, actions=(BatteryAction(below_pct=None, words="RTL below 1 mAh (BATT_FS_LOW_ACT=2)"),)
            ),
            BatteryRule(
                said=False, actions=(BatteryAction(below_pct=None, words="RTL below 1 V (BATT_FS_LOW_ACT=2)"),)
            ),
        ],
    ),
    (
        "what PX4 does on a low battery",
        lambda: [
            failsafes.battery_rule(PX4, parameters)
            for parameters in (
                {},
                {"COM_LOW_BAT_ACT": 3.0, "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05},
                {"COM_LOW_BAT_ACT": 2.0, "BAT_CRIT_THR": 0.07},
            )
        ],
        [
            BatteryRule(said=False, actions=()),
            BatteryRule(
                said=True,
                actions=(
                    BatteryAction(below_pct=7.0, words="RTL below 7 % (COM_LOW_BAT_ACT=3)"),
                    BatteryAction(below_pct=5.0, words="land below 5 % (COM_LOW_BAT_ACT=3)"),
                ),
            ),
            BatteryRule(said=True, actions=(BatteryAction(below_pct=7.0, words="land below 7 % (COM_LOW_BAT_ACT=2)"),)),
        ],
    ),
    (
        "which fence a vehicle keeps to",
        lambda: [
            failsafes.geofence(ARDUPILOT, parameters)
            for parameters in (
                {},
                FENCE,
                FENCE | {"FENCE_ENABLE": 0.0},
                FENCE | {"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 1.0},
                FENCE | {"FENCE_TYPE": 1.0},
                FENCE | {"FENCE_TYPE": 2.0},
                FENCE | {"FENCE_TYPE": 4.0},
                FENCE | {"FENCE_RADIUS": 0.0},
                FENCE | {"FENCE_ALT_MAX": 0.0},
                {"FENCE_ENABLE": 1.0},
                {"FENCE_ENABLE": 1.0, "FENCE_RADIUS": 1.0},
                {"FENCE_ENABLE": 1.0, "FENCE_ALT_MAX": 1.0},
            )
        ],
        [
            None,
            Cylinder(height_m=80.0, radius_m=300.0),
            None,
            Cylinder(height_m=80.0, radius_m=300.0),
            Cylinder(height_m=80.0, radius_m=None),
            Cylinder(height_m=None, radius_m=300.0),
            None,
            Cylinder(height_m=80.0, radius_m=None),
            Cylinder(height_m=None, radius_m=300.0),
            None,
            Cylinder(height_m=None, radius_m=1.0),
            Cylinder(height_m=1.0, radius_m=None),
        ],
    ),
    (
        "which fence PX4 keeps to",
        lambda: [
            failsafes.geofence(PX4, parameters)
            for parameters in (
                {},
                {"GF_ACTION": 3.0, "GF_MAX_VER_DIST": 60.0},
                {"GF_ACTION": 3.0, "GF_MAX_HOR_DIST": 200.0},
                {"GF_ACTION": 0.0, "GF_MAX_HOR_DIST": 200.0},
            )
        ],
        [None, Cylinder(height_m=60.0, radius_m=None), Cylinder(height_m=None, radius_m=200.0), None],
    ),
    (
        "kinds of vehicles in words",
        lambda: {number: firmware.vehicle_words(number) for number in range(36)},
        {
            0: "generic vehicle",
            1: "fixed wing",
            2: "quadrotor",
            3: "coaxial helicopter",
            4: "helicopter",
            5: "antenna tracker",
            6: "vehicle of type 6",
            7: "airship",
            8: "balloon",
            9: "vehicle of type 9",
            10: "ground rover",
            11: "boat",
            12: "submarine",
            13: "hexarotor",
            14: "octorotor",
            15: "tricopter",
            16: "flapping wing",
            17: "vehicle of type 17",
            18: "vehicle of type 18",
            19: "tail-sitter",
            20: "tail-sitter",
            21: "tilt-rotor",
            22: "VTOL",
            23: "tail-sitter",
            24: "tilt-wing",
            25: "VTOL",
            26: "vehicle of type 26",
            27: "vehicle of type 27",
            28: "vehicle of type 28",
            29: "dodecarotor",
            30: "vehicle of type 30",
            31: "vehicle of type 31",
            32: "vehicle of type 32",
            33: "vehicle of type 33",
            34: "vehicle of type 34",
            35: "decarotor",
        },
    ),
    (
        "vehicles without a kind, autopilots, versions",
        lambda: [
            firmware.vehicle_words(None),
            *map(firmware.autopilot_words, (3, 8, 12, 4)),
            *(
                str(firmware.banner_version(text))
                for text in (
                    "ArduCopter V4.7",
                    "ArduCopter V4.7.2-rc1",
                    "PX4 v1.15.4",
                    "APM:Copter V3.3.3",
                    "Rover V4.5",
                )
            ),
        ],
        [
            "vehicle of unknown type",
            "ArduPilot",
            "no autopilot",
            "PX4",
            "autopilot 4",
            "4.7.0",
            "4.7.2-rc",
            "1.15.4",
            "3.3.3",
            "None",
        ],
    ),
    (
        "who speaks for a system",
        lambda: [
            speaker.speaker_after(known, component, Heartbeat(autopilot, 0, False, 4, kind))
            for known in (Speaker(), Speaker(1, heard=True), Speaker(5), Speaker(5, heard=True))
            for component, autopilot, kind in ((1, 3, 2), (5, 3, 2), (7, 12, 13), (7, 8, 26), (7, 3, 26), (7, 0, 2))
        ],
        [
            Speaker(heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=7, heard=True),
            Speaker(),
            Speaker(),
            Speaker(),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=7, heard=True),
            Speaker(component=5),
            Speaker(component=5),
            Speaker(component=5),
            Speaker(heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=5, heard=True),
            Speaker(component=5, heard=True),
        ],
    ),
    (
        "times in words",
        lambda: [words.minutes(seconds) for seconds in (-3, 0, 59.9, 60, 3599, 3600, 7325)],
        ["0:00", "0:00", "0:59", "1:00", "59:59", "1:00:00", "2:02:05"],
    ),
    (
        "times since the take-off in words",
        lambda: [words.since_take_off(seconds) for seconds in (None, -0.1, 0.0, 61.0)],
        ["", "", "T+0:00", "T+1:01"],
    ),
    (
        "satellites in words",
        lambda: [
            words.gps(fix, satellites)
            for fix, satellites in ((None, 3), *((fix, None) for fix in range(8)), (3, 0), (3, 9))
        ],
        ["?", "no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK", "fix 7", "3D, 0 sat", "3D, 9 sat"],
    ),
    (
        "what may be true of a place",
        lambda: [
            plausible.plausible(Position(1.0, lat_deg, lon_deg, alt_m, rel_m, speed_m_s, 0.0, 0.0, heading_deg))
            is not None
            for lat_deg, lon_deg, alt_m, rel_m, speed_m_s, heading_deg in (
                (90.0, 180.0, -1000.0, 20000.0, 150.0, 360.0),
                (90.1, 0.0, 0.0, 0.0, 0.0, None),
                (0.0, 180.1, 0.0, 0.0, 0.0, None),
                (1.0, 0.0, -1000.1, 0.0, 0.0, None),
                (1.0, 0.0, 0.0, 20000.1, 0.0, None),
                (0.0, 1.0, 0.0, 0.0, -150.1, None),
            )
        ],
        [True, False, False, False, False, False],
    ),
    (
        "what may be true of a heading",
        lambda: [
            getattr(
                plausible.plausible(Position(1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, heading_deg)), "heading_deg", None
            )
            for heading_deg in (0.0, -0.1, 360.0, 360.1)
        ],
        [0.0, None, 360.0, None],
    ),
    (
        "what may be true of a battery",
        lambda: [
            plausible.plausible(Battery(0, percent, volts_v, current_a, consumed_ah, 1, 0, cells_v))
            for percent, volts_v, current_a, consumed_ah, cells_v in (
                (0.0, 1.0, 0.0, 0.0, (0.5,)),
                (100.0, 500.0, 1000.0, 1000.0, (4.9,)),
                (-0.1, 0.9, -0.1, -0.1, (0.4,)),
                (100.1, 500.1, 1000.1, 1000.1, (5.0,)),
            )
        ],
        [
            Battery(
                battery=0,
                remaining_pct=0.0,
                voltage_v=1.0,
                current_a=0.0,
                consumed_ah=0.0,
                charge_state=1,
                faults=0,
                cells_v=(0.5,),
            ),
            Battery(
                battery=0,
                remaining_pct=100.0,
                voltage_v=500.0,
                current_a=NOW_S,
                consumed_ah=NOW_S,
                charge_state=1,
                faults=0,
                cells_v=(4.9,),
            ),
            Battery(
                battery=0,
                remaining_pct=None,
                voltage_v=None,
                current_a=None,
                consumed_ah=None,
                charge_state=1,
                faults=0,
            ),
            Battery(
                battery=0,
                remaining_pct=None,
                voltage_v=None,
                current_a=None,
                consumed_ah=None,
                charge_state=1,
                faults=0,
            ),
        ],
    ),
    (
        "what may be true of a status",
        lambda: [
            plausible.plausible(SystemStatus(percent, volts_v, 0, None))
            for percent, volts_v in ((0.0, 1.0), (100.0, 500.0), (-0.1, 0.9), (100.1, 1.0), (1.0, 500.1))
        ],
        [
            SystemStatus(remaining_pct=0.0, voltage_v=1.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=100.0, voltage_v=500.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=None, voltage_v=None, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=None, voltage_v=1.0, unhealthy=0, prearm_ok=None),
            SystemStatus(remaining_pct=1.0, voltage_v=None, unhealthy=0, prearm_ok=None),
        ],
    ),
    (
        "what may be true of an attitude",
        lambda: [
            plausible.plausible(Attitude(roll_deg, pitch_deg)) is not None
            for roll_deg, pitch_deg in ((360.0, -360.0), (360.1, 0.0), (0.0, -360.1))
        ],
        [True, False, False],
    ),
    (
        "what may be true of the rest",
        lambda: [
            plausible.plausible(one) is not None
            for one in (
                Gps(0, None),
                Gps(8, None),
                Gps(9, None),
                Gps(-1, None),
                Wind(0.0, 0.0),
                Wind(150.0, 360.0),
                Wind(150.1, 0.0),
                Wind(-0.1, 0.0),
                Wind(1.0, 360.1),
                Wind(1.0, -0.1),
                MissionCurrent(0, None),
                MissionCurrent(65534, None),
                MissionCurrent(65535, None),
                MissionCurrent(-1, None),
                MissionReached(0),
                MissionReached(65534),
                MissionReached(65535),
                MissionReached(-1),
            )
        ],
        [
            True,
            True,
            False,
            False,
            True,
            True,
            False,
            False,
            False,
            False,
            True,
            True,
            False,
            False,
            True,
            True,
            False,
            False,
        ],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
