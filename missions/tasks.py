"""Network and fleet to a planning problem, and the way back from its numbers to the network's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from missions.areas import Unreachable
from missions.pricing import Pricing, build_priced_instance
from planner import Instance, Plan, Route, Vehicle, is_reversed, segment_of, visit_of


@dataclass(frozen=True, slots=True)
class Task:
    """A planning problem over some of a network's segments."""

    instance: Instance
    segment_ids: tuple[int, ...]
    """The network's segment for each of the instance's."""
    pricing: Pricing | None = None
    """From which the instance is made; None: by the paper's model."""
    unreachable: tuple[Unreachable, ...] = ()
    """What else of the network was asked for, and no flight can inspect."""

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


def build_open_task(pricing: Pricing, open_segments: Iterable[int], vehicles: Sequence[Vehicle]) -> Task:
    """Return the problem of inspecting what is still open, from wherever the vehicles are.

    Args:
        pricing: Of the whole network.
        open_segments: Its segments that are still to be inspected; taken in ascending order.
        vehicles: With the start (east, north) where each becomes free, the budget that is left then, and whether it is
            in the air there.

    Raises:
        IndexError: a segment is not in the network.
        planner.InstanceError: there is no vehicle, or a start is not a number.
    """
    segment_ids = tuple(sorted(set(open_segments)))
    count = len(pricing.tracks_m)
    if segment_ids and not 0 <= segment_ids[0] <= segment_ids[-1] < count:
        raise IndexError(f"open segments {segment_ids[0]} to {segment_ids[-1]}: expected below {count}")
    part = pricing.select_segments(segment_ids, (vehicle.name for vehicle in vehicles))
    return Task(build_priced_instance(part, vehicles), segment_ids, part)
