"""One vehicle's cameras as they are known: each picture with its place and look, and what each said of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from executor.core.interface.messages import GimbalAttitude
from missions.cameras import PictureProof


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that a camera, or an autopilot, said it took."""

    camera: str
    """By its name in the site file."""
    source: PictureProof
    sequence: int
    at_s: float
    """When it was taken, in the ground station's time."""
    unix_s: float | None
    """By the camera's own clock, where it says that."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    alt_rel_m: float
    """Over the vehicle's own home."""
    pitch_deg: float | None
    """Of the camera from the horizon; None where nobody knows."""
    yaw_deg: float | None
    """Of the camera from north."""
    speed_m_s: float
    file: str
    segment: int | None
    """Which span it shows; None where it was taken elsewhere."""
    along_m: float | None
    """Where along the span's flight track, from a."""
    points: tuple[int, ...] = ()
    """At a pylon: of which of its viewpoints it is."""
    flaw: str = ""
    """Why it does not count; nothing if it does."""


@dataclass(frozen=True, slots=True)
class WantedPicture:
    """A picture that was passed over, and is asked for again."""

    sequence: int
    tries: int = 0
    at_s: float = float("-inf")
    """When it was asked for last."""


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """What one camera said of itself."""

    name: str
    component: int
    heard_s: float | None = None
    """When it said anything last."""
    picture_s: float | None = None
    """When it took its last picture that succeeded."""
    last: int | None = None
    """The highest number of a picture."""
    wanted: tuple[WantedPicture, ...] = ()
    failures: int = 0
    """Pictures in a row that it says it could not take."""
    beside: int = 0
    """Pictures in a row that its gimbal aimed beside what was asked."""
    left_behind: int = 0
    """Viewpoints since it last said anything of a picture."""
    films: bool = False
    free_mib: float | None = None
    images: int | None = None
    """How many it says it has taken."""


@dataclass(frozen=True, slots=True)
class PayloadState:
    """All cameras of one vehicle."""

    pictures: tuple[Picture, ...] = ()
    cameras: tuple[CameraRecord, ...] = ()
    gimbal: GimbalAttitude | None = None
    gimbal_s: float | None = None
    off_since_s: float | None = None
    """Since when the gimbal does not point where the leg under way wants it."""
    working: tuple[int, float] | None = None
    """The visit on which pictures are due now, and since when it moves along it."""
    broken: frozenset[str] = frozenset()
    """Cameras that do not do their work any more, by their names."""

    def camera_of(self, name: str, component: int) -> CameraRecord:
        """Return what is known of a camera."""
        return next((one for one in self.cameras if one.name == name), CameraRecord(name, component))

    def with_camera(self, camera: CameraRecord) -> PayloadState:
        """Return it with what is known of one camera replaced."""
        others = tuple(one for one in self.cameras if one.name != camera.name)
        return replace(self, cameras=(*others, camera))


@dataclass(frozen=True, slots=True)
class AwaitedPictures:
    """A span that was flown, and whose pictures are waited for."""

    vehicle: str
    since_s: float
    nearer_m: float | None = None
    """The distance of one that counts already, from farther away."""


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
