"""What may say who changed a mode, and what has failed: texts, PX4's events, orders, switches.

Texts are those of ArduPilot 3.3 to 4.7 and of PX4 1.11 to 1.17. ArduPilot: events.cpp, ekf_check.cpp, crash_check.cpp,
failsafe.cpp, fence.cpp of Copter, AP_BattMonitor, AP_Vehicle. PX4: state_machine_helper.cpp and Commander.cpp up to
1.13, the health checks and failsafe/framework.cpp since.

Since 1.14 PX4 sends "Failsafe activated" as a text, and why only as an event: a number with arguments. An event is
known by its name, of which its number is a hash, whichever version sends it; arguments that a version does not have are
zeros. Health checks are among them: those that a vehicle in the air has only when something fails, of the others none.
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


ALARM = re.compile(
    rf"failsafe|{FENCE_BREACH}|\bkill|\bcrash|terminat|parachute|emergency|thrust loss|motor fail|critical battery|"
    r"low battery|"
    r"battery .*(low|critical|missing|unhealthy|fail)|no valid mission",
    re.IGNORECASE,
)
"""What both autopilots say when a mission ends: "Battery Failsafe", "Crash: Disarming", "Battery 1 is low"."""
CHANGES_MODE = re.compile(
    rf"^(?!.*cleared).*(failsafe|{FENCE_BREACH}|critical|emergency|terminat|crash|parachute|motor|thrust|"
    r"no valid mission)",
    re.IGNORECASE,
)
"""Texts after which an autopilot changes its mode; "Low battery" alone only warns."""
STOPS_MOTORS = re.compile(r"emergency stop|kill", re.IGNORECASE)
"""Somebody may stop the motors."""
EXPLAINS_DISARMING = re.compile(r"disarm|crash|kill|emergency stop|terminat", re.IGNORECASE)
"""It may say why a vehicle disarms in the air."""


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


ARGUMENT_BYTES = 25
"""Of uORB's event; MAVLink's has room for 40."""
AUTOPILOT_EVENTS = 1 << 24
"""The component that the names belong to, in the number's upper byte."""
_BASIS, _PRIME, _WORD, _LOW_BITS = 0x811C9DC5, 0x01000193, 0xFFFFFFFF, 0xFFFFFF
"""FNV-1a of 32 bits, of which 24 are kept."""
_ACTIONS: Mapping[int, str] = MappingProxyType({
    2: "Position", 3: "Altitude", 4: "Stabilized", 5: "Hold", 6: "RTL", 7: "Land", 8: "Descend", 9: "disarm",
    10: "termination",
})  # fmt: skip
"""failsafe_action_t; 0 is none, and 1 only a warning."""
ACTION_AT, WARNS = 4, 1
_CAUSES: Mapping[int, tuple[str, str]] = MappingProxyType({
    1: ("rc", "manual control lost"), 2: ("ground station", "ground station lost"),
    3: ("battery", "low battery level"), 4: ("battery", "critical battery level"),
    5: ("battery", "emergency battery level"), 6: ("battery", "remaining flight time low"),
})  # fmt: skip
"""failsafe_cause_t; 0 is any other."""
UNNAMED = ("other", "")


def compute_event_id(name: str) -> int:
    """Return the number of one of PX4's events.

    >>> compute_event_id("commander_failsafe_enter") & 0xFFFFFF
    9751178
    """
    value = _BASIS
    for letter in name.encode():
        value = (value ^ letter) * _PRIME & _WORD
    return value & _LOW_BITS | AUTOPILOT_EVENTS


def parse_px4_event(number: int, arguments: bytes) -> OwnFailsafe | ModeChange | None:
    """Return what an event says of a failsafe, or of who changed the mode; None if it says nothing of that.

    Args:
        number: Of the event.
        arguments: Packed, little-endian; what is missing is zero.
    """
    said, arguments = _BY_NUMBER.get(number), arguments.ljust(ARGUMENT_BYTES, b"\0")
    if isinstance(said, ActingFailsafe):
        return said.read(arguments)
    return said.get(arguments[0]) if isinstance(said, Mapping) else said


@dataclass(frozen=True, slots=True)
class ActingFailsafe:
    """Where an event of a failsafe that acts, or will, says what: its action comes behind the mode that was wanted."""

    cause_at: int | None = None
    delay_at: int | None = None

    def read(self, arguments: bytes) -> OwnFailsafe | None:
        """Return what it says; None of a failsafe that only warns."""
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
"""arm_disarm_reason_t, of those that are neither a person's nor a landing's."""


EVENTS: Mapping[str, ActingFailsafe | OwnFailsafe | ModeChange | Mapping[int, OwnFailsafe]] = MappingProxyType({
    "commander_failsafe_enter": ActingFailsafe(cause_at=5),
    "commander_failsafe_enter_hold": ActingFailsafe(cause_at=7, delay_at=5),
    "commander_failsafe_enter_generic": ActingFailsafe(),
    "commander_failsafe_enter_generic_hold": ActingFailsafe(delay_at=5),
    "commander_failsafe_enter_autopilot_disengaged": ActingFailsafe(),
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
"""By their names in PX4 1.13 to 1.18."""
_BY_NUMBER = MappingProxyType({compute_event_id(name): said for name, said in EVENTS.items()})


MODE_CHANNEL_SETTINGS = frozenset({"FLTMODE_CH", "MODE_CH", "RC_MAP_FLTMODE"})
"""ArduPilot's, its rovers' and PX4's name of it."""
THROTTLE_LOST_SETTING = "FS_THR_VALUE"
THROTTLE_LOST_US = 975.0
"""Its default; PX4 is told by the receiver itself."""
LEAST_US, MOST_US = 800, 2200
"""What no receiver sends is no channel."""
THROTTLE = 2
STICKS = 4
MOST_CHANNELS = 18
MODE_STEP_US = 80
"""Six positions of a switch are 160 apart: so much is no noise, nor a knob that is turned."""
SWITCH_STEP_US = 200
"""Any other switch has two or three positions; a knob or a gimbal's wheel moves in smaller steps."""
REPEATED_S = 0.8
"""An order that is sent again within this time is the same."""
MOST_ORDERS, MOST_SWITCHES = 24, 4
LATE_ORDER_S = 20.0
"""An older order explains nothing any more."""


def record_evidence(known: ModeEvidence, message: EvidenceMessage, now_s: float) -> ModeEvidence:
    """Take what may explain a mode."""
    match message:
        case OrderSeen(custom_mode=mode):
            if any(one.custom_mode == mode and now_s - seen_s < REPEATED_S for one, seen_s in known.others_orders):
                return known
            young = [one for one in known.others_orders if now_s - one[1] < LATE_ORDER_S]
            return replace(known, others_orders=(*young, (message, now_s))[-MOST_ORDERS:])
        case ModeChange():
            return replace(known, recorded=(message, now_s))
        case RcChannels(values_us):
            moved = _find_moved_switch(known, values_us, now_s)
            switched = known.switched if moved is None else (*known.switched, moved)[-MOST_SWITCHES:]
            return replace(known, channels_us=values_us, channels_s=now_s, switched=switched)
        case VehicleSetting(name, value):
            return _record_setting(known, name, value)
        case OwnFailsafe():
            return record_failure(known, message, now_s)


def may_be_ours(given: Orders, seen: OrderSeen, now_s: float) -> bool:
    """Return whether an order that was seen, or its answer, may be one that was given from here.

    Most ground stations have our number, and old firmware answers without one. Who has ordered nothing lately knows
    that it is another's; who has, does not, and then it proves nothing.
    """
    return seen.by is None and now_s - given.ordered_mode_s <= FOLLOWED_LATE_S


def record_critical_heartbeat(
    known: ModeEvidence, before: Heartbeat | None, beat: Heartbeat, now_s: float
) -> ModeEvidence:
    """Take a HEARTBEAT: both autopilots call themselves critical as long as a failsafe acts."""
    rises = beat.system_status >= CRITICAL and (before is None or before.system_status < CRITICAL)
    return replace(known, critical_s=now_s) if rises and before is not None else known


def record_failure(known: ModeEvidence, said: OwnFailsafe, now_s: float) -> ModeEvidence:
    """Take what has failed, or is over again."""
    others = tuple(one for one in known.failed if one[0].what != said.what)
    if said.active:
        return replace(known, failed=(*others, (said, now_s)))
    over = tuple((*one, now_s) for one in known.failed if one[0].what == said.what)
    if not over:
        return known
    passed = tuple(one for one in known.passed if one[0].what != said.what)
    return replace(known, failed=others, passed=(*passed, *over))


def _record_setting(known: ModeEvidence, name: str, value: float) -> ModeEvidence:
    if name in MODE_CHANNEL_SETTINGS and 0 <= value <= MOST_CHANNELS and value == int(value):
        return replace(known, mode_channel=int(value))
    if name == THROTTLE_LOST_SETTING and math.isfinite(value):
        return replace(known, throttle_lost_us=value)
    return known


def _find_moved_switch(known: ModeEvidence, now_us: tuple[int, ...], now_s: float) -> SwitchMove | None:
    """Return a switch that was moved since the last report, the one for the modes before others."""
    if _is_transmitter_lost(known, known.channels_us) or _is_transmitter_lost(known, now_us):
        return None  # a receiver that hears nothing puts its channels where it was told to
    mode_channel = known.mode_channel or 0
    moved = [
        SwitchMove(channel, was, now, known.channels_s, now_s)
        for channel, (was, now) in enumerate(zip(known.channels_us, now_us, strict=False), start=1)
        if (channel == mode_channel or channel > STICKS)
        and LEAST_US <= was <= MOST_US
        and LEAST_US <= now <= MOST_US
        and abs(now - was) >= (MODE_STEP_US if channel in {mode_channel, DEFAULT_MODE_CHANNEL} else SWITCH_STEP_US)
    ]
    return min(moved, key=lambda one: one.channel not in {mode_channel, DEFAULT_MODE_CHANNEL}, default=None)


DEFAULT_MODE_CHANNEL = 5
"""FLTMODE_CH of ArduPilot, where nobody has changed it."""


def _is_transmitter_lost(known: ModeEvidence, values_us: tuple[int, ...]) -> bool:
    lost_us = THROTTLE_LOST_US if known.throttle_lost_us is None else known.throttle_lost_us
    return len(values_us) > THROTTLE and LEAST_US <= values_us[THROTTLE] < lost_us
