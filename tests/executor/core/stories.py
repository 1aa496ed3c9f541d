"""Flights that have begun."""

from __future__ import annotations

from tests.executor.builders import Fleet, fleet_of
from tests.fakes.flight import Story

FLEET = fleet_of()
TIMEOUT_S = 10.0
EVERYTHING = set(range(6))


def story(ready: Fleet = FLEET) -> Story:
    """Return a flight that has been launched and heard."""
    flight = Story(ready.context, dict(ready.boards))
    flight.launch()
    return flight


def under_way(ready: Fleet = FLEET) -> Story:
    """Return a flight in which uav2 is in the midst of its first segment."""
    flight = story(ready)
    flight.run(lambda: flight.inspecting("uav2", 2))
    return flight
