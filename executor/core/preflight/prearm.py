"""Why a vehicle does not let itself be armed, in words."""

from __future__ import annotations

from collections.abc import Mapping

from executor.core.interface.messages import SystemStatus

SENSORS = {
    0x1: "gyroscope", 0x2: "accelerometer", 0x4: "compass", 0x8: "barometer", 0x20: "GPS", 0x10000: "remote control",
    0x100000: "geofence", 0x200000: "attitude estimate", 0x1000000: "logging", 0x2000000: "battery",
    0x40000000: "motors",
}  # fmt: skip
"""MAV_SYS_STATUS_SENSOR, as far as a multicopter's crew can do something about it."""
PREFIXES = ("PreArm:", "Arm:", "Preflight Fail:", "Arming denied:", "Arming denied!")
"""What the autopilots put before a reason."""
VALID_S = 35.0
"""ArduPilot repeats the reasons every 30 s: an older one is settled."""
SHOWN = 3
"""More reasons than this are counted only."""


def parse_prearm_reason(text: str) -> str | None:
    """Return the reason that a text gives; None if it is about something else.

    >>> parse_prearm_reason("PreArm: Compass not calibrated")
    'Compass not calibrated'
    """
    for prefix in PREFIXES:
        if text.startswith(prefix):
            return text.removeprefix(prefix).strip() or None
    return None


def describe_prearm_failure(reasons_s: Mapping[str, float], status: SystemStatus | None, now_s: float) -> str:
    """Return why the pre-arm checks fail.

    Args:
        reasons_s: What the vehicle said, and when last.
        status: Its last SYS_STATUS.
        now_s: The time.
    """
    fresh = [reason for reason, said_s in reasons_s.items() if now_s - said_s <= VALID_S]
    parts = fresh[:SHOWN]
    if len(fresh) > SHOWN:
        parts.append(f"{len(fresh) - SHOWN} more")
    if not parts and status is not None:
        ill = [name for bit, name in SENSORS.items() if status.unhealthy & bit]
        if ill:
            parts.append(f"not healthy: {', '.join(ill)}")
    return "its own pre-arm checks fail" + (f": {'; '.join(parts)}" if parts else ", no reason reported")
