"""What cameras and gimbals say, from frames as pymavlink packs them; nothing of it passes for the autopilot's word."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.message_readers import angles_deg
from executor.core.interface.messages import (
    CameraHeard,
    CameraStatus,
    GimbalAttitude,
    Message,
    PictureTaken,
    SendCommand,
)
from missions.cameras import PictureProof
from simulator.camera import quaternion_from_euler

NOWHERE = (0.0, 0.0, 0.0, 0.0)


def heard(message: mav.MAVLink_message, component: int) -> Message | None:
    packed = bytes(message.pack(mav.MAVLink(None, srcSystem=3, srcComponent=component)))
    [received] = MavlinkCodec().decode(packed)
    return received.message


def captured(q: tuple[float, ...] = NOWHERE, result: int = 1, place: tuple[int, int] = (0, 0)) -> mav.MAVLink_message:
    return mav.MAVLink_camera_image_captured_message(
        12_500, 0, 0, *place, 300_000, 40_000, q, 7, result, b"DSC00008.JPG"
    )


def test_a_picture_of_a_mavlink_camera() -> None:
    said = heard(captured(quaternion_from_euler(-72.0, 350.0), place=(496000000, 156000000)), 100)
    assert isinstance(said, PictureTaken)
    assert (said.source, said.component, said.sequence, said.ok, said.boot_s, said.file) == (
        PictureProof.CAPTURED, 100, 7, True, 12.5, "DSC00008.JPG",
    )  # fmt: skip
    assert (said.lat_deg, said.lon_deg, said.alt_msl_m, said.alt_rel_m) == (49.6, 15.6, 300.0, 40.0)
    assert said.pitch_deg == pytest.approx(-72.0, abs=0.01)
    assert said.yaw_deg == pytest.approx(350.0, abs=0.01)


def test_what_a_camera_does_not_know_is_unknown_and_never_zero() -> None:
    said = heard(captured(result=0), 100)
    assert isinstance(said, PictureTaken)
    assert (said.ok, said.unix_s, said.lat_deg, said.alt_rel_m, said.pitch_deg) == (False, None, None, None, None)
    assert angles_deg((math.nan, 0.0, 0.0, 0.0)) == (None, None, None)


def test_feedback_and_triggers_of_the_autopilots() -> None:
    feedback = mav.MAVLink_camera_feedback_message(
        20_000_000, 0, 0, 5, 496000000, 156000000, 300.0, 40.0, 1.0, -2.0, 90.0, 0.0, 0, 5
    )
    said = heard(feedback, 1)
    assert isinstance(said, PictureTaken)
    assert (said.source, said.camera, said.sequence, said.boot_s, said.yaw_deg) == (
        PictureProof.FEEDBACK,
        1,
        5,
        20.0,
        90.0,
    )
    dated = heard(mav.MAVLink_camera_trigger_message(1_790_000_000_000_000, 4), 1)
    assert isinstance(dated, PictureTaken)
    assert (dated.source, dated.sequence, dated.boot_s, dated.unix_s) == (PictureProof.TRIGGER, 4, None, 1.79e9)


def test_a_status_a_heartbeat_and_a_gimbal() -> None:
    status = mav.MAVLink_camera_capture_status_message(1000, 0, 1, 0.0, 5000, 120.0, 9)
    assert heard(status, 100) == CameraStatus(100, films=True, images=9, free_mib=120.0)
    beat = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_CAMERA, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    assert heard(beat, 101) == CameraHeard(101)
    q = quaternion_from_euler(-30.0, 20.0)
    for flags, from_north in ((32, False), (64, True), (16, True), (12, False)):
        gimbal = mav.MAVLink_gimbal_device_attitude_status_message(0, 0, 1, flags, q, 0.0, 0.0, 0.0, 0)
        said = heard(gimbal, 154)
        assert isinstance(said, GimbalAttitude)
        assert (round(said.pitch_deg), round(said.yaw_deg), said.from_north) == (-30, 20, from_north)


def test_a_question_goes_to_the_camera() -> None:
    packed = MavlinkCodec().encode(SendCommand(512, (263.0, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0), component=100), 3, 1)
    frame = mav.MAVLink(None).decode(bytearray(packed))
    assert (frame.target_system, frame.target_component, frame.param2) == (3, 100, 7.0)
