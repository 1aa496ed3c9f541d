"""Whether an autopilot takes the pictures that a mission asks it for: one without its driver flies past everything."""

from __future__ import annotations

from executor.core.interface.check_codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity, VehicleFacts
from missions import Dialect, FlightPath


def list_shutter_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say so."""
    return (dialect.shutter.parameter,)


def check_shutter(facts: VehicleFacts, dialect: Dialect, path: FlightPath | None) -> list[Check]:
    """Say whether pictures are taken that a vehicle's mission asks of its autopilot; nothing where it asks for none."""
    rule = dialect.shutter
    asked = {capture.trigger for point in path.waypoints for capture in point.captures} if path is not None else set()
    if not asked & rule.triggers:
        return []
    if unread := facts.check_parameters_read(
        (rule.parameter,), "whether its autopilot takes pictures is", CheckCode.CAMERA
    ):
        return unread
    value = facts.parameters.get(rule.parameter)
    if value:
        text = f"its autopilot takes pictures ({rule.parameter} {value:g})"
        return [Check(Severity.OK, facts.name, text, CheckCode.CAMERA)]
    said = f"does not say {rule.parameter}" if value is None else f"{rule.parameter} 0"
    text = f"{said}: its autopilot takes no pictures {rule.words}; expected {rule.remedy}, and a restart"
    return [Check(Severity.WARNING, facts.name, text, CheckCode.CAMERA)]
