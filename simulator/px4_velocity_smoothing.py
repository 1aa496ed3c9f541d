"""One axis of PX4's trajectories: a speed that goes towards a wish with limited acceleration and jerk.

After VelocitySmoothing.cpp of PX4 v1.17: three phases of constant jerk, the second with none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NOTHING = 1e-7


@dataclass(slots=True)
class Axis:
    """Position, speed and acceleration of the trajectory along one axis."""

    at_m: float
    speed_m_s: float = 0.0
    accelerates_m_s2: float = 0.0
    jerk_m_s3: float = 0.0
    """The jerk that it plans with."""
    wish_m_s: float = 0.0
    phases_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    way: float = 0.0
    """Sign of the first phase's jerk."""

    @property
    def duration_s(self) -> float:
        """How long it takes to reach the wish."""
        return sum(self.phases_s)

    def plan_speed(self, wish_m_s: float, accelerate_m_s2: float, jerk_m_s3: float) -> None:
        """Go for a speed as fast as the limits allow."""
        self.wish_m_s, self.jerk_m_s3 = wish_m_s, jerk_m_s3
        now = self.accelerates_m_s2
        # The speed when the present acceleration has faded out.
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
        """Take longer, so that all axes are ready at the same time."""
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

    Jerk is reckoned with as a delay of two full swings of the acceleration.
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
