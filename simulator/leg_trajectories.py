"""Leg trajectories: ArduPilot's target moves by the clock, PX4's trajectory waits for the vehicle.

ArduPilot plans every leg from rest to rest (AC_WPNav.cpp, SCurve.cpp): its target accelerates for ``ramp_s``, cruises,
and decelerates. At a fly-through corner the next leg's target starts while this one's decelerates; the vehicle follows
the sum of both. Measured on Copter 4.7-dev: legs of 3 to 300 m take the computed time within 0.1 s.

PX4 slows down towards a leg's end with limited jerk, and stops in all unclear cases: after VelocitySmoothing.cpp (three
phases of constant jerk, the second with none), FlightTaskAuto.cpp and PositionSmoothing.cpp of PX4 v1.17 with its
default parameters. A trajectory runs ahead, and waits for a vehicle that lags behind it or drifts off to its side; a
vehicle farther from its line than the waypoint's acceptance radius flies back to it first. Checked against legs of
PX4's own simulator, the median of several flights each: durations agree within a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from simulator.physics import Body, Place, PositionDrift, Vector, Velocity

JERK_M_S3 = 1.0
"""WPNAV_JERK."""
SNAP_S = 0.3
"""Time in which the jerk builds up: twice ATC_INPUT_TC, as the planned snap is half of the vehicle's."""
ACCELERATE_Z_M_S2 = 1.0
"""WPNAV_ACCEL_Z."""
TURN_S = 0.45
"""Extra time of a leg that begins with a turn on the spot, times (1 - cosine of the angle); measured."""
SEARCH_S = 0.05


class TargetState(NamedTuple):
    """Position on the line, speed and acceleration of a target."""

    done_m: float
    speed_m_s: float
    accelerates_m_s2: float


@dataclass(frozen=True, slots=True)
class LegLimits:
    """Limits requested of a vehicle."""

    level_m_s: float
    up_m_s: float
    down_m_s: float
    accelerate_m_s2: float
    corner_m: float
    """WPNAV_RADIUS: maximum distance by which a corner is cut."""

    def speed_m_s(self, way: Vector) -> float:
        """Return the maximum speed along a line (kinematic_limit in control.cpp)."""
        return _combine_limits(way, self.level_m_s, self.up_m_s if way.up_m > 0 else self.down_m_s)

    def acceleration_m_s2(self, way: Vector) -> float:
        """Return the maximum acceleration along a line."""
        return _combine_limits(way, self.accelerate_m_s2, ACCELERATE_Z_M_S2)


@dataclass(frozen=True, slots=True)
class SCurve:
    """A straight line from rest to rest, timed by the clock."""

    way: Vector
    top_m_s: float
    ramp_s: float

    @classmethod
    def build(cls, way: Vector, pace: LegLimits) -> SCurve:
        """Build the curve that flies ``way`` as fast as the pace allows."""
        top, most, length = pace.speed_m_s(way), pace.acceleration_m_s2(way), way.length_m
        if top * ramp_s(top, most) > length:
            low = 0.0
            for _ in range(40):
                middle = (low + top) / 2
                low, top = (middle, top) if middle * ramp_s(middle, most) < length else (low, middle)
        return cls(way, top, ramp_s(top, most))

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return self.way.length_m / self.top_m_s + self.ramp_s

    def state_at(self, age_s: float) -> TargetState:
        """Return the target's state at an age."""
        age_s = min(max(age_s, 0.0), self.duration_s)
        left_s = self.duration_s - age_s
        if left_s < self.ramp_s:
            done, speed, accelerates = self._ramp_state(left_s)
            return TargetState(self.way.length_m - done, speed, -accelerates)
        return self._ramp_state(age_s)

    def _ramp_state(self, age_s: float) -> TargetState:
        if age_s >= self.ramp_s:
            return TargetState(self.top_m_s * (age_s - self.ramp_s / 2), self.top_m_s, 0.0)
        turn = math.pi / self.ramp_s
        half = self.top_m_s / 2
        sine, cosine = math.sin(turn * age_s), math.cos(turn * age_s)
        return TargetState(half * (age_s - sine / turn), half * (1 - cosine), half * turn * sine)


@dataclass(frozen=True, slots=True)
class DelayedCurve:
    """A curve with its delay after the leg's start; negative if it has already started."""

    curve: SCurve
    begins_s: float


def ramp_s(speed_m_s: float, most_m_s2: float) -> float:
    """Return the time from rest to a speed."""
    peak = JERK_M_S3 / 2 * (math.sqrt(SNAP_S**2 + 4 * speed_m_s / JERK_M_S3) - SNAP_S)
    if peak < most_m_s2:
        return 2 * (SNAP_S + peak / JERK_M_S3)
    return speed_m_s / most_m_s2 + SNAP_S + most_m_s2 / JERK_M_S3


def overlap_s(one: SCurve, two: SCurve, pace: LegLimits) -> float:
    """Return how long before the end of one leg the next begins (advance_target_along_track).

    Half-way through the turn the target must be near enough to the corner, slower than on either leg, and within the
    limit of curvature.
    """
    lasts_s = min(one.ramp_s, two.ramp_s)
    ahead, after = one.way.scale(1 / one.way.length_m), two.way.scale(1 / two.way.length_m)
    slowest = min(pace.speed_m_s(one.way), pace.speed_m_s(two.way))
    while lasts_s > 0:
        before, behind = one.state_at(one.duration_s - lasts_s / 2), two.state_at(lasts_s / 2)
        cut = ahead.scale(before.done_m - one.way.length_m).add(after.scale(behind.done_m))
        speed = ahead.scale(before.speed_m_s).add(after.scale(behind.speed_m_s))
        curved = ahead.scale(before.accelerates_m_s2).add(after.scale(behind.accelerates_m_s2))
        if (
            cut.length_m < pace.corner_m
            and speed.length_m < slowest
            and math.hypot(curved.east_m, curved.north_m) < 2 * pace.accelerate_m_s2
            and abs(curved.up_m) < ACCELERATE_Z_M_S2
        ):
            return lasts_s
        lasts_s -= SEARCH_S
    return 0.0


def turn_s(turn_rad: float) -> float:
    """Return the extra time that a turn on the spot adds to the next leg."""
    return TURN_S * (1 - math.cos(turn_rad))


def compute_target(base: Place, strands: tuple[DelayedCurve, ...], age_s: float) -> tuple[Place, Velocity]:
    """Return position and velocity of the target of several strands; ``base`` is where the first begins."""
    place, velocity = base, Vector(0.0, 0.0, 0.0)
    for strand in strands:
        moment, way = strand.curve.state_at(age_s - strand.begins_s), strand.curve.way
        place = place.add(way.scale(moment.done_m / way.length_m))
        velocity = velocity.add(way.scale(moment.speed_m_s / way.length_m))
    return place, Velocity(*velocity)


def _combine_limits(way: Vector, level: float, upright: float) -> float:
    flat = math.hypot(way.east_m, way.north_m)
    if flat * upright >= abs(way.up_m) * level:
        return level * way.length_m / flat
    return upright * way.length_m / abs(way.up_m)


NOTHING = 1e-7


@dataclass(slots=True)
class Axis:
    """Position, speed and acceleration of the trajectory along one axis."""

    at_m: float
    speed_m_s: float = 0.0
    accelerates_m_s2: float = 0.0
    jerk_m_s3: float = 0.0
    """Jerk used for planning."""
    wish_m_s: float = 0.0
    phases_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    way: float = 0.0
    """Sign of the first phase's jerk."""

    @property
    def duration_s(self) -> float:
        """Time until it reaches the desired speed."""
        return sum(self.phases_s)

    def plan_speed(self, wish_m_s: float, accelerate_m_s2: float, jerk_m_s3: float) -> None:
        """Plan to reach a speed as fast as the limits allow."""
        self.wish_m_s, self.jerk_m_s3 = wish_m_s, jerk_m_s3
        now = self.accelerates_m_s2
        # Speed once the present acceleration has decayed.
        faded = self.speed_m_s + now * abs(now) / (2 * jerk_m_s3)
        self.way = _sign(wish_m_s - faded) or _sign(now)
        if not self.way:
            self.phases_s = (0.0, 0.0, 0.0)
            return
        jerk, change = self.way * jerk_m_s3, wish_m_s - self.speed_m_s
        root = 2 * now * now + 4 * jerk * change
        first = 0.0
        if root >= 0:
            first = _first_valid_root(
                [(-now + half) / jerk for half in (math.sqrt(root) / 2, -math.sqrt(root) / 2)], now / jerk
            )
        first = max(_cap_ramp_time(first, now, jerk, accelerate_m_s2), 0.0)
        third = max(now / jerk + first, 0.0)
        top = now + jerk * first
        second = 0.0
        if abs(top) > NOTHING:
            ramps = -jerk * first * first / 2 - jerk * first * third - now * first
            second = max((ramps + jerk * third * third / 2 - now * third + change) / top, 0.0)
        self.phases_s = (first, second, third)

    def stretch_plan(self, lasts_s: float, accelerate_m_s2: float) -> None:
        """Stretch the plan so that all axes finish at the same time."""
        if not self.way:
            return
        jerk, now = self.way * self.jerk_m_s3, self.accelerates_m_s2
        change = self.wish_m_s - self.speed_m_s
        root = (lasts_s * jerk) ** 2 + 2 * lasts_s * now * jerk - now * now - 4 * jerk * change
        first = 0.0
        if root >= 0:
            middle = lasts_s * jerk - now
            roots = [max((middle - half) / (2 * jerk), 0.0) for half in (math.sqrt(root), -math.sqrt(root))]
            first = _first_valid_root(roots, now / jerk, lasts_s)
        first = _cap_ramp_time(first, now, jerk, accelerate_m_s2)
        third = max(now / jerk + first, 0.0)
        self.phases_s = (first, max(lasts_s - first - third, 0.0), third)

    def advance(self, dt_s: float) -> None:
        """Move along the plan."""
        left_s = dt_s
        for lasts_s, way in zip(self.phases_s, (self.way, 0.0, -self.way), strict=True):
            step_s = min(left_s, lasts_s)
            if step_s > 0:
                self._apply_jerk(step_s, way * self.jerk_m_s3)
                left_s -= step_s
        if left_s > 0:
            self.accelerates_m_s2 = 0.0
            self._apply_jerk(left_s, 0.0)

    def _apply_jerk(self, dt_s: float, jerk_m_s3: float) -> None:
        now, speed = self.accelerates_m_s2, self.speed_m_s
        self.at_m += speed * dt_s + now * dt_s**2 / 2 + jerk_m_s3 * dt_s**3 / 6
        self.speed_m_s += now * dt_s + jerk_m_s3 * dt_s**2 / 2
        self.accelerates_m_s2 += jerk_m_s3 * dt_s


def braking_speed_m_s(left_m: float, accelerate_m_s2: float, jerk_m_s3: float, exit_m_s: float = 0.0) -> float:
    """Return the speed from which ``exit_m_s`` is reached in ``left_m`` (computeMaxSpeedFromDistance in TrajMath.hpp).

    Jerk counts as a delay of two full swings of the acceleration.
    """
    delay = 4 * accelerate_m_s2**2 / jerk_m_s3
    speed = (math.sqrt(delay**2 + 4 * (2 * accelerate_m_s2 * left_m + exit_m_s**2)) - delay) / 2
    return max(speed, exit_m_s)


def _first_valid_root(roots: list[float], offset_s: float, most_s: float = math.inf) -> float:
    for root in roots:
        if root >= 0 and offset_s + root >= 0 and 2 * root + offset_s <= most_s:
            return root
    return 0.0


def _cap_ramp_time(first_s: float, now: float, jerk: float, most: float) -> float:
    top = now + jerk * first_s
    if abs(top) <= most:
        return first_s
    return (math.copysign(most, top) - now) / jerk


def _sign(value: float) -> float:
    return math.copysign(1.0, value) if value else 0.0


JERK = 4.0
"""MPC_JERK_AUTO."""
LEVEL = 3.0
"""MPC_ACC_HOR."""
UP, DOWN = (4.0, 3.0), (3.0, 1.5)
"""Acceleration and speed: MPC_ACC_UP_MAX, MPC_Z_V_AUTO_UP; MPC_ACC_DOWN_MAX, MPC_Z_V_AUTO_DN."""
CORNER = 0.5
"""MPC_XY_TRAJ_P: share of LEVEL used for planning corners."""
HEIGHT_M = 0.8
"""NAV_MC_ALT_RAD: height tolerance of a reached item."""
LAG_M = 2.0
"""MPC_XY_ERR_MAX: lag of the vehicle at which the trajectory stops."""
AHEAD_M = 5.0
"""Distance ahead on its line at which a turning vehicle aims."""
SLOW_M_S = 0.5
NAVIGATOR_S = 0.3
"""Time from reaching an item to flying to the next (measured)."""
FOLLOW_PER_S = (0.95, 0.95, 1.0)
"""MPC_XY_P, MPC_Z_P."""
PUSH_PER_S = (1.8, 1.8, 4.0)
"""MPC_XY_VEL_P_ACC, MPC_Z_VEL_P_ACC."""
GATHER_PER_S2 = (0.4, 0.4, 2.0)
"""MPC_XY_VEL_I_ACC, MPC_Z_VEL_I_ACC."""
DAMP = (0.2, 0.2, 0.0)
"""MPC_XY_VEL_D_ACC, MPC_Z_VEL_D_ACC."""
LEAN_S = 0.15
"""Delay from a desired acceleration to the tilt."""
DRAG_PER_S = 1.0
"""Drag of its simulator: SIH_KDV 1 on SIH_MASS 1. At 10 m/s it tilts to its limit."""
PUSH_MOST_M_S2 = 9.0


@dataclass(frozen=True, slots=True)
class Px4Leg:
    """Fly to a waypoint and hold there for a while, as PX4 does."""

    origin: Place
    target: Place
    after: Place | None
    """Next place if it does not stop at the target; None if it stops."""
    speed_m_s: float
    accept_m: float
    hold_s: float


@dataclass(slots=True)
class _Line:
    """Line flown at present: not always from the origin to the target."""

    origin: Place
    target: Place
    after: Place


class Px4Trajectory:
    """The trajectory, and a vehicle that follows it; it persists from leg to leg."""

    def __init__(self, body: Body, wander: PositionDrift) -> None:
        self._wander = wander
        self._axes = tuple(Axis(at_m, speed) for at_m, speed in zip(body.place, body.velocity, strict=True))
        self._goal: Px4Leg | None = None
        self._line = _Line(body.place, body.place, body.place)
        self._state = ""
        self._age_s = 0.0
        self._reached_s: float | None = None
        self._fastest_m_s = 0.0
        self._rises = False
        self._gathered = [DRAG_PER_S * axis.speed_m_s for axis in self._axes]
        self._pushed = [DRAG_PER_S * axis.speed_m_s for axis in self._axes]

    def fly(self, goal: Px4Leg, body: Body, now_s: float, dt_s: float) -> bool:
        """Move the body for ``dt_s`` from ``now_s`` on.

        Returns:
            Whether the goal is reached and its hold is over.
        """
        if goal is not self._goal:
            if self._goal is None or (goal.origin, goal.target) != (self._goal.origin, self._goal.target):
                self._age_s, self._reached_s = 0.0, None
            self._goal, self._state = goal, ""
        self._age_s += dt_s
        here = body.place
        if self._age_s > NAVIGATOR_S:
            self._find_line(goal, here)
        self._plan_speeds(goal)
        follows = self._follow(body, dt_s)  # both advance one step from the same moment
        self._advance(here, now_s, dt_s)
        body.carry(follows, dt_s)
        east, north, up = (a - b for a, b in zip(goal.target, body.place, strict=True))
        if self._reached_s is None and math.hypot(east, north) <= goal.accept_m and abs(up) <= HEIGHT_M:
            self._reached_s = self._age_s
        return self._reached_s is not None and self._age_s - self._reached_s >= goal.hold_s

    def _find_line(self, goal: Px4Leg, here: Place) -> None:
        """Choose the line to fly (_getCurrentState, _updateInternalWaypoints)."""
        origin, target, after = goal.origin, goal.target, goal.after or goal.target
        length, done, nearest = math.dist(origin, target), 0.0, origin
        if length > 0:
            ahead = Place(*((b - a) / length for a, b in zip(origin, target, strict=True)))
            done = sum(u * (h - o) for u, h, o in zip(ahead, here, origin, strict=True))
            nearest = origin.add(ahead.scale(done))
        state = "on"
        if length > 0 and done > length:
            state = "beyond"
        elif length > 0 and done < 0 and math.dist(here, origin) > goal.accept_m:
            state = "before"
        elif length > 0 and math.dist(here, nearest) > goal.accept_m:
            state = "off"
        if state != self._state or state == "off":
            match state:
                case "beyond":
                    self._line = _Line(here, target, after)
                case "before":
                    self._line = _Line(here, origin, target)
                case "off":
                    self._line = _Line(here, nearest, target)
                case _:
                    self._line = _Line(origin, target, after)
        self._state = state

    def _plan_speeds(self, goal: Px4Leg) -> None:
        """Choose the target speeds of the axes (_generateVelocitySetpoint)."""
        line, here = self._line, Place(*(axis.at_m for axis in self._axes))
        level, upright = self._horizontal_speed_m_s(goal, here), self._vertical_speed_m_s(here)
        aim = line.target
        if self._is_turning(goal, here):
            aim = self._find_point_ahead(goal, here)
            level = min(level, self._fastest_m_s)
        else:
            self._fastest_m_s = level
        away = math.dist(here, aim)
        speed = math.hypot(level, upright) / away if away > 0 else 0.0
        wish = [speed * (there - at) for there, at in zip(aim, here, strict=True)]
        flat = math.hypot(wish[0], wish[1])
        if flat > level:
            wish = [w * level / flat for w in wish[:2]] + [wish[2] * (1.0 if flat < SLOW_M_S else level / flat)]
        if abs(wish[2]) > upright:
            share = upright / abs(wish[2])
            slow = abs(wish[2]) < SLOW_M_S
            wish = [w * (1.0 if slow else share) for w in wish[:2]] + [wish[2] * share]
        self._rises = wish[2] > 0
        most = (LEVEL, LEVEL, self._vertical[0])
        for axis, speed_m_s, accelerate in zip(self._axes, wish, most, strict=True):
            axis.plan_speed(speed_m_s, accelerate, JERK)
        longest_s = max(axis.duration_s for axis in self._axes)
        for axis, accelerate in zip(self._axes, most, strict=True):
            if axis.duration_s < longest_s:
                axis.stretch_plan(longest_s, accelerate)

    @property
    def _vertical(self) -> tuple[float, float]:
        return UP if self._rises else DOWN

    def _horizontal_speed_m_s(self, goal: Px4Leg, here: Place) -> float:
        """Return the horizontal speed that line and corner allow (computeXYSpeedFromWaypoints)."""
        line, corner = self._line, 0.0
        onward = math.dist(line.target[:2], line.after[:2])
        if onward > max(goal.accept_m, 0.001):
            fastest = min(goal.speed_m_s, braking_speed_m_s(onward, LEVEL, JERK))
            half = _corner_angle_rad(here, line.target, line.after) / 2
            turn = math.sqrt(CORNER * LEVEL * goal.accept_m * math.tan(half)) if half < 1.5707 else math.inf
            corner = min(fastest, turn)
        left_m = math.dist(here[:2], line.target[:2])
        return min(goal.speed_m_s, braking_speed_m_s(left_m, LEVEL, JERK, corner))

    def _vertical_speed_m_s(self, here: Place) -> float:
        """Return the vertical speed (_getMaxZSpeed, whose distances are from the origin of its map)."""
        line, (accelerate, most) = self._line, self._vertical
        exit_m_s = 0.0
        if abs(line.target[2] - line.after[2]) > 0.001:
            profile = [(math.hypot(p[0], p[1]), 0.0, p[2]) for p in (here, line.target, line.after)]
            half = _corner_angle_rad(*((p[0], p[2], 0.0) for p in profile)) / 2
            exit_m_s = min(math.sqrt(accelerate * HEIGHT_M * math.tan(half)), most) if half < 1.5707 else most
        left_m = abs(line.target[2] - here[2])
        return min(most, braking_speed_m_s(left_m, accelerate, JERK, exit_m_s))

    def _is_turning(self, goal: Px4Leg, here: Place) -> bool:
        east, north = self._line.target[0] - here[0], self._line.target[1] - here[1]
        speed, left_m = math.hypot(self._axes[0].speed_m_s, self._axes[1].speed_m_s), math.hypot(east, north)
        if speed <= 0.2 or left_m <= goal.accept_m:
            return False
        along = self._axes[0].speed_m_s * east + self._axes[1].speed_m_s * north
        return along < 0.98 * speed * left_m

    def _find_point_ahead(self, goal: Px4Leg, here: Place) -> Place:
        origin, target = self._line.origin, self._line.target
        length = math.dist(origin, target) or 1.0
        ahead = Place(*((b - a) / length for a, b in zip(origin, target, strict=True)))
        nearest = origin.add(ahead.scale(sum(u * (h - o) for u, h, o in zip(ahead, here, origin, strict=True))))
        reach = max(goal.accept_m, AHEAD_M) ** 2 - math.dist(nearest, here) ** 2
        return nearest.add(ahead.scale(math.sqrt(max(reach, 0.0))))

    def _advance(self, here: Place, now_s: float, dt_s: float) -> None:
        """Advance the trajectory, by less the farther off the vehicle seems, unless it seems to be ahead."""
        off_m = self._wander.offset_m(now_s)
        east, north = self._axes[0].at_m - here[0] - off_m[0], self._axes[1].at_m - here[1] - off_m[1]
        behind = east * self._axes[0].speed_m_s + north * self._axes[1].speed_m_s >= 0
        share = moving_share(east, north) if behind else 1.0
        for axis in self._axes:
            axis.advance(dt_s * share)

    def _follow(self, body: Body, dt_s: float) -> Velocity:
        """Return the velocity of the following vehicle (PositionControl.cpp, and a body with drag)."""
        moves = body.velocity
        speeds = []
        for index, (axis, at_m, speed) in enumerate(zip(self._axes, body.place, moves, strict=True)):
            wish = axis.speed_m_s + FOLLOW_PER_S[index] * (axis.at_m - at_m)
            if index == 2:
                wish = min(max(wish, -DOWN[1]), UP[1])
            error = wish - speed
            accelerates = self._pushed[index] - DRAG_PER_S * speed
            push = axis.accelerates_m_s2 + PUSH_PER_S[index] * error + self._gathered[index] - DAMP[index] * accelerates
            if abs(push) <= PUSH_MOST_M_S2 or error * push < 0:
                self._gathered[index] += GATHER_PER_S2[index] * error * dt_s
            push = min(max(push, -PUSH_MOST_M_S2), PUSH_MOST_M_S2)
            self._pushed[index] += (push - self._pushed[index]) * dt_s / LEAN_S
            speeds.append(speed + (self._pushed[index] - DRAG_PER_S * speed) * dt_s)
        return Velocity(*speeds)


def moving_share(east_m: float, north_m: float) -> float:
    """Return the share of time in which a trajectory advances for a vehicle with this offset."""
    return 1 - min(math.hypot(east_m, north_m) / LAG_M, 1.0)


def _corner_angle_rad(start: Sequence[float], corner: Sequence[float], end: Sequence[float]) -> float:
    """Return the horizontal angle between the lines from a corner back and onward; straight on is pi."""
    back = (start[0] - corner[0], start[1] - corner[1])
    onward = (end[0] - corner[0], end[1] - corner[1])
    lengths = math.hypot(*back) * math.hypot(*onward)
    if lengths == 0:
        return math.pi / 2
    return math.acos(min(max((back[0] * onward[0] + back[1] * onward[1]) / lengths, -1.0), 1.0))
