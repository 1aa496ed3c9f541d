"""Flight without a mission: positions, velocities and orbits, as commanded to both autopilots."""

from __future__ import annotations

import math

from simulator.airframe import Airframe
from simulator.guidance import Circle, Drift, Hover, Leg, find_stopping_place, find_target
from simulator.messages import SetPoint
from simulator.physics import Home, Limits, Place, Vector, Velocity

ABSOLUTE, RELATIVE = frozenset({0, 5}), frozenset({3, 6, 10, 11})
"""MAV_FRAME by height reference; the ground is level, so terrain frames are relative ones."""
LOCAL, OFFSETS, BODY = 1, frozenset({7, 8, 9}), frozenset({8, 9})
PLACE_BITS, VELOCITY_BITS = 0b000_111, 0b111_000
"""Ignore bits of POSITION_TARGET_TYPEMASK."""


class GuidedFlight:
    """Fly commanded goals while in the air and intact."""

    def __init__(self, frame: Airframe, home: Home, limits: Limits) -> None:
        self._frame, self._home, self._limits = frame, home, limits
        self.heard_s = -math.inf
        """Time of the last set-point."""
        self.last: Place | Velocity | None = None
        """Last set-point."""

    @property
    def may_move(self) -> bool:
        """Whether it is in the air and intact."""
        return self._frame.armed and not self._frame.wrecked and not self._frame.body.on_ground

    def locate(self, place_e7: tuple[int, int], z_m: float, frame: int) -> Place | None:
        """Return the local place of latitude, longitude and height; None for invalid values."""
        if frame not in ABSOLUTE | RELATIVE or not math.isfinite(z_m):
            return None
        up_m = z_m if frame in RELATIVE else z_m - self._home.alt_m
        lat_e7, lon_e7 = place_e7
        known = abs(lat_e7) <= 900_000_000 and abs(lon_e7) <= 1_800_000_000
        return self._home.place_of(lat_e7, lon_e7, up_m) if known else None

    def go(self, place: Place, speed_m_s: float) -> None:
        """Fly straight to a place, and hold there."""
        if self.may_move:
            here = find_stopping_place(self._frame.body, self._limits)
            leg = Leg(here, place, self._frame.achieved_speed_m_s(speed_m_s), accept_m=0.0)
            self._frame.pilot.fly([leg, Hover(place)])

    def go_round(self, centre: Place, radius_m: float, speed_m_s: float, approach_m_s: float) -> None:
        """Fly to a circle and then along it, clockwise at a speed above 0."""
        if self.may_move:
            speed_m_s = self._frame.achieved_speed_m_s(speed_m_s)
            self._frame.pilot.fly([Circle(centre, radius_m, speed_m_s, self._frame.achieved_speed_m_s(approach_m_s))])

    def note(self, point: SetPoint, now_s: float) -> bool:
        """Store a set-point; returns whether it contains a target."""
        self.heard_s, self.last = now_s, self._read(point)
        return self.last is not None

    def follow(self, speed_m_s: float) -> None:
        """Follow the last set-point: to a place at this speed at most, or at its own velocity."""
        match self.last:
            case Vector() if find_target(self._frame.pilot.goal) != self.last:
                self.go(self.last, speed_m_s)
            case Velocity() if self.may_move:
                self._frame.pilot.fly([Drift(self.last)])

    def _read(self, point: SetPoint) -> Place | Velocity | None:
        if not point.ignored & PLACE_BITS:
            return self._read_place(point)
        if point.ignored & VELOCITY_BITS:
            return None
        north, east = self._turn(point, *point.velocity[:2])
        return Velocity(east, north, -point.velocity[2])

    def _read_place(self, point: SetPoint) -> Place | None:
        x, y, z = point.place
        if not point.local:
            return self.locate((int(x), int(y)), z, point.frame)
        north, east = self._turn(point, x, y)
        if point.frame == LOCAL:
            return Place(east, north, -z)
        here = self._frame.body.place
        return here.add(Place(east, north, -z)) if point.frame in OFFSETS else None

    def _turn(self, point: SetPoint, north: float, east: float) -> tuple[float, float]:
        """Return north and east of components that may be ahead and to the right."""
        if not (point.local and point.frame in BODY):
            return north, east
        sine, cosine = math.sin(self._frame.body.yaw_rad), math.cos(self._frame.body.yaw_rad)
        return north * cosine - east * sine, north * sine + east * cosine
