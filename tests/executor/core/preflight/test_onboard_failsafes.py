"""What a vehicle does without us and on a low battery, and its fence, read off its parameters."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executor.core.preflight import onboard_failsafes
from executor.core.preflight.onboard_failsafes import (
    BatteryAction,
    LinkFailsafe,
)
from missions import ARDUPILOT, PX4, list_other_names
from tests.executor.core.steps import rounded

ARDU = {"FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 7.0, "SYSID_MYGCS": 254.0}
PACK = {"BATT_FS_LOW_ACT": 2.0, "BATT_LOW_MAH": 1000.0, "BATT_LOW_VOLT": 14.4, "BATT_CAPACITY": 5000.0}
NO_FENCE = (None, None)
FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 3.0, "FENCE_ALT_MAX": 80.0, "FENCE_RADIUS": 300.0}

ROWS: list[tuple[str, Callable[[], object], object]] = [
    (
        "action without the ground station",
        lambda: [
            onboard_failsafes.read_link_failsafe(ARDUPILOT, parameters)
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
            LinkFailsafe(acts=None, after_s=5.0, words="GCS failsafe not known: it has no FS_GCS_ENABLE"),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: RTL after 7 s (FS_GCS_ENABLE=1)", returns=True),
            LinkFailsafe(
                acts=False,
                after_s=7.0,
                words="no GCS failsafe (FS_GCS_ENABLE=0): without a link it flies its mission to the end",
            ),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: land after 7 s (FS_GCS_ENABLE=5)"),
            LinkFailsafe(acts=None, after_s=7.0, words="GCS failsafe: unknown action after 7 s (FS_GCS_ENABLE=99)"),
            LinkFailsafe(
                acts=False, after_s=7.0, words="no GCS failsafe in a mission (FS_GCS_ENABLE=1, but FS_OPTIONS=2)"
            ),
            LinkFailsafe(acts=True, after_s=7.0, words="GCS failsafe: RTL after 7 s (FS_GCS_ENABLE=1)", returns=True),
            LinkFailsafe(
                acts=False, after_s=7.0, words="no GCS failsafe in a mission (FS_GCS_ENABLE=1, but FS_OPTIONS=6)"
            ),
        ],
    ),
    (
        "action of PX4 without the ground station",
        lambda: [
            onboard_failsafes.read_link_failsafe(PX4, parameters)
            for parameters in (
                {},
                {"NAV_DLL_ACT": 2.0},
                {"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 20.0, "COM_FAIL_ACT_T": 7.0},
                {"NAV_DLL_ACT": 0.0},
                {"NAV_DLL_ACT": 2.0, "COM_DLL_EXCEPT": 1.0},
            )
        ],
        [
            LinkFailsafe(acts=None, after_s=17.0, words="GCS failsafe not known: it has no NAV_DLL_ACT", holds_s=5.0),
            LinkFailsafe(
                acts=True, after_s=17.0, words="GCS failsafe: RTL after 17 s (NAV_DLL_ACT=2)", returns=True, holds_s=5.0
            ),
            LinkFailsafe(
                acts=True, after_s=29.0, words="GCS failsafe: RTL after 29 s (NAV_DLL_ACT=2)", returns=True, holds_s=7.0
            ),
            LinkFailsafe(
                acts=False,
                after_s=17.0,
                words="no GCS failsafe (NAV_DLL_ACT=0): without a link it flies its mission to the end",
                holds_s=5.0,
            ),
            LinkFailsafe(
                acts=False,
                after_s=17.0,
                words="no GCS failsafe in a mission (NAV_DLL_ACT=2, but COM_DLL_EXCEPT=1)",
                holds_s=5.0,
            ),
        ],
    ),
    (
        "stations whose HEARTBEATs count",
        lambda: [
            onboard_failsafes.find_watched_station(ARDUPILOT, parameters)
            for parameters in ({}, ARDU, ARDU | {"MAV_GCS_SYSID": 3.0})
        ],
        [None, ("SYSID_MYGCS", 254), ("MAV_GCS_SYSID", 3)],
    ),
    (
        "requested parameters",
        lambda: [onboard_failsafes.list_preflight_parameters(dialect) for dialect in (ARDUPILOT, PX4)],
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
                "FENCE_ACTION",
                "WPNAV_ACCEL",
                "WPNAV_JERK",
                "WPNAV_ACCEL_Z",
                "WPNAV_SPEED_UP",
                "WPNAV_SPEED_DN",
                "LAND_SPEED",
                "LAND_ALT_LOW",
                "WPNAV_SPEED",
                "RTL_SPEED",
                "MOT_BAT_VOLT_MAX",
            ),
            (
                "NAV_DLL_ACT",
                "COM_DL_LOSS_T",
                "COM_FAIL_ACT_T",
                "COM_DLL_EXCEPT",
                "COM_FLTT_LOW_ACT",
                "COM_LOW_BAT_ACT",
                "BAT_CRIT_THR",
                "BAT_EMERGEN_THR",
                "GF_ACTION",
                "GF_MAX_VER_DIST",
                "GF_MAX_HOR_DIST",
                "MPC_ACC_HOR",
                "MPC_Z_V_AUTO_UP",
                "MPC_Z_V_AUTO_DN",
                "MPC_Z_VEL_MAX_DN",
                "MPC_TKO_SPEED",
                "MPC_XY_CRUISE",
                "BAT1_CAPACITY",
                "BAT1_N_CELLS",
            ),
        ],
    ),
    (
        "requested parameters by their other names",
        lambda: [
            list_other_names(ARDUPILOT, ["MAV_GCS_SYSID", "FS_OPTIONS", "WPNAV_SPEED"], parameters)
            for parameters in ({}, {"MAV_GCS_SYSID": 3.0}, {"WPNAV_SPEED": 1.0})
        ],
        [("SYSID_MYGCS", "WP_SPD"), ("WP_SPD",), ("SYSID_MYGCS",)],
    ),
    (
        "action on a low battery",
        lambda: [
            onboard_failsafes.list_battery_actions(ARDUPILOT, parameters)
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
            [],
            [],
            [BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)")],
            [BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)")],
            [
                BatteryAction(below_pct=20.0, words="RTL below 20 % or 14.4 V (BATT_FS_LOW_ACT=2)"),
                BatteryAction(below_pct=10.0, words="land below 10 % (BATT_FS_CRT_ACT=1)"),
            ],
            [BatteryAction(below_pct=None, words="RTL below 1000 mAh or 14.4 V (BATT_FS_LOW_ACT=2)")],
            [BatteryAction(below_pct=20.0, words="RTL below 20 % (BATT_FS_LOW_ACT=2)")],
            [BatteryAction(below_pct=None, words="RTL below 14.4 V (BATT_FS_LOW_ACT=2)")],
            [
                BatteryAction(
                    below_pct=20.0, words="unknown action below 20 % or 14.4 V (BATT_FS_LOW_ACT=99)", known=False
                )
            ],
            [],
            [],
            [BatteryAction(below_pct=None, words="RTL below 1 mAh (BATT_FS_LOW_ACT=2)")],
            [BatteryAction(below_pct=None, words="RTL below 1 V (BATT_FS_LOW_ACT=2)")],
        ],
    ),
    (
        "action of PX4 on a low battery",
        lambda: [
            onboard_failsafes.list_battery_actions(PX4, parameters)
            for parameters in (
                {},
                {"COM_LOW_BAT_ACT": 3.0, "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05},
                {"COM_LOW_BAT_ACT": 2.0, "BAT_CRIT_THR": 0.07},
            )
        ],
        [
            [],
            [
                BatteryAction(below_pct=7.0, words="RTL below 7 % (COM_LOW_BAT_ACT=3)"),
                BatteryAction(below_pct=5.0, words="land below 5 % (COM_LOW_BAT_ACT=3)"),
            ],
            [BatteryAction(below_pct=7.0, words="land below 7 % (COM_LOW_BAT_ACT=2)")],
        ],
    ),
    (
        "fence of a vehicle",
        lambda: [
            onboard_failsafes.read_geofence(ARDUPILOT, parameters)
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
            NO_FENCE,
            (80.0, 300.0),
            NO_FENCE,
            (80.0, 300.0),
            (80.0, None),
            (None, 300.0),
            NO_FENCE,
            (80.0, None),
            (None, 300.0),
            NO_FENCE,
            (None, 1.0),
            (1.0, None),
        ],
    ),
    (
        "fence of a PX4 vehicle",
        lambda: [
            onboard_failsafes.read_geofence(PX4, parameters)
            for parameters in (
                {},
                {"GF_ACTION": 3.0, "GF_MAX_VER_DIST": 60.0},
                {"GF_ACTION": 3.0, "GF_MAX_HOR_DIST": 200.0},
                {"GF_ACTION": 0.0, "GF_MAX_HOR_DIST": 200.0},
            )
        ],
        [NO_FENCE, (60.0, None), (None, 200.0), NO_FENCE],
    ),
]


@pytest.mark.parametrize(("what", "found", "expected"), ROWS, ids=[row[0] for row in ROWS])
def test_everything_that_comes_of_it(what: str, found: Callable[[], object], expected: object) -> None:
    assert rounded(found()) == expected
