"""Where cameras look: angles between two looks."""

from __future__ import annotations

import math


def angle_between_deg(pitch_deg: float, yaw_deg: float, other_pitch_deg: float, other_yaw_deg: float) -> float:
    """Return the angle between two looks, each by its pitch from the horizon and its bearing.

    >>> round(angle_between_deg(0, 0, 0, 90)), round(angle_between_deg(-90, 0, -90, 180))
    (90, 0)
    """
    one, other = _look_vector(pitch_deg, yaw_deg), _look_vector(other_pitch_deg, other_yaw_deg)
    return math.degrees(math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True))))))


def bearing_deg(begin_m: tuple[float, float], end_m: tuple[float, float]) -> float:
    """Return the bearing from one place to another, east and north in metres."""
    return math.degrees(math.atan2(end_m[0] - begin_m[0], end_m[1] - begin_m[1])) % 360


def _look_vector(pitch_deg: float, yaw_deg: float) -> tuple[float, float, float]:
    pitch, yaw = math.radians(pitch_deg), math.radians(yaw_deg)
    return math.cos(pitch) * math.sin(yaw), math.cos(pitch) * math.cos(yaw), math.sin(pitch)
