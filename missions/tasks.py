"""Network and fleet to a planning problem, and the way back from its numbers to the network's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from missions.network import Network
from planner import Instance, Plan, Route, Travel, Vehicle, build_instance, is_reversed, segment_of, visit_of

DEPOT_M = (0.0, 0.0)
"""The depot in its own frame: every plan starts and ends there; pads are a few steps away."""


@dataclass(frozen=True, slots=True)
class Task:
    """A planning problem over some of a network's segments."""

    instance: Instance
    segment_ids: tuple[int, ...]
    """The network's segment for each of the instance's."""

    def to_network(self, visits: Iterable[int]) -> tuple[int, ...]:
        """Return the instance's visits as the network's."""
        return tuple(visit_of(self.segment_ids[segment_of(visit)], is_reversed(visit)) for visit in visits)

    def from_network(self, visits: Iterable[int]) -> tuple[int, ...]:
        """Return the network's visits as the instance's.

        Raises:
            KeyError: a visit's segment is no part of the problem.
        """
        reduced = {segment: index for index, segment in enumerate(self.segment_ids)}
        return tuple(visit_of(reduced[segment_of(visit)], is_reversed(visit)) for visit in visits)

    def plan_to_network(self, plan: Plan) -> Plan:
        """Return a plan of the instance with the network's segments."""
        routes = tuple(Route(route.vehicle, self.to_network(route.visits)) for route in plan.routes)
        return Plan(routes, tuple(self.segment_ids[segment] for segment in plan.uncovered))


def open_task(network: Network, open_segments: Iterable[int], vehicles: Sequence[Vehicle], travel: Travel) -> Task:
    """Return the problem of inspecting what is still open, from wherever the vehicles are.

    Args:
        network: The whole network.
        open_segments: Its segments that are still to be inspected; taken in ascending order.
        vehicles: With the start (east, north) where each becomes free, the budget that is left then, and whether it is
            in the air there.
        travel: Speeds and energy rates.

    Raises:
        IndexError: a segment is not in the network.
        planner.InstanceError: there is no vehicle, or a start is not a number.
    """
    segment_ids = tuple(sorted(set(open_segments)))
    if segment_ids and not 0 <= segment_ids[0] <= segment_ids[-1] < len(network.segments):
        raise IndexError(f"open segments {segment_ids[0]} to {segment_ids[-1]}: expected below {len(network.segments)}")
    ends_m = network.ends_m[list(segment_ids)]
    return Task(build_instance(ends_m, DEPOT_M, vehicles, travel), segment_ids)
