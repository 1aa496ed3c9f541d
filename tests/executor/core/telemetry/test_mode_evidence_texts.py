"""What an autopilot's texts say has failed."""

from __future__ import annotations

import pytest

from executor.core.telemetry.mode_evidence import has_failsafe_action, parse_failure_text

SAID = {
    # ArduPilot 3.3 to 4.7
    "Low Battery!": "battery",
    "Low battery": "battery",
    "Battery 1 is low 10.22V used 1476 mAh": "battery",
    "Battery 2 is critical 9.80V used 3000 mAh": "battery",
    "Battery Failsafe": "battery",
    "Radio + Battery Failsafe - Continuing Landing": "battery",
    "Crash: Disarming": "crash",
    "Crash: Disarming: AngErr=40>30, Accel=0.0<3.0": "crash",
    "Parachute: Released": "crash",
    "EKF Failsafe: changed to LAND Mode": "ekf",
    "GPS Failsafe": "gps",
    "DeadReckon Failsafe": "gps",
    "Potential Thrust Loss (3)": "motor",
    "Vibration compensation ON": "vibration",
    "Vibration Failsafe": "vibration",
    "Max Alt fence breached": "fence",
    "Radio Failsafe": "rc",
    "GCS Failsafe": "ground station",
    "Failsafe: Terrain data missing": "terrain",
    # from 4.8 on
    "Failsafe: Terrain Rangefinder Unhealthy": "terrain",
    "Failsafe: Terrain Unavailable": "terrain",
    "Radio Failsafe - Continuing Auto Mode": "rc",
    # PX4 1.11 to 1.17
    "CRITICAL BATTERY, RETURNING TO LAND": "battery",
    "Critical battery": "battery",
    "Emergency battery level": "battery",
    "Dangerously low battery! Shutting system down": "battery",
    "Battery 1 disconnected": "battery",
    "Failsafe activated due to critical battery, triggering Return": "battery",
    "Failsafe enabled: no RC": "rc",
    "Manual control lost": "rc",
    # from 1.18 on
    "Manual control lost: switching to Hold": "rc",
    "Failsafe enabled: no datalink": "ground station",
    "Data link lost": "ground station",
    "Failsafe enabled: no local position": "ekf",
    "Critical navigation failure! Check sensor calibration": "ekf",
    "Motor failure detected": "motor",
    "Geofence exceeded": "fence",
    "Failsafe activated": "other",
    "Flight termination active": "other",
}
SILENT = (
    "PreArm: Battery 1 is low", "Arm: Compass calibration running", "PreArm: Throttle below Failsafe",
    "PreArm: Radio failsafe on", "Preflight Fail: Battery unhealthy", "GPS Glitch cleared", "EKF Failsafe Cleared",
    "GCS Failsafe Cleared", "Manual control regained", "EKF2 IMU0 in-flight yaw alignment complete", "GROUND START",
    "Reached command #3", "SIM Hit ground at 0.5 m/s", "EKF variance", "EKF variance: position lost", "GPS Glitch",
    "Low battery, return advised",
)  # fmt: skip


@pytest.mark.parametrize(("text", "kind"), SAID.items())
def test_what_failed(text: str, kind: str) -> None:
    found = parse_failure_text(text, low_acts=True)
    assert found is not None
    assert (found.what, found.words, found.active) == (kind, text, True)


@pytest.mark.parametrize("text", SILENT)
def test_what_says_of_no_failure(text: str) -> None:
    assert parse_failure_text(text, low_acts=True) is None


def test_low_battery_is_a_failsafe_of_one_autopilot_and_advice_of_the_other() -> None:
    assert parse_failure_text("Low battery", low_acts=False) is None
    assert parse_failure_text("Critical battery", low_acts=False) is not None


@pytest.mark.parametrize(
    ("text", "does"),
    [
        ("Battery Failsafe", True),
        ("EKF Failsafe: changed to LAND Mode", True),
        ("Radio Failsafe - Continuing Auto Mode", False),
        ("Vibration compensation ON", False),
        ("Potential Thrust Loss (3)", False),
        ("Failsafe: Terrain data missing", True),
        ("Failsafe: Terrain Rangefinder Unhealthy", True),
        ("EKF Failsafe: changed to RTL Mode", True),
        ("Manual control lost: switching to Hold", True),
    ],
)
def test_whether_it_does_something_about_it(text: str, does: bool) -> None:
    found = parse_failure_text(text, low_acts=True)
    assert found is not None
    assert has_failsafe_action(found) is does
