"""What PX4's log says of modes and failsafes: who chose a mode, and what failed.

Topics and fields changed their names over the years; every name that one of 1.8 to 1.17 has is here.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from executor.core.interface.messages import Actor

DO_SET_MODE = 176
SWITCH_MODE = 7
"""action_request.action."""
REQUESTED_BY = MappingProxyType(dict.fromkeys((0, 1, 2, 3), Actor.PILOT))
"""action_request.source: a gesture of the sticks, a switch, a button, the mode switch."""
MODE_SWITCHES = (
    "mode_slot", "mode_switch", "return_switch", "loiter_switch", "posctl_switch", "offboard_switch", "acro_switch",
    "rattitude_switch", "stab_switch", "man_switch",
)  # fmt: skip
"""Of manual_control_switches, and before 1.12 of manual_control_setpoint."""
ORDERED_USEC = 1_500_000
"""So long after an order a mode changes because of it: the commander looks at its orders many times a second."""
FAILED: Mapping[str, tuple[str, str]] = MappingProxyType({
    # failsafe_flags, since 1.14
    "battery_low_remaining_time": ("battery", "battery: too little for the way home"),
    "battery_unhealthy": ("battery", "battery unhealthy"),
    "manual_control_signal_lost": ("rc", "manual control lost"),
    "gcs_connection_lost": ("ground station", "ground station lost"),
    "global_position_invalid": ("gps", "global position invalid"),
    "position_accuracy_low": ("gps", "position accuracy low"),
    "local_position_invalid": ("ekf", "local position invalid"),
    "local_velocity_invalid": ("ekf", "local velocity invalid"),
    "local_altitude_invalid": ("ekf", "local altitude invalid"),
    "attitude_invalid": ("attitude", "attitude invalid"),
    "angular_velocity_invalid": ("attitude", "angular velocity invalid"),
    "geofence_breached": ("fence", "geofence breached"),
    "fd_critical_failure": ("attitude", "failure detector: attitude"),
    "fd_esc_arming_failure": ("motor", "failure detector: speed controller"),
    "fd_motor_failure": ("motor", "failure detector: motor"),
    "fd_imbalanced_prop": ("motor", "failure detector: imbalanced propeller"),
    "mission_failure": ("other", "mission failed"),
    "navigator_failure": ("other", "navigator failed"),
    "offboard_control_signal_lost": ("other", "offboard control lost"),
    "wind_limit_exceeded": ("other", "wind limit exceeded"),
    "flight_time_limit_exceeded": ("other", "flight time limit exceeded"),
    # vehicle_status, before 1.14
    "rc_signal_lost": ("rc", "manual control lost"),
    "data_link_lost": ("ground station", "ground station lost"),
    "engine_failure": ("motor", "motor failed"),
})  # fmt: skip
"""Flags, and what kind of failsafe they are a reason for."""
VALID: Mapping[str, tuple[str, str]] = MappingProxyType({
    "condition_global_position_valid": ("gps", "global position invalid"),
    "condition_local_position_valid": ("ekf", "local position invalid"),
    "condition_local_velocity_valid": ("ekf", "local velocity invalid"),
    "condition_battery_healthy": ("battery", "battery unhealthy"),
})  # fmt: skip
"""vehicle_status_flags, before 1.14: what is well."""
CRITICAL = 2
"""battery_warning of failsafe_flags and battery_status: critical, and above it emergency and failed."""
UNNAMED = ("other", "failsafe")
"""The log has no flag that would say what failed."""
