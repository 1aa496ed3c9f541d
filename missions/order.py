"""In which direction routes are flown where vehicles share pylons: so that who inspects from its layer need not.

Where two may meet over the line one has the air there, and the other inspects from its layer (`asked`), unless the
first has left before it comes: then it is let down on its way. A route takes about as long in either direction, so the
direction decides who comes first. Nothing is promised by it: who is late finds the other still there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from missions.asked import Closed, Routes, airway, first_paths, lies_lower, low_segments, ways_m
from missions.estimate import estimate
from missions.flight_model import FlightModel
from missions.geo import FloatArray
from missions.pads import column_radius_m
from missions.setup import FlightSetup
from missions.waypoints import FlightPath
from planner import is_reversed, segment_of, visit_of

MOST_VISITS = 300
"""Of all routes together: for more it would take longer than a plan may."""
PASSES = 2


def turned(
    setup: FlightSetup,
    routes: Routes,
    models: Mapping[str, FlightModel],
    ahead_s: float,
    may: Callable[[Routes], bool],
) -> dict[str, tuple[int, ...]]:
    """Return routes of which some are flown the other way round, where less is inspected from layers then.

    Args:
        setup: Heights and pads.
        routes: Visits of the setup's network, by the vehicle's name.
        models: How each of them flies.
        ahead_s: How long before it begins a part of the line a vehicle must be let down to it.
        may: Whether routes that are better in this are as good in everything else.
    """
    best = {name: tuple(visits) for name, visits in routes.items()}
    if sum(map(len, best.values())) > MOST_VISITS:
        return best
    least = _from_layers(setup, best, models, ahead_s)
    for name in list(best) * PASSES:
        if not least:
            break
        back = tuple(visit_of(segment_of(visit), not is_reversed(visit)) for visit in reversed(best[name]))
        other = {**best, name: back}
        found = _from_layers(setup, other, models, ahead_s)
        if found < least and may(other):
            best, least = other, found
    return best


def _from_layers(setup: FlightSetup, routes: Routes, models: Mapping[str, FlightModel], ahead_s: float) -> int:
    """Return how many segments are inspected from layers, if everybody flies as planned."""
    paths = first_paths(setup, routes)
    ends_s = {
        name: np.cumsum([leg.duration_s for leg in estimate(path, models[name]).legs], dtype=np.float64)
        for name, path in paths.items()
    }
    count = 0
    for name, path in paths.items():
        low = low_segments(path, routes[name])
        for number, segment in enumerate(map(segment_of, routes[name])):
            if segment in low or not lies_lower(setup, name, segment):
                continue
            # What is flown to is not replaced: the first part of a route is flown as it was uploaded.
            at_s = ends_s[name][_last(path, number - 1)] - ahead_s if number else 0.0
            if number == 0 or _is_closed(setup, name, segment, paths, ends_s, at_s):
                count += 1
    return count


def _last(path: FlightPath, visit: int) -> int:
    """Return the waypoint at the end of a visit."""
    return max(number for number, point in enumerate(path.waypoints) if point.visit == visit)


def _is_closed(
    setup: FlightSetup, name: str, segment: int, paths: Mapping[str, FlightPath], ends_s: Mapping[str, FloatArray],
    at_s: float,
) -> bool:  # fmt: skip
    """Return whether anybody may still be where a vehicle would come down to a segment, from a time on."""
    left = [
        airway(setup, path, int(np.searchsorted(ends_s[other], at_s))) for other, path in paths.items() if other != name
    ]
    radius_m = column_radius_m(setup.inspection.layer_m)
    return bool(Closed(setup, left).to(name, ways_m(setup, segment), radius_m).any())
