"""What simulated cameras write: small JPEGs of the line as they would see it, with EXIF, in a folder for each card."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from executor.images.matching import (
    DETAILS,
    EXPOSURE,
    GPS,
    MAKE,
    MODEL,
    OFFSET,
    ORIGINAL,
    SERIAL,
    SUBSECOND,
    build_gps_tags,
)
from missions import Network
from missions.geo import FloatArray
from simulator.camera import CapturedImage, format_picture_name

SIZE_PX = (160, 120)
VIEW_DEG = 70.0
GROUND, SKY, WIRE = (96, 120, 72), (170, 195, 220), (30, 30, 30)
NEAREST_M = 0.5
EXPOSURE_S = 0.001


@dataclass(slots=True)
class SimulatedCards:
    """The cards of a simulated fleet."""

    folder: Path
    network: Network
    unix_s: float
    """Seconds since 1970 when the simulation begins."""
    ahead_s: Mapping[str, float] = field(default_factory=dict)
    """By how much the clocks of a vehicle's cameras are ahead, by its name."""
    places: bool = True
    """Whether the cameras know where they are."""
    zoned: bool = False
    """Whether they say their time zone."""

    def write(self, vehicle: str, shot: CapturedImage) -> Path:
        """Write one picture.

        Raises:
            OSError: there is no room, or the folder cannot be made.
        """
        from PIL import Image, ImageDraw

        folder = self.folder / f"{vehicle}-{shot.camera}"
        folder.mkdir(parents=True, exist_ok=True)
        image = Image.new("RGB", SIZE_PX, SKY)
        draw = ImageDraw.Draw(image)
        horizon_px = SIZE_PX[1] / 2 - _focal_px() * math.tan(math.radians(max(-80.0, min(80.0, -shot.pitch_deg))))
        draw.rectangle((0, max(0.0, horizon_px), *SIZE_PX), fill=GROUND)
        for ends in self._project_spans(shot):
            draw.line([tuple(end) for end in ends.tolist()], fill=WIRE, width=2)
        draw.text((4, 4), f"{vehicle} {shot.number}", fill=WIRE)
        exif = image.getexif()
        for tag, value in ((MAKE, "faultline"), (MODEL, shot.camera)):
            exif[tag] = value
        taken = datetime.fromtimestamp(self.unix_s + shot.t_s + self.ahead_s.get(vehicle, 0.0), UTC)
        details = {
            ORIGINAL: f"{taken:%Y:%m:%d %H:%M:%S}", SUBSECOND: f"{taken.microsecond // 1000:03d}",
            EXPOSURE: EXPOSURE_S, SERIAL: "0001",
        }  # fmt: skip
        exif.get_ifd(DETAILS).update(details | ({OFFSET: "+00:00"} if self.zoned else {}))
        if self.places:
            exif.get_ifd(GPS).update(build_gps_tags(shot.lat_deg, shot.lon_deg, shot.alt_msl_m))
        path = folder / format_picture_name(shot.number)
        image.save(path, "JPEG", quality=60, exif=exif)
        return path

    def _project_spans(self, shot: CapturedImage) -> list[FloatArray]:
        """Return the spans that are in sight, (2, 2) float64 each, in pixels."""
        network, frame = self.network, self.network.frame
        here_m = np.array([*frame.to_local_m(shot.lat_deg, shot.lon_deg), shot.alt_msl_m])
        tops_m = np.array([
            frame.alt_m + shot.up_m - 15.0 if pylon.elevation_m is None else pylon.elevation_m + (pylon.height_m or 0.0)
            for pylon in network.pylons
        ])  # fmt: skip
        seen = []
        for segment in network.segments:
            ends = np.column_stack((network.positions_m[[segment.a, segment.b]], tops_m[[segment.a, segment.b]]))
            pixels = _project_leg(ends - here_m, shot.pitch_deg, shot.yaw_deg)
            if pixels is not None:
                seen.append(pixels)
        return seen


def _focal_px() -> float:
    return SIZE_PX[0] / 2 / math.tan(math.radians(VIEW_DEG) / 2)


def _project_leg(offsets_m: FloatArray, pitch_deg: float, yaw_deg: float) -> FloatArray | None:
    """Return (2, 2) pixels of a leg before the camera, cut off at it; None where all of it is behind."""
    pitch, yaw = math.radians(pitch_deg), math.radians(yaw_deg)
    ahead = np.array([math.cos(pitch) * math.sin(yaw), math.cos(pitch) * math.cos(yaw), math.sin(pitch)])
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    depths = offsets_m @ ahead
    if depths.max() <= NEAREST_M:
        return None
    if depths.min() < NEAREST_M:
        near, far = (0, 1) if depths[0] < depths[1] else (1, 0)
        share = (NEAREST_M - depths[near]) / (depths[far] - depths[near])
        offsets_m = offsets_m.copy()
        offsets_m[near] += share * (offsets_m[far] - offsets_m[near])
        depths = offsets_m @ ahead
    up = np.cross(right, ahead)
    across, above = offsets_m @ right / depths, offsets_m @ up / depths
    focal_px = _focal_px()
    return np.column_stack((SIZE_PX[0] / 2 + focal_px * across, SIZE_PX[1] / 2 - focal_px * above)).clip(-1e4, 1e4)
