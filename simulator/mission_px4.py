"""PX4's mission flight in AUTO.MISSION, with the behaviour measured on v1.17.0."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from enum import Enum

from missions.items import Command, MissionItem
from simulator.airframe import Airframe
from simulator.guidance import Goal, Land, Leg
from simulator.leg_trajectories import Px4Leg
from simulator.messages import MissionState, Severity, VehicleOutbox, build_message
from simulator.mission_store import DONE_IN_PASSING, CarryOut, has_place, params_of, place_of
from simulator.params import ParamTable
from simulator.physics import Home, Place
from simulator.store_px4 import NAV_VTOL_LAND, NAV_VTOL_TAKEOFF, Px4Store

CHECK_S = 0.5
"""Time after an upload on the ground until the mission is valid; an earlier MISSION_START is denied."""
LEAST_RADIUS_M = 0.05
"""Radius above which an item's own acceptance radius counts."""
REACHED_REPEATS = 10
REACHED_AGAIN_S = 1.0
FAST_LANDING_M, SLOW_LANDING_M = 10.0, 5.0
"""MPC_LAND_ALT1 and MPC_LAND_ALT2. Recorded: 1.6 m/s down, about 1 m/s under 8 m, 0.7 m/s at the ground."""

SINKS_SHARE = 0.83
"""Average share of the permitted sink rate. Measured: 1.25 m/s on average at a limit of 1.5. Its trajectory also waits
for the vehicle in height, whenever the estimate is off its line by some decimetres."""


class MissionEnd(Enum):
    """Ways in which a mission leaves AUTO.MISSION."""

    LOITER = "loiter"
    RETURN = "return"


class Px4Mission:
    """Behaviour of AUTO.MISSION."""

    def __init__(
        self,
        frame: Airframe,
        store: Px4Store,
        home: Home,
        params: ParamTable,
        voice: VehicleOutbox,
        carry_out: CarryOut,
    ) -> None:
        self._frame, self._store, self._home, self._params, self._voice = frame, store, home, params, voice
        self._carry_out = carry_out
        self.left_fence_at: Callable[[], int | None] = lambda: None
        """Return the first item outside the fence, or None."""
        self.index = 0
        self.asked_m_s = params["MPC_XY_CRUISE"]
        self.running = False
        """Whether it is flying items."""
        self._nav: MissionItem | None = None
        self._finished = False
        self._stood_disarmed = False
        """Whether the motors have stopped since the mission was last flown."""
        self._state = MissionState.NO_MISSION
        self._progressed = False
        """Whether an item was reached since the mission was entered or changed."""
        self._checked_s = 0.0
        self._origin: Place | None = None
        self._arrived: Place | None = None
        """End of the last leg, if the next one begins there."""
        self._bound_for: Place | None = None
        """End of the present leg."""
        self.ended_at: Place | None = None
        """Last waypoint of a completed mission, where it loiters."""
        self._reached: tuple[int, int, float] | None = None
        """(item, repeats left, next at)."""

    def report_state(self, now_s: float, *, active: bool) -> MissionState:
        """Return the state in MISSION_CURRENT; ``active`` is whether the mode is a mission mode.

        It is PAUSED only if an item was reached since the mission was entered or uploaded; otherwise it stays as it
        was, mostly ACTIVE (mavlink_mission.cpp, and measured).
        """
        if not self.is_feasible:
            self._state = MissionState.NO_MISSION
        elif now_s < self._checked_s:
            return self._state
        elif self._finished:
            self._state = MissionState.COMPLETE
        elif active:
            self._state = MissionState.ACTIVE
        elif self._progressed:
            self._state = MissionState.PAUSED
        elif self.index < 1:
            self._state = MissionState.NOT_STARTED
        return self._state

    def is_valid(self, now_s: float) -> bool:
        """Return whether a mission has passed its check."""
        return self.is_feasible and now_s >= self._checked_s

    @property
    def is_feasible(self) -> bool:
        """Whether a mission exists that a multicopter can fly."""
        items = self._store.items
        flyable = all(item.command not in {NAV_VTOL_TAKEOFF, NAV_VTOL_LAND} for item in items)
        return bool(items) and flyable and self.left_fence_at() is None

    @property
    def speed_m_s(self) -> float:
        """Cruise speed where it can be reached."""
        return self._frame.achieved_speed_m_s(self.asked_m_s)

    def enter(self) -> MissionEnd | None:
        """Start or resume at the index; the cruise speed is the default again."""
        self.asked_m_s = self._params["MPC_XY_CRUISE"]
        if not self.is_feasible:
            return self.give_up()
        if self._finished and not self._rewind_if_flown():
            return self.give_up()
        self.running = True
        self._stood_disarmed = False
        self.ended_at = None
        self._progressed = False
        self._voice.send_text(Severity.INFO, "Executing Mission")
        self._origin = self._arrived = self._bound_for = None
        return self._start(self.index)

    def _rewind_if_flown(self) -> bool:
        """Go to the first item of a completely flown mission, if the motors have stopped since.

        ``MissionBase::checkMissionRestart`` of PX4 1.17.
        """
        if not self._stood_disarmed or self.index + 1 != len(self._store.items):
            return False
        self._finished = False
        self.index = 0
        return True

    def leave(self) -> None:
        """Stop flying items; the index is kept."""
        self.running = False
        self._frame.body.face_rad = None

    def give_up(self) -> MissionEnd:
        """Report that there is nothing to fly."""
        self.running = False
        self._voice.send_text(Severity.CRITICAL, "No valid mission available, loitering")
        return MissionEnd.LOITER

    def step(self, now_s: float) -> MissionEnd | None:
        """Repeat the reports of reached items, and advance to the next item when the present one is done."""
        self._repeat_reached(now_s)
        if not self.running or self._nav is None or self._frame.pilot.goal is not None:
            return None
        done, seq = self._nav, self.index
        if done.command == Command.NAV_LAND:
            return None  # ends when the motors have stopped
        self._reached = (seq, REACHED_REPEATS, now_s)
        self._progressed = True
        self._arrived = self._frame.takeoff_end or place_of(done, self._home, self._frame.body.place)
        end = self._start(seq + 1)
        self._repeat_reached(now_s)
        return end

    def apply_landing(self, now_s: float) -> None:
        """End the mission as the motors stop after its landing; any other landing only interrupts it."""
        self._stood_disarmed = True
        if not self.running or self._nav is None or self._nav.command != Command.NAV_LAND:
            self.running = False
            return
        self._reached = (self.index, REACHED_REPEATS, now_s)
        self._end("Mission finished, landed")

    def apply_new_list(self, current: int | None, now_s: float) -> MissionEnd | None:
        """Handle a new list: the flagged item is next; without a flag the old number is kept, clamped."""
        last = max(len(self._store.items) - 1, 0)
        self.index = min(self.index if current is None else current, last)
        self._finished = self._progressed = False
        self._reached = None
        if not self.running:
            self._checked_s = now_s + CHECK_S
            return None
        self._checked_s = now_s
        if not self.is_feasible:
            return self.give_up()
        return self._start(self.index)

    def apply_clear(self) -> MissionEnd | None:
        """Handle a cleared list; in flight it holds."""
        self.index = 0
        self._finished = self._progressed = False
        self._reached = None
        return self.give_up() if self.running else None

    def set_current(self, seq: int) -> MissionEnd | None:
        """Fly item ``seq`` next."""
        self._finished = self._progressed = False
        self.index = seq
        if not self.running:
            return None
        self._origin = self._arrived = None
        return self._start(seq)

    def apply_reboot(self) -> None:
        """Keep list and index, reset everything else."""
        self.running = self._progressed = False
        self._reached = None

    def _start(self, seq: int) -> MissionEnd | None:
        items = self._store.items
        while seq < len(items) and items[seq].command in DONE_IN_PASSING:
            if items[seq].command != Command.DO_CHANGE_SPEED:
                self._carry_out(items[seq].command, params_of(items[seq]))
            elif items[seq].param2 > 0:
                self.asked_m_s = items[seq].param2
            if self._reached is not None and self._reached[0] == seq - 1:
                # A DO item replaces the item before it in the report.
                self._reached = (seq, self._reached[1], self._reached[2])
            seq += 1
        if seq >= len(items):
            return self._finish(MissionEnd.LOITER)
        old, self._nav, self.index = self._nav, items[seq], seq
        if self._nav.command == Command.NAV_RETURN_TO_LAUNCH:
            self._reached = (seq, REACHED_REPEATS, self._reached[2] if self._reached else 0.0)
            return self._finish(MissionEnd.RETURN)
        if old is None or (old.x, old.y, old.z) != (self._nav.x, self._nav.y, self._nav.z):
            # After a jump in flight, its line starts at the end of the interrupted leg (mission.cpp).
            self._origin = self._arrived or self._bound_for or self._frame.body.place
        self._arrived = None
        turned = self._nav.command == Command.NAV_WAYPOINT and not math.isnan(self._nav.param4)
        self._frame.body.face_rad = math.radians(self._nav.param4) if turned else None
        self._frame.pilot.fly(self._build_goals(self._nav, seq))
        return None

    def _finish(self, end: MissionEnd) -> MissionEnd:
        self._end("Mission finished, loitering")
        self.ended_at = self._arrived
        return end

    def _end(self, text: str) -> None:
        self.leave()
        self._finished = True
        self.index = min(self.index, max(len(self._store.items) - 1, 0))
        self._voice.send_text(Severity.INFO, text)

    def _build_goals(self, item: MissionItem, seq: int) -> Iterator[Goal]:
        frame = self._frame
        here = frame.body.place
        if frame.body.on_ground:
            # Without a take-off item it first climbs to a minimum height.
            takeoff = item.command == Command.NAV_TAKEOFF
            up_m = place_of(item, self._home, here).up_m if takeoff else self._params["MIS_TAKEOFF_ALT"]
            self._voice.send_text(Severity.INFO, f"Climb to {up_m:.1f} meters above home")
            yield from frame.take_off(up_m, frame.pilot.limits.climb_m_s, self._params["MPC_TKO_SPEED"])
            if takeoff:
                return
            here = Place(here.east_m, here.north_m, up_m)
            self._origin = here
        else:
            frame.climbing_out = False
        target = place_of(item, self._home, here)
        if item.command == Command.NAV_LAND:
            over = Place(target.east_m, target.north_m, here.up_m) if has_place(item) else here
            yield Leg(here, over, self.speed_m_s, accept_m=0.0)
            yield land_goal(over, self._params)
            return
        # It flies a take-off item in the air as a waypoint.
        self._bound_for = target
        accept_m = item.param2 if item.param2 > LEAST_RADIUS_M else self._params["NAV_ACC_RAD"]
        after = next((nav for nav in self._store.items[seq + 1 :] if nav.command not in DONE_IN_PASSING), None)
        # It brakes for a hold, and for a landing at the same place.
        onward = None
        if item.param1 <= 0 and after is not None and has_place(after):
            onward = place_of(after, self._home, target)
        yield Px4Leg(self._origin or here, target, onward, self.speed_m_s, accept_m, max(item.param1, 0.0))

    def _repeat_reached(self, now_s: float) -> None:
        if self._reached is None or now_s < self._reached[2]:
            return
        seq, left, _ = self._reached
        self._voice.send([build_message("MISSION_ITEM_REACHED", seq=seq)])
        self._reached = (seq, left - 1, now_s + REACHED_AGAIN_S) if left > 0 else None


def land_goal(over: Place, params: ParamTable) -> Land:
    """Return a landing."""
    return Land(
        over, SINKS_SHARE * params["MPC_Z_VEL_MAX_DN"], params["MPC_LAND_SPEED"], SLOW_LANDING_M, FAST_LANDING_M
    )
