"""MAVLink's numbers in the words of the answers, and what of a message is essential."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from missions import MissionItem

MISSION_STATES = {0: "state unknown", 1: "no mission", 2: "not started", 3: "active", 4: "paused", 5: "complete"}
LANDED_STATES = {0: "ground unknown", 1: "on the ground", 2: "in the air", 3: "taking off", 4: "landing"}
COPTER_MODES = {
    0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 17: "BRAKE", 27: "AUTO_RTL"
}  # fmt: skip
PX4_MAIN = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 4: "AUTO"}
PX4_AUTO = {1: "READY", 2: "TAKEOFF", 3: "LOITER", 4: "MISSION", 5: "RTL", 6: "LAND"}
BACKGROUND = re.compile(r"PreArm: |EKF3 |SIM |AHRS: |\w+ #\d fail")
"""Texts that come when the vehicle feels like it, or when its simulator gets no processor."""
FIELDS = ("frame", "command", "current", "autocontinue", "param1", "param2", "param3", "param4", "x", "y", "z")


def mode(autopilot: str, custom_mode: int) -> str:
    """Return a flight mode's name."""
    if autopilot == "ardupilot":
        return COPTER_MODES.get(custom_mode, f"mode {custom_mode}")
    main, sub = custom_mode >> 16 & 255, custom_mode >> 24
    name = PX4_MAIN.get(main, f"mode {main}")
    return f"{name}.{PX4_AUTO.get(sub, sub)}" if name == "AUTO" else name


def _enum(enum: str, number: int, prefix: str) -> str:
    entry = mavlink.enums[enum].get(number)
    return str(number) if entry is None else entry.name.removeprefix(prefix)


def mission_result(number: int) -> str:
    """Return MAV_MISSION_RESULT by name."""
    return "ACCEPTED" if number == 0 else _enum("MAV_MISSION_RESULT", number, "MAV_MISSION_")


def command_name(number: int) -> str:
    """Return MAV_CMD by name."""
    return _enum("MAV_CMD", number, "MAV_CMD_")


def capabilities(bits: int) -> str:
    """Return the capabilities by their bits' numbers."""
    return " ".join(str(bit) for bit in range(64) if bits >> bit & 1)


def essence(message: Any) -> str | None:
    """Return what of an answer is compared; None for telemetry."""
    name = message.get_type()
    match name:
        case "COMMAND_ACK":
            return f"{command_name(message.command)} {_enum('MAV_RESULT', message.result, 'MAV_RESULT_')}"
        case "MISSION_ACK":
            return f"MISSION_ACK {mission_result(message.type)}"
        case "MISSION_REQUEST" | "MISSION_REQUEST_INT":
            return f"{name} {message.seq}"
        case "MISSION_COUNT":
            return f"MISSION_COUNT {message.count}"
        case "PARAM_VALUE":
            kind = _enum("MAV_PARAM_TYPE", message.param_type, "MAV_PARAM_TYPE_")
            index = "no index" if message.param_index == 65535 else "its index"
            return f"PARAM_VALUE {message.param_id} {kind}, {index}"
        case "PARAM_ERROR":
            return f"PARAM_ERROR {message.param_id} {_enum('MAV_PARAM_ERROR', message.error, 'MAV_PARAM_ERROR_')}"
        case "AUTOPILOT_VERSION":
            version = message.flight_sw_version
            number = ".".join(str(version >> shift & 255) for shift in (24, 16, 8))
            kind = _enum("FIRMWARE_VERSION_TYPE", version & 255, "FIRMWARE_VERSION_TYPE_")
            return f"AUTOPILOT_VERSION {number} {kind}, capabilities {capabilities(message.capabilities)}"
        case _:
            return None


def texts(said: Sequence[str]) -> tuple[str, ...]:
    """Return texts in the order of their first coming, without what is measured in them."""
    said = [text for text in said if not BACKGROUND.match(text)]
    kept = (re.sub(r"^Arm: .*", "Arm: #", re.sub(r"-?\d+\.\d+|\d+(?= m\b)", "#", text.strip())) for text in said)
    return tuple(dict.fromkeys(text for text in kept if text))


def rewritten(sent: Sequence[MissionItem], back: Sequence[Any], *, home_item: bool) -> list[str]:
    """Return the fields that came back changed, each with the items that it is changed of."""
    changed: dict[str, list[int]] = {}
    for item, other in zip(sent, back, strict=False):
        if item.seq == 0 and home_item:
            continue
        for name in FIELDS:
            was, now = getattr(item, name), getattr(other, name)
            if abs(float(was) - float(now)) > (1e-3 if name != "z" else 0.011):
                changed.setdefault(f"{name} {float(was):g} as {float(now):g}", []).append(item.seq)
    return [f"{what}: items {' '.join(str(seq) for seq in seqs)}" for what, seqs in changed.items()]
