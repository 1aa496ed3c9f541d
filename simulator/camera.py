"""Cameras of a simulated vehicle: triggered by its autopilot or by themselves, with a card, a gimbal and faults.

The gimbal is a component that reports its attitude; the autopilot manages it and reports which system controls it.

A camera with a component id from 7 on sends its own messages by the camera protocol v2; one wired to the autopilot
sends nothing, and the autopilot reports each trigger: ArduPilot by CAMERA_FEEDBACK, PX4 by CAMERA_TRIGGER.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from missions.items import Command as Item
from simulator.config import AutopilotKind, SimCamera, SimVehicle
from simulator.messages import Command, FieldValue, Outbound, Peer, Result, build_command_ack, build_message
from simulator.physics import Body, Home, Place

GIMBAL = 154
"""MAV_COMP_ID_GIMBAL."""
GIMBAL_S = 0.5
TURNS_DEG_S = 60.0
MANAGER_INFORMATION, MANAGER_STATUS, DEVICE_INFORMATION = 280, 281, 283
YAW_LOCK = 16
"""GIMBAL_MANAGER_FLAGS: yaw relative to north."""
ROLL_AND_PITCH_LOCK = 4 | 8
YAW_OF_VEHICLE = 32
"""GIMBAL_DEVICE_FLAGS: reported yaw relative to the nose."""
ABILITIES = 2 | 4 | 256 | 512 | 1024
"""GIMBAL_MANAGER_CAP_FLAGS: neutral position and axes, with yaw following or locked."""
DOWN_RAD, UP_RAD = math.radians(-90.0), math.radians(30.0)
ASKING, NOBODY = -2.0, -3.0
"""Arguments of DO_GIMBAL_MANAGER_CONFIGURE: give control to the sender, or release the sender's control."""


@dataclass(slots=True)
class Gimbal:
    """Pointing direction of the cameras: pitch from the horizon, yaw from the nose."""

    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    wanted: tuple[float, float] = (0.0, 0.0)
    from_north: bool = False
    """Whether the target yaw is relative to north."""
    stuck: bool = False
    due_s: float = 0.0
    control: tuple[int, int] | None = None
    """System and component in control; None before the first."""

    def step(self, dt_s: float, nose_deg: float) -> None:
        """Turn towards the target."""
        if self.stuck:
            return
        most_deg = TURNS_DEG_S * dt_s
        wanted_deg = self.wanted[1] - nose_deg if self.from_north else self.wanted[1]
        turn_deg = (wanted_deg - self.yaw_deg + 180.0) % 360.0 - 180.0
        self.pitch_deg += max(-most_deg, min(most_deg, self.wanted[0] - self.pitch_deg))
        self.yaw_deg += max(-most_deg, min(most_deg, turn_deg))

    # Reports.

    def build_attitude_message(self, boot_ms: int) -> Outbound:
        """Return the attitude message, sent by the gimbal."""
        return build_message(
            "GIMBAL_DEVICE_ATTITUDE_STATUS", target_system=0, target_component=0, time_boot_ms=boot_ms,
            flags=ROLL_AND_PITCH_LOCK | YAW_OF_VEHICLE, q=quaternion_from_euler(self.pitch_deg, self.yaw_deg),
            angular_velocity_x=math.nan, angular_velocity_y=math.nan, angular_velocity_z=math.nan, failure_flags=0,
            delta_yaw=math.nan, delta_yaw_velocity=math.nan, gimbal_device_id=0,
        )  # fmt: skip

    def build_manager_message(self, number: int, boot_ms: int) -> Outbound | None:
        """Return a requested message of the autopilot; None if it is not about gimbals."""
        if number == MANAGER_INFORMATION:
            return build_message(
                "GIMBAL_MANAGER_INFORMATION", time_boot_ms=boot_ms, cap_flags=ABILITIES, gimbal_device_id=GIMBAL,
                **_RANGES,
            )  # fmt: skip
        return self.build_status_message(boot_ms) if number == MANAGER_STATUS else None

    def build_status_message(self, boot_ms: int) -> Outbound:
        """Return the control status, sent by the autopilot."""
        system, component = self.control or (0, 0)
        return build_message(
            "GIMBAL_MANAGER_STATUS", time_boot_ms=boot_ms, flags=ROLL_AND_PITCH_LOCK, gimbal_device_id=GIMBAL,
            primary_control_sysid=system, primary_control_compid=component, secondary_control_sysid=0,
            secondary_control_compid=0,
        )  # fmt: skip

    def build_device_message(self, boot_ms: int) -> Outbound:
        """Return the device information, sent by the gimbal."""
        return build_message(
            "GIMBAL_DEVICE_INFORMATION", time_boot_ms=boot_ms, vendor_name=b"faultline", model_name=b"gimbal",
            custom_name=b"", firmware_version=1, hardware_version=1, uid=0, cap_flags=ABILITIES, custom_cap_flags=0,
            gimbal_device_id=0, **_RANGES,
        )  # fmt: skip


_RANGES = {
    "roll_min": 0.0, "roll_max": 0.0, "pitch_min": DOWN_RAD, "pitch_max": UP_RAD, "yaw_min": -math.pi,
    "yaw_max": math.pi,
}  # fmt: skip


def quaternion_from_euler(pitch_deg: float, yaw_deg: float) -> tuple[float, float, float, float]:
    """Return the attitude without roll as MAVLink's quaternion: w, x, y, z."""
    (cp, sp), (cy, sy) = (
        (math.cos(math.radians(angle) / 2), math.sin(math.radians(angle) / 2)) for angle in (pitch_deg, yaw_deg)
    )
    return cp * cy, -sp * sy, sp * cy, cp * sy


FIRST_COMPONENT = 7
CAMERA_TYPE, NO_AUTOPILOT = 30, 8
HEARTBEAT = build_message(
    "HEARTBEAT", type=CAMERA_TYPE, autopilot=NO_AUTOPILOT, base_mode=0, custom_mode=0, system_status=4,
    mavlink_version=3,
)  # fmt: skip
EVERYBODY = Peer(0, 0)
CARD_MIB, PICTURE_MIB = 32_000.0, 8.0
INFORMATION, SETTINGS, STORAGE, STATUS, CAPTURED = 259, 260, 261, 262, 263
CAPTURES = 1 | 2 | 8
"""CAMERA_CAP_FLAGS: video, images, and images during video."""
FOCAL_MM, SENSOR_MM, PIXELS = 24.0, (17.3, 13.0), (5280, 3956)
REQUEST_MESSAGE = 512
NEVER_S = math.inf
LOOKS_DEG = -90.0
"""Pitch of a camera without a gimbal."""
OF_CAMERAS = frozenset({
    Item.IMAGE_START_CAPTURE, Item.IMAGE_STOP_CAPTURE, Item.VIDEO_START_CAPTURE, Item.VIDEO_STOP_CAPTURE,
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class CapturedImage:
    """An image on a card."""

    camera: str
    number: int
    t_s: float
    """Simulated seconds since the simulation began."""
    lat_deg: float
    lon_deg: float
    alt_msl_m: float
    east_m: float
    """Position from its pad, like the next two."""
    north_m: float
    up_m: float
    pitch_deg: float
    yaw_deg: float
    speed_m_s: float


class CameraUnit:
    """One camera."""

    def __init__(self, config: SimCamera) -> None:
        self.config = config
        self.speaks = config.id >= FIRST_COMPONENT
        self.silent = self.mute = self.full = False
        self.loss = 0.0
        self.images = 0
        """Number of images taken."""
        self.told: dict[int, Outbound] = {}
        """Message sent for each image."""
        self.every_s = 0.0
        self.due_s = NEVER_S
        self.filming_s: float | None = None
        self.beat_s = 0.0


@dataclass(frozen=True, slots=True)
class ComponentMessage:
    """A message of one of the vehicle's components; None is the autopilot."""

    component: int | None
    message: Outbound


@dataclass(slots=True)
class Payload:
    """All cameras of one vehicle and the gimbal that carries them."""

    vehicle: SimVehicle
    home: Home
    body: Body
    units: list[CameraUnit] = field(init=False)
    gimbal: Gimbal | None = field(init=False)
    region: Place | None = None
    """Target of the gimbal, or of the nose without one."""
    every_m: float = 0.0
    """Trigger distance of the autopilot; 0 is off."""
    _last_m: tuple[float, float] | None = None
    _triggers: int = 0
    _said: list[ComponentMessage] = field(default_factory=list)
    _shots: list[CapturedImage] = field(default_factory=list)
    _rng: random.Random = field(init=False)
    now_s: float = 0.0
    boot_s: float = 0.0

    def __post_init__(self) -> None:
        self.units = [CameraUnit(config) for config in self.vehicle.cameras]
        self.gimbal = Gimbal() if any(config.gimbal for config in self.vehicle.cameras) else None
        self._rng = random.Random(f"{self.vehicle.seed}:{self.vehicle.name}:cameras")

    # Inputs.

    def execute_item(self, number: int, params: Sequence[float]) -> bool:
        """Execute a mission item or a command; returns whether it is one for cameras."""
        match number:
            case Item.DO_SET_CAM_TRIGG_DIST:
                self.every_m = max(0.0, params[0])
                self._last_m = (self.body.east_m, self.body.north_m)
                if self.every_m and params[2] == 1:
                    self._trigger()
            case Item.DO_DIGICAM_CONTROL:
                if params[4] == 1:
                    self._trigger()
            case Item.DO_GIMBAL_MANAGER_PITCHYAW | Item.DO_SET_ROI_LOCATION | Item.DO_SET_ROI_NONE:
                self._point_gimbal(number, params)
            case _ if number in OF_CAMERAS:
                for unit in self.units:
                    self._command_camera(unit, number, params)
            case _:
                return False
        return True

    def _point_gimbal(self, number: int, params: Sequence[float]) -> None:
        self.region = None
        if number == Item.DO_SET_ROI_LOCATION:
            self.region = self.home.place_of(int(params[4]), int(params[5]), params[6])
        elif number == Item.DO_SET_ROI_NONE:
            self.body.face_rad = None
        elif self.gimbal is not None:
            self.gimbal.wanted, self.gimbal.from_north = (params[0], params[1]), bool(int(params[4]) & YAW_LOCK)

    def _command_camera(self, unit: CameraUnit, number: int, params: Sequence[float]) -> None:
        match number:
            case Item.VIDEO_START_CAPTURE:
                unit.filming_s = self.now_s
            case Item.VIDEO_STOP_CAPTURE:
                unit.filming_s = None
            case _ if params[0] not in {0.0, float(unit.config.id)}:  # addressed to another camera
                pass
            case Item.IMAGE_STOP_CAPTURE:
                unit.every_s, unit.due_s = 0.0, NEVER_S
            case _ if params[2] == 1:
                self._take_picture(unit)
            case _:
                unit.every_s, unit.due_s = params[1], self.now_s

    def answer_component_command(self, command: Command, component: int) -> None:
        """Answer a command to one of its components."""
        if component == GIMBAL and self.gimbal is not None and command.number == REQUEST_MESSAGE:
            known = command.integer_param(0) == DEVICE_INFORMATION
            self._said.append(
                ComponentMessage(GIMBAL, build_command_ack(command.number, _to_result(done=known), EVERYBODY))
            )
            self._said += [ComponentMessage(GIMBAL, self.gimbal.build_device_message(self._boot_ms))] if known else []
        for unit in self.units:
            if unit.config.id != component or unit.silent:
                continue
            message = self._build_requested_message(unit, command) if command.number == REQUEST_MESSAGE else None
            done = message is not None or self.execute_item(command.number, command.params)
            self._queue_message(unit, build_command_ack(command.number, _to_result(done=done), EVERYBODY))
            if message is not None:
                self._queue_message(unit, message)

    def build_manager_message(self, number: int) -> Outbound | None:
        """Return the autopilot's answer to a request for a gimbal message; None without an answer."""
        return None if self.gimbal is None else self.gimbal.build_manager_message(number, self._boot_ms)

    def change_gimbal_control(self, params: Sequence[float], sender: tuple[int, int]) -> bool:
        """Give a sender control of the gimbal, or release it; returns whether there is a gimbal."""
        if self.gimbal is None:
            return False
        if params[0] == ASKING:
            self.gimbal.control = sender
        elif params[0] >= 0:
            self.gimbal.control = (int(params[0]), int(params[1]))
        elif params[0] == NOBODY and self.gimbal.control == sender:
            self.gimbal.control = (0, 0)
        return True

    def apply_camera_fault(self, fault: str, value: float) -> None:
        """Apply a fault, named as in `InjectionKind`."""
        for unit in self.units:
            match fault:
                case "camera-silent":
                    unit.silent = True
                case "camera-mute":
                    unit.mute = True
                case "camera-loss":
                    unit.loss = value
                case "card-full":
                    unit.full = True
        if fault == "gimbal-stuck" and self.gimbal is not None:
            self.gimbal.stuck = True

    def step(self, now_s: float, boot_s: float, dt_s: float) -> None:
        """Run for one step."""
        self.now_s, self.boot_s = now_s, boot_s
        if self.region is not None:
            self._turn_to(self.region)
        if self.gimbal is not None:
            self.gimbal.step(dt_s, math.degrees(self.body.yaw_rad))
            if now_s >= self.gimbal.due_s:
                self.gimbal.due_s = now_s + GIMBAL_S
                self._said.append(ComponentMessage(GIMBAL, self.gimbal.build_attitude_message(self._boot_ms)))
                if self.gimbal.control is not None:
                    self._said.append(ComponentMessage(None, self.gimbal.build_status_message(self._boot_ms)))
        here_m = (self.body.east_m, self.body.north_m)
        if self.every_m and self._last_m is not None and math.dist(here_m, self._last_m) >= self.every_m:
            self._last_m = here_m
            self._trigger()
        for unit in self.units:
            if now_s >= unit.due_s:
                unit.due_s = now_s + unit.every_s
                self._take_picture(unit)
            if unit.speaks and not unit.silent and now_s >= unit.beat_s:
                unit.beat_s = now_s + 1.0
                self._queue_message(unit, HEARTBEAT)
                self._queue_message(unit, self._build_capture_status(unit))

    def _turn_to(self, region: Place) -> None:
        """Point the gimbal at a region of interest; without a gimbal the vehicle turns its nose (autoyaw.cpp)."""
        east_m, north_m = region.east_m - self.body.east_m, region.north_m - self.body.north_m
        bearing_rad = math.atan2(east_m, north_m)
        if self.gimbal is None:
            self.body.face_rad = bearing_rad
            return
        pitch_rad = math.atan2(region.up_m - self.body.up_m, math.hypot(east_m, north_m))
        self.gimbal.wanted, self.gimbal.from_north = (math.degrees(pitch_rad), math.degrees(bearing_rad)), True

    # Outputs.

    def drain(self) -> list[ComponentMessage]:
        """Remove and return the messages to send."""
        said, self._said = self._said, []
        return said

    def drain_shots(self) -> list[CapturedImage]:
        """Remove and return the new images."""
        shots, self._shots = self._shots, []
        return shots

    @property
    def _boot_ms(self) -> int:
        return round((self.now_s - self.boot_s) * 1000)

    def _queue_message(self, unit: CameraUnit, message: Outbound) -> None:
        self._said.append(ComponentMessage(unit.config.id, message))

    def _trigger(self) -> None:
        number, self._triggers = self._triggers, self._triggers + 1
        usec = round((self.now_s - self.boot_s) * 1e6)
        taken = [(unit, self._take_picture(unit)) for unit in self.units]
        if self.vehicle.autopilot is AutopilotKind.PX4:
            self._said.append(ComponentMessage(None, build_message("CAMERA_TRIGGER", time_usec=usec, seq=number)))
            return
        for unit, done in taken:
            if done and not unit.speaks and not unit.mute and self._rng.random() >= unit.loss:
                self._said.append(ComponentMessage(None, self._build_feedback(unit, number + 1, usec)))

    def _build_feedback(self, unit: CameraUnit, number: int, usec: int) -> Outbound:
        lat, lon = self.home.lat_lon_e7(self.body.east_m, self.body.north_m)
        angles = (math.degrees(angle) for angle in (self.body.roll_rad, self.body.pitch_rad, self.body.yaw_rad))
        roll, pitch, yaw = angles
        return build_message(
            "CAMERA_FEEDBACK", time_usec=usec, target_system=0, cam_idx=max(0, unit.config.id - 1), img_idx=number,
            lat=lat, lng=lon, alt_msl=self.home.alt_m + self.body.up_m, alt_rel=self.body.up_m, roll=roll, pitch=pitch,
            yaw=yaw % 360, foc_len=0.0, flags=0, completed_captures=number,
        )  # fmt: skip

    def _take_picture(self, unit: CameraUnit) -> bool:
        """Take one image; returns whether the camera reacted."""
        if unit.silent:
            return False
        lat, lon = self.home.lat_lon_e7(self.body.east_m, self.body.north_m)
        if not unit.full:
            unit.images += 1
            self._shots.append(CapturedImage(
                unit.config.name, unit.images, self.now_s, lat / 1e7, lon / 1e7, self.home.alt_m + self.body.up_m,
                self.body.east_m, self.body.north_m, self.body.up_m, *self._look_angles_deg(unit),
                self.body.ground_speed_m_s,
            ))  # fmt: skip
        elif not unit.speaks:
            return False
        if unit.speaks:
            pitch_deg, yaw_deg = self._look_angles_deg(unit)
            number = unit.images - 1 if not unit.full else unit.images
            message = build_message(
                "CAMERA_IMAGE_CAPTURED", time_boot_ms=self._boot_ms, time_utc=0, camera_id=0, lat=lat, lon=lon,
                alt=round((self.home.alt_m + self.body.up_m) * 1e3), relative_alt=round(self.body.up_m * 1e3),
                q=quaternion_from_euler(pitch_deg, yaw_deg), image_index=number, capture_result=int(not unit.full),
                file_url=b"" if unit.full else format_picture_name(number + 1).encode(),
            )  # fmt: skip
            if not unit.full:
                unit.told[number] = message
            if not unit.mute and self._rng.random() >= unit.loss:
                self._queue_message(unit, message)
        return True

    def _look_angles_deg(self, unit: CameraUnit) -> tuple[float, float]:
        yaw_deg = math.degrees(self.body.yaw_rad)
        if unit.config.gimbal and self.gimbal is not None:
            return self.gimbal.pitch_deg, (yaw_deg + self.gimbal.yaw_deg) % 360
        return LOOKS_DEG, yaw_deg % 360

    def _build_requested_message(self, unit: CameraUnit, command: Command) -> Outbound | None:
        wanted = command.integer_param(0)
        if wanted == STATUS:
            return self._build_capture_status(unit)
        if wanted == STORAGE:
            return self._build_storage(unit)
        if wanted == INFORMATION:
            return self._build_information(unit)
        if wanted == SETTINGS:
            return build_message("CAMERA_SETTINGS", time_boot_ms=self._boot_ms, mode_id=int(unit.filming_s is not None))
        return unit.told.get(command.integer_param(1)) if wanted == CAPTURED and not unit.mute else None

    def _free_mib(self, unit: CameraUnit) -> float:
        return 0.0 if unit.full else max(0.0, CARD_MIB - PICTURE_MIB * unit.images)

    def _build_capture_status(self, unit: CameraUnit) -> Outbound:
        films = unit.filming_s is not None and not unit.full
        since_s = self.now_s - unit.filming_s if films and unit.filming_s is not None else 0.0
        return build_message(
            "CAMERA_CAPTURE_STATUS", time_boot_ms=self._boot_ms, image_status=2 if unit.every_s else 0,
            video_status=int(films), image_interval=unit.every_s, recording_time_ms=round(since_s * 1e3),
            available_capacity=self._free_mib(unit), image_count=unit.images, camera_device_id=0,
        )  # fmt: skip

    def _build_information(self, unit: CameraUnit) -> Outbound:
        return build_message(
            "CAMERA_INFORMATION", time_boot_ms=self._boot_ms, vendor_name=_to_padded_bytes("faultline", 32),
            model_name=_to_padded_bytes(unit.config.name, 32), firmware_version=1, focal_length=FOCAL_MM,
            sensor_size_h=SENSOR_MM[0], sensor_size_v=SENSOR_MM[1], resolution_h=PIXELS[0], resolution_v=PIXELS[1],
            lens_id=0, flags=CAPTURES, cam_definition_version=0, cam_definition_uri=b"",
        )  # fmt: skip

    def _build_storage(self, unit: CameraUnit) -> Outbound:
        free_mib = self._free_mib(unit)
        fields: dict[str, FieldValue] = {
            "time_boot_ms": self._boot_ms, "storage_id": 1, "storage_count": 1, "status": 2,
            "total_capacity": CARD_MIB, "used_capacity": CARD_MIB - free_mib, "available_capacity": free_mib,
            "read_speed": 0.0, "write_speed": 0.0, "type": 0, "name": b"", "storage_usage": 0,
        }  # fmt: skip
        return Outbound("STORAGE_INFORMATION", fields)


def format_picture_name(number: int) -> str:
    """Return the camera's file name of an image."""
    return f"DSC{number:05d}.JPG"


def _to_padded_bytes(text: str, length: int) -> list[int]:
    return list(text.encode()[: length - 1].ljust(length, b"\0"))


def _to_result(*, done: bool) -> Result:
    return Result.ACCEPTED if done else Result.UNSUPPORTED
