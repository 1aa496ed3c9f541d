"""Define cameras, the camera tasks of each asset, and the camera actions along a leg.

Along a span a camera takes a picture at a fixed distance, triggered by the autopilot or by the camera's own timer, or
records video. The camera actions of a leg are stored in its waypoint, and so are part of the mission.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from missions.errors import SafetyError

FIRST_COMPONENT = 7
"""First component id of MAVLink cameras; 1 to 6 are wired to the autopilot, 0 is all of them."""


ONE_STOP_M = 1.0
"""Horizontal distance below which viewpoints above each other are one stop."""


class Trigger(Enum):
    """What triggers a picture."""

    DISTANCE = "distance"
    """By the autopilot at a distance (DO_SET_CAM_TRIGG_DIST)."""
    INTERVAL = "interval"
    """By the camera at an interval (IMAGE_START_CAPTURE)."""
    VIDEO = "video"
    """Video instead of pictures (VIDEO_START_CAPTURE)."""
    ONCE = "once"
    """By the mission at the end of the leg (IMAGE_START_CAPTURE of one image, or DO_DIGICAM_CONTROL)."""


class PictureProof(Enum):
    """Message that confirms a picture."""

    CAPTURED = "captured"
    """CAMERA_IMAGE_CAPTURED of a MAVLink camera."""
    FEEDBACK = "feedback"
    """CAMERA_FEEDBACK of ArduPilot."""
    TRIGGER = "trigger"
    """CAMERA_TRIGGER of PX4: reports the trigger only."""


LEAST_INTERVAL_S = 1.0
"""Default for a camera's shortest interval between pictures."""
AIM_DEG = 20.0
"""Default for the largest aiming error."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that vehicles carry."""

    name: str
    id: int = 0
    """Camera id in mission items."""
    focal_mm: float | None = None
    sensor_mm: tuple[float, float] | None = None
    """Width and height of the sensor; the width lies across the flight."""
    image_px: tuple[int, int] | None = None
    """Width and height of a picture."""
    least_interval_s: float = LEAST_INTERVAL_S
    """Shortest interval between two pictures."""
    gimbal: bool = False
    """Whether it has a gimbal that missions point."""

    def footprint_m(self, distance_m: float) -> tuple[float, float]:
        """Return the footprint of a picture at a distance: across the flight direction and along it.

        Raises:
            SafetyError: its focal length or sensor is not known.
        """
        if self.focal_mm is None or self.sensor_mm is None:
            raise SafetyError(f"camera {self.name!r}: focal_mm and sensor_mm: expected both for a footprint")
        across, along = (side * distance_m / self.focal_mm for side in self.sensor_mm)
        return across, along

    def ground_sample_m(self, distance_m: float) -> float:
        """Return the ground sample distance: the size of one pixel at a distance.

        Raises:
            SafetyError: its focal length, sensor or pixels are not known.
        """
        if self.image_px is None:
            raise SafetyError(f"camera {self.name!r}: image_px: expected width and height for a ground sample distance")
        return self.footprint_m(distance_m)[0] / self.image_px[0]


@dataclass(frozen=True, slots=True)
class SpanCameraTask:
    """Task of one camera along a span."""

    camera: str
    trigger: Trigger
    every_m: float = 0.0
    """Distance between two pictures; 0 for video."""
    pitch_deg: float | None = None
    """Camera pitch from the horizon, negative is down; None points it at the line."""
    aim_deg: float = AIM_DEG
    """Largest aiming error of a picture that counts."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A place from which a pylon is viewed."""

    place_m: tuple[float, float]
    """East and north of the depot."""
    yaw_deg: int
    """Heading to the pylon, from north, -180 to 180."""
    below_m: float = 0.0
    """Depth below the common surface of all flights."""
    crosses: bool = False
    """Whether the next leg crosses a line: up to the common surface, across, and down again."""


@dataclass(frozen=True, slots=True)
class PylonStop:
    """One stop of the flight around a pylon."""

    place_m: tuple[float, float]
    below_m: float
    points: tuple[int, ...] = ()
    """Viewpoints photographed here; empty where it only climbs or descends."""


@dataclass(frozen=True, slots=True)
class PylonCameraTask:
    """Task of one camera at a pylon."""

    camera: str
    points: tuple[Viewpoint, ...]
    """Viewpoints in forward order of flight."""
    hover_s: float
    aim_deg: float
    target_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Target: east, north, and height above the depot's ground."""
    pitch_deg: float | None = None
    """Camera pitch from the horizon, negative is down; None points it at the target."""
    roi: bool = False
    """Whether the target is a region of interest: the vehicle turns its nose there."""

    @property
    def deepest_m(self) -> float:
        """Depth of its lowest viewpoint below the common surface."""
        return max(point.below_m for point in self.points)

    def list_stops(self, *, reverse: bool, low: bool) -> list[PylonStop]:
        """Return the stops of its flight, from the first viewpoint to the last, or reversed.

        Args:
            reverse: Whether to reverse the order.
            low: Whether the vehicle descends to viewpoints below the common surface; from its layer those above each
                other are one place, and one picture.
        """
        found: list[PylonStop] = []
        for number, point in enumerate(self.points):
            stop = PylonStop(point.place_m, point.below_m if low else 0.0, (number,))
            before = found[-1] if found and found[-1].points and found[-1].place_m == stop.place_m else None
            if before is not None and abs(before.below_m - stop.below_m) < ONE_STOP_M:
                found.pop()  # both are merged, at the higher of their places
                stop = PylonStop(stop.place_m, min(before.below_m, stop.below_m), (*before.points, *stop.points))
            found.append(stop)
            if low and point.crosses:
                ends = (stop, self.points[number + 1])
                found += [PylonStop(end.place_m, 0.0) for end in ends if end.below_m > 0]
        return found[::-1] if reverse else found

    def pitch_from_deg(self, place_m: tuple[float, float], up_m: float) -> int:
        """Return the pitch in whole degrees to the target from a place at a height over the depot's ground."""
        if self.pitch_deg is not None:
            return round(self.pitch_deg)
        return round(math.degrees(math.atan2(self.target_m[2] - up_m, math.dist(self.target_m[:2], place_m))))


@dataclass(frozen=True, slots=True)
class Region:
    """A region of interest."""

    lat_deg: float
    lon_deg: float
    alt_rel_m: float
    """Height above the vehicle's own home."""


@dataclass(frozen=True, slots=True)
class Capture:
    """Action of one camera along a leg."""

    camera: str
    camera_id: int
    trigger: Trigger
    every_m: float
    pitch_deg: int | None = None
    """Gimbal pitch from the horizon; None leaves it unchanged. Whole degrees, as ArduPilot stores no others."""
    yaw_deg: int | None = None
    """Gimbal yaw from the nose, clockwise."""
    aim_deg: float = AIM_DEG
    from_north: bool = False
    """Whether ``yaw_deg`` counts from north."""
    region: Region | None = None
    """Target for the vehicle's nose, with ``yaw_deg`` from north; also without a gimbal."""
    points: tuple[int, ...] = ()
    """At a pylon: viewpoints that the picture shows."""

    @property
    def is_filming(self) -> bool:
        """Whether it records video."""
        return self.trigger is Trigger.VIDEO


@dataclass(frozen=True, slots=True)
class CameraTasks:
    """Camera tasks of all segments, and the vehicles' cameras."""

    cameras: Mapping[str, Camera] = field(default_factory=dict)
    carriers: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Cameras carried, by vehicle name."""
    spans: Mapping[int, tuple[SpanCameraTask, ...]] = field(default_factory=dict)
    """Tasks by segment."""
    pylons: Mapping[int, PylonCameraTask] = field(default_factory=dict)
    """Tasks by the segment that represents a pylon."""

    def __bool__(self) -> bool:
        return bool(self.spans or self.pylons)

    def cameras_for(self, segment: int) -> frozenset[str]:
        """Return the cameras that a segment requires."""
        pylon = self.pylons.get(segment)
        own = frozenset(look.camera for look in self.spans.get(segment, ()))
        return own if pylon is None else own | {pylon.camera}

    def find_barred_segments(self, vehicle: str, broken: Iterable[str] = ()) -> frozenset[int]:
        """Return the segments that a vehicle cannot be assigned because it lacks a required camera.

        Args:
            vehicle: Its name.
            broken: Its cameras that have failed.
        """
        own = self.carriers.get(vehicle, frozenset()) - set(broken)
        return frozenset(segment for segment in (*self.spans, *self.pylons) if not self.cameras_for(segment) <= own)

    @property
    def deepest_m(self) -> float:
        """Depth of the lowest of all viewpoints below the common surface."""
        return max((look.deepest_m for look in self.pylons.values()), default=0.0)


NO_LOOKS = CameraTasks()


def choose_picture_proof(camera: Camera, autopilot: str) -> PictureProof:
    """Return the message that confirms a camera's pictures on a vehicle."""
    if camera.id >= FIRST_COMPONENT:
        return PictureProof.CAPTURED
    return PictureProof.FEEDBACK if autopilot == "ardupilot" else PictureProof.TRIGGER
