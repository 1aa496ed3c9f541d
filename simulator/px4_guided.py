"""PX4 v1.17.0 without a mission, as measured: places, circles, set-points, and injected failures."""

from __future__ import annotations

import math
from abc import abstractmethod
from enum import IntEnum

from simulator import messages
from simulator.autopilot import Autopilot
from simulator.guidance import Circle, Hover, find_stopping_place
from simulator.mission_px4 import Px4Mission
from simulator.physics import Limits, Place

MAIN_AUTO = 4


def encode_custom_mode(main: int, sub: int = 0) -> int:
    """Return the custom mode that a heartbeat reports."""
    return sub << 24 | main << 16


class Mode(IntEnum):
    """custom_mode, as far as simulated."""

    ALTCTL = encode_custom_mode(2)
    POSCTL = encode_custom_mode(3)
    ORBIT = encode_custom_mode(3, 1)
    OFFBOARD = encode_custom_mode(6)
    TAKEOFF = encode_custom_mode(4, 2)
    LOITER = encode_custom_mode(4, 3)
    MISSION = encode_custom_mode(4, 4)
    RETURN = encode_custom_mode(4, 5)
    LAND = encode_custom_mode(4, 6)


LIMITS = Limits(accelerate_m_s2=2.0, brake_m_s2=2.5, climb_m_s=3.0, descend_m_s=1.5, vertical_m_s2=1.5, corner_m_s2=1.1)
"""Recorded: a right angle at 2.3 m/s; 2.9 m/s up, 1.6 m/s down."""
ONE_OF_FOUR = 0.25
LEAST_RADIUS_M, ORBIT_M_S2 = 1.0, 2.0
FAILING_GPS, FAILING_MOTOR, WELL, OFF = 4, 101, 0, 1
"""FAILURE_UNIT and FAILURE_TYPE."""


class Px4Guided(Autopilot):
    """Flight without a mission of one vehicle."""

    mission: Px4Mission
    _takeoff_up_m: float
    _centre = Place(0.0, 0.0, 0.0)
    _motor_off = False
    _lost_set_points = False
    """Whether it returns because set-points stopped."""

    @abstractmethod
    def _describe_breach(self, place: Place) -> str:
        """Return the text for a place outside the fence; empty inside."""

    @abstractmethod
    def _switch(self, mode: Mode) -> None:
        """Change the mode."""

    def _take_off(self, command: messages.Command) -> messages.Result:
        """Take off to a height above mean sea level, or to the default height."""
        least_m, up_m = self.params["MIS_TAKEOFF_ALT"], command.params[6] - self.home.alt_m
        self._takeoff_up_m = max(least_m, up_m) if math.isfinite(up_m) else least_m
        return self.set_mode(Mode.TAKEOFF)

    def _reposition(self, command: messages.Command) -> messages.Result:
        """Fly to a place, and hold there. Measured: it does so even when it reports the command as unsupported."""
        flags, speed_m_s = command.integer_param(1), command.params[0]
        asked_m_s = self.mission.asked_m_s if self.mode == Mode.LOITER else self.params["MPC_XY_CRUISE"]
        result = self.set_mode(Mode.LOITER) if flags == 1 else messages.Result.UNSUPPORTED
        if self.mode == Mode.LOITER:
            here = find_stopping_place(self.frame.body, LIMITS)
            up_m = command.params[6] - self.home.alt_m
            up_m = up_m if math.isfinite(up_m) else self.frame.body.up_m
            where = command.place_e7
            place = here._replace(up_m=up_m) if where is None else self.home.place_of(*where, up_m)
            self._go(place, speed_m_s if speed_m_s > 0 else asked_m_s, "Reposition is outside geofence")
        return result

    def _change_height(self, command: messages.Command) -> messages.Result:
        result = self.set_mode(Mode.LOITER)
        up_m = command.params[0] - self.home.alt_m
        here = find_stopping_place(self.frame.body, LIMITS)
        self._go(here._replace(up_m=up_m), self.mission.asked_m_s, "Altitude change is outside geofence")
        return result

    def _go(self, place: Place, speed_m_s: float, refusal: str) -> None:
        if self.guided.may_move and int(self.params["GF_ACTION"]) != 0 and self._describe_breach(place):
            self.voice.send_text(messages.Severity.CRITICAL, refusal)
        else:
            self.guided.go(place, speed_m_s)

    def _orbit(self, command: messages.Command) -> messages.Result:
        """Orbit a place, after FlightTaskOrbit.cpp: clockwise for a radius above 0, at limited speed."""
        radius_m, speed_m_s, up_m = command.params[0], command.params[1], command.params[6] - self.home.alt_m
        result, where, here = self.set_mode(Mode.ORBIT), command.place_e7, self.frame.body.place
        self._centre = here if where is None else self.home.place_of(*where, here.up_m)
        if math.isfinite(up_m):
            self._centre = self._centre._replace(up_m=up_m)
        radius_m = radius_m if math.isfinite(radius_m) else LEAST_RADIUS_M
        if not LEAST_RADIUS_M <= abs(radius_m) <= self.params["MC_ORBIT_RAD_MAX"]:
            self.voice.send_text(messages.Severity.CRITICAL, "Orbit radius limit exceeded")
            self.frame.pilot.hold()
            return result
        most_m_s = min(math.sqrt(ORBIT_M_S2 * abs(radius_m)), self.params["MPC_XY_VEL_MAX"])
        speed_m_s = min(abs(speed_m_s) if math.isfinite(speed_m_s) else 1.0, most_m_s)
        self.guided.go_round(
            self._centre, abs(radius_m), math.copysign(speed_m_s, radius_m), self.params["MPC_XY_CRUISE"]
        )
        return result

    def _build_circle_report(self) -> messages.Outbound | None:
        circle = self.frame.pilot.goal
        if not isinstance(circle, Circle):
            return None
        lat, lon = self.home.lat_lon_e7(circle.centre.east_m, circle.centre.north_m)
        return messages.build_message(
            "ORBIT_EXECUTION_STATUS", time_usec=self.boot_ms * 1000, frame=0, x=lat, y=lon,
            radius=math.copysign(circle.radius_m, circle.speed_m_s), z=self.home.alt_m + circle.centre.up_m,
        )  # fmt: skip

    def _follow_set_point(self, point: messages.SetPoint) -> None:
        if self.guided.note(point, self.now_s) and self.mode == Mode.OFFBOARD:
            self.guided.follow(self.params["MPC_XY_VEL_MAX"])

    def _lacks_set_points(self) -> bool:
        return self.now_s - self.guided.heard_s > self.params["COM_OF_LOSS_T"]

    def _inject_failure(self, command: messages.Command) -> messages.Result | None:
        """Fail a motor or GPS, as its simulations do; other units get no answer."""
        if not self.params["SYS_FAILURE_EN"]:
            return messages.Result.DENIED
        unit, kind = command.integer_param(0), command.integer_param(1)
        if unit not in {FAILING_GPS, FAILING_MOTOR}:
            return None
        if kind not in {WELL, OFF}:
            return messages.Result.UNSUPPORTED
        if unit == FAILING_MOTOR:
            self._motor_off = kind == OFF
        elif kind == OFF:
            self.positioning.lose(self.now_s, 0.0)
        else:
            self.positioning.find(self.now_s)
        return messages.Result.ACCEPTED

    def _fly_guided(self) -> None:
        body = self.frame.body
        if self._motor_off and self.guided.may_move:
            self._motor_off = False
            self.frame.damage(lost_thrust=ONE_OF_FOUR, turns_over=True)
        end = self.frame.takeoff_end
        if self.mode == Mode.TAKEOFF and self.guided.may_move and self.frame.pilot.goal is None and end is not None:
            self._switch(Mode.LOITER)
            self.frame.pilot.fly([Hover(end)])
        if self.mode == Mode.ORBIT:
            body.face_rad = math.atan2(self._centre.east_m - body.east_m, self._centre.north_m - body.north_m)
        if self.mode == Mode.OFFBOARD and self.guided.may_move and self._lacks_set_points():
            self.frame.record_event("failsafe offboard")
            self.voice.send_text(messages.Severity.CRITICAL, "Failsafe activated")
            self._lost_set_points = True
            self._switch(Mode.RETURN)
        elif self._lost_set_points and not self._lacks_set_points():
            self._switch(Mode.OFFBOARD)  # it continues as soon as set-points return
