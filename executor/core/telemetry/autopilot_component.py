"""Which component of a system is the vehicle: its autopilot alone says how it is.

Gimbals, cameras and computers on board share their vehicle's number, and some of them send HEARTBEATs that look like
an autopilot's: never armed, in no mode.
"""

from __future__ import annotations

from dataclasses import dataclass

from executor.core.interface.messages import (
    ComponentText,
    Heartbeat,
    Message,
    OrderSeen,
    PayloadMessage,
    Radio,
    StationHeard,
    StatusText,
)
from executor.core.telemetry.firmware import MULTICOPTERS, OTHERS

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
