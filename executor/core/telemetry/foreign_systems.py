"""Who else is on a vehicle's link, in words."""

from __future__ import annotations

from collections.abc import Iterator

from executor.core.interface.messages import DoubleHeard, StationHeard

ForeignSystem = StationHeard | DoubleHeard
MOST_NAMED = 8
"""Of each kind: anybody can send in the name of any number of systems."""


def add_foreign_system(known: frozenset[ForeignSystem], heard: ForeignSystem) -> frozenset[ForeignSystem]:
    """Return who is known with one more, as long as they are few."""
    return known if heard in known or _count(known, heard) >= MOST_NAMED else known | {heard}


def describe_new_foreign_systems(before: frozenset[ForeignSystem], now: frozenset[ForeignSystem]) -> Iterator[str]:
    """Yield a line for who is new; the last of them says that it is."""
    for stranger in now - before if now is not before else ():
        more = "; further ones are not listed" if _count(now, stranger) == MOST_NAMED else ""
        yield f"{describe_foreign_system(stranger)}{more}"


def describe_foreign_system(heard: ForeignSystem) -> str:
    """Return who was heard that should not be there."""
    match heard:
        case StationHeard(system, component):
            return f"another ground station is on its link, system {system} component {component}"
        case DoubleHeard(system, ()):
            whose = f"system id {system}" if system else "its system id"
            return f"two vehicles use {whose}: their telemetry is mixed, and both would follow commands"
        case DoubleHeard(system, places):
            return f"sysid {system} is used at {' and '.join(places)}: duplicate system id"


def _count(known: frozenset[ForeignSystem], like: ForeignSystem) -> int:
    return sum(type(one) is type(like) for one in known)
