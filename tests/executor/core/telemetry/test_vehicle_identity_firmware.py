"""What start-up texts and heartbeats say of a firmware."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.core.preflight.vehicle_checks import PREARM_SENSORS, parse_prearm_reason
from executor.core.telemetry.vehicle_identity import AUTOPILOT_NAMES, MULTICOPTERS, OTHER_TYPES, parse_banner_version


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("ArduCopter V4.7.0-dev (6a1b8c2d)", "4.7.0-dev"), ("ArduCopter V4.6.2 (2a3dc4b7)", "4.6.2"),
        ("APM:Copter V3.3.3 (acf4b6c2)", "3.3.3"), ("ArduPlane V4.6.2 (2a3dc4b7)", None), ("ChibiOS: 88b84600", None),
        ("Frame: QUAD/X", None),
    ],
)  # fmt: skip
def test_the_version_in_a_banner(text: str, version: str | None) -> None:
    found = parse_banner_version(text)
    assert (None if found is None else str(found)) == version


def test_types_autopilots_and_sensors_have_pymavlinks_numbers() -> None:
    types = {number: entry.name for number, entry in mav.enums["MAV_TYPE"].items()}
    expected = {"QUADROTOR", "HEXAROTOR", "OCTOROTOR", "TRICOPTER", "DODECAROTOR", "DECAROTOR"}
    assert {types[number].removeprefix("MAV_TYPE_") for number in MULTICOPTERS} == expected
    assert all(number in types for number in OTHER_TYPES)
    assert AUTOPILOT_NAMES[mav.MAV_AUTOPILOT_PX4] == "PX4"
    assert AUTOPILOT_NAMES[mav.MAV_AUTOPILOT_ARDUPILOTMEGA] == "ArduPilot"
    names = {number: entry.name for number, entry in mav.enums["MAV_SYS_STATUS_SENSOR"].items()}
    assert names[0x20] == "MAV_SYS_STATUS_SENSOR_GPS"
    assert all(bit in names for bit in PREARM_SENSORS)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("PreArm: Compass not calibrated", "Compass not calibrated"), ("Preflight Fail: No GPS", "No GPS"),
        ("Arm: Mode not armable", "Mode not armable"), ("Takeoff detected", None), ("PreArm:", None),
    ],
)  # fmt: skip
def test_the_reason_in_a_text(text: str, reason: str | None) -> None:
    assert parse_prearm_reason(text) == reason
