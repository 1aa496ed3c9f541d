"""Who else is on a vehicle's link, in words."""

from __future__ import annotations

from executor.core.messages import DoubleHeard, StationHeard


def stranger_words(heard: StationHeard | DoubleHeard) -> str:
    """Return who was heard that should not be there."""
    match heard:
        case StationHeard(system, component):
            return f"another ground station is on its link, system {system} component {component}"
        case DoubleHeard(system, places):
            return f"system {system} speaks from {' and '.join(places)}: two vehicles have the same number"
