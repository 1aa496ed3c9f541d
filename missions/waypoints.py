"""Model a route as waypoints: the interface between planning and MAVLink."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from missions.cameras import Capture
from missions.geo import FloatArray, LocalFrame


class Phase(Enum):
    """The vehicle's activity on the leg that *ends* at a waypoint."""

    TAKEOFF = "takeoff"
    TRANSIT = "transit"
    """To the first pylon of a visit, or around another vehicle's pad."""
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
    """Height above the vehicle's own home."""
    speed_m_s: float
    """Ground speed on the leg that ends here."""
    hold: bool = False
    """Whether the vehicle must stop here, so that the next leg's speed applies from its beginning."""
    visit: int | None = None
    """Position in the route of this leg's visit (transit and inspection); None for other legs."""
    captures: tuple[Capture, ...] = ()
    """Camera actions along the leg that ends here."""
    below_m: float = 0.0
    """Depth below the vehicle's own layer: above 0 on the line, when inspecting at the requested height."""
    hover_s: float = 0.0
    """Stay at the waypoint, if longer than the hold of every stop."""


@dataclass(frozen=True, slots=True)
class FlightPath:
    """One vehicle's whole flight."""

    vehicle: str
    waypoints: tuple[Waypoint, ...]


def legs_m(path: FlightPath, frame: LocalFrame, home_up_m: float = 0.0) -> FloatArray:
    """Return (w, 2, 3) float64: start and end of every leg, the first one from the ground below the first waypoint.

    Args:
        path: A path with at least one waypoint.
        frame: Frame of east and north.
        home_up_m: Height of the vehicle's home over the depot, to which the path's heights are relative.
    """
    places = np.array([(point.lat_deg, point.lon_deg, point.alt_rel_m) for point in path.waypoints])
    ends = np.column_stack((frame.many_to_local_m(places[:, :2]), places[:, 2] + home_up_m))
    ground = np.array([ends[0, 0], ends[0, 1], home_up_m])
    return np.stack((np.vstack((ground, ends[:-1])), ends), axis=1)
