"""What PX4 says by events: numbers with arguments, where its texts say less or nothing.

Since 1.14 PX4 sends "Failsafe activated" as a text, and why only as an event. An event is known by its name, of which
its number is a hash, whichever version sends it; arguments that a version does not have are zeros. Health checks are
among them: those that a vehicle in the air has only when something fails, and of the others none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from executor.core.interface.messages import Actor, ModeChange, OwnFailsafe

ARGUMENT_BYTES = 25
"""Of uORB's event; MAVLink's has room for 40."""
AUTOPILOT_EVENTS = 1 << 24
"""The component that the names belong to, in the number's upper byte."""
_BASIS, _PRIME, _WORD, _LOW = 0x811C9DC5, 0x01000193, 0xFFFFFFFF, 0xFFFFFF
"""FNV-1a of 32 bits, of which 24 are kept."""
_ACTIONS: Mapping[int, str] = MappingProxyType({
    2: "Position", 3: "Altitude", 4: "Stabilized", 5: "Hold", 6: "RTL", 7: "Land", 8: "Descend", 9: "disarm",
    10: "termination",
})  # fmt: skip
"""failsafe_action_t; 0 is none, and 1 only a warning."""
WARNS = 1
_CAUSES: Mapping[int, tuple[str, str]] = MappingProxyType({
    1: ("rc", "manual control lost"), 2: ("ground station", "ground station lost"),
    3: ("battery", "low battery level"), 4: ("battery", "critical battery level"),
    5: ("battery", "emergency battery level"), 6: ("battery", "remaining flight time low"),
})  # fmt: skip
"""failsafe_cause_t; 0 is any other."""
UNNAMED = ("other", "")

EventMeaning = OwnFailsafe | ModeChange | None


def compute_event_id(name: str) -> int:
    """Return the number of one of PX4's events.

    >>> compute_event_id("commander_failsafe_enter") & 0xFFFFFF
    9751178
    """
    value = _BASIS
    for letter in name.encode():
        value = (value ^ letter) * _PRIME & _WORD
    return value & _LOW | AUTOPILOT_EVENTS


def parse_px4_event(number: int, arguments: bytes) -> EventMeaning:
    """Return what an event says of a failsafe, or of who changed the mode; None if it says nothing of that.

    Args:
        number: Of the event.
        arguments: Packed, little-endian; what is missing is zero.
    """
    read = _BY_NUMBER.get(number)
    return None if read is None else read(arguments.ljust(ARGUMENT_BYTES, b"\0"))


def _build_failsafe_reader(
    action_at: int, cause_at: int | None = None, delay_at: int | None = None
) -> Callable[[bytes], EventMeaning]:
    """Return how to read a failsafe that acts, or will: behind the mode that was wanted come these."""

    def read(arguments: bytes) -> EventMeaning:
        if arguments[action_at] == WARNS:
            return None
        kind, why = UNNAMED if cause_at is None else _CAUSES.get(arguments[cause_at], UNNAMED)
        mode = _ACTIONS.get(arguments[action_at], "")
        delay_s = 0 if delay_at is None else int.from_bytes(arguments[delay_at : delay_at + 2], "little")
        then = f"switching to {mode}" + (f" in {delay_s} s" if delay_s else "") if mode else ""
        words = ", ".join(part for part in (why, then) if part)
        return OwnFailsafe(kind, active=True, words=f"failsafe: {words}" if words else "failsafe activated")

    return read


def _build_failure_reader(kind: str, words: str) -> Callable[[bytes], EventMeaning]:
    return lambda _: OwnFailsafe(kind, active=True, words=words)


def _build_mode_change_reader(by: Actor) -> Callable[[bytes], EventMeaning]:
    return lambda _: ModeChange(None, by)


DISARMED_BY: Mapping[int, tuple[str, str]] = MappingProxyType({
    10: ("attitude", "disarmed by its failure detector"), 14: ("other", "disarmed by a failsafe"),
})  # fmt: skip
"""arm_disarm_reason_t, of those that are neither a person's nor a landing's."""


def _read_disarm_reason(arguments: bytes) -> EventMeaning:
    known = DISARMED_BY.get(arguments[0])
    return None if known is None else OwnFailsafe(known[0], active=True, words=known[1])


EVENTS: Mapping[str, Callable[[bytes], EventMeaning]] = MappingProxyType({
    "commander_failsafe_enter": _build_failsafe_reader(4, cause_at=5),
    "commander_failsafe_enter_hold": _build_failsafe_reader(4, cause_at=7, delay_at=5),
    "commander_failsafe_enter_generic": _build_failsafe_reader(4),
    "commander_failsafe_enter_generic_hold": _build_failsafe_reader(4, delay_at=5),
    "commander_failsafe_enter_autopilot_disengaged": _build_failsafe_reader(4),
    "check_battery_critical": _build_failure_reader("battery", "critical battery"),
    "check_battery_emergency": _build_failure_reader("battery", "emergency battery level"),
    "commander_low_bat_shutdown": _build_failure_reader("battery", "dangerously low battery, shutting down"),
    "check_gf_violation_max_hor_dist": _build_failure_reader("fence", "geofence violation: maximum distance to home"),
    "check_gf_violation_max_alt": _build_failure_reader("fence", "geofence violation: maximum height above home"),
    "check_gf_violation_custom_gf": _build_failure_reader("fence", "geofence violation"),
    "check_failure_detector_roll": _build_failure_reader("attitude", "failure detector: roll"),
    "check_failure_detector_pitch": _build_failure_reader("attitude", "failure detector: pitch"),
    "check_failure_detector_alt": _build_failure_reader("attitude", "failure detector: height"),
    "check_failure_detector_ext": _build_failure_reader("other", "failure detector: external system"),
    "check_failure_detector_motor": _build_failure_reader("motor", "failure detector: motor"),
    "check_failure_detector_imbalanced_prop": _build_failure_reader("motor", "failure detector: imbalanced propeller"),
    "check_system_flight_term_active": _build_failure_reader("other", "flight termination active"),
    "commander_disarmed_by": _read_disarm_reason,
    "commander_rc_override": _build_mode_change_reader(Actor.PILOT),
    "failsafe_rc_override": _build_mode_change_reader(Actor.PILOT),
    "mission_finished": _build_mode_change_reader(Actor.MISSION),
    "mission_finished_loiter": _build_mode_change_reader(Actor.MISSION),
})  # fmt: skip
"""By their names in PX4 1.13 to 1.17."""
_BY_NUMBER = MappingProxyType({compute_event_id(name): read for name, read in EVENTS.items()})
