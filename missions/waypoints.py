"""A route as the places that a vehicle flies through: the seam between planning and MAVLink."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from missions.cameras import Capture


class Phase(Enum):
    """What the vehicle does on the leg that *ends* at a waypoint."""

    TAKEOFF = "takeoff"
    TRANSIT = "transit"
    """On the way to the first pylon of a visit, or around somebody's pad."""
    INSPECT = "inspect"
    """Along the segment, to its last pylon."""
    RETURN = "return"
    LAND = "land"


@dataclass(frozen=True, slots=True)
class Waypoint:
    """The end of one leg."""

    phase: Phase
    lat_deg: float
    lon_deg: float
    alt_rel_m: float
    """Above the vehicle's own home."""
    speed_m_s: float
    """Ground speed on the leg that ends here."""
    hold: bool = False
    """Whether the vehicle must come to a stop here, so that the next leg's speed is flown from its beginning."""
    visit: int | None = None
    """Position in the route of the visit that this leg belongs to (transit and inspection); None for the rest."""
    captures: tuple[Capture, ...] = ()
    """What cameras do along the leg that ends here."""
    below_m: float = 0.0
    """How far below its own layer the vehicle is here: above nothing on the line, where it inspects as asked."""
    hover_s: float = 0.0
    """How long it stays here, where that is longer than the hold that every stop takes."""


@dataclass(frozen=True, slots=True)
class FlightPath:
    """One vehicle's whole flight."""

    vehicle: str
    waypoints: tuple[Waypoint, ...]
