"""Hold the state of one vehicle's cameras: each picture with its position and direction, and each camera's reports."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.interface.messages import GimbalAttitude
from missions.cameras import PictureProof


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that a camera or an autopilot reported."""

    camera: str
    """Camera name from the site file."""
    source: PictureProof
    sequence: int
    at_s: float
    """Time of exposure, in the ground station's time."""
    unix_s: float | None
    """By the camera's own clock, where reported."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    alt_rel_m: float
    """Over the vehicle's own home."""
    pitch_deg: float | None
    """Camera pitch from the horizon; None if unknown."""
    yaw_deg: float | None
    """Camera yaw from north."""
    speed_m_s: float
    file: str
    segment: int | None
    """The span it shows; None if taken elsewhere."""
    along_m: float | None
    """Distance along the span's flight track, from a."""
    points: tuple[int, ...] = ()
    """At a pylon, the viewpoints it covers."""
    flaw: str = ""
    """Why it does not count; empty if it does."""


@dataclass(frozen=True, slots=True)
class WantedPicture:
    """A missing picture that is requested again."""

    sequence: int
    tries: int = 0
    at_s: float = float("-inf")
    """When it was last requested."""


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """The reports of one camera."""

    name: str
    component: int
    heard_s: float | None = None
    """When it last reported."""
    picture_s: float | None = None
    """When it took its last good picture."""
    last: int | None = None
    """Highest picture number."""
    wanted: tuple[WantedPicture, ...] = ()
    failures: int = 0
    """Consecutive pictures it reports as failed."""
    beside: int = 0
    """Consecutive pictures with its gimbal off target."""
    left_behind: int = 0
    """Viewpoints passed since it last reported a picture."""
    films: bool = False
    free_mib: float | None = None
    images: int | None = None
    """Pictures taken, as counted by the camera."""


@dataclass(frozen=True, slots=True)
class PayloadState:
    """All cameras of one vehicle."""

    pictures: tuple[Picture, ...] = ()
    cameras: tuple[CameraRecord, ...] = ()
    gimbal: GimbalAttitude | None = None
    gimbal_s: float | None = None
    off_since_s: float | None = None
    """Since when the gimbal does not point where the present leg requires."""
    working: tuple[int, float] | None = None
    """The visit with pictures due now, and since when the vehicle moves along it."""
    broken: frozenset[str] = frozenset()
    """Names of cameras that no longer work."""

    def camera_of(self, name: str, component: int) -> CameraRecord:
        """Return the record of a camera."""
        return next((one for one in self.cameras if one.name == name), CameraRecord(name, component))

    def with_camera(self, camera: CameraRecord) -> PayloadState:
        """Return the payload with one camera's record replaced."""
        others = tuple(one for one in self.cameras if one.name != camera.name)
        return replace(self, cameras=(*others, camera))


@dataclass(frozen=True, slots=True)
class AwaitedPictures:
    """A flown span that waits for its pictures."""

    vehicle: str
    since_s: float
    nearer_m: float | None = None
    """For a span that counts from farther away already, the new distance."""


def angle_between_deg(pitch_deg: float, yaw_deg: float, other_pitch_deg: float, other_yaw_deg: float) -> float:
    """Return the angle between two directions, each by its pitch from the horizon and its bearing.

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
