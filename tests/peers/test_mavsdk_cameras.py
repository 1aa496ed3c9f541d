"""MAVSDK's camera and gimbal clients work a simulated vehicle's, as a crew with its own program would."""

from __future__ import annotations

import asyncio

import pytest
from mavsdk.asyncio.plugins.camera import CameraAsync
from mavsdk.asyncio.plugins.gimbal import GimbalAsync
from mavsdk.plugins.camera import CaptureInfo
from mavsdk.plugins.gimbal import ControlMode, GimbalMode, SendMode

from simulator.config import AutopilotKind, SimCamera
from tests.peers.test_mavsdk import connected, wait_for
from tests.simulator.harness import LAT_DEG, LON_DEG

CAMERA = 100
"""MAV_COMP_ID_CAMERA."""
ZOOM = SimCamera("zoom", CAMERA, gimbal=True)


async def captured(camera: CameraAsync, count: int) -> dict[int, CaptureInfo]:
    """Return what is said of so many pictures, by their numbers.

    Words that are lost are no part of this: MAVSDK 4.1.0 asks for them again without the picture's number.
    """
    found: dict[int, CaptureInfo] = {}

    def is_enough(info: CaptureInfo) -> bool:
        found[info.index] = info
        return len(found) == count

    await wait_for(camera.subscribe_capture_info(), is_enough)
    return found


@pytest.mark.asyncio
@pytest.mark.parametrize("kind", list(AutopilotKind))
async def test_its_camera_client_takes_pictures_and_films(kind: AutopilotKind) -> None:
    async with connected(kind, "udpin", (ZOOM,)) as system:
        camera = CameraAsync(system)
        listed = await wait_for(camera.subscribe_camera_list(), lambda value: len(value.cameras) == 1)
        [known] = listed.cameras
        assert (known.component_id, known.vendor_name, known.model_name) == (CAMERA, "faultline", "zoom")
        collecting = asyncio.create_task(captured(camera, 3))
        await asyncio.sleep(0)
        await camera.take_photo(CAMERA)
        await camera.start_photo_interval(CAMERA, 1.0)
        found = await collecting
        await camera.stop_photo_interval(CAMERA)
        assert sorted(found) == [0, 1, 2]
        assert [found[index].file_url for index in range(3)] == [f"DSC{number:05d}.JPG" for number in (1, 2, 3)]
        assert all(one.is_success for one in found.values())
        place = found[0].position
        assert (place.latitude_deg, place.longitude_deg) == pytest.approx((LAT_DEG, LON_DEG), abs=1e-6)
        await camera.start_video(CAMERA)
        await wait_for(camera.subscribe_storage(), lambda value: value.storage.video_on)
        await camera.stop_video(CAMERA)
        await wait_for(camera.subscribe_storage(), lambda value: not value.storage.video_on)


@pytest.mark.asyncio
@pytest.mark.parametrize("kind", list(AutopilotKind))
async def test_its_gimbal_client_takes_control_and_turns_it(kind: AutopilotKind) -> None:
    async with connected(kind, "udpin", (ZOOM,)) as system:
        gimbal = GimbalAsync(system)
        listed = await wait_for(gimbal.subscribe_gimbal_list(), lambda value: len(value.gimbals) == 1)
        [known] = listed.gimbals
        number = known.gimbal_id
        await gimbal.take_control(number, ControlMode.PRIMARY)
        await wait_for(gimbal.subscribe_control_status(), lambda value: value.control_mode == ControlMode.PRIMARY)
        await gimbal.set_angles(number, 0.0, -45.0, 20.0, GimbalMode.YAW_FOLLOW, SendMode.ONCE)
        turned = await wait_for(
            gimbal.subscribe_attitude(), lambda value: abs(value.euler_angle_forward.pitch_deg + 45.0) < 0.1
        )
        assert turned.euler_angle_forward.yaw_deg == pytest.approx(20.0, abs=0.1)
        await gimbal.release_control(number)
        await wait_for(gimbal.subscribe_control_status(), lambda value: value.control_mode == ControlMode.NONE)
