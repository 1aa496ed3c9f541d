"""Lower bound of any answer to a failure scenario, even one that knows all losses at the first one."""

from __future__ import annotations

from benchmarks.scenario import Scenario, day_of, initial_timelines
from benchmarks.scenarios import build_day_left_with_foresight, least_last_end_s
from planner import InstanceError

SAME = 1e-6
"""Values closer to each other than this are equal: sums depend on their order."""


def least_value(scenario: Scenario, limit_s: float) -> float:
    """Return a bound of the last trip's end: routes until the first loss are given, all losses are known at it.

    Its quality depends on ``limit_s`` seconds of proof; for a day with too many trips it covers only trips under way.
    """
    day = day_of(scenario)
    first = initial_timelines(scenario, day)
    if not scenario.losses:
        return max((trip.end_s for own in first for trip in own), default=0.0)
    left, until_s = build_day_left_with_foresight(day, first, [(one.vehicle - 1, one.at) for one in scenario.losses])
    under_way_s = max((trip.end_s for own in left.kept for trip in own), default=0.0)
    if left.instance is None:
        return under_way_s
    try:
        return max(under_way_s, least_last_end_s(left.instance, until_s, limit_s))
    except InstanceError:
        return under_way_s
