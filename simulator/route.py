"""Where the items of a mission are, and how long the flight is that they describe."""

from __future__ import annotations

import math
from collections.abc import Iterable

from missions.items import Command, MissionItem
from simulator.mission_store import has_place, is_relative
from simulator.physics import Home, Place


def place_of(item: MissionItem, home: Home, here: Place) -> Place:
    """Return where an item is; without a place of its own it is where the vehicle is, at the item's height."""
    up_m = item.z if is_relative(item) else item.z - home.alt_m
    return home.place_of(item.x, item.y, up_m) if has_place(item) else Place(here.east_m, here.north_m, up_m)


def mission_length_m(items: Iterable[MissionItem], home: Home) -> float:
    """Return the length of the whole flight that a list describes, from the pad to wherever it ends."""
    here = Place(0.0, 0.0, 0.0)
    length = 0.0
    for item in items:
        stops: list[Place] = []
        if item.command in {Command.NAV_TAKEOFF, Command.NAV_WAYPOINT}:
            stops = [place_of(item, home, here)]
        elif item.command == Command.NAV_RETURN_TO_LAUNCH:
            stops = [Place(0.0, 0.0, here.up_m), Place(0.0, 0.0, 0.0)]
        elif item.command == Command.NAV_LAND:
            over = place_of(item, home, here)
            stops = [Place(over.east_m, over.north_m, here.up_m), Place(over.east_m, over.north_m, 0.0)]
        for stop in stops:
            length += math.dist(here, stop)
            here = stop
    return length
