"""Which vehicle and which firmware: what heartbeat, version message and start-up texts say."""

from __future__ import annotations

import re

from executor.core.interface.messages import Version
from missions import AUTOPILOTS

AUTOPILOT_NAMES = {8: "no autopilot"} | {dialect.number: dialect.title for dialect in AUTOPILOTS}
"""MAV_AUTOPILOT, as far as it can be met."""
MULTICOPTERS = {
    2: "quadrotor", 13: "hexarotor", 14: "octorotor", 15: "tricopter", 29: "dodecarotor", 35: "decarotor",
}  # fmt: skip
"""MAV_TYPE of what can hover, turn on the spot and fly the missions of this program."""
OTHERS = {
    0: "generic vehicle", 1: "fixed wing", 3: "coaxial helicopter", 4: "helicopter", 5: "antenna tracker",
    7: "airship", 8: "balloon", 10: "ground rover", 11: "boat", 12: "submarine", 16: "flapping wing",
    19: "tail-sitter", 20: "tail-sitter", 21: "tilt-rotor", 22: "VTOL", 23: "tail-sitter", 24: "tilt-wing", 25: "VTOL",
}  # fmt: skip
"""MAV_TYPE of what cannot."""

_BANNER = re.compile(r"(?:ArduCopter|APM:Copter|PX4\D*?)\s*[Vv]?(\d+)\.(\d+)(?:\.(\d+))?(?:-?(dev|alpha|beta|rc))?")


def parse_banner_version(text: str) -> Version | None:
    """Return the version that a start-up text names; None if it names none.

    >>> str(parse_banner_version("ArduCopter V4.7.0-dev (6a1b8c2d)"))
    '4.7.0-dev'
    >>> parse_banner_version("EKF3 IMU0 is using GPS") is None
    True
    """
    found = _BANNER.match(text)
    if found is None:
        return None
    major, minor, patch, release = found.groups()
    return Version(int(major), int(minor), int(patch or 0), release or "")


def describe_vehicle_type(vehicle_type: int | None) -> str:
    """Return a MAV_TYPE in words."""
    if vehicle_type is None:
        return "vehicle of unknown type"
    return MULTICOPTERS.get(vehicle_type) or OTHERS.get(vehicle_type) or f"vehicle of type {vehicle_type}"


def describe_autopilot(autopilot: int) -> str:
    """Return a MAV_AUTOPILOT in words."""
    return AUTOPILOT_NAMES.get(autopilot, f"autopilot {autopilot}")
