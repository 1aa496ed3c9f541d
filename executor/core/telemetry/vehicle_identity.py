"""Who speaks on a vehicle's link: which vehicle and firmware, which component of it, and who else is there.

Gimbals, cameras and computers on board share their vehicle's number, and some of them send HEARTBEATs that look like
an autopilot's: never armed, in no mode.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from executor.core.interface.messages import (
    ComponentText,
    DoubleHeard,
    Heartbeat,
    Message,
    OrderSeen,
    PayloadMessage,
    Radio,
    StationActed,
    StationHeard,
    StatusText,
    Version,
)
from executor.core.lines import link
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


AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
NO_AUTOPILOTS = frozenset({0, 1, 8})
"""MAV_AUTOPILOT: generic, reserved, and none at all."""


@dataclass(frozen=True, slots=True)
class AutopilotComponent:
    """The component that speaks for a system."""

    component: int = AUTOPILOT
    heard: bool = False
    """Whether its HEARTBEAT was."""


def update_autopilot_component(known: AutopilotComponent, component: int, beat: Heartbeat) -> AutopilotComponent:
    """Return who speaks for a system after a HEARTBEAT: component 1, or else the first that is an autopilot."""
    if component in {known.component, AUTOPILOT}:
        return known if known.heard and component == known.component else AutopilotComponent(component, heard=True)
    real = beat.autopilot not in NO_AUTOPILOTS and beat.vehicle_type in MULTICOPTERS.keys() | OTHERS.keys()
    return AutopilotComponent(component, heard=True) if real and not known.heard else known


def select_component_message(known: AutopilotComponent, component: int, message: Message) -> Message | None:
    """Return what is heard of a message: of other components only words, the link, cameras and gimbals."""
    if component == known.component or isinstance(message, StationHeard | Radio | OrderSeen | PayloadMessage):
        return message
    return ComponentText(component, message.severity, message.text) if isinstance(message, StatusText) else None


ForeignSystem = StationHeard | StationActed | DoubleHeard
MOST_NAMED = 8
"""Of each kind: anybody can send in the name of any number of systems."""


def add_foreign_system(known: frozenset[ForeignSystem], heard: ForeignSystem) -> frozenset[ForeignSystem]:
    """Return who is known with one more, as long as they are few."""
    return known if heard in known or _count(known, heard) >= MOST_NAMED else known | {heard}


def describe_new_foreign_systems(before: frozenset[ForeignSystem], now: frozenset[ForeignSystem]) -> Iterator[str]:
    """Yield a line for who is new; the last of them says that it is."""
    for stranger in now - before if now is not before else ():
        more = link.OTHERS_NOT_LISTED if _count(now, stranger) == MOST_NAMED else ""
        yield f"{describe_foreign_system(stranger)}{more}"


def is_behind_forward(heard: ForeignSystem) -> bool:
    """Return whether a station is heard through us alone: it is said once, and not of every vehicle."""
    return isinstance(heard, StationActed) or (isinstance(heard, StationHeard) and heard.behind)


def describe_foreign_system(heard: ForeignSystem) -> str:
    """Return who was heard that should not be there."""
    match heard:
        case StationHeard(system, component, behind):
            return (link.STATION_BEHIND if behind else link.OTHER_STATION).format(system=system, component=component)
        case StationActed(0, _, words):
            return words
        case StationActed(system, component, words):
            return link.STATION_WORDS.format(system=system, component=component, words=words)
        case DoubleHeard(system, ()):
            which = link.SYSTEM_ID.format(system=system) if system else link.ITS_SYSTEM_ID
            return link.TWO_VEHICLES.format(which=which)
        case DoubleHeard(system, places):
            return link.DUPLICATE_ID.format(system=system, places=" and ".join(places))


def _count(known: frozenset[ForeignSystem], like: ForeignSystem) -> int:
    return sum(type(one) is type(like) for one in known)
