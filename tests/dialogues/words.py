"""MAVLink's numbers in the words of the answers, and what of a message is essential."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

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
