"""Telemetry that both dialects fill identically, and sensor values derived from the body's motion.

Only simulated quantities are reported: there is no magnetic field, no differential pressure and no noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar, Protocol

from simulator.airframe import Airframe
from simulator.config import SimVehicle
from simulator.guidance import find_target
from simulator.messages import FieldValue, Outbound, build_message
from simulator.physics import DRAG_PER_S, GRAVITY_M_S2, THRUST_TO_WEIGHT, Body, Home, Place, Positioning

Builder = Callable[[], Outbound | None]


class Reporter(Protocol):
    """Properties of a vehicle that telemetry reports."""

    CAPABILITIES: ClassVar[int]
    VERSION: ClassVar[tuple[int, int, int, int]]
    """Three numbers and FIRMWARE_VERSION_TYPE."""
    vehicle: SimVehicle
    home: Home
    frame: Airframe
    positioning: Positioning
    now_s: float

    @property
    def boot_ms(self) -> int:
        """Time since boot."""
        ...

    @property
    def gps_fix(self) -> int:
        """GPS_FIX_TYPE."""
        ...


INT16_MAX = 32767
UINT16_MAX = 65535
UNUSED_CELLS = (UINT16_MAX,) * 9
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)
UNKNOWN_COVARIANCE = (math.nan,) * 21
UNKNOWN_RSSI = 255
ACCELERATION_AND_TURN, PRESSURE = 0x3F, 1 << 9 | 1 << 11 | 1 << 12
"""HIGHRES_IMU.fields_updated."""
MILLI_G, MILLI = 1000.0 / GRAVITY_M_S2, 1000.0
PLACE_ALONE = 0b110111111000
"""POSITION_TARGET_TYPEMASK."""
LOCAL_NED, RELATIVE_INT = 1, 6
"""MAV_FRAME."""
MOTORS = 4
AUTOPILOT_ESTIMATOR = 8
"""MAV_ESTIMATOR_TYPE."""


def make_builders(vehicle: Reporter) -> Mapping[str, Builder]:
    """Return the builders of telemetry that both dialects fill identically, by message name."""
    home, body, frame = vehicle.home, vehicle.frame.body, vehicle.frame
    lat, lon = home.lat_lon_e7(0.0, 0.0)
    return {
        "GLOBAL_POSITION_INT": lambda: _build_global_position(vehicle),
        "GPS_RAW_INT": lambda: _build_gps_raw(vehicle),
        "AUTOPILOT_VERSION": lambda: _build_autopilot_version(vehicle),
        "LOCAL_POSITION_NED": lambda: build_message(
            "LOCAL_POSITION_NED", time_boot_ms=vehicle.boot_ms, x=body.north_m, y=body.east_m, z=-body.up_m,
            vx=body.v_north_m_s, vy=body.v_east_m_s, vz=-body.v_up_m_s,
        ),
        "ATTITUDE": lambda: build_message(
            "ATTITUDE", time_boot_ms=vehicle.boot_ms, roll=body.roll_rad, pitch=body.pitch_rad, yaw=body.yaw_rad,
            rollspeed=0.0, pitchspeed=0.0, yawspeed=body.yaw_rate_rad_s,
        ),
        "VFR_HUD": lambda: build_message(
            "VFR_HUD", airspeed=body.ground_speed_m_s, groundspeed=body.ground_speed_m_s,
            heading=heading_cdeg(body) // 100, throttle=38 if frame.motors_on else 0,
            alt=home.alt_m + body.up_m, climb=body.v_up_m_s,
        ),
        "HOME_POSITION": lambda: build_message(
            "HOME_POSITION", latitude=lat, longitude=lon, altitude=round(home.alt_m * 1000), x=0.0, y=0.0, z=0.0,
            q=NO_ROTATION, approach_x=0.0, approach_y=0.0, approach_z=0.0, time_usec=vehicle.boot_ms * 1000,
        ),
        # Without a satellite clock the time of day is unknown, and unknown is 0.
        "SYSTEM_TIME": lambda: build_message("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=vehicle.boot_ms),
        "TIMESYNC": lambda: build_message("TIMESYNC", tc1=0, ts1=vehicle.boot_ms * 1_000_000),
        "EXTENDED_SYS_STATE": lambda: build_message(
            "EXTENDED_SYS_STATE", vtol_state=0, landed_state=int(frame.landed_state)
        ),
        **_make_sensors(vehicle), **_make_states(vehicle), **_make_targets(vehicle),
    }  # fmt: skip


def _make_sensors(vehicle: Reporter) -> Mapping[str, Builder]:
    """Return the builders of sensor and motor messages, sent on request."""
    home, body = vehicle.home, vehicle.frame.body

    def scaled_imu(name: str, **stamp: int) -> Outbound:
        (x, y, z), (p, q, r) = body.specific_force_m_s2, body.turn_rates_rad_s
        return build_message(
            name, xacc=round(x * MILLI_G), yacc=round(y * MILLI_G), zacc=round(z * MILLI_G), xgyro=round(p * MILLI),
            ygyro=round(q * MILLI), zgyro=round(r * MILLI), xmag=0, ymag=0, zmag=0, **stamp,
        )  # fmt: skip

    def highres_imu() -> Outbound:
        (x, y, z), (p, q, r), alt_m = body.specific_force_m_s2, body.turn_rates_rad_s, home.alt_m + body.up_m
        return build_message(
            "HIGHRES_IMU", time_usec=vehicle.boot_ms * 1000, xacc=x, yacc=y, zacc=z, xgyro=p, ygyro=q, zgyro=r,
            xmag=0.0, ymag=0.0, zmag=0.0, abs_pressure=pressure_hpa(alt_m), diff_pressure=0.0, pressure_alt=alt_m,
            temperature=temperature_deg(alt_m), fields_updated=ACCELERATION_AND_TURN | PRESSURE, id=0,
        )  # fmt: skip

    def motors() -> list[float]:
        return [thrust_share(vehicle)] * MOTORS

    def servo_output() -> Outbound:
        pwm = {f"servo{number}_raw": round(1000 + 1000 * share) for number, share in enumerate(motors(), start=1)}
        others = {f"servo{number}_raw": 0 for number in range(MOTORS + 1, 9)}
        return build_message("SERVO_OUTPUT_RAW", time_usec=vehicle.boot_ms * 1000, port=0, **pwm, **others)

    return {
        "ATTITUDE_QUATERNION": lambda: build_message(
            "ATTITUDE_QUATERNION", time_boot_ms=vehicle.boot_ms,
            **{f"q{at}": value for at, value in enumerate(body.quaternion, start=1)}, **name_rates(body),
        ),
        "RAW_IMU": lambda: scaled_imu("RAW_IMU", time_usec=vehicle.boot_ms * 1000),
        "SCALED_IMU": lambda: scaled_imu("SCALED_IMU", time_boot_ms=vehicle.boot_ms),
        "HIGHRES_IMU": highres_imu,
        "SCALED_PRESSURE": lambda: build_message(
            "SCALED_PRESSURE", time_boot_ms=vehicle.boot_ms, press_abs=pressure_hpa(home.alt_m + body.up_m),
            press_diff=0.0, temperature=round(100 * temperature_deg(home.alt_m + body.up_m)),
        ),
        "SERVO_OUTPUT_RAW": servo_output,
        "ACTUATOR_OUTPUT_STATUS": lambda: build_message(
            "ACTUATOR_OUTPUT_STATUS", time_usec=vehicle.boot_ms * 1000, active=MOTORS,
            actuator=(*motors(), *(0.0,) * (32 - MOTORS)),
        ),
    }  # fmt: skip


def _make_states(vehicle: Reporter) -> Mapping[str, Builder]:
    """Return the builders of position messages, estimated and true."""
    home, body = vehicle.home, vehicle.frame.body
    return {
        "ALTITUDE": lambda: build_message(
            "ALTITUDE", time_usec=vehicle.boot_ms * 1000, altitude_monotonic=home.alt_m + body.up_m,
            altitude_amsl=home.alt_m + body.up_m, altitude_local=body.up_m, altitude_relative=body.up_m,
            altitude_terrain=math.nan, bottom_clearance=math.nan,
        ),
        "ODOMETRY": lambda: build_message(
            "ODOMETRY", time_usec=vehicle.boot_ms * 1000, frame_id=LOCAL_NED, child_frame_id=LOCAL_NED,
            x=body.north_m, y=body.east_m, z=-body.up_m, q=body.quaternion, vx=body.v_north_m_s, vy=body.v_east_m_s,
            vz=-body.v_up_m_s, **name_rates(body), pose_covariance=UNKNOWN_COVARIANCE,
            velocity_covariance=UNKNOWN_COVARIANCE, reset_counter=0, estimator_type=AUTOPILOT_ESTIMATOR, quality=0,
        ),
        "HIL_STATE_QUATERNION": lambda: _build_truth(vehicle, name_rates(body)),
        "SIMSTATE": lambda: build_message(
            "SIMSTATE", roll=body.roll_rad, pitch=body.pitch_rad, yaw=body.yaw_rad,
            **dict(zip(("xacc", "yacc", "zacc"), body.specific_force_m_s2, strict=True)),
            **dict(zip(("xgyro", "ygyro", "zgyro"), body.turn_rates_rad_s, strict=True)),
            lat=home.lat_lon_e7(body.east_m, body.north_m)[0], lng=home.lat_lon_e7(body.east_m, body.north_m)[1],
        ),
        # It has no receiver.
        "RC_CHANNELS": lambda: build_message(
            "RC_CHANNELS", time_boot_ms=vehicle.boot_ms, chancount=0, rssi=UNKNOWN_RSSI,
            **{f"chan{number}_raw": 0 for number in range(1, 19)},
        ),
    }  # fmt: skip


def name_rates(body: Body) -> dict[str, float]:
    """Return the turn rates by field name."""
    return dict(zip(("rollspeed", "pitchspeed", "yawspeed"), body.turn_rates_rad_s, strict=True))


def _build_truth(vehicle: Reporter, rates: Mapping[str, float]) -> Outbound:
    home, body = vehicle.home, vehicle.frame.body
    lat, lon = home.lat_lon_e7(body.east_m, body.north_m)
    x, y, z = (round(value * MILLI_G) for value in body.specific_force_m_s2)
    air_m_s = _to_centi(vehicle.frame.air_speed_m_s)
    return build_message(
        "HIL_STATE_QUATERNION", time_usec=vehicle.boot_ms * 1000, attitude_quaternion=body.quaternion, **rates,
        lat=lat, lon=lon, alt=round((home.alt_m + body.up_m) * 1000), vx=_to_centi(body.v_north_m_s),
        vy=_to_centi(body.v_east_m_s), vz=_to_centi(-body.v_up_m_s), ind_airspeed=air_m_s, true_airspeed=air_m_s,
        xacc=x, yacc=y, zacc=z,
    )  # fmt: skip


def _make_targets(vehicle: Reporter) -> Mapping[str, Builder]:
    """Return the builders of target messages, which are omitted without a target."""
    home, body = vehicle.home, vehicle.frame.body

    def target() -> Place | None:
        return find_target(vehicle.frame.pilot.goal) if vehicle.frame.armed else None

    def position_target(name: str, frame: int, **place: float) -> Outbound:
        rest = dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0)
        return build_message(
            name, time_boot_ms=vehicle.boot_ms, coordinate_frame=frame, type_mask=PLACE_ALONE, **place, **rest
        )

    def global_target(to: Place) -> Outbound:
        lat, lon = home.lat_lon_e7(to.east_m, to.north_m)
        return position_target("POSITION_TARGET_GLOBAL_INT", RELATIVE_INT, lat_int=lat, lon_int=lon, alt=to.up_m)

    def local_target(to: Place) -> Outbound:
        return position_target("POSITION_TARGET_LOCAL_NED", LOCAL_NED, x=to.north_m, y=to.east_m, z=-to.up_m)

    def navigation() -> Outbound:
        to = target() or body.place
        east, north = to.east_m - body.east_m, to.north_m - body.north_m
        bearing = round(math.degrees(math.atan2(east, north)))
        return build_message(
            "NAV_CONTROLLER_OUTPUT", nav_roll=math.degrees(body.roll_rad), nav_pitch=math.degrees(body.pitch_rad),
            nav_bearing=bearing, target_bearing=bearing, wp_dist=min(round(math.hypot(east, north)), UINT16_MAX),
            alt_error=to.up_m - body.up_m, aspd_error=0.0, xtrack_error=0.0,
        )  # fmt: skip

    def when_known(build: Callable[[Place], Outbound]) -> Builder:
        def builder() -> Outbound | None:
            to = target()
            return None if to is None else build(to)

        return builder

    return {
        "GPS_GLOBAL_ORIGIN": lambda: build_message(
            "GPS_GLOBAL_ORIGIN", latitude=home.lat_lon_e7(0.0, 0.0)[0], longitude=home.lat_lon_e7(0.0, 0.0)[1],
            altitude=round(home.alt_m * 1000), time_usec=vehicle.boot_ms * 1000,
        ),
        "POSITION_TARGET_GLOBAL_INT": when_known(global_target),
        "POSITION_TARGET_LOCAL_NED": when_known(local_target), "NAV_CONTROLLER_OUTPUT": navigation,
    }  # fmt: skip


def pressure_hpa(alt_m: float) -> float:
    """Return the pressure of the standard atmosphere."""
    return float(1013.25 * (1.0 - 2.25577e-5 * alt_m) ** 5.25588)


def temperature_deg(alt_m: float) -> float:
    """Return the temperature of the standard atmosphere."""
    return 15.0 - 0.0065 * alt_m


def thrust_share(vehicle: Reporter) -> float:
    """Return the share of full thrust that the present motion needs."""
    frame = vehicle.frame
    if not frame.motors_on or frame.body.on_ground:
        return 0.0
    body, more = frame.body, frame.body.acceleration
    east, north = more[0] + DRAG_PER_S * body.v_east_m_s, more[1] + DRAG_PER_S * body.v_north_m_s
    return min(math.hypot(east, north, GRAVITY_M_S2 + more[2]) / (GRAVITY_M_S2 * THRUST_TO_WEIGHT), 1.0)


def heading_cdeg(body: Body) -> int:
    """Return the heading in hundredths of a degree."""
    return round(math.degrees(body.yaw_rad) * 100) % 36000


def _to_centi(value_m_s: float) -> int:
    return round(value_m_s * 100)


def _build_global_position(vehicle: Reporter) -> Outbound:
    home, body, now_s = vehicle.home, vehicle.frame.body, vehicle.now_s
    lat, lon = home.lat_lon_e7(body.east_m + vehicle.positioning.off_m(now_s), body.north_m)
    return build_message(
        "GLOBAL_POSITION_INT", time_boot_ms=vehicle.boot_ms, lat=lat, lon=lon,
        alt=round((home.alt_m + body.up_m) * 1000), relative_alt=round(body.up_m * 1000),
        vx=_to_centi(body.v_north_m_s), vy=_to_centi(body.v_east_m_s + vehicle.positioning.off_m_s(now_s)),
        vz=_to_centi(-body.v_up_m_s), hdg=heading_cdeg(body),
    )  # fmt: skip


def _build_gps_raw(vehicle: Reporter) -> Outbound:
    """Return GPS_RAW_INT; accuracies as in the recorded flights."""
    home, body = vehicle.home, vehicle.frame.body
    lat, lon = home.lat_lon_e7(body.east_m, body.north_m)
    alt_mm = round((home.alt_m + body.up_m) * 1000)
    course = round(math.degrees(math.atan2(body.v_east_m_s, body.v_north_m_s)) * 100) % 36000
    return build_message(
        "GPS_RAW_INT", time_usec=vehicle.boot_ms * 1000, fix_type=vehicle.gps_fix, lat=lat, lon=lon, alt=alt_mm,
        eph=121, epv=200, vel=_to_centi(body.ground_speed_m_s), cog=course, satellites_visible=10,
        alt_ellipsoid=alt_mm, h_acc=300, v_acc=300, vel_acc=0, hdg_acc=0, yaw=0,
    )  # fmt: skip


def name_cells(voltage_v: float) -> dict[str, FieldValue]:
    """Return the cells in BATTERY_STATUS as both autopilots do: the pack in the first, the rest unused."""
    cells = round(voltage_v * 1000), *UNUSED_CELLS
    unused = dict.fromkeys(("id", "time_remaining", "mode", "fault_bitmask"), 0)
    return {**unused, "temperature": INT16_MAX, "voltages": cells, "voltages_ext": (0, 0, 0, 0)}


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


def _build_autopilot_version(vehicle: Reporter) -> Outbound:
    version, uid = vehicle.VERSION, vehicle.vehicle.sysid
    software = version[0] << 24 | version[1] << 16 | version[2] << 8 | version[3]
    return build_message(
        "AUTOPILOT_VERSION", capabilities=vehicle.CAPABILITIES, flight_sw_version=software,
        middleware_sw_version=software, os_sw_version=0, board_version=0, flight_custom_version=(0,) * 8,
        middleware_custom_version=(0,) * 8, os_custom_version=(0,) * 8, vendor_id=0, product_id=0,
        uid=uid, uid2=(uid, *(0,) * 17),
    )  # fmt: skip
