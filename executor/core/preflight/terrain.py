"""What an autopilot follows of the ground by itself: nothing here relies on it, and where it is on the crew is told."""

from __future__ import annotations

from collections.abc import Iterable

from executor.core.check_codes import CheckCode
from executor.core.preflight.checks import Check, Facts, Severity
from missions import Dialect


def names(dialect: Dialect) -> tuple[str, ...]:
    """Return the parameters that say so."""
    return tuple(rule.parameter for rule in dialect.terrain)


def following(facts: Facts, dialect: Dialect) -> list[Check]:
    """Say what a vehicle follows by itself: a warning where its flight is another for it than was planned."""
    on = [rule for rule in dialect.terrain if int(facts.parameters.get(rule.parameter, -1)) in rule.on]
    said = "follows the ground by itself"
    found = [
        Check(Severity.WARNING, facts.name, f"{said}: {_said(facts, rule.parameter)}: {rule.words}", CheckCode.TERRAIN)
        for rule in on
        if rule.in_flight
    ]
    idle = [f"{_said(facts, rule.parameter)} {rule.words}" for rule in on if not rule.in_flight]
    if found:
        return found
    text = "its missions and its RTL do not follow the ground by themselves" + _listed(idle)
    return [Check(Severity.OK, facts.name, text, CheckCode.TERRAIN)]


def _said(facts: Facts, name: str) -> str:
    return f"{name} {facts.parameters[name]:g}"


def _listed(idle: Iterable[str]) -> str:
    text = "; ".join(idle)
    return f" ({text})" if text else ""
