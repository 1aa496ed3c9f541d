"""Identify the senders on a vehicle's link: vehicle and firmware, its components, and other systems.

Gimbals, cameras and companion computers share the vehicle's system id, and some of them send HEARTBEATs that look like
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
"""Names of MAV_AUTOPILOT values in use."""
MULTICOPTERS = {
    2: "quadrotor", 13: "hexarotor", 14: "octorotor", 15: "tricopter", 29: "dodecarotor", 35: "decarotor",
}  # fmt: skip
"""MAV_TYPE of vehicles that can hover, turn on the spot and fly this program's missions."""
OTHER_TYPES = {
    0: "generic vehicle", 1: "fixed wing", 3: "coaxial helicopter", 4: "helicopter", 5: "antenna tracker",
    7: "airship", 8: "balloon", 10: "ground rover", 11: "boat", 12: "submarine", 16: "flapping wing",
    19: "tail-sitter", 20: "tail-sitter", 21: "tilt-rotor", 22: "VTOL", 23: "tail-sitter", 24: "tilt-wing", 25: "VTOL",
}  # fmt: skip
"""MAV_TYPE of vehicles that cannot."""

_BANNER = re.compile(r"(?:ArduCopter|APM:Copter|PX4\D*?)\s*[Vv]?(\d+)\.(\d+)(?:\.(\d+))?(?:-?(dev|alpha|beta|rc))?")


def parse_banner_version(text: str) -> Version | None:
    """Return the version in a start-up text; None if there is none.

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
    return MULTICOPTERS.get(vehicle_type) or OTHER_TYPES.get(vehicle_type) or f"vehicle of type {vehicle_type}"


def describe_autopilot(autopilot: int) -> str:
    """Return a MAV_AUTOPILOT in words."""
    return AUTOPILOT_NAMES.get(autopilot, f"autopilot {autopilot}")


AUTOPILOT = 1
"""MAV_COMP_ID_AUTOPILOT1."""
NO_AUTOPILOTS = frozenset({0, 1, 8})
"""MAV_AUTOPILOT values: generic, reserved, and none."""


@dataclass(frozen=True, slots=True)
class AutopilotComponent:
    """The autopilot component of a system."""

    component: int = AUTOPILOT
    heard: bool = False
    """Whether its HEARTBEAT was received."""


def update_autopilot_component(known: AutopilotComponent, component: int, beat: Heartbeat) -> AutopilotComponent:
    """Return a system's autopilot after a HEARTBEAT: component 1, or else the first that is one."""
    if component in {known.component, AUTOPILOT}:
        return known if known.heard and component == known.component else AutopilotComponent(component, heard=True)
    real = beat.autopilot not in NO_AUTOPILOTS and beat.vehicle_type in MULTICOPTERS.keys() | OTHER_TYPES.keys()
    return AutopilotComponent(component, heard=True) if real and not known.heard else known


def select_component_message(known: AutopilotComponent, component: int, message: Message) -> Message | None:
    """Return a component's message as far as it counts; of other components texts, link, camera and gimbal messages."""
    if component == known.component or isinstance(message, StationHeard | Radio | OrderSeen | PayloadMessage):
        return message
    return ComponentText(component, message.severity, message.text) if isinstance(message, StatusText) else None


ForeignSystem = StationHeard | StationActed | DoubleHeard
MAX_SYSTEMS = 8
"""Limit of each kind; anybody can send under any number of system ids."""


def add_foreign_system(known: frozenset[ForeignSystem], heard: ForeignSystem) -> frozenset[ForeignSystem]:
    """Return the foreign systems with another one added, up to the limit."""
    return known if heard in known or _count(known, heard) >= MAX_SYSTEMS else known | {heard}


def describe_new_foreign_systems(before: frozenset[ForeignSystem], now: frozenset[ForeignSystem]) -> Iterator[str]:
    """Yield a line for each new system; the last one says that no more are listed."""
    for stranger in now - before if now is not before else ():
        more = link.OTHERS_NOT_LISTED if _count(now, stranger) == MAX_SYSTEMS else ""
        yield f"{describe_foreign_system(stranger)}{more}"


def is_behind_forward(heard: ForeignSystem) -> bool:
    """Return whether a station is received only through us: it is reported once, not for every vehicle."""
    return isinstance(heard, StationActed) or (isinstance(heard, StationHeard) and heard.behind)


def describe_foreign_system(heard: ForeignSystem) -> str:
    """Return the description of a foreign system."""
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
