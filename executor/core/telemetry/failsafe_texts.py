"""What an autopilot says in words has failed: the texts of ArduPilot 3.3 to 4.7 and of PX4 1.11 to 1.17.

ArduPilot: events.cpp, ekf_check.cpp, crash_check.cpp, failsafe.cpp, fence.cpp of Copter, AP_BattMonitor, AP_Vehicle.
PX4: state_machine_helper.cpp and Commander.cpp up to 1.13, the health checks and failsafe/framework.cpp since.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from executor.core.interface.messages import OwnFailsafe

_NO_NEWS = re.compile(
    r"^\W*(pre-?arm|arm|arming|preflight)\b|preflight fail|cleared|regained|restored|recovered|disabled|not? fail",
    re.IGNORECASE,
)
"""What is said of arming is said on the ground; what is over has not failed."""
FENCE_BREACH = (
    r"fence breach|\bbreached\b|geo-?fence (violation\b(?! for)|violated|exceed|breach)|"
    r"geofence: (approaching|exceeding)"
)
"""ArduPilot names the kind, "Polygon fence breached"; PX4 1.17 says "Geofence: exceeding maximum altitude above Home",
up to 1.13 "Geofence violation". "Geofence violation for waypoint 2", "Geofence invalid, doesn't contain Home position"
and "Fence Indexed OK" are about what was uploaded (measured)."""
_KINDS: Mapping[str, str] = MappingProxyType(
    {
        # "Crash: Disarming: AngErr=40>30, Accel=0.0<3.0"
        "crash": r"\bcrash(:| detected)|parachute:? released",
        # "Battery 1 is low 10.22V used 1476 mAh", "Battery Failsafe"; "CRITICAL BATTERY, RETURNING TO LAND", "Emergency
        # battery level", "Battery 1 disconnected", "Failsafe activated due to critical battery, triggering Return"
        "battery": r"battery.* failsafe|(critical|emergency|dangerous(ly low)?) battery|due to .*battery|"
        r"battery (level )?(\d+ )?(is )?(critical|emergency|missing|disconnected|unhealthy|fail)|battery \d* ?is low|"
        r"remaining flight time low",
        # "EKF Failsafe: changed to Land Mode"; "Critical navigation failure! Check sensor calibration"
        "ekf": r"ekf failsafe|critical navigation fail|no (valid )?(local|global) position|position estimate lost|"
        r"failsafe enabled: no (local|global) pos|invalid .*position estimate",
        "gps": r"gps failsafe|dead ?reckon\w* failsafe|lost gps|failsafe enabled: no gps",
        "compass": r"compass failsafe|compass .*(failed|failure)",
        # "Potential Thrust Loss (3)"; "Motor failure detected", "Attitude failure (roll)"
        "motor": r"potential thrust loss|(motor|esc)\w* fail|failure detect|critical failure|attitude failure",
        "vibration": r"vibration failsafe|vibration compensation on",
        "fence": FENCE_BREACH,
        "rc": r"(radio|rc|throttle) failsafe|(manual control|rc signal|rc link|manual control signal) lost|"
        r"failsafe enabled: no rc|due to .*(manual control|rc )",
        "ground station": r"gcs failsafe|(data ?link|gcs connection|connection to ground (control )?station) lost|"
        r"failsafe enabled: no data ?link|due to .*(data ?link|gcs)",
        "terrain": r"failsafe: terrain|terrain failsafe",
        "other": r"terminat(ed|ion)|internal error|cpu failsafe|^failsafe (mode )?(activated|enabled)",
    }
)
"""By kind, the most important first."""
_PATTERNS = tuple((kind, re.compile(pattern, re.IGNORECASE)) for kind, pattern in _KINDS.items())
_LOW = re.compile(r"^low battery!?$", re.IGNORECASE)
"""ArduPilot up to 3.5 says no more than this of its battery failsafe; PX4's means that it is time to come home."""
_WARNS = re.compile(
    r"glitch|variance|compass|terrain data$|late frames|barometer|internal error|compensation|thrust loss|avoids",
    re.IGNORECASE,
)
"""Worth a word; what its autopilot does about it, if anything, is said by another text."""
_GOES_ON = re.compile(r"continuing|warning triggered|advised", re.IGNORECASE)
"""It says that it does nothing about it."""


_ALARM = re.compile(
    rf"failsafe|{FENCE_BREACH}|\bkill|\bcrash|terminat|parachute|emergency|thrust loss|motor fail|critical battery|"
    r"low battery|"
    r"battery .*(low|critical|missing|unhealthy|fail)|no valid mission",
    re.IGNORECASE,
)
"""What both autopilots say when a mission ends: "Battery Failsafe", "Crash: Disarming", "Battery 1 is low"."""
_CHANGES_MODE = re.compile(
    rf"^(?!.*cleared).*(failsafe|{FENCE_BREACH}|critical|emergency|terminat|crash|parachute|motor|thrust|"
    r"no valid mission)",
    re.IGNORECASE,
)
"""Texts after which an autopilot changes its mode; "Low battery" alone only warns."""
_STOPS = re.compile(r"emergency stop|kill", re.IGNORECASE)
_DISARMS = re.compile(r"disarm|crash|kill|emergency stop|terminat", re.IGNORECASE)


def is_alarm(text: str) -> bool:
    """Return whether a text may say why a mission ends."""
    return bool(_ALARM.search(text))


def may_change_mode(text: str) -> bool:
    """Return whether an autopilot changes its mode after a text."""
    return bool(_CHANGES_MODE.search(text))


def may_stop_motors(text: str) -> bool:
    """Return whether a text may say that somebody stops the motors."""
    return bool(_STOPS.search(text))


def may_explain_disarming(text: str) -> bool:
    """Return whether a text may say why a vehicle disarms in the air."""
    return bool(_DISARMS.search(text))


@lru_cache(maxsize=256)
def parse_failure_text(text: str, *, low_acts: bool) -> OwnFailsafe | None:
    """Return what a text says has failed, None if it says nothing of that.

    Args:
        text: Of the autopilot.
        low_acts: Whether "Low battery" is said by what acts on it: ArduPilot's.
    """
    text = text.strip()
    if _NO_NEWS.search(text):
        return None
    if low_acts and _LOW.match(text):
        return OwnFailsafe("battery", active=True, words=text)
    found = next((kind for kind, pattern in _PATTERNS if pattern.search(text)), None)
    return None if found is None else OwnFailsafe(found, active=True, words=text)


def has_failsafe_action(failed: OwnFailsafe) -> bool:
    """Return whether an autopilot does something about what failed, as far as its words tell."""
    return failed.active and not _GOES_ON.search(failed.words) and not _WARNS.search(failed.words)
