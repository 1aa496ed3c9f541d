"""Motion of a multicopter with limits so that positions never jump, and its position estimate.

Local metres relative to the vehicle's own pad: east, north, up. The ground is level at up = 0.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import NamedTuple

GRAVITY_M_S2 = 9.81
TERMINAL_FALL_M_S = 25.0
HARD_LANDING_M_S = 2.0
"""Touch-down speed that destroys the vehicle, as a fall from 25 cm does."""
DRAG_PER_S = 0.35
"""Specific drag: at 5 m/s the recorded flights tilt by 0.2 rad, g * 0.2 / 5."""
THRUST_TO_WEIGHT = 2.0
"""Thrust-to-weight ratio at full throttle; most multicopters hover at half throttle."""
SINK_DRAG_PER_S = 1.2
"""Drag of rotors in descent, so that a vehicle with too little thrust sinks instead of falling: at 3.3 m/s without 70 %
of it."""
CARRIED_YAW_RAD_S = 1.0
EQUATOR_M = 6378137.0
ECCENTRICITY2 = 6.69437999014e-3
"""WGS 84."""


class Vector(NamedTuple):
    """A position or displacement in local metres."""

    east_m: float
    north_m: float
    up_m: float

    @property
    def length_m(self) -> float:
        """Length."""
        return math.sqrt(self.east_m**2 + self.north_m**2 + self.up_m**2)

    def scale(self, factor: float) -> Vector:
        """Return it multiplied by a factor."""
        return Vector(self.east_m * factor, self.north_m * factor, self.up_m * factor)

    def add(self, other: Vector) -> Vector:
        """Return the sum."""
        return Vector(self.east_m + other.east_m, self.north_m + other.north_m, self.up_m + other.up_m)

    def subtract(self, other: Vector) -> Vector:
        """Return the displacement from another place to this one."""
        return Vector(self.east_m - other.east_m, self.north_m - other.north_m, self.up_m - other.up_m)


Place = Vector


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that the autopilot sets for the airframe."""

    accelerate_m_s2: float
    brake_m_s2: float
    climb_m_s: float
    descend_m_s: float
    vertical_m_s2: float
    corner_m_s2: float
    """Lateral acceleration for planning corners."""
    yaw_rad_s: float = 1.0


class Velocity(NamedTuple):
    """A desired or actual velocity, in m/s."""

    east_m_s: float = 0.0
    north_m_s: float = 0.0
    up_m_s: float = 0.0


class Home:
    """The pad, and the flat conversion from latitude and longitude to metres.

    The radii of curvature are those at the pad, so both directions agree exactly and a straight line is off by less
    than a decimetre 3 km away.
    """

    def __init__(self, lat_deg: float, lon_deg: float, alt_m: float) -> None:
        self.alt_m = alt_m
        self._stand_at(lat_deg, lon_deg)

    def _stand_at(self, lat_deg: float, lon_deg: float) -> None:
        self.lat_deg, self.lon_deg = lat_deg, lon_deg
        sine = math.sin(math.radians(lat_deg))
        bulge = 1 - ECCENTRICITY2 * sine * sine
        self._north_m_deg = math.radians(EQUATOR_M * (1 - ECCENTRICITY2) / bulge**1.5)
        self._east_m_deg = math.radians(EQUATOR_M / math.sqrt(bulge) * math.cos(math.radians(lat_deg)))

    def move(self, east_m: float, north_m: float) -> None:
        """Move the origin east and north: every user of this home counts from there."""
        lat_e7, lon_e7 = self.lat_lon_e7(east_m, north_m)
        self._stand_at(lat_e7 * 1e-7, lon_e7 * 1e-7)

    def place_of(self, lat_e7: int, lon_e7: int, up_m: float) -> Place:
        """Return the local place of 1e-7 degrees."""
        return Place(
            (lon_e7 * 1e-7 - self.lon_deg) * self._east_m_deg, (lat_e7 * 1e-7 - self.lat_deg) * self._north_m_deg, up_m
        )

    def east_north_m(self, lat_e7: int, lon_e7: int) -> tuple[float, float]:
        """Return east and north of 1e-7 degrees."""
        place = self.place_of(lat_e7, lon_e7, 0.0)
        return place.east_m, place.north_m

    def lat_lon_e7(self, east_m: float, north_m: float) -> tuple[int, int]:
        """Return latitude and longitude of a local place in 1e-7 degrees."""
        return (
            round((self.lat_deg + north_m / self._north_m_deg) * 1e7),
            round((self.lon_deg + east_m / self._east_m_deg) * 1e7),
        )


class Body:
    """Position, velocity and attitude of one vehicle."""

    def __init__(self) -> None:
        self.east_m = self.north_m = self.up_m = 0.0
        self.v_east_m_s = self.v_north_m_s = self.v_up_m_s = 0.0
        self.yaw_rad = self.roll_rad = self.pitch_rad = self.yaw_rate_rad_s = 0.0
        self.face_rad: float | None = None
        """Target heading; None is along the flight."""
        self.flown_m = 0.0
        """Odometer."""
        self.acceleration = Velocity()
        """Acceleration in the last step, in m/s²."""
        self._tilt_rates_rad_s = (0.0, 0.0)
        self.lost_thrust = 0.0
        """Share of its thrust that is lost."""

    @property
    def place(self) -> Place:
        """Position."""
        return Place(self.east_m, self.north_m, self.up_m)

    @property
    def velocity(self) -> Velocity:
        """Velocity."""
        return Velocity(self.v_east_m_s, self.v_north_m_s, self.v_up_m_s)

    @property
    def ground_speed_m_s(self) -> float:
        """Horizontal speed."""
        return math.hypot(self.v_east_m_s, self.v_north_m_s)

    @property
    def on_ground(self) -> bool:
        """Whether it stands on the ground."""
        return self.up_m <= 0.0 and self.v_up_m_s <= 0.0

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Attitude: from forward, right and down to north, east and down."""
        cr, sr = math.cos(self.roll_rad / 2), math.sin(self.roll_rad / 2)
        cp, sp = math.cos(self.pitch_rad / 2), math.sin(self.pitch_rad / 2)
        cy, sy = math.cos(self.yaw_rad / 2), math.sin(self.yaw_rad / 2)
        return (
            cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )  # fmt: skip

    @property
    def specific_force_m_s2(self) -> tuple[float, float, float]:
        """Specific force at an accelerometer, forward, right and down: all forces but gravity."""
        rise = (0.0, 0.0, 0.0) if self.on_ground else self.acceleration
        north, east, down = rise[1], rise[0], -rise[2] - GRAVITY_M_S2
        cr, sr, cp, sp = (f(a) for a in (self.roll_rad, self.pitch_rad) for f in (math.cos, math.sin))
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        ahead, right = north * cy + east * sy, east * cy - north * sy
        lifted = ahead * sp + down * cp
        return ahead * cp - down * sp, right * cr + lifted * sr, lifted * cr - right * sr

    @property
    def turn_rates_rad_s(self) -> tuple[float, float, float]:
        """Turn rates about the forward, right and down axes."""
        roll, pitch = (0.0, 0.0) if self.on_ground else self._tilt_rates_rad_s
        yaw, cr, sr, cp = (
            self.yaw_rate_rad_s,
            math.cos(self.roll_rad),
            math.sin(self.roll_rad),
            math.cos(self.pitch_rad),
        )
        return (roll - math.sin(self.pitch_rad) * yaw, cr * pitch + sr * cp * yaw, -sr * pitch + cr * cp * yaw)

    def fly(self, wish: Velocity, limits: Limits, dt_s: float) -> None:
        """Move for ``dt_s``, changing velocity towards ``wish`` as fast as the limits allow."""
        before = self.velocity
        d_east, d_north = wish.east_m_s - self.v_east_m_s, wish.north_m_s - self.v_north_m_s
        change = math.hypot(d_east, d_north)
        slowing = math.hypot(wish.east_m_s, wish.north_m_s) < self.ground_speed_m_s
        most = (limits.brake_m_s2 if slowing else limits.accelerate_m_s2) * dt_s
        if change > most:
            d_east, d_north = d_east * most / change, d_north * most / change
        self.v_east_m_s += d_east
        self.v_north_m_s += d_north
        up = min(max(wish.up_m_s, -limits.descend_m_s), limits.climb_m_s)
        most = limits.vertical_m_s2 * dt_s
        self.v_up_m_s += min(max(up - self.v_up_m_s, -most), most)
        self._sink(before[2], dt_s)
        self._move(before, dt_s)
        self._tilt(d_east / dt_s, d_north / dt_s, limits.yaw_rad_s, dt_s)

    def carry(self, velocity: Velocity, dt_s: float) -> None:
        """Move for ``dt_s`` and end at this velocity; the caller has applied the limits."""
        before = self.velocity
        self.v_east_m_s, self.v_north_m_s, self.v_up_m_s = velocity
        self._sink(before[2], dt_s)
        self._move(before, dt_s)
        d_east, d_north = velocity.east_m_s - before[0], velocity.north_m_s - before[1]
        self._tilt(d_east / dt_s, d_north / dt_s, CARRIED_YAW_RAD_S, dt_s)

    def fall(self, dt_s: float) -> float:
        """Move for ``dt_s`` without thrust.

        Returns:
            The vertical speed in m/s at which it hit the ground in this step; 0 without an impact.
        """
        if self.up_m <= 0.0:
            self.stop()
            return 0.0
        before = self.velocity
        self.v_up_m_s = max(self.v_up_m_s - GRAVITY_M_S2 * dt_s, -TERMINAL_FALL_M_S)
        self.v_east_m_s -= DRAG_PER_S * self.v_east_m_s * dt_s
        self.v_north_m_s -= DRAG_PER_S * self.v_north_m_s * dt_s
        impact_m_s = -self.v_up_m_s
        self._move(before, dt_s)
        return impact_m_s if self.up_m <= 0.0 else 0.0

    def stop(self) -> None:
        """Stop on the ground."""
        self.up_m = max(self.up_m, 0.0)
        self.v_east_m_s = self.v_north_m_s = self.v_up_m_s = 0.0
        self.roll_rad = self.pitch_rad = self.yaw_rate_rad_s = 0.0

    def _sink(self, before_m_s: float, dt_s: float) -> None:
        """Limit the climb rate to what the remaining thrust allows."""
        if self.lost_thrust > 0.0:
            lift_m_s2 = (
                GRAVITY_M_S2 * (THRUST_TO_WEIGHT * (1.0 - self.lost_thrust) - 1.0) - SINK_DRAG_PER_S * before_m_s
            )
            self.v_up_m_s = min(self.v_up_m_s, before_m_s + lift_m_s2 * dt_s)

    def _move(self, before: tuple[float, float, float], dt_s: float) -> None:
        east = (before[0] + self.v_east_m_s) / 2 * dt_s
        north = (before[1] + self.v_north_m_s) / 2 * dt_s
        up = (before[2] + self.v_up_m_s) / 2 * dt_s
        self.east_m += east
        self.north_m += north
        self.up_m += up
        self.flown_m += math.sqrt(east * east + north * north + up * up)
        self.acceleration = Velocity(
            (self.v_east_m_s - before[0]) / dt_s, (self.v_north_m_s - before[1]) / dt_s,
            (self.v_up_m_s - before[2]) / dt_s,
        )  # fmt: skip
        if self.up_m <= 0.0 and self.v_up_m_s <= 0.0:
            self.up_m = 0.0
            self.stop()

    def _tilt(self, a_east: float, a_north: float, yaw_rad_s: float, dt_s: float) -> None:
        """Turn the nose to its target heading, and tilt against drag and for acceleration."""
        self.yaw_rate_rad_s = 0.0
        if self.face_rad is not None or self.ground_speed_m_s > 0.5:
            ahead = math.atan2(self.v_east_m_s, self.v_north_m_s)
            heading = ahead if self.face_rad is None else self.face_rad
            error = math.remainder(heading - self.yaw_rad, 2 * math.pi)
            turn = min(max(error, -yaw_rad_s * dt_s), yaw_rad_s * dt_s)
            self.yaw_rad = math.remainder(self.yaw_rad + turn, 2 * math.pi)
            self.yaw_rate_rad_s = turn / dt_s
        thrust_east = a_east + DRAG_PER_S * self.v_east_m_s
        thrust_north = a_north + DRAG_PER_S * self.v_north_m_s
        sine, cosine = math.sin(self.yaw_rad), math.cos(self.yaw_rad)
        before = self.roll_rad, self.pitch_rad
        self.pitch_rad = -math.atan2(thrust_east * sine + thrust_north * cosine, GRAVITY_M_S2)
        self.roll_rad = math.atan2(thrust_east * cosine - thrust_north * sine, GRAVITY_M_S2)
        self._tilt_rates_rad_s = (self.roll_rad - before[0]) / dt_s, (self.pitch_rad - before[1]) / dt_s


FAILSAFE_S = 4.0
"""Time without a fix until its failsafe acts."""
ABSOLUTE_S = 10.0
"""Time without a fix during which its estimator still reports an absolute position."""
DRIFT_M_S2 = 0.2
"""Acceleration bias in dead reckoning: 360 m in a minute."""
AIDED, ALONE = 831, 167
"""Flags of EKF_STATUS_REPORT and ESTIMATOR_STATUS: as recorded in flight, and in constant position mode."""
GPS_BIT = 0x20
"""MAV_SYS_STATUS_SENSOR_GPS."""


class Positioning:
    """A GPS receiver that may lose its fix."""

    def __init__(self) -> None:
        self.lost_s: float | None = None
        """Time since which it has no fix."""
        self._back_s = math.inf
        self._acted = False

    def lose(self, now_s: float, for_s: float) -> None:
        """Lose the fix, permanently if `for_s` is 0."""
        self.lost_s, self._back_s, self._acted = now_s, now_s + for_s if for_s else math.inf, False

    def find(self, now_s: float) -> None:
        """Regain the fix."""
        self._back_s = now_s

    def without_s(self, now_s: float) -> float:
        """Return the time without a fix; 0 with one."""
        if self.lost_s is not None and now_s >= self._back_s:
            self.lost_s = None
        return 0.0 if self.lost_s is None else now_s - self.lost_s

    def acts(self, now_s: float) -> bool:
        """Return, once, whether the failsafe acts now."""
        if self._acted or self.without_s(now_s) < FAILSAFE_S:
            return False
        self._acted = True
        return True

    def off_m(self, now_s: float) -> float:
        """Return the east error of the position estimate."""
        return 0.5 * DRIFT_M_S2 * self.without_s(now_s) ** 2

    def off_m_s(self, now_s: float) -> float:
        """Return the east error of the velocity estimate."""
        return DRIFT_M_S2 * self.without_s(now_s)

    def flags(self, now_s: float) -> int:
        """Return the estimator's status flags."""
        return AIDED if self.without_s(now_s) < ABSOLUTE_S else ALONE


PERIODS_S = (4.0, 7.0, 12.0)
"""Periods of the position error, which decorrelates within about 5 s."""
SPREAD = 0.15
"""Spread of the periods between vehicles, as a share."""


class PositionDrift:
    """An oscillation about zero, east and north, equal for equal seeds.

    The vehicle's position estimate wanders, and the vehicle follows it. PX4's trajectory waits for a vehicle off its
    line or behind it, so this error costs it time. In logs of PX4's own simulator the vehicle is 0.12 to 0.17 m off
    along its line and 0.25 to 0.5 m across (one standard deviation), and climbs and inspections last as much longer as
    an oscillation of 0.2 m on each axis makes them here; its estimate itself is off by 0.16 m.
    """

    def __init__(self, off_m: float, seed: str) -> None:
        """Begin.

        Args:
            off_m: One standard deviation on each axis; 0 for a vehicle exactly on its target.
            seed: The vehicle's seed.
        """
        rng = random.Random(seed)
        self._swing_m = off_m * math.sqrt(2.0 / len(PERIODS_S))
        self._waves = [
            [
                (2.0 * math.pi / (period_s * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD)), rng.uniform(0.0, 2.0 * math.pi))
                for period_s in PERIODS_S
            ]
            for _ in range(2)
        ]

    def offset_m(self, now_s: float) -> tuple[float, float]:
        """Return the offset, east and north."""
        if not self._swing_m:
            return 0.0, 0.0
        east, north = (sum(math.sin(turn * now_s + phase) for turn, phase in waves) for waves in self._waves)
        return self._swing_m * east, self._swing_m * north
