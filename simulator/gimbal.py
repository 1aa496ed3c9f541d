"""A gimbal that a vehicle's cameras hang on, and what is said of it by the gimbal protocol v2.

The gimbal is a component that says where it looks; the autopilot manages it and passes on who has control of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from simulator.messages import Outbound, build_message

GIMBAL = 154
"""MAV_COMP_ID_GIMBAL."""
GIMBAL_S = 0.5
TURNS_DEG_S = 60.0
MANAGER_INFORMATION, MANAGER_STATUS, DEVICE_INFORMATION = 280, 281, 283
YAW_LOCK = 16
"""GIMBAL_MANAGER_FLAGS: the yaw counts from north."""
ROLL_AND_PITCH_LOCK = 4 | 8
YAW_OF_VEHICLE = 32
"""GIMBAL_DEVICE_FLAGS: the yaw that is said counts from the nose."""
ABILITIES = 2 | 4 | 256 | 512 | 1024
"""GIMBAL_MANAGER_CAP_FLAGS: a neutral place, and its axes, the yaw with the vehicle or locked."""
DOWN_RAD, UP_RAD = math.radians(-90.0), math.radians(30.0)
ASKING, NOBODY = -2.0, -3.0
"""Whom DO_GIMBAL_MANAGER_CONFIGURE gives the control to: who asks; nobody, if it was who asks."""


@dataclass(slots=True)
class Gimbal:
    """Where the cameras look: from the horizon, and from the nose."""

    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    wanted: tuple[float, float] = (0.0, 0.0)
    from_north: bool = False
    """Whether the yaw that is wanted counts from north."""
    stuck: bool = False
    due_s: float = 0.0
    control: tuple[int, int] | None = None
    """System and component that have taken control of it; None while nobody ever has."""

    def apply_pitch_yaw_command(self, params: Sequence[float]) -> None:
        """Obey DO_GIMBAL_MANAGER_PITCHYAW."""
        self.wanted, self.from_north = (params[0], params[1]), bool(int(params[4]) & YAW_LOCK)

    def change_control(self, params: Sequence[float], sender: tuple[int, int]) -> None:
        """Give its control to who asks for it, or take it back."""
        if params[0] == ASKING:
            self.control = sender
        elif params[0] >= 0:
            self.control = (int(params[0]), int(params[1]))
        elif params[0] == NOBODY and self.control == sender:
            self.control = (0, 0)

    def step(self, dt_s: float, nose_deg: float) -> None:
        """Turn towards where it is to look."""
        if self.stuck:
            return
        most_deg = TURNS_DEG_S * dt_s
        wanted_deg = self.wanted[1] - nose_deg if self.from_north else self.wanted[1]
        turn_deg = (wanted_deg - self.yaw_deg + 180.0) % 360.0 - 180.0
        self.pitch_deg += max(-most_deg, min(most_deg, self.wanted[0] - self.pitch_deg))
        self.yaw_deg += max(-most_deg, min(most_deg, turn_deg))

    # What is said of it.

    def build_attitude_message(self, boot_ms: int) -> Outbound:
        """Return where it looks; the gimbal says it."""
        return build_message(
            "GIMBAL_DEVICE_ATTITUDE_STATUS", target_system=0, target_component=0, time_boot_ms=boot_ms,
            flags=ROLL_AND_PITCH_LOCK | YAW_OF_VEHICLE, q=quaternion_from_euler(0.0, self.pitch_deg, self.yaw_deg),
            angular_velocity_x=math.nan, angular_velocity_y=math.nan, angular_velocity_z=math.nan, failure_flags=0,
            delta_yaw=math.nan, delta_yaw_velocity=math.nan, gimbal_device_id=0,
        )  # fmt: skip

    def build_manager_message(self, number: int, boot_ms: int) -> Outbound | None:
        """Return a message that the autopilot is asked for; None if it is not of gimbals."""
        if number == MANAGER_INFORMATION:
            return build_message(
                "GIMBAL_MANAGER_INFORMATION", time_boot_ms=boot_ms, cap_flags=ABILITIES, gimbal_device_id=GIMBAL,
                **_RANGES,
            )  # fmt: skip
        return self.build_status_message(boot_ms) if number == MANAGER_STATUS else None

    def build_status_message(self, boot_ms: int) -> Outbound:
        """Return who has control of it; the autopilot says it."""
        system, component = self.control or (0, 0)
        return build_message(
            "GIMBAL_MANAGER_STATUS", time_boot_ms=boot_ms, flags=ROLL_AND_PITCH_LOCK, gimbal_device_id=GIMBAL,
            primary_control_sysid=system, primary_control_compid=component, secondary_control_sysid=0,
            secondary_control_compid=0,
        )  # fmt: skip

    def build_device_message(self, boot_ms: int) -> Outbound:
        """Return what it is; the gimbal says it."""
        return build_message(
            "GIMBAL_DEVICE_INFORMATION", time_boot_ms=boot_ms, vendor_name=b"faultline", model_name=b"gimbal",
            custom_name=b"", firmware_version=1, hardware_version=1, uid=0, cap_flags=ABILITIES, custom_cap_flags=0,
            gimbal_device_id=0, **_RANGES,
        )  # fmt: skip


_RANGES = {
    "roll_min": 0.0,
    "roll_max": 0.0,
    "pitch_min": DOWN_RAD,
    "pitch_max": UP_RAD,
    "yaw_min": -math.pi,
    "yaw_max": math.pi,
}


def quaternion_from_euler(roll_deg: float, pitch_deg: float, yaw_deg: float) -> tuple[float, float, float, float]:
    """Return an attitude as MAVLink has it: w, x, y, z."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(math.radians(angle) / 2), math.sin(math.radians(angle) / 2))
        for angle in (roll_deg, pitch_deg, yaw_deg)
    )
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    return w, x, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
