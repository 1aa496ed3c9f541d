"""Goals that a vehicle flies, as frozen data, and the velocity each requires.

A goal describes a flight; ``compute_desired_velocity`` turns it into a velocity and ``is_finished`` reports its
completion. The body applies its limits. A ``GoalFollower`` flies a queue of goals.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

from simulator import leg_trajectories
from simulator.physics import Body, Limits, Place, PositionDrift, Velocity

BRAKE_MARGIN = 0.7
"""Share of braking power that a planned stop uses; the rest is for corrections."""
NEAR_PER_S = 1.5
"""Approach speed per remaining metre, in the last metres before a stop."""
CROSS_TRACK_PER_S = 0.8
HEIGHT_PER_S = 1.0
STOPPED_M = 0.3
STOPPED_M_S = 0.3
"""Speed and distance below which a stop is complete."""
CLIMBED_M = 0.15
"""Tolerance at the top of a climb. Recorded: ArduPilot's take-off to 25 m ends at 24.84 m."""
RIDE_PER_S = 2.0
"""Rate at which a vehicle closes in on a moving target."""
RIDE_M_S2 = 8.0
RIDE_M = 1.5
RIDE_M_S = 1.0
"""Distance and speed difference within which a vehicle joins a leg's moving target."""
ON_CIRCLE_M = 2.0
RESTART_M_S = 0.4
RESTART_M_S2 = 0.8
"""Acceleration of ArduPilot's leg after a restart. Measured: the speed dips from 4.9 to 1.4-1.9 m/s and recovers within
about 4 s; with a restart every second it crawls at 0.8 m/s."""


@dataclass(frozen=True, slots=True)
class SpoolUp:
    """Stay on the ground while the motors spool up."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Climb:
    """Climb or descend vertically to a height."""

    place: Place
    speed_m_s: float
    slow_m_s: float = math.inf
    slow_below_m: float = 0.0
    """Height up to which it climbs at ``slow_m_s`` at most."""
    accept_m: float = CLIMBED_M
    brakes: tuple[float, float] | None = None
    """Acceleration and jerk at the end of the climb; None: those of the limits."""


@dataclass(frozen=True, slots=True)
class Leg:
    """Fly a straight line."""

    origin: Place
    target: Place
    speed_m_s: float
    accept_m: float
    """Distance to its end at which a fly-through leg is complete."""
    stop: bool = True
    exit_m_s: float = 0.0
    """Speed allowed at the corner of a fly-through leg."""
    entry_m_s: float | None = None
    """Speed on the first part, if a slow-down takes effect late."""
    entry_m: float = 0.0
    restarted: bool = False
    """Whether the speed ramps up again although the vehicle is moving."""


@dataclass(frozen=True, slots=True)
class TimedLeg:
    """Follow a moving target, timed by the clock, from leg to leg."""

    leg: Leg
    """Equivalent plain leg, flown once the vehicle has lost the timed target."""
    base: Place
    strands: tuple[leg_trajectories.DelayedCurve, ...]
    lasts_s: float


@dataclass(frozen=True, slots=True)
class Hover:
    """Hold a point, for a time or indefinitely."""

    place: Place
    seconds: float = math.inf


@dataclass(frozen=True, slots=True)
class ThrottleDescent:
    """Hold position and descend: a stick mode with the throttle low and no pilot."""

    place: Place
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Drift:
    """Fly at a velocity until another goal is set."""

    velocity: Velocity


@dataclass(frozen=True, slots=True)
class Circle:
    """Fly straight to a circle, then along it."""

    centre: Place
    radius_m: float
    speed_m_s: float
    """Speed, clockwise positive."""
    approach_m_s: float


@dataclass(frozen=True, slots=True)
class Land:
    """Descend to the ground over a point."""

    place: Place
    fast_m_s: float
    slow_m_s: float
    slow_from_m: float
    """Height below which the descent is slow."""
    fast_from_m: float
    """Height above which the descent is fast; it slows down in between."""


Goal = SpoolUp | Climb | Leg | TimedLeg | leg_trajectories.Px4Leg | Hover | ThrottleDescent | Drift | Circle | Land


def find_target(goal: Goal | None) -> Place | None:
    """Return where a goal ends, or None if it has no end point."""
    match goal:
        case Leg() | leg_trajectories.Px4Leg():
            return goal.target
        case TimedLeg():
            return goal.leg.target
        case Climb() | Hover():
            return goal.place
        case Land():
            return goal.place._replace(up_m=0.0)
        case _:
            return None


def distance_m(a: Place, b: Place) -> float:
    """Return the straight-line distance."""
    return a.subtract(b).length_m


def find_stopping_place(body: Body, limits: Limits) -> Place:
    """Return where the vehicle stops if it brakes now."""
    share = body.ground_speed_m_s / (2 * limits.brake_m_s2 * BRAKE_MARGIN)
    up = abs(body.v_up_m_s) / (2 * limits.vertical_m_s2)
    return Place(
        body.east_m + body.v_east_m_s * share,
        body.north_m + body.v_north_m_s * share,
        max(body.up_m + body.v_up_m_s * up, 0.0),
    )


def corner_speed_m_s(before: Leg, after: Place, limits: Limits, cut_m: float) -> float:
    """Return the speed for flying the corner at the end of ``before``, cutting it by at most ``cut_m``.

    The arc that touches both legs and passes ``cut_m`` from the corner of turn angle phi has the radius cut / (1 /
    cos(phi / 2) - 1); the planned lateral acceleration gives the speed.
    """
    one = (before.target.east_m - before.origin.east_m, before.target.north_m - before.origin.north_m)
    two = (after.east_m - before.target.east_m, after.north_m - before.target.north_m)
    lengths = math.hypot(*one) * math.hypot(*two)
    if lengths < 1e-6:
        return 0.0
    cosine = max(-1.0, min(1.0, (one[0] * two[0] + one[1] * two[1]) / lengths))
    half = math.sqrt((1 + cosine) / 2)
    if half > 0.9999:
        return before.speed_m_s
    if half < 1e-3:
        return 0.0
    return min(before.speed_m_s, math.sqrt(limits.corner_m_s2 * cut_m / (1 / half - 1)))


def compute_desired_velocity(goal: Goal, body: Body, age_s: float, limits: Limits) -> Velocity:
    """Return the velocity that the goal requires ``age_s`` after its start."""
    match goal:
        case SpoolUp() | leg_trajectories.Px4Leg():
            return Velocity()
        case Drift() | Circle():
            return goal.velocity if isinstance(goal, Drift) else _compute_circling_velocity(goal, body, limits)
        case Climb():
            east, north = _approach_velocity_m_s(goal.place, body, limits)
            up = _vertical_speed_m_s(goal.place.up_m, body, limits)
            if goal.brakes is not None:
                left_m = goal.place.up_m - body.up_m
                up = math.copysign(leg_trajectories.braking_speed_m_s(abs(left_m), *goal.brakes), left_m)
            most = min(goal.speed_m_s, goal.slow_m_s) if body.up_m < goal.slow_below_m else goal.speed_m_s
            return Velocity(east, north, min(max(up, -most), most))
        case Hover():
            east, north = _approach_velocity_m_s(goal.place, body, limits)
            return Velocity(east, north, _vertical_speed_m_s(goal.place.up_m, body, limits))
        case ThrottleDescent():
            east, north = _approach_velocity_m_s(goal.place, body, limits)
            return Velocity(east, north, -goal.speed_m_s)
        case Land():
            east, north = _approach_velocity_m_s(goal.place, body, limits)
            share = min(max((body.up_m - goal.slow_from_m) / max(goal.fast_from_m - goal.slow_from_m, 0.01), 0.0), 1.0)
            return Velocity(east, north, -(goal.slow_m_s + share * (goal.fast_m_s - goal.slow_m_s)))
        case Leg():
            return _compute_leg_velocity(goal, body, age_s, limits)
        case TimedLeg():
            place, velocity = leg_trajectories.compute_target(goal.base, goal.strands, age_s)
            return Velocity(
                velocity.east_m_s + RIDE_PER_S * (place.east_m - body.east_m),
                velocity.north_m_s + RIDE_PER_S * (place.north_m - body.north_m),
                velocity.up_m_s + RIDE_PER_S * (place.up_m - body.up_m),
            )


def is_finished(goal: Goal, body: Body, age_s: float) -> bool:
    """Return whether the goal has been reached."""
    match goal:
        case SpoolUp() | Hover():
            return age_s >= goal.seconds
        case Climb():
            return abs(body.up_m - goal.place.up_m) < goal.accept_m
        case TimedLeg():
            return age_s >= goal.lasts_s
        case ThrottleDescent() | Drift() | Circle() | leg_trajectories.Px4Leg():
            return False
        case Land():
            return body.on_ground
        case Leg():
            left_m = distance_m(body.place, goal.target)
            if goal.stop:
                return left_m < max(goal.accept_m, STOPPED_M) and (
                    goal.accept_m > STOPPED_M or body.ground_speed_m_s < STOPPED_M_S
                )
            return left_m < goal.accept_m or _leg_progress_m(goal, body)[1] <= 0.0


def can_join_timed_leg(ride: TimedLeg, body: Body) -> bool:
    """Return whether a vehicle is near enough to a timed leg's start, and fast enough, to join it."""
    place, velocity = leg_trajectories.compute_target(ride.base, ride.strands, 0.0)
    return distance_m(place, body.place) < RIDE_M and math.dist(body.velocity, velocity) < RIDE_M_S


def _compute_circling_velocity(goal: Circle, body: Body, limits: Limits) -> Velocity:
    east, north = body.east_m - goal.centre.east_m, body.north_m - goal.centre.north_m
    away_m = math.hypot(east, north)
    out = (east / away_m, north / away_m) if away_m > 1e-6 else (0.0, 1.0)
    off_m = goal.radius_m - away_m
    near = abs(off_m) < ON_CIRCLE_M and abs(goal.centre.up_m - body.up_m) < ON_CIRCLE_M
    back = math.copysign(min(_stopping_speed_m_s(abs(off_m), 0.0, limits), goal.approach_m_s), off_m)
    round_m_s = goal.speed_m_s if near else 0.0
    up = _vertical_speed_m_s(goal.centre.up_m, body, limits)
    return Velocity(out[0] * back + out[1] * round_m_s, out[1] * back - out[0] * round_m_s, up)


def _approach_velocity_m_s(place: Place, body: Body, limits: Limits) -> tuple[float, float]:
    east, north = place.east_m - body.east_m, place.north_m - body.north_m
    left_m = math.hypot(east, north)
    if left_m < 1e-6:
        return 0.0, 0.0
    speed = _stopping_speed_m_s(left_m, 0.0, limits)
    return east / left_m * speed, north / left_m * speed


def _vertical_speed_m_s(up_m: float, body: Body, limits: Limits) -> float:
    error_m = up_m - body.up_m
    braking = math.sqrt(2 * BRAKE_MARGIN * limits.vertical_m_s2 * abs(error_m))
    return math.copysign(min(HEIGHT_PER_S * abs(error_m), braking), error_m)


def _stopping_speed_m_s(left_m: float, exit_m_s: float, limits: Limits) -> float:
    braking = math.sqrt(exit_m_s**2 + 2 * BRAKE_MARGIN * limits.brake_m_s2 * max(left_m, 0.0))
    return min(braking, exit_m_s + NEAR_PER_S * max(left_m, 0.0))


def _leg_progress_m(leg: Leg, body: Body) -> tuple[float, float]:
    """Return metres flown along the leg's horizontal line, and metres left of it."""
    east, north = leg.target.east_m - leg.origin.east_m, leg.target.north_m - leg.origin.north_m
    length = math.hypot(east, north)
    if length < 1e-6:
        return 0.0, distance_m(body.place, leg.target)
    done = ((body.east_m - leg.origin.east_m) * east + (body.north_m - leg.origin.north_m) * north) / length
    return done, length - done


def _compute_leg_velocity(leg: Leg, body: Body, age_s: float, limits: Limits) -> Velocity:
    east, north = leg.target.east_m - leg.origin.east_m, leg.target.north_m - leg.origin.north_m
    length = math.hypot(east, north)
    rise = leg.target.up_m - leg.origin.up_m
    if length < 0.1:
        return Velocity(
            *_approach_velocity_m_s(leg.target, body, limits), _vertical_speed_m_s(leg.target.up_m, body, limits)
        )
    done, left = _leg_progress_m(leg, body)
    speed = leg.speed_m_s if leg.entry_m_s is None or done >= leg.entry_m else leg.entry_m_s
    if leg.restarted:
        speed = min(speed, RESTART_M_S + RESTART_M_S2 * age_s)
    steepest = limits.climb_m_s if rise > 0 else limits.descend_m_s
    if abs(rise) > 1e-3:
        speed = min(speed, 0.9 * steepest * length / abs(rise))
    speed = min(speed, _stopping_speed_m_s(left, 0.0 if leg.stop else leg.exit_m_s, limits))
    share = min(max(done / length, 0.0), 1.0)
    off_east = leg.origin.east_m + east * share - body.east_m
    off_north = leg.origin.north_m + north * share - body.north_m
    back_east, back_north = CROSS_TRACK_PER_S * off_east, CROSS_TRACK_PER_S * off_north
    back, most = math.hypot(back_east, back_north), max(speed, 1.0)
    if back > most:
        back_east, back_north, back = back_east * most / back, back_north * most / back, most
    # The combined speed must not exceed the leg's.
    speed = min(speed, math.sqrt(most**2 - back**2))
    up = _vertical_speed_m_s(leg.origin.up_m + rise * share, body, limits) + (
        rise / length * speed if 0 < share < 1 else 0.0
    )
    return Velocity(east / length * speed + back_east, north / length * speed + back_north, up)


class GoalFollower:
    """Fly goals one after the other."""

    def __init__(self, body: Body, limits: Limits, wander: PositionDrift | None = None) -> None:
        self.body = body
        self.limits = limits
        self._wander = wander or PositionDrift(0.0, "")
        self._now_s = 0.0
        self._goals: deque[Goal] = deque()
        self._age_s = 0.0
        self._glider: leg_trajectories.Px4Trajectory | None = None
        self._riding = replace(
            limits, accelerate_m_s2=RIDE_M_S2, brake_m_s2=RIDE_M_S2, vertical_m_s2=RIDE_M_S2, corner_m_s2=RIDE_M_S2
        )

    @property
    def goal(self) -> Goal | None:
        """Current goal; None when all are finished."""
        return self._goals[0] if self._goals else None

    def fly(self, goals: Iterable[Goal]) -> None:
        """Drop the current goals and start new ones."""
        self._goals = deque(goals)
        self._age_s = 0.0

    def change_speed(self, speed_m_s: float) -> None:
        """Fly the current leg at another speed from now on."""
        match self.goal:
            case Leg() as leg:
                self._goals[0] = replace(leg, speed_m_s=speed_m_s, entry_m_s=None)
            case TimedLeg(leg=leg):
                self._goals[0] = replace(leg, speed_m_s=speed_m_s)
            case leg_trajectories.Px4Leg() as glide:
                self._goals[0] = replace(glide, speed_m_s=speed_m_s)

    def hold(self) -> None:
        """Brake and hold."""
        self.fly([Hover(find_stopping_place(self.body, self.limits))])

    def step(self, dt_s: float) -> None:
        """Fly for ``dt_s``; without a goal the vehicle holds position."""
        goal = self.goal or Hover(self.body.place)
        self._age_s += dt_s
        self._now_s += dt_s
        if isinstance(goal, leg_trajectories.Px4Leg):
            self._glider = self._glider or leg_trajectories.Px4Trajectory(self.body, self._wander)
            over = self._glider.fly(goal, self.body, self._now_s, dt_s)
        else:
            self._glider = None
            limits = self._riding if isinstance(goal, TimedLeg) else self.limits
            wanted = compute_desired_velocity(goal, self.body, self._age_s, limits)
            if isinstance(goal, Climb):
                # Its trajectory is stationary over the ground, so there is no drift to anticipate.
                wanted = wanted._replace(
                    up_m_s=wanted.up_m_s * leg_trajectories.moving_share(*self._wander.offset_m(self._now_s))
                )
            self.body.fly(wanted, limits, dt_s)
            over = is_finished(goal, self.body, self._age_s)
        if self._goals and over:
            self._goals.popleft()
            self._age_s = 0.0
