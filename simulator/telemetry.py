"""Telemetry messages that both autopilots fill alike."""

from __future__ import annotations

import math

from simulator.messages import Outbound, build_message
from simulator.physics import Body, Home

INT16_MAX = 32767
UINT16_MAX = 65535
UNUSED_CELLS = (UINT16_MAX,) * 9
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)


def _heading_cdeg(body: Body) -> int:
    return round(math.degrees(body.yaw_rad) * 100) % 36000


def _to_centi(value_m_s: float) -> int:
    return round(value_m_s * 100)


def build_global_position(home: Home, body: Body, boot_ms: int, off: tuple[float, float] = (0.0, 0.0)) -> Outbound:
    """Return GLOBAL_POSITION_INT; `off` is how far east, and faster to the east, it takes itself to be."""
    lat, lon = home.lat_lon_e7(body.east_m + off[0], body.north_m)
    return build_message(
        "GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=lat, lon=lon, alt=round((home.alt_m + body.up_m) * 1000),
        relative_alt=round(body.up_m * 1000), vx=_to_centi(body.v_north_m_s),
        vy=_to_centi(body.v_east_m_s + off[1]), vz=_to_centi(-body.v_up_m_s), hdg=_heading_cdeg(body),
    )  # fmt: skip


def build_local_position(body: Body, boot_ms: int) -> Outbound:
    """Return LOCAL_POSITION_NED about the pad."""
    return build_message(
        "LOCAL_POSITION_NED", time_boot_ms=boot_ms, x=body.north_m, y=body.east_m, z=-body.up_m, vx=body.v_north_m_s,
        vy=body.v_east_m_s, vz=-body.v_up_m_s,
    )  # fmt: skip


def build_attitude(body: Body, boot_ms: int) -> Outbound:
    """Return ATTITUDE."""
    return build_message(
        "ATTITUDE", time_boot_ms=boot_ms, roll=body.roll_rad, pitch=body.pitch_rad, yaw=body.yaw_rad, rollspeed=0.0,
        pitchspeed=0.0, yawspeed=body.yaw_rate_rad_s,
    )  # fmt: skip


def build_gps_raw(home: Home, body: Body, boot_ms: int, *, fix: int) -> Outbound:
    """Return GPS_RAW_INT; accuracies as in the recorded flights."""
    lat, lon = home.lat_lon_e7(body.east_m, body.north_m)
    alt_mm = round((home.alt_m + body.up_m) * 1000)
    course = round(math.degrees(math.atan2(body.v_east_m_s, body.v_north_m_s)) * 100) % 36000
    return build_message(
        "GPS_RAW_INT", time_usec=boot_ms * 1000, fix_type=fix, lat=lat, lon=lon, alt=alt_mm, eph=121, epv=200,
        vel=_to_centi(body.ground_speed_m_s), cog=course, satellites_visible=10, alt_ellipsoid=alt_mm, h_acc=300,
        v_acc=300, vel_acc=0, hdg_acc=0, yaw=0,
    )  # fmt: skip


def build_vfr_hud(home: Home, body: Body, *, motors: bool) -> Outbound:
    """Return VFR_HUD."""
    return build_message(
        "VFR_HUD", airspeed=body.ground_speed_m_s, groundspeed=body.ground_speed_m_s,
        heading=_heading_cdeg(body) // 100, throttle=38 if motors else 0, alt=home.alt_m + body.up_m,
        climb=body.v_up_m_s,
    )  # fmt: skip


def build_home_position(home: Home, boot_ms: int) -> Outbound:
    """Return HOME_POSITION."""
    lat, lon = home.lat_lon_e7(0.0, 0.0)
    return build_message(
        "HOME_POSITION", latitude=lat, longitude=lon, altitude=round(home.alt_m * 1000), x=0.0, y=0.0, z=0.0,
        q=NO_ROTATION, approach_x=0.0, approach_y=0.0, approach_z=0.0, time_usec=boot_ms * 1000,
    )  # fmt: skip


def build_battery_status(
    *,
    voltage_v: float,
    current_ca: int,
    consumed_mah: int,
    energy_hj: int,
    remaining_pct: int,
    charge_state: int,
    kind: int,
) -> Outbound:
    """Return BATTERY_STATUS as both autopilots fill it: the pack in the first cell, the rest unused.

    Args:
        voltage_v: of the pack.
        current_ca: centiamperes, -1 unknown.
        consumed_mah: -1 unknown.
        energy_hj: hectojoules, -1 unknown.
        remaining_pct: -1 unknown.
        charge_state: MAV_BATTERY_CHARGE_STATE.
        kind: MAV_BATTERY_TYPE, and function: 0 unknown, 1 lithium polymer for everything.
    """
    return build_message(
        "BATTERY_STATUS", id=0, battery_function=kind, type=kind, temperature=INT16_MAX,
        voltages=(round(voltage_v * 1000), *UNUSED_CELLS), current_battery=current_ca, current_consumed=consumed_mah,
        energy_consumed=energy_hj, battery_remaining=remaining_pct, time_remaining=0, charge_state=charge_state,
        voltages_ext=(0, 0, 0, 0), mode=0, fault_bitmask=0,
    )  # fmt: skip


def build_sys_status(
    sensors: tuple[int, int, int], *, voltage_v: float, current_ca: int, remaining_pct: int
) -> Outbound:
    """Return SYS_STATUS; ``sensors`` is (present, enabled, healthy)."""
    return build_message(
        "SYS_STATUS", onboard_control_sensors_present=sensors[0], onboard_control_sensors_enabled=sensors[1],
        onboard_control_sensors_health=sensors[2], load=0, voltage_battery=round(voltage_v * 1000),
        current_battery=current_ca, battery_remaining=remaining_pct, drop_rate_comm=0, errors_comm=0, errors_count1=0,
        errors_count2=0, errors_count3=0, errors_count4=0,
    )  # fmt: skip


def build_ekf_status(flags: int) -> Outbound:
    """Return EKF_STATUS_REPORT with the variances of a good estimate."""
    return build_message(
        "EKF_STATUS_REPORT", flags=flags, velocity_variance=0.005, pos_horiz_variance=0.005, pos_vert_variance=0.001,
        compass_variance=0.01, terrain_alt_variance=0.0,
    )  # fmt: skip


def estimator_status(flags: int, boot_ms: int) -> Outbound:
    """Return ESTIMATOR_STATUS of a good estimate."""
    return build_message(
        "ESTIMATOR_STATUS", time_usec=boot_ms * 1000, vel_ratio=0.05, pos_horiz_ratio=0.05, pos_vert_ratio=0.05,
        mag_ratio=0.05, hagl_ratio=0.0, tas_ratio=0.0, pos_horiz_accuracy=0.5, pos_vert_accuracy=0.5, flags=flags,
    )  # fmt: skip


def build_fence_status(boot_ms: int, breaches: int, *, breached: bool) -> Outbound:
    """Return FENCE_STATUS of a circle fence."""
    return build_message(
        "FENCE_STATUS", breach_status=int(breached), breach_count=breaches, breach_type=3 if breached else 0,
        breach_time=boot_ms, breach_mitigation=0,
    )  # fmt: skip


def build_wind(wind_m_s: tuple[float, float]) -> Outbound:
    """Return WIND, for air that moves (east, north): ArduPilot's degrees go from -180 to 180."""
    east, north = wind_m_s
    return build_message(
        "WIND", direction=math.degrees(math.atan2(-east, -north)), speed=math.hypot(east, north), speed_z=0.0
    )


def build_wind_cov(wind_m_s: tuple[float, float], boot_ms: int, alt_m: float) -> Outbound:
    """Return WIND_COV, for air that moves (east, north)."""
    return build_message(
        "WIND_COV", time_usec=boot_ms * 1000, wind_x=wind_m_s[1], wind_y=wind_m_s[0], wind_z=0.0, var_horiz=0.3,
        var_vert=0.0, wind_alt=alt_m, horiz_accuracy=0.5, vert_accuracy=0.0,
    )  # fmt: skip


def build_heartbeat(*, autopilot: int, base_mode: int, custom_mode: int, system_status: int) -> Outbound:
    """Return HEARTBEAT of a quadrotor."""
    return build_message(
        "HEARTBEAT", type=2, autopilot=autopilot, base_mode=base_mode, custom_mode=custom_mode,
        system_status=system_status, mavlink_version=3,
    )  # fmt: skip


def build_autopilot_version(*, capabilities: int, version: tuple[int, int, int, int], uid: int) -> Outbound:
    """Return AUTOPILOT_VERSION; ``version`` is three numbers and FIRMWARE_VERSION_TYPE."""
    software = version[0] << 24 | version[1] << 16 | version[2] << 8 | version[3]
    return build_message(
        "AUTOPILOT_VERSION", capabilities=capabilities, flight_sw_version=software, middleware_sw_version=software,
        os_sw_version=0, board_version=0, flight_custom_version=(0,) * 8, middleware_custom_version=(0,) * 8,
        os_custom_version=(0,) * 8, vendor_id=0, product_id=0, uid=uid, uid2=(uid, *(0,) * 17),
    )  # fmt: skip
