"""A route as the places that a vehicle flies through: the seam between planning and MAVLink."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from missions.cameras import Capture
from missions.geo import FloatArray, LocalFrame


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


def legs_m(path: FlightPath, frame: LocalFrame, home_up_m: float = 0.0) -> FloatArray:
    """Return (w, 2, 3) float64: start and end of every leg, the first one from the ground below the first waypoint.

    Args:
        path: With at least one waypoint.
        frame: Whose east and north to use.
        home_up_m: Height of the vehicle's home over the depot, to which the path's heights are relative.
    """
    places = np.array([(point.lat_deg, point.lon_deg, point.alt_rel_m) for point in path.waypoints])
    ends = np.column_stack((frame.many_to_local_m(places[:, :2]), places[:, 2] + home_up_m))
    ground = np.array([ends[0, 0], ends[0, 1], home_up_m])
    return np.stack((np.vstack((ground, ends[:-1])), ends), axis=1)
