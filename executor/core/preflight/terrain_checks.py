"""What an autopilot follows of the ground by itself: nothing here relies on it, and where it is on the crew is told."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from executor.core.context import Context
from executor.core.interface.check_codes import CheckCode
from executor.core.preflight.vehicle_checks import Check, Severity, VehicleFacts
from missions import Dialect

GPS_M = 5.0
"""What a good GPS is off in height beside the raster."""


def list_terrain_parameters(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say so."""
    return tuple(rule.parameter for rule in dialect.terrain)


def check_terrain_following(facts: VehicleFacts, dialect: Dialect) -> list[Check]:
    """Say what a vehicle follows by itself: a warning where its flight is another for it than was planned."""
    if unread := facts.check_parameters_read(
        list_terrain_parameters(dialect), "whether it follows the ground is", CheckCode.TERRAIN
    ):
        return unread
    set_ = [rule for rule in dialect.terrain if facts.parameters.get(rule.parameter)]
    on = [rule for rule in set_ if int(facts.parameters[rule.parameter]) in rule.on]
    said = "follows the ground by itself"
    found = [
        Check(
            Severity.WARNING,
            facts.name,
            f"{said}: {_format_parameter(facts, rule.parameter)}: {rule.words}",
            CheckCode.TERRAIN,
        )
        for rule in on
        if rule.in_flight
    ]
    found += [
        Check(
            Severity.WARNING, facts.name,
            f"may follow the ground by itself: {_format_parameter(facts, rule.parameter)} is unknown",
            CheckCode.TERRAIN,
        )
        for rule in set_
        if rule not in on
    ]  # fmt: skip
    idle = [f"{_format_parameter(facts, rule.parameter)} {rule.words}" for rule in on if not rule.in_flight]
    if found:
        return found
    text = "its missions and its RTL do not follow the ground by themselves" + _format_idle_parameters(idle)
    return [Check(Severity.OK, facts.name, text, CheckCode.TERRAIN)]


def _format_parameter(facts: VehicleFacts, name: str) -> str:
    return f"{name} {facts.parameters[name]:g}"


def _format_idle_parameters(idle: Iterable[str]) -> str:
    text = "; ".join(idle)
    return f" ({text})" if text else ""


def check_pad_ground(context: Context, facts: VehicleFacts) -> list[Check]:
    """Hold a pad's height by the vehicle's own GPS against the raster: all heights of its mission are counted from it.

    A GPS that is too high sends the vehicle lower over the ground than its mission says.
    """
    terrain, pad = context.setup.terrain, context.setup.pad_of(facts.name)
    if terrain is None:
        return []
    known = terrain.elevation
    ground_m = float(known.interpolate_m(np.array([[pad.east_m, pad.north_m]]))[0])
    off_m = pad.alt_m - ground_m
    if not abs(off_m) > known.uncertainty_m + GPS_M:
        return []
    lower = f"{abs(off_m):.0f} m {'lower' if off_m > 0 else 'higher'} over the ground than planned"
    text = f"its pad is at {pad.alt_m:.0f} m by its GPS, at {ground_m:.0f} m by {known.source}: it flies {lower}"
    severity = Severity.STOP if off_m > terrain.margin_m else Severity.WARNING
    return [Check(severity, facts.name, f"{text} if the raster is right", CheckCode.PAD_HEIGHT)]
