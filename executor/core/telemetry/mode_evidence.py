"""Collect evidence of which party changed a mode, and of failures: texts, PX4's events, commands, switches.

Texts are those of ArduPilot 3.3 to 4.7 and of PX4 1.11 to 1.17. ArduPilot: events.cpp, ekf_check.cpp, crash_check.cpp,
failsafe.cpp, fence.cpp of Copter, AP_BattMonitor, AP_Vehicle. PX4: state_machine_helper.cpp and Commander.cpp up to
1.13, the health checks and failsafe/framework.cpp since.

Since 1.14 PX4 sends "Failsafe activated" as a text, and the reason only as an event: a number with arguments. The
number is a hash of the event's name, the same in every version; arguments that a version does not have are zero. Of the
health checks only those that fail in the air are listed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType

from executor.core.interface.messages import (
    CRITICAL,
    Actor,
    EvidenceMessage,
    Heartbeat,
    ModeChange,
    OrderSeen,
    OwnFailsafe,
    RcChannels,
    VehicleSetting,
)
from executor.core.state.vehicle_parts import FOLLOWED_LATE_S, ModeEvidence, Orders, SwitchMove

_NO_FAILURE = re.compile(
    r"^\W*(pre-?arm|arm|arming|preflight)\b|preflight fail|cleared|regained|restored|recovered|disabled|not? fail",
    re.IGNORECASE,
)
"""Texts about arming, sent on the ground, and about failures that are over."""
FENCE_BREACH = (
    r"fence breach|\bbreached\b|geo-?fence (violation\b(?! for)|violated|exceed|breach)|"
    r"geofence: (approaching|exceeding)"
)
"""Breach texts. ArduPilot names the kind, "Polygon fence breached"; PX4 1.17 sends "Geofence: exceeding maximum
altitude above Home", up to 1.13 "Geofence violation". "Geofence violation for waypoint 2", "Geofence invalid, doesn't
contain Home position" and "Fence Indexed OK" concern uploads (measured)."""
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
        "other": r"terminat(ed|ion)|internal error|cpu failsafe|^failsafe (mode )?(activated|enabled)|"
        r"no valid mission",
    }
)
"""Patterns by kind, the most important first."""
_PATTERNS = tuple((kind, re.compile(pattern, re.IGNORECASE)) for kind, pattern in _KINDS.items())
_LOW = re.compile(r"^low battery!?$", re.IGNORECASE)
"""All that ArduPilot up to 3.5 sends about its battery failsafe; PX4's means that it is time to return."""
_WARNS_ONLY = re.compile(
    r"^(?!.*failsafe).*"
    r"(glitch|variance|compass|terrain data$|late frames|barometer|internal error|compensation|thrust loss|avoids)",
    re.IGNORECASE,
)
"""Warnings, none of which is called a failsafe; another text reports the autopilot's action, if there is one."""
_TAKES_NO_ACTION = re.compile(r"continuing|warning triggered|advised", re.IGNORECASE)
"""Texts that report no action."""


ALARM = re.compile(
    rf"failsafe|{FENCE_BREACH}|\bkill|\bcrash|terminat|parachute|emergency|thrust loss|motor fail|critical battery|"
    r"low battery|"
    r"battery .*(low|critical|missing|unhealthy|fail)|no valid mission",
    re.IGNORECASE,
)
"""Texts of both autopilots when a mission ends: "Battery Failsafe", "Crash: Disarming", "Battery 1 is low"."""
STOPS_MOTORS = re.compile(r"emergency stop|kill", re.IGNORECASE)
"""Texts about a motor stop, possibly by a person."""
EXPLAINS_DISARMING = re.compile(r"disarm|crash|kill|emergency stop|terminat", re.IGNORECASE)
"""Texts that may explain why a vehicle disarms in the air."""


@lru_cache(maxsize=256)
def parse_failure_text(text: str, *, low_acts: bool) -> OwnFailsafe | None:
    """Return the failure that a text reports; None if it reports none.

    Args:
        text: A text of the autopilot.
        low_acts: Whether "Low battery" means that the failsafe acts, as in ArduPilot.
    """
    text = text.strip()
    if _NO_FAILURE.search(text):
        return None
    if low_acts and _LOW.match(text):
        return OwnFailsafe("battery", active=True, words=text)
    found = next((kind for kind, pattern in _PATTERNS if pattern.search(text)), None)
    return None if found is None else OwnFailsafe(found, active=True, words=text)


def has_failsafe_action(failed: OwnFailsafe) -> bool:
    """Return whether an autopilot acts on a failure, by its text."""
    return failed.active and not _TAKES_NO_ACTION.search(failed.words) and not _WARNS_ONLY.search(failed.words)


ARGUMENT_BYTES = 25
"""Bytes of arguments in uORB's event; MAVLink's has room for 40."""
AUTOPILOT_EVENTS = 1 << 24
"""Component of the names, in the upper byte of the number."""
_BASIS, _PRIME, _WORD, _LOW_BITS = 0x811C9DC5, 0x01000193, 0xFFFFFFFF, 0xFFFFFF
"""FNV-1a of 32 bits, of which 24 are used."""
_ACTIONS: Mapping[int, str] = MappingProxyType({
    2: "Position", 3: "Altitude", 4: "Stabilized", 5: "Hold", 6: "RTL", 7: "Land", 8: "Descend", 9: "disarm",
    10: "termination",
})  # fmt: skip
"""failsafe_action_t; 0 is none, 1 only a warning."""
ACTION_AT, WARNS = 4, 1
_CAUSES: Mapping[int, tuple[str, str]] = MappingProxyType({
    1: ("rc", "manual control lost"), 2: ("ground station", "ground station lost"),
    3: ("battery", "low battery level"), 4: ("battery", "critical battery level"),
    5: ("battery", "emergency battery level"), 6: ("battery", "remaining flight time low"),
})  # fmt: skip
"""failsafe_cause_t; 0 is any other."""
UNNAMED = ("other", "")


def compute_event_id(name: str) -> int:
    """Return the number of a PX4 event.

    >>> compute_event_id("commander_failsafe_enter") & 0xFFFFFF
    9751178
    """
    value = _BASIS
    for letter in name.encode():
        value = (value ^ letter) * _PRIME & _WORD
    return value & _LOW_BITS | AUTOPILOT_EVENTS


def parse_px4_event(number: int, arguments: bytes) -> OwnFailsafe | ModeChange | None:
    """Return the failsafe or mode change that an event reports; None if neither.

    Args:
        number: The event's number.
        arguments: Packed, little-endian; missing ones are zero.
    """
    said, arguments = _BY_NUMBER.get(number), arguments.ljust(ARGUMENT_BYTES, b"\0")
    if isinstance(said, ActingFailsafe):
        return said.read(arguments)
    return said.get(arguments[0]) if isinstance(said, Mapping) else said


@dataclass(frozen=True, slots=True)
class ActingFailsafe:
    """Positions of the fields in a failsafe event; the action follows the intended mode."""

    cause_at: int | None = None
    delay_at: int | None = None

    def read(self, arguments: bytes) -> OwnFailsafe | None:
        """Return the failsafe; None if it only warns."""
        action = arguments[ACTION_AT]
        if action == WARNS:
            return None
        kind, why = UNNAMED if self.cause_at is None else _CAUSES.get(arguments[self.cause_at], UNNAMED)
        mode = _ACTIONS.get(action, "")
        delay_s = 0 if self.delay_at is None else int.from_bytes(arguments[self.delay_at : self.delay_at + 2], "little")
        then = f"switching to {mode}" + (f" in {delay_s} s" if delay_s else "") if mode else ""
        words = ", ".join(part for part in (why, then) if part)
        return OwnFailsafe(kind, active=True, words=f"failsafe: {words}" if words else "failsafe activated")


DISARMED_BY: Mapping[int, OwnFailsafe] = MappingProxyType({
    10: OwnFailsafe("attitude", True, "disarmed by its failure detector"),
    14: OwnFailsafe("other", True, "disarmed by a failsafe"),
})  # fmt: skip
"""arm_disarm_reason_t values that are neither a person's nor a landing's."""


EVENTS: Mapping[str, ActingFailsafe | OwnFailsafe | ModeChange | Mapping[int, OwnFailsafe]] = MappingProxyType({
    "commander_failsafe_enter": ActingFailsafe(cause_at=5),
    "commander_failsafe_enter_hold": ActingFailsafe(cause_at=7, delay_at=5),
    "commander_failsafe_enter_generic": ActingFailsafe(),
    "commander_failsafe_enter_generic_hold": ActingFailsafe(delay_at=5),
    "commander_failsafe_enter_autopilot_disengaged": ActingFailsafe(),
    "commander_rc_loss_hold_no_failsafe": OwnFailsafe("rc", True, "manual control lost, switching to Hold"),
    "check_battery_critical": OwnFailsafe("battery", True, "critical battery"),
    "check_battery_emergency": OwnFailsafe("battery", True, "emergency battery level"),
    "commander_low_bat_shutdown": OwnFailsafe("battery", True, "dangerously low battery, shutting down"),
    "check_gf_violation_max_hor_dist": OwnFailsafe("fence", True, "geofence violation: maximum distance to home"),
    "check_gf_violation_max_alt": OwnFailsafe("fence", True, "geofence violation: maximum height above home"),
    "check_gf_violation_custom_gf": OwnFailsafe("fence", True, "geofence violation"),
    "check_failure_detector_roll": OwnFailsafe("attitude", True, "failure detector: roll"),
    "check_failure_detector_pitch": OwnFailsafe("attitude", True, "failure detector: pitch"),
    "check_failure_detector_alt": OwnFailsafe("attitude", True, "failure detector: height"),
    "check_failure_detector_ext": OwnFailsafe("other", True, "failure detector: external system"),
    "check_failure_detector_motor": OwnFailsafe("motor", True, "failure detector: motor"),
    "check_motor_overcurrent": OwnFailsafe("motor", True, "failure detector: a motor draws too much"),
    "check_motor_undercurrent": OwnFailsafe("motor", True, "failure detector: a motor draws too little"),
    "check_failure_detector_imbalanced_prop": OwnFailsafe("motor", True, "failure detector: imbalanced propeller"),
    "check_system_flight_term_active": OwnFailsafe("other", True, "flight termination active"),
    "commander_disarmed_by": DISARMED_BY,
    "commander_rc_override": ModeChange(None, Actor.PILOT),
    "failsafe_rc_override": ModeChange(None, Actor.PILOT),
    "mission_finished": ModeChange(None, Actor.MISSION),
    "mission_finished_loiter": ModeChange(None, Actor.MISSION),
})  # fmt: skip
"""Events by their names in PX4 1.13 to 1.18."""
_BY_NUMBER = MappingProxyType({compute_event_id(name): said for name, said in EVENTS.items()})


MODE_CHANNEL_SETTINGS = frozenset({"FLTMODE_CH", "MODE_CH", "RC_MAP_FLTMODE"})
"""The parameter for it in ArduPilot Copter, in Rover and in PX4."""
THROTTLE_LOST_SETTING = "FS_THR_VALUE"
THROTTLE_LOST_US = 975.0
"""Default of FS_THR_VALUE; in PX4 the receiver itself reports a lost transmitter."""
MIN_US, MAX_US = 800, 2200
"""Range of channel values that a receiver sends; others are no channel."""
THROTTLE = 2
STICKS = 4
MAX_CHANNELS = 18
MODE_STEP_US = 80
"""Shortest step of the mode switch: its six positions are 160 apart, and noise or a turned knob is less."""
SWITCH_STEP_US = 200
"""Shortest step of any other switch, which has two or three positions; a knob or a gimbal wheel moves in smaller
steps."""
SAME_COMMAND_S = 0.8
"""Time within which a repeated command is the same one."""
MAX_COMMANDS, MAX_SWITCH_MOVES = 24, 4
COMMAND_AGE_S = 20.0
"""Age at which a command no longer explains a mode."""


def record_evidence(known: ModeEvidence, message: EvidenceMessage, now_s: float) -> ModeEvidence:
    """Apply a message that may explain a mode."""
    match message:
        case OrderSeen(custom_mode=mode):
            if any(one.custom_mode == mode and now_s - seen_s < SAME_COMMAND_S for one, seen_s in known.others_orders):
                return known
            young = [one for one in known.others_orders if now_s - one[1] < COMMAND_AGE_S]
            return replace(known, others_orders=(*young, (message, now_s))[-MAX_COMMANDS:])
        case ModeChange():
            return replace(known, recorded=(message, now_s))
        case RcChannels(values_us):
            moved = _find_moved_switch(known, values_us, now_s)
            switched = known.switched if moved is None else (*known.switched, moved)[-MAX_SWITCH_MOVES:]
            return replace(known, channels_us=values_us, channels_s=now_s, switched=switched)
        case VehicleSetting(name, value):
            return _record_setting(known, name, value)
        case OwnFailsafe():
            return record_failure(known, message, now_s)


def may_be_ours(given: Orders, seen: OrderSeen, now_s: float) -> bool:
    """Return whether a command, or its acknowledgement, may be one of ours.

    Most ground stations share our id, and old firmware acknowledges without one. Without a recent command of ours it is
    another station's; with one it proves nothing.
    """
    return seen.by is None and now_s - given.ordered_mode_s <= FOLLOWED_LATE_S


def record_critical_heartbeat(
    known: ModeEvidence, before: Heartbeat | None, beat: Heartbeat, now_s: float
) -> ModeEvidence:
    """Apply a HEARTBEAT: both autopilots report CRITICAL while a failsafe acts."""
    rises = beat.system_status >= CRITICAL and (before is None or before.system_status < CRITICAL)
    return replace(known, critical_s=now_s) if rises and before is not None else known


def record_failure(known: ModeEvidence, said: OwnFailsafe, now_s: float) -> ModeEvidence:
    """Apply a failure, or its end."""
    others = tuple(one for one in known.failed if one[0].what != said.what)
    if said.active:
        return replace(known, failed=(*others, (said, now_s)))
    over = tuple((*one, now_s) for one in known.failed if one[0].what == said.what)
    if not over:
        return known
    passed = tuple(one for one in known.passed if one[0].what != said.what)
    return replace(known, failed=others, passed=(*passed, *over))


def _record_setting(known: ModeEvidence, name: str, value: float) -> ModeEvidence:
    if name in MODE_CHANNEL_SETTINGS and 0 <= value <= MAX_CHANNELS and value == int(value):
        return replace(known, mode_channel=int(value))
    if name == THROTTLE_LOST_SETTING and math.isfinite(value):
        return replace(known, throttle_lost_us=value)
    return known


def _find_moved_switch(known: ModeEvidence, now_us: tuple[int, ...], now_s: float) -> SwitchMove | None:
    """Return a switch moved since the last report, the mode switch first."""
    if _is_transmitter_lost(known, known.channels_us) or _is_transmitter_lost(known, now_us):
        return None  # a receiver without a transmitter sets its channels to their failsafe values
    mode_channel = known.mode_channel or 0
    moved = [
        SwitchMove(channel, was, now, known.channels_s, now_s)
        for channel, (was, now) in enumerate(zip(known.channels_us, now_us, strict=False), start=1)
        if (channel == mode_channel or channel > STICKS)
        and MIN_US <= was <= MAX_US
        and MIN_US <= now <= MAX_US
        and abs(now - was) >= (MODE_STEP_US if channel in {mode_channel, DEFAULT_MODE_CHANNEL} else SWITCH_STEP_US)
    ]
    return min(moved, key=lambda one: one.channel not in {mode_channel, DEFAULT_MODE_CHANNEL}, default=None)


DEFAULT_MODE_CHANNEL = 5
"""FLTMODE_CH of ArduPilot by default."""


def _is_transmitter_lost(known: ModeEvidence, values_us: tuple[int, ...]) -> bool:
    lost_us = THROTTLE_LOST_US if known.throttle_lost_us is None else known.throttle_lost_us
    return len(values_us) > THROTTLE and MIN_US <= values_us[THROTTLE] < lost_us
