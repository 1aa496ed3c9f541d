"""An autopilot that flies the items in its own memory: what was uploaded is what is flown."""

from __future__ import annotations

import math

from executor.core.interface.messages import Battery, Message, MissionCurrent, Position
from missions import Command, Dialect, LocalFrame, ModeNumber
from tests.fakes.vehicle import FakeAutopilot

STEP_S = 0.25
CLIMB_M_S = 2.5
SINK_M_S = 1.0
TRANSIT_M_S = 8.0
OWN_M_S = 10.0
"""What it flies on a mission until an item says otherwise."""


class Flyer(FakeAutopilot):
    """Flies in straight lines at the speeds of its items, and says where it is."""

    def __init__(self, dialect: Dialect, frame: LocalFrame, pad_m: tuple[float, float], home_alt_m: float) -> None:
        """Stand on the pad."""
        super().__init__(dialect, parameters={})
        self.frame = frame
        self.pad_m = pad_m
        self.home_alt_m = home_alt_m
        self.place_m = pad_m
        self.up_m = 0.0
        self.percent = 100.0
        self.index = 0
        self.speed_m_s = TRANSIT_M_S
        self.wait_s = 0.0
        self._velocity_m_s = (0.0, 0.0, 0.0)
        self._fly_s = 0.0

    @property
    def wake_s(self) -> float:
        """The next step, or what the protocols wait for."""
        return min(self._fly_s, super().wake_s)

    def tick(self, now_s: float) -> list[Message]:
        """Fly on, and report."""
        said = super().tick(now_s)
        while now_s >= self._fly_s:
            self._fly_s += STEP_S
            self._fly()
            said += [self._position(), MissionCurrent(self.index, None)]
            if self._fly_s == math.floor(self._fly_s):
                said.append(Battery(0, float(round(self.percent)), 16.6, None, None, 1, 0))
        return said

    def change_mode(self, mode: ModeNumber) -> None:
        """Take on a mode; the mission's speed is forgotten with it."""
        if mode != self.mode:
            self.speed_m_s = OWN_M_S
        super().change_mode(mode)

    def change_speed(self, speed_m_s: float) -> None:
        """Take on a speed over ground."""
        self.speed_m_s = speed_m_s

    def _fly(self) -> None:
        self._velocity_m_s = (0.0, 0.0, 0.0)
        if not self.armed:
            self.index = 0
            return
        self.percent -= 0.036 * STEP_S
        if self.mode == self.dialect.modes.return_home:
            if self._toward((*self.pad_m, self.up_m), TRANSIT_M_S):
                self._land()
        elif self.mode == self.dialect.modes.mission:
            self._follow()

    def _follow(self) -> None:
        if self.wait_s > 0.0:
            self.wait_s -= STEP_S
            return
        if self.index == 0 and self.dialect.home_item:
            self.index = 1
        while self.missions.items[self.index].command == Command.DO_CHANGE_SPEED:
            self.speed_m_s = self.missions.items[self.index].param2
            self.index += 1
        item = self.missions.items[self.index]
        goal = self.place_m if (item.x, item.y) == (0, 0) else self.frame.to_local_m(item.x / 1e7, item.y / 1e7)
        match item.command:
            case Command.NAV_TAKEOFF:
                arrived = self._toward((*self.place_m, item.z), CLIMB_M_S)
            case Command.NAV_LAND:
                if self._toward((*goal, self.up_m), self.speed_m_s):
                    self._land()
                return
            case _:
                arrived = self._toward((*goal, item.z), self.speed_m_s)
        if arrived:
            self.wait_s = item.param1
            self.index += 1

    def _land(self) -> None:
        if self._toward((*self.place_m, 0.0), SINK_M_S):
            self.armed = False

    def _toward(self, goal_m: tuple[float, float, float], speed_m_s: float) -> bool:
        here = (*self.place_m, self.up_m)
        away = math.dist(here, goal_m)
        share = 1.0 if away <= speed_m_s * STEP_S else speed_m_s * STEP_S / away
        east, north, up = ((to - at) * share for at, to in zip(here, goal_m, strict=True))
        self.place_m, self.up_m = (here[0] + east, here[1] + north), here[2] + up
        self._velocity_m_s = (east / STEP_S, north / STEP_S, up / STEP_S)
        return share == 1.0

    def _position(self) -> Position:
        lat_deg, lon_deg = self.frame.to_wgs84_deg(*self.place_m)
        east, north, up = self._velocity_m_s
        msl_m = self.home_alt_m + self.up_m
        return Position(self._fly_s, lat_deg, lon_deg, msl_m, self.up_m, north, east, -up, None)
