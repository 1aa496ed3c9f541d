"""What cameras and gimbals say, as our messages; `codec` takes the frames apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from executor.adapters.mavlink.message_readers import Frame
from executor.core.formatting import escape_controls
from executor.core.interface.messages import CameraStatus, GimbalAttitude, PictureTaken
from missions.cameras import PictureProof

FIRST_UNIX_S = 1e9
"""A time before 2001 is one since the vehicle's start."""
IN_EARTH, IN_VEHICLE, YAW_LOCK = 64, 32, 16
"""GIMBAL_DEVICE_FLAGS: from where its yaw is counted; the third says it where neither of the first is set."""


def angles_deg(q: Sequence[float]) -> tuple[float | None, float | None, float | None]:
    """Return roll, pitch and yaw of an attitude w, x, y, z; None where it is not known: MAVLink sends zeros or NaN."""
    w, x, y, z = q
    if not all(map(math.isfinite, q)) or not 0.5 < w * w + x * x + y * y + z * z < 1.5:
        return None, None, None
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw) % 360


def _split_time(usec: int) -> tuple[float | None, float | None]:
    """Return a time since the vehicle's start, and one since 1970: a field holds either."""
    seconds = usec / 1e6
    if not seconds:
        return None, None
    return (None, seconds) if seconds > FIRST_UNIX_S else (seconds, None)


def _read_image_captured(frame: Frame) -> PictureTaken:
    roll, pitch, yaw = angles_deg(frame.q)
    placed = (frame.lat, frame.lon) != (0, 0)
    return PictureTaken(
        PictureProof.CAPTURED,
        frame.get_srcComponent(),
        frame.camera_id,
        frame.image_index,
        ok=frame.capture_result == 1,
        boot_s=frame.time_boot_ms / 1e3 if frame.time_boot_ms else None,
        unix_s=frame.time_utc / 1e6 if frame.time_utc / 1e6 > FIRST_UNIX_S else None,
        lat_deg=frame.lat / 1e7 if placed else None,
        lon_deg=frame.lon / 1e7 if placed else None,
        alt_msl_m=frame.alt / 1e3 if placed else None,
        alt_rel_m=frame.relative_alt / 1e3 if placed else None,
        roll_deg=roll,
        pitch_deg=pitch,
        yaw_deg=yaw,
        file=escape_controls(frame.file_url),
    )


def _read_camera_feedback(frame: Frame) -> PictureTaken:
    boot_s, unix_s = _split_time(frame.time_usec)
    return PictureTaken(
        PictureProof.FEEDBACK,
        frame.get_srcComponent(),
        frame.cam_idx + 1,
        frame.img_idx,
        ok=True,
        boot_s=boot_s,
        unix_s=unix_s,
        lat_deg=frame.lat / 1e7,
        lon_deg=frame.lng / 1e7,
        alt_msl_m=frame.alt_msl,
        alt_rel_m=frame.alt_rel,
        roll_deg=frame.roll,
        pitch_deg=frame.pitch,
        yaw_deg=frame.yaw,
    )


def _read_camera_trigger(frame: Frame) -> PictureTaken:
    boot_s, unix_s = _split_time(frame.time_usec)
    return PictureTaken(
        PictureProof.TRIGGER, frame.get_srcComponent(), 0, frame.seq, ok=True, boot_s=boot_s, unix_s=unix_s
    )


def _read_capture_status(frame: Frame) -> CameraStatus:
    free_mib = frame.available_capacity if math.isfinite(frame.available_capacity) else None
    return CameraStatus(frame.get_srcComponent(), frame.video_status == 1, frame.image_count, free_mib)


def _read_storage(frame: Frame) -> CameraStatus:
    ready = frame.status == 2  # STORAGE_STATUS_READY: only then its figures say something
    return CameraStatus(frame.get_srcComponent(), None, None, frame.available_capacity if ready else None)


def _read_gimbal_attitude(frame: Frame) -> GimbalAttitude | None:
    _, pitch, yaw = angles_deg(frame.q)
    if pitch is None or yaw is None:
        return None
    said = frame.flags & (IN_EARTH | IN_VEHICLE)
    from_north = bool(said & IN_EARTH) if said else bool(frame.flags & YAW_LOCK)
    return GimbalAttitude(pitch, yaw, from_north, failed=frame.failure_flags != 0)


def _read_mount_status(frame: Frame) -> GimbalAttitude | None:
    known = math.isfinite(frame.pitch) and math.isfinite(frame.yaw)
    return GimbalAttitude(frame.pitch, frame.yaw, from_north=False) if known else None


CAMERA_READERS: dict[str, Any] = {
    "CAMERA_IMAGE_CAPTURED": _read_image_captured,
    "CAMERA_FEEDBACK": _read_camera_feedback,
    "CAMERA_TRIGGER": _read_camera_trigger,
    "CAMERA_CAPTURE_STATUS": _read_capture_status,
    "STORAGE_INFORMATION": _read_storage,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": _read_gimbal_attitude,
    "MOUNT_ORIENTATION": _read_mount_status,
}
