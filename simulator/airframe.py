"""The airframe without its autopilot: it flies goals, drains its battery, takes off, lands, falls and crashes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from simulator.battery import Battery
from simulator.config import SimVehicle
from simulator.guidance import Climb, Goal, GoalFollower, Hover, Land, Leg, SpoolUp, find_stopping_place
from simulator.messages import LandedState
from simulator.physics import HARD_LANDING_M_S, Body, Limits, Place, PositionDrift

AIRBORNE_M = 0.3
SETTLES_M_S = 8.6
"""Impact speed that a vehicle with killed motors survives: a fall from just under 4 m."""
WRECK_ROLL_RAD = math.radians(170.0)
WRECK_UP_M = 0.1
"""Height reported by a wrecked vehicle."""
IDLE_DISARM_S = 10.0
"""Idle time on the ground until it disarms: DISARM_DELAY, COM_DISARM_PRFLT."""


PAD = Place(0.0, 0.0, 0.0)
PLAIN_CLIMB = Climb(PAD, 0.0)


@dataclass(frozen=True, slots=True)
class Event:
    """A true event, named as in ``Truth``."""

    what: str
    t_s: float
    sender: int | None = None
    """System that sent the command, if any."""
    place: Place = PAD
    charge_pct: float = 0.0


@dataclass(frozen=True, slots=True)
class AirframeSettings:
    """The autopilot's settings of the airframe."""

    limits: Limits
    spool_s: float
    """Time from motor start to lift-off."""
    disarm_landed_s: float
    """Time from touch-down to motor stop."""
    climb: Climb = PLAIN_CLIMB
    """Take-off template, without place and speeds."""
    wander_m: float = 0.0
    """Standard deviation of its position about the target, on each axis."""


class Airframe:
    """Body, battery and motors of one vehicle."""

    def __init__(self, vehicle: SimVehicle, manners: AirframeSettings) -> None:
        self.body = Body()
        self.pilot = GoalFollower(
            self.body, manners.limits, PositionDrift(manners.wander_m, f"{vehicle.seed}:{vehicle.name}:wander")
        )
        self.battery = Battery(
            vehicle.drone, charge_pct=vehicle.charge_pct, health=vehicle.health, consumption=vehicle.consumption
        )
        self._wind_m_s = vehicle.wind_m_s
        self._reaches = vehicle.speed_reached
        self.armed = False
        self.crashed_s: float | None = None
        """Time of its crash."""
        self.climbing_out = False
        """Whether the present climb is a take-off."""
        self.wrecked = False
        """Whether it is a wreck on the ground that still transmits."""
        self.highest_m = 0.0
        self._turns_over = False
        """Whether the present fall ends on its back."""
        self._stops = False
        """Whether it was disarmed when the fall began."""
        self._bears_m_s = HARD_LANDING_M_S
        """Impact speed that it survives in the present fall."""
        self._descending = False
        self._manners = manners
        self._climbed_to: Place | None = None
        self._falling = False
        self._airborne = False
        self._ground_s = 0.0
        self._now_s = 0.0
        self._events: list[Event] = []

    @property
    def motors_on(self) -> bool:
        """Whether the motors turn."""
        return self.armed and not self._falling

    @property
    def air_speed_m_s(self) -> float:
        """Horizontal speed through the air: it holds its ground speed in any wind."""
        if self.body.on_ground:
            return 0.0
        east, north = self._wind_m_s
        return math.hypot(self.body.v_east_m_s - east, self.body.v_north_m_s - north)

    def achieved_speed_m_s(self, asked_m_s: float) -> float:
        """Return the actual ground speed for a requested one."""
        return self._reaches * asked_m_s

    @property
    def landed_state(self) -> LandedState:
        """MAV_LANDED_STATE."""
        if self.body.on_ground:
            return LandedState.ON_GROUND
        match self.pilot.goal:
            case Climb() if self.climbing_out:
                return LandedState.TAKEOFF
            case Land():
                return LandedState.LANDING
            case _:
                return LandedState.IN_AIR

    @property
    def takeoff_end(self) -> Place | None:
        """Planned end of the last take-off, until another kind of flight begins; the next leg starts there."""
        return self._climbed_to if self.climbing_out else None

    def step(self, now_s: float, dt_s: float) -> None:
        """Run for ``dt_s``, until ``now_s``."""
        self._now_s = now_s
        self.battery.step(dt_s, motors=self.motors_on, speed_m_s=self.air_speed_m_s, climb_m_s=self.body.v_up_m_s)
        self.highest_m = max(self.highest_m, self.body.up_m)
        if self._falling:
            self._fall(dt_s)
        elif self.armed and not self.wrecked:
            self._fly(dt_s)
            if self.battery.is_empty:
                self.lose_thrust()

    def arm(self) -> None:
        """Start the motors."""
        if not self.armed:
            self.armed, self._stops = True, False
            self._ground_s = 0.0
            self.record_event("armed")

    def disarm(self) -> None:
        """Stop the motors; in the air it falls."""
        if not self.armed:
            return
        if not self.body.on_ground and not self.wrecked:
            self._falling = self._stops = True
            return
        self._stop_motors()
        self.pilot.fly([])

    def kill(self) -> None:
        """Stop the motors and disarm at once in any state: it survives a fall from three metres."""
        if not self.armed:
            return
        self._falling = not self.body.on_ground and not self.wrecked
        self._bears_m_s = SETTLES_M_S
        self._stop_motors()
        self.pilot.fly([])

    def damage(self, *, lost_thrust: float, turns_over: bool) -> None:
        """Lose a share of thrust; or fall and end on its back, with the motors on if it was not disarmed."""
        self.body.lost_thrust = lost_thrust
        if turns_over:
            self._turns_over = self._falling = True

    def put_on_pad(self) -> None:
        """Reset it on its pad, as a restarted simulator does."""
        self._falling = self.wrecked = self._turns_over = self._stops = False
        self.crashed_s, self.body.lost_thrust = None, 0.0
        self.body.east_m = self.body.north_m = self.body.up_m = 0.0
        self.body.stop()
        self.disarm()
        self.record_event("on_pad")

    def lose_thrust(self) -> None:
        """Fall; on the ground, break down. A destroyed vehicle does not crash or report again."""
        if self.crashed_s is not None:
            return
        if self.body.on_ground:
            self._break()
        else:
            self._falling = True

    def record_event(self, what: str, sender: int | None = None) -> None:
        """Record an event, or a command of a system."""
        self._events.append(Event(what, self._now_s, sender, self.body.place, self.battery.charge_pct))

    def drain_events(self) -> list[Event]:
        """Remove and return the events."""
        events, self._events = self._events, []
        return events

    def take_off(self, up_m: float, climb_m_s: float, slow_m_s: float = math.inf) -> Iterator[Goal]:
        """Yield a vertical take-off to a height, slower near the ground if the settings require it."""
        self.climbing_out = True
        self._climbed_to = Place(self.body.east_m, self.body.north_m, up_m)
        if self.body.on_ground:
            yield SpoolUp(self._manners.spool_s)
        yield replace(self._manners.climb, place=self._climbed_to, speed_m_s=climb_m_s, slow_m_s=slow_m_s)

    def go_home(self, up_m: float, *, speed_m_s: float, linger_s: float, land: Land, to: Place = PAD) -> Iterator[Goal]:
        """Yield the return: climb if needed, fly straight to the pad or a rally point, linger, land."""
        self.climbing_out = False
        here = find_stopping_place(self.body, self._manners.limits)
        if not self.body.on_ground:
            above = Place(here.east_m, here.north_m, max(here.up_m, up_m))
            if above.up_m > here.up_m + AIRBORNE_M:
                yield Climb(above, self._manners.limits.climb_m_s)
            over = Place(to.east_m, to.north_m, above.up_m)
            yield Leg(above, over, self.achieved_speed_m_s(speed_m_s), accept_m=0.0)
            yield Hover(over, linger_s)
        yield land

    def _stop_motors(self) -> None:
        self.armed = self._airborne = self.climbing_out = self._descending = False
        self._ground_s = 0.0
        self.record_event("disarmed")

    def _fall(self, dt_s: float) -> None:
        impact_m_s = self.body.fall(dt_s)
        if not self.body.on_ground:
            return
        if self._turns_over:
            self._rest_on_back()
        elif impact_m_s > self._bears_m_s:
            self._break()
        else:
            self._falling = False
            self.record_event("fell")
            self.disarm()

    def _rest_on_back(self) -> None:
        roll_rad = WRECK_ROLL_RAD if self._turns_over else 0.0
        self._falling = self._turns_over = False
        self.wrecked = True
        self.body.stop()
        self.body.up_m, self.body.roll_rad = WRECK_UP_M, roll_rad
        self.record_event("wreck")
        if self._stops:
            self._stop_motors()

    def _fly(self, dt_s: float) -> None:
        lands = isinstance(self.pilot.goal, Land)
        self.pilot.step(dt_s)
        if self._descending != isinstance(self.pilot.goal, Land):
            self._descending = not self._descending
            if self._descending and not self.body.on_ground:
                self.record_event("descends")
        if self.body.up_m > AIRBORNE_M and not self._airborne:
            self._airborne = True
            self.record_event("took_off")
        if self.body.lost_thrust and self._airborne and self.body.on_ground and self._ground_s == 0.0 and not lands:
            self._rest_on_back()  # its motors are on, and no autopilot detects a landing
            return
        rests = self.body.on_ground and not isinstance(self.pilot.goal, SpoolUp | Climb)
        if rests and self._airborne and self._ground_s == 0.0:
            self.record_event("landed")
        self._ground_s = self._ground_s + dt_s if rests else 0.0
        if self._ground_s >= (self._manners.disarm_landed_s if self._airborne else IDLE_DISARM_S):
            self.disarm()

    def _break(self) -> None:
        self.crashed_s = self._now_s
        self._falling = False
        self.body.stop()
        self.record_event("crash")
        self.disarm()
