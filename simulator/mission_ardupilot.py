"""ArduPilot's mission flight in AUTO, with the behaviour measured on Copter 4.7-dev."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from missions.items import Command, MissionItem
from simulator.airframe import Airframe
from simulator.guidance import Goal, Hover, Land, Leg, TimedLeg, can_join_timed_leg, corner_speed_m_s, distance_m
from simulator.leg_trajectories import DelayedCurve, LegLimits, SCurve, overlap_s, turn_s
from simulator.messages import MissionState, Severity, VehicleOutbox, build_message
from simulator.mission_store import DONE_IN_PASSING, CarryOut, find_return_destination, has_place, params_of, place_of
from simulator.params import ParamTable
from simulator.physics import Home, Place
from simulator.store_ardupilot import ArduPilotStore

LATE_SLOWDOWN_M = 22.5
"""Distance of the old speed after a fly-through corner. Measured: 60 m at '1 m/s' in 42 s, 100 m in 82 s."""
NEVER_SLOWS_M = 2 * LATE_SLOWDOWN_M
"""Leg length up to which the slow-down never takes effect: 40 m took 9.6 s."""
NAMES = {
    Command.NAV_WAYPOINT: "WP", Command.NAV_RETURN_TO_LAUNCH: "RTL", Command.NAV_LAND: "Land",
    Command.NAV_TAKEOFF: "Takeoff", Command.DO_CHANGE_SPEED: "ChangeSpeed", Command.DO_DIGICAM_CONTROL: "DigiCamCtrl",
    Command.DO_SET_ROI_LOCATION: "SetROILocation", Command.DO_SET_ROI_NONE: "SetROINone",
    Command.DO_SET_CAM_TRIGG_DIST: "SetCamTriggDst", Command.DO_GIMBAL_MANAGER_PITCHYAW: "GimbalPitchYaw",
    Command.IMAGE_START_CAPTURE: "ImageStartCapture", Command.IMAGE_STOP_CAPTURE: "ImageStopCapture",
    Command.VIDEO_START_CAPTURE: "VideoStartCapture", Command.VIDEO_STOP_CAPTURE: "VideoStopCapture",
}  # fmt: skip
PASS_S = 0.4
"""Time before a corner at which it passes it. Recorded: 0 to 0.5 m before it at 1 m/s, 1.3 to 2.3 m at 5 m/s."""
SETTLES_S = 0.4
"""Additional time of the leg after a take-off (measured)."""
UPRIGHT_S = 0.6
"""Additional time of a vertical leg (measured)."""
UPRIGHT_M = 1.0
SHORTEST_M = 0.1
APPROACH_M = 1.1
"""Height above LAND_ALT_LOW plus 0.5 m in which the descent slows down as if to stop."""
CM = 0.01
CONE_LEAST_M = 2.0
"""Minimum height of the RTL cone (RTL_ALT_MIN in the source)."""


class ArduPilotMission:
    """Behaviour of AUTO."""

    def __init__(
        self,
        frame: Airframe,
        store: ArduPilotStore,
        home: Home,
        params: ParamTable,
        voice: VehicleOutbox,
        carry_out: CarryOut,
    ) -> None:
        self._frame, self._store, self._home, self._params, self._voice = frame, store, home, params, voice
        self._carry_out = carry_out
        self.index = 0
        """Index in MISSION_CURRENT."""
        self.nav: MissionItem | None = None
        """The item being flown, a copy that survives its deletion."""
        self.asked_m_s = params["WPNAV_SPEED"] * CM
        self._state = MissionState.NOT_STARTED
        self._origin: Place | None = None
        """Start of the next leg's line after a fly-through or a stop; None: the vehicle's position."""
        self._passed_m_s: float | None = None
        """Speed of the last leg, if its end is a fly-through."""
        self._turning: tuple[Place, SCurve, float] | None = None
        """Start of the last leg, its curve and the next leg's lead, if its end is a fly-through."""
        self._reached = 0
        self._paused = False
        self._nothing_left = False
        """Whether it has reported that the list ends before the present item."""

    @property
    def state(self) -> MissionState:
        """State in MISSION_CURRENT: leaving AUTO makes it 'not started', only DO_PAUSE_CONTINUE 'paused'."""
        if self._paused:
            return MissionState.PAUSED
        return MissionState.NO_MISSION if self._store.count <= 1 else self._state

    @property
    def is_running(self) -> bool:
        """Whether it is flying items."""
        return self._state is MissionState.ACTIVE

    def is_takeoff_next(self) -> bool:
        """Return whether the next item to start is a take-off."""
        seq = self._find_resume_seq()
        while (item := self._store.item_at(seq)) is not None and item.command in DONE_IN_PASSING:
            seq += 1
        return item is not None and item.command == Command.NAV_TAKEOFF

    @property
    def speed_m_s(self) -> float:
        """Cruise speed where it can be reached."""
        return self._frame.achieved_speed_m_s(self.asked_m_s)

    def enter(self) -> None:
        """Start or resume. The speed of the mission's DO_CHANGE_SPEED is lost at every mode change."""
        self.asked_m_s = self._params["WPNAV_SPEED"] * CM
        self._origin = self._passed_m_s = self._turning = None
        self._start(self._find_resume_seq())

    def leave(self) -> None:
        """Stop flying items; the index is kept, and the nose no longer turns to a region of interest."""
        self._paused = False
        self._frame.body.face_rad = None
        if self.is_running:
            self._state = MissionState.NOT_STARTED

    def pause(self) -> bool:
        """Stop on a leg to a waypoint; False in any other phase."""
        if not self.is_running or self.nav is None or self.nav.command != Command.NAV_WAYPOINT:
            return False
        self._paused = True
        self._frame.pilot.hold()
        return True

    def resume(self) -> None:
        """Continue after a pause."""
        if self._paused and self.nav is not None:
            self._paused = False
            self._frame.pilot.fly(self._build_waypoint_goals(self.nav, self.index, restarted=True))

    def step(self) -> None:
        """Advance to the next item when the present one is done."""
        if self._paused or not self.is_running or self.nav is None or self._frame.pilot.goal is not None:
            return
        if self.nav.command in {Command.NAV_WAYPOINT, Command.NAV_TAKEOFF}:
            self._advance_after(self.nav)
        # A landing ends when the motors have stopped.

    def apply_disarm(self) -> None:
        """End the mission after its return; any other disarming resets it to its start.

        Measured: after its own NAV_LAND the list starts again with the motors off. It is 'active', and nothing moves.
        """
        landed = self.nav.command if self.is_running and self.nav is not None else None
        index, self.index = self.index, 0
        self.nav = None
        self._paused = False
        if landed == Command.NAV_RETURN_TO_LAUNCH:
            self._send_reached(index)
            self._state = MissionState.COMPLETE
        elif landed == Command.NAV_LAND:
            self.index = self._execute_do_items(1)
        elif self.is_running:
            self._state = MissionState.NOT_STARTED

    def apply_reboot(self) -> None:
        """Forget everything but the list."""
        self.index = 0
        self.nav = None
        self._state = MissionState.NOT_STARTED

    def apply_clear(self) -> None:
        """Handle clearing of the list outside of AUTO."""
        if not self.is_running:
            self.index = 0
            self._state = MissionState.NOT_STARTED

    def set_current(self, seq: int) -> bool:
        """Fly item ``seq`` next; 0 acts as 1.

        Returns:
            Whether there is that item. After the mission's end it is stored and not flown.
        """
        seq = max(seq, 1)
        if self._store.item_at(seq) is None:
            return False
        if self.is_running:
            self._origin = self._passed_m_s = self._turning = None
            self._start(seq)
        else:
            self.index = seq
        return True

    def apply_truncation(self) -> None:
        """Handle an announced upload: without items left, report it and continue to the present target."""
        flies = self.is_running and self.nav is not None and self.nav.command == Command.NAV_WAYPOINT
        if flies and not self._nothing_left and self._find_nav_seq(self.index) is None:
            self._nothing_left = True
            self._voice.send_text(Severity.CRITICAL, "Auto mission changed but failed to restart command")

    def apply_stored_item(self) -> None:
        """Handle an item replaced in flight: each one restarts the leg, if there is one to fly.

        Measured: a speed item that replaces the current waypoint moves the index on to the next item of the list as it
        is then, old or new; so it runs ahead of an upload item by item (``AP_Mission::set_current_cmd``).
        """
        if not self.is_running or self.nav is None or self.nav.command != Command.NAV_WAYPOINT:
            return
        if self._find_nav_seq(self.index) is None:
            return
        self._origin = self._passed_m_s = self._turning = None
        self._start(self.index, restarted=True)
        self._voice.send_text(Severity.CRITICAL, "Auto mission changed, restarted command")

    def _find_resume_seq(self) -> int:
        if self._state is MissionState.COMPLETE or self._store.item_at(self.index) is None:
            return 1
        return max(self.index, 1)

    def _find_nav_seq(self, seq: int) -> int | None:
        while (item := self._store.item_at(seq)) is not None:
            if item.command not in DONE_IN_PASSING:
                return seq
            seq += 1
        return None

    def _start(self, seq: int, *, restarted: bool = False) -> None:
        self._state = MissionState.ACTIVE
        self._paused = self._nothing_left = False
        seq = self._execute_do_items(seq)
        item = self._store.item_at(seq)
        if item is None:
            self._complete()
            return
        self.index, self.nav = seq, item
        self._frame.pilot.fly(self._build_goals(item, seq, restarted=restarted))

    def _execute_do_items(self, seq: int) -> int:
        """Execute the DO items from ``seq`` and return the number of the next that moves, or of the list's end."""
        while (item := self._store.item_at(seq)) is not None:
            self._voice.send_text(Severity.INFO, f"Mission: {seq} {NAMES[Command(item.command)]}")
            if item.command not in DONE_IN_PASSING:
                break
            if item.command != Command.DO_CHANGE_SPEED:
                self._carry_out(item.command, params_of(item))
            elif item.param2 > 0:
                self.asked_m_s = item.param2
            self._reached = seq
            seq += 1
        return seq

    def _build_goals(self, item: MissionItem, seq: int, *, restarted: bool) -> Iterator[Goal]:
        frame = self._frame
        match item.command:
            case Command.NAV_WAYPOINT:
                yield from self._build_waypoint_goals(item, seq, restarted=restarted)
            case Command.NAV_TAKEOFF:
                # In the air it completes immediately.
                if frame.body.on_ground:
                    up_m = place_of(item, self._home, frame.body.place).up_m
                    yield from frame.take_off(up_m, frame.pilot.limits.climb_m_s)
            case Command.NAV_LAND:
                frame.climbing_out = False
                here = frame.body.place
                over = place_of(item, self._home, here) if has_place(item) else here
                over = Place(over.east_m, over.north_m, here.up_m)
                yield Leg(here, over, self.speed_m_s, accept_m=0.0)
                yield land_goal(over, self._params)
            case _:
                far_m = 1000.0 * self._params["RALLY_LIMIT_KM"] or math.inf
                to = find_return_destination(self._store.rally, self._home, frame.body.place, far_m)
                yield from build_home_goals(frame, self._params, to)

    def _build_waypoint_goals(self, item: MissionItem, seq: int, *, restarted: bool) -> list[Goal]:
        frame = self._frame
        settles_s = SETTLES_S if frame.climbing_out else 0.0
        frame.climbing_out = False
        target = place_of(item, self._home, frame.body.place)
        after_seq = self._find_nav_seq(seq + 1)
        after = None if after_seq is None else self._store.item_at(after_seq)
        passes = item.param1 <= 0 and after is not None and after.command == Command.NAV_WAYPOINT
        origin = self._origin or frame.body.place
        length_m = distance_m(origin, target)
        slows = self._passed_m_s is not None and self.speed_m_s < self._passed_m_s
        speed_m_s = self._passed_m_s if slows and self._passed_m_s and length_m <= NEVER_SLOWS_M else self.speed_m_s
        accept_m = min(self._params["WPNAV_RADIUS"] * CM, PASS_S * speed_m_s)
        leg = Leg(origin, target, speed_m_s, accept_m if passes else 0.0, stop=not passes, restarted=restarted)
        if passes and after is not None:
            corner = corner_speed_m_s(leg, place_of(after, self._home, target), frame.pilot.limits, accept_m)
            leg = replace(leg, exit_m_s=corner)
        if slows:
            leg = replace(leg, entry_m_s=self._passed_m_s, entry_m=LATE_SLOWDOWN_M)
        self._passed_m_s = speed_m_s if passes else None
        self._origin = target
        flown: Leg | TimedLeg = leg
        if restarted or slows:
            self._turning = None
        else:
            onward = place_of(after, self._home, target) if passes and after is not None else None
            passed = (self._store.item_at(between) for between in range(seq + 1, after_seq or 0))
            changes = any(one is not None and one.command == Command.DO_CHANGE_SPEED for one in passed)
            flown = self._build_timed_leg(leg, onward, settles_s, changes=changes) or leg
        return [flown, Hover(target, item.param1)] if item.param1 > 0 else [flown]

    def _build_timed_leg(self, leg: Leg, after: Place | None, settles_s: float, *, changes: bool) -> TimedLeg | None:
        """Return the timed leg; None if the vehicle is not where the clock requires."""
        turning, self._turning = self._turning, None
        way, body = leg.target.subtract(leg.origin), self._frame.body
        params = self._params
        up_m_s, down_m_s = params["WPNAV_SPEED_UP"] * CM, params["WPNAV_SPEED_DN"] * CM
        pace = LegLimits(leg.speed_m_s, up_m_s, down_m_s, params["WPNAV_ACCEL"] * CM, params["WPNAV_RADIUS"] * CM)
        if way.length_m < SHORTEST_M or (after is not None and changes):
            return None
        curve = SCurve.build(way, pace)
        base = leg.origin
        upright = math.hypot(way.east_m, way.north_m) < UPRIGHT_M
        turns_s = UPRIGHT_S if upright else turn_s(math.atan2(way.east_m, way.north_m) - body.yaw_rad)
        strands = [DelayedCurve(curve, settles_s + turns_s)]
        if turning is not None:
            base, before, early_s = turning
            strands = [DelayedCurve(before, early_s / 2 - before.duration_s), DelayedCurve(curve, -early_s / 2)]
        lasts_s = strands[-1].begins_s + curve.duration_s
        if after is not None:
            way_on = after.subtract(leg.target)
            if way_on.length_m < SHORTEST_M:
                return None
            following = SCurve.build(way_on, pace)
            early_s = overlap_s(curve, following, pace)
            strands.append(DelayedCurve(following, lasts_s - early_s))
            lasts_s -= early_s / 2
            self._turning = (leg.origin, curve, early_s)
        ride = TimedLeg(leg, base, tuple(strands), lasts_s)
        if not can_join_timed_leg(ride, body):
            self._turning = None
            return None
        return ride

    def _advance_after(self, done: MissionItem) -> None:
        self._reached = self.index
        if done.command == Command.NAV_TAKEOFF:
            self._origin = self._frame.takeoff_end
        if done.command == Command.NAV_WAYPOINT:
            self._voice.send_text(Severity.INFO, f"Reached command #{self.index}")
        if self.index >= self._store.count:
            # A shorter list replaced its list: it reports completion, and flies the leg that it had read before.
            index = self.index
            self._send_reached(index)
            beyond = self._store.stale_item_at(index + 1)
            self._complete()
            self.index = index
            if beyond is not None and beyond.command == Command.NAV_WAYPOINT:
                here = self._frame.body.place
                target = place_of(beyond, self._home, here)
                self._frame.pilot.fly([Leg(here, target, self.speed_m_s, 0.0), Hover(target)])
            return
        self._start(self.index + 1)
        # A DO item executed in passing replaces the waypoint in this report.
        self._send_reached(self._reached)

    def _complete(self) -> None:
        self._state = MissionState.COMPLETE
        self.index = 0
        self.nav = None
        self._frame.pilot.hold()

    def _send_reached(self, seq: int) -> None:
        self._voice.send([build_message("MISSION_ITEM_REACHED", seq=seq)])


def land_goal(over: Place, params: ParamTable) -> Land:
    """Return a landing; recorded: 1.49 m/s down to 10 m, then 0.49 m/s."""
    slow_m_s = params["LAND_SPEED"] * CM
    slow_from_m = params["LAND_ALT_LOW"] * CM + slow_m_s
    return Land(over, params["WPNAV_SPEED_DN"] * CM, slow_m_s, slow_from_m, slow_from_m + APPROACH_M)


def build_home_goals(frame: Airframe, params: ParamTable, to: Place) -> Iterator[Goal]:
    """Yield RTL: not lower than RTL_ALT or the cone over the pad, at RTL_SPEED or WPNAV_SPEED, a pause over the pad."""
    here = frame.body.place
    speed_m_s = (params["RTL_SPEED"] or params["WPNAV_SPEED"]) * CM
    pad = here if frame.body.on_ground else to
    up_m = params["RTL_ALT"] * CM
    if params["RTL_CONE_SLOPE"] > 0:
        up_m = min(up_m, max(math.hypot(here.east_m, here.north_m) * params["RTL_CONE_SLOPE"], CONE_LEAST_M))
    yield from frame.go_home(
        up_m, speed_m_s=speed_m_s, linger_s=params["RTL_LOIT_TIME"] * 1e-3, land=land_goal(pad, params), to=to
    )
