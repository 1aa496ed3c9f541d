"""PX4 v1.17.0 as measured: modes, arming, failsafes, reports."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar

from simulator import messages, mission_store
from simulator.airframe import AirframeSettings
from simulator.autopilot import Handler
from simulator.config import SimVehicle
from simulator.guidance import Climb, Goal, Hover, find_stopping_place
from simulator.leg_trajectories import HEIGHT_M, JERK, UP
from simulator.mission_px4 import FAST_LANDING_M, MissionEnd, Px4Mission, land_goal
from simulator.physics import ALONE, GPS_BIT, Home, Place
from simulator.px4_guided import LIMITS, MAIN_AUTO, Mode, Px4Guided, encode_custom_mode
from simulator.store_px4 import Px4Store
from simulator.streams import Streams
from simulator.telemetry import build_sys_status, name_cells

WORDS = {
    "POSCTL": Mode.POSCTL, "ALTCTL": Mode.ALTCTL, "HOLD": Mode.LOITER, "RTL": Mode.RETURN, "LAND": Mode.LAND,
    "MISSION": Mode.MISSION,
}  # fmt: skip
"""Modes that a pilot may select."""
MISSION_MODES = frozenset({Mode.MISSION, Mode.TAKEOFF, Mode.LAND})
"""Modes in which MISSION_CURRENT reports 'active', as PX4 does."""


MAV_AUTOPILOT_PX4 = 12
CLIMB = Climb(Place(0.0, 0.0, 0.0), 0.0, slow_below_m=FAST_LANDING_M, accept_m=HEIGHT_M, brakes=(UP[0], JERK))
"""At MPC_TKO_SPEED up to MPC_LAND_ALT1; ends just below the item's height (mission_block.cpp)."""
MANNERS = AirframeSettings(LIMITS, spool_s=4.1, disarm_landed_s=2.0, climb=CLIMB, wander_m=0.2)
"""Measured: 4 to 5.5 s from arming to lift-off, of which COM_SPOOLUP_TIME is 1 and MPC_TKO_RAMP_T 3; the position
error."""
SENSORS_BOOT = (0x0, 0x0, 0x321C83F)
SENSORS = (0x300402F, 0x301402F, 0x1320C83F)
"""From the recorded flights: (present, enabled, healthy)."""
PREARM_BIT = 0x10000000
"""Sensor bit of the arming checks."""
LOSS_MARGIN_S = 2.0
"""Extra delay of the link failsafe. Measured: AUTO.LOITER about 12 s after the last heartbeat, COM_DL_LOSS_T at 10."""
CONE_CLOSE_M = 2.0
UNKNOWN_CURRENT_CA = -100
"""Current without a sensor: -1 A in centiamperes, not -1."""
EMPTY_TOTAL = 65535
LEAST_FACTOR = 0.01
"""Minimum factor on the rates of its streams."""
RADIO_FORGOTTEN_S = 5.0
"""MAV_RADIO_TOUT."""
EMERGENCY_PCT = 4.5
"""Charge left by the emergency fault: below BAT_EMERGEN_THR, and enough to land."""
OFFICIAL = 255
"""FIRMWARE_VERSION_TYPE."""


class Px4(Px4Guided):
    """One vehicle."""

    REFUSED: ClassVar = messages.Result.TEMPORARILY_REJECTED
    INVALID: ClassVar = messages.Result.DENIED
    ACKNOWLEDGES_FIRST: ClassVar = False
    ACKNOWLEDGES_EVERYWHERE: ClassVar = True
    ON_ITS_BACK: ClassVar = "Preflight Fail: Attitude failure (roll)"
    KILLED: ClassVar = "Preflight Fail: Kill switch engaged"
    KILL_SAYS: ClassVar = "Kill engaged"
    WORDS: ClassVar = WORDS
    FIX: ClassVar = 3
    CAPABILITIES: ClassVar = sum(1 << bit for bit in (0, 1, 2, 3, 4, 5, 7, 13, 14, 15))
    """Missions in float and int, COMMAND_INT, parameters as floats and bytewise, MAVFTP, set-points, MAVLink 2, fence,
    rally points."""
    UNKNOWN: ClassVar = frozenset({"SIMSTATE", "RC_CHANNELS", "RAW_IMU"})
    VERSION: ClassVar = (1, 17, 0, OFFICIAL)
    STREAMS_S: ClassVar = {
        "HEARTBEAT": 1.0, "SYS_STATUS": 1.0, "BATTERY_STATUS": 2.0, "GLOBAL_POSITION_INT": 0.25, "ATTITUDE": 0.25,
        "VFR_HUD": 0.5, "GPS_RAW_INT": 1.0, "HOME_POSITION": 2.0, "EXTENDED_SYS_STATE": 1.0, "MISSION_CURRENT": 1.0,
        "LOCAL_POSITION_NED": 0.5, "SYSTEM_TIME": 1.0, "WIND_COV": 2.0,
    }  # fmt: skip

    def __init__(self, vehicle: SimVehicle) -> None:
        first = self._store = Px4Store(vehicle.transfer_patience_s)
        others = (Px4Store(vehicle.transfer_patience_s, beside=first) for _ in vehicle.connections[1:])
        home = Home(vehicle.home_lat_deg, vehicle.home_lon_deg, vehicle.home_alt_m)
        super().__init__(vehicle, MANNERS, (first, *others), home)
        self.mode = Mode.LOITER
        self.mission = Px4Mission(self.frame, self._store, home, self.params, self.voice, self.execute_payload_command)
        self._arming_for_mission = False
        self._mode_after_flight = Mode.LOITER
        """Last armable mode that the crew chose; it returns to it with the motors off."""
        self._announced = 0
        """Last reported index."""
        self._link_lost = False
        self._failsafe = self._blind = self._lost_gps = False
        self._emergency = Mode.LAND
        """Mode for the emergency fault, whatever COM_LOW_BAT_ACT is."""
        self._emergency_ordered = False
        self._action_due: tuple[float, Mode] | None = None
        """End of a failsafe's hold, and the mode that follows."""
        self._charge_state = 1
        self._landed_state = messages.LandedState.ON_GROUND
        self._shapes: tuple[mission_store.FenceShape, ...] = ()
        self._outside = False
        """Whether it is outside its fence."""
        self._takeoff_up_m = self.params["MIS_TAKEOFF_ALT"]
        self.mission.left_fence_at = self._find_item_outside_fence

    def _own_commands(self) -> dict[int, Handler]:
        # DO_SET_MISSION_CURRENT and DO_PAUSE_CONTINUE are missing: 'unsupported', as measured.
        return {
            messages.MavCommand.DO_SET_MODE: self._handle_set_mode_command,
            messages.MavCommand.MISSION_START: self._start_mission,
            messages.MavCommand.NAV_RETURN_TO_LAUNCH: lambda _: self._go_down(Mode.RETURN, "Returning to launch"),
            messages.MavCommand.NAV_LAND: lambda _: self._go_down(Mode.LAND, "Landing at current position"),
            messages.MavCommand.NAV_TAKEOFF: self._take_off,
            messages.MavCommand.DO_REPOSITION: self._reposition,
            messages.MavCommand.DO_CHANGE_ALTITUDE: self._change_height,
            messages.MavCommand.DO_ORBIT: self._orbit,
            messages.MavCommand.INJECT_FAILURE: self._inject_failure,
        }

    # Modes.

    def set_mode(self, mode: int) -> messages.Result:
        """Change the mode as commanded by the crew. It ends a failsafe's hold and cancels its action."""
        if mode not in set(Mode):
            if mode >> 16 & 255 != MAIN_AUTO:
                # Measured: a main mode that does not exist is accepted, and nothing happens.
                return messages.Result.ACCEPTED
            self.voice.send_text(messages.Severity.CRITICAL, "Unsupported auto mode")
            return messages.Result.TEMPORARILY_REJECTED
        self._action_due, self._lost_set_points = None, False
        if mode == Mode.MISSION and self.frame.armed and not self._store.items:
            self.voice.send_text(messages.Severity.CRITICAL, "Switching to Mission is currently not available")
            return messages.Result.TEMPORARILY_REJECTED
        if mode == Mode.OFFBOARD and self._lacks_set_points():
            self.voice.send_text(messages.Severity.CRITICAL, "Switching to Offboard is currently not available")
            return messages.Result.TEMPORARILY_REJECTED
        if mode not in {Mode.RETURN, Mode.LAND, Mode.TAKEOFF, Mode.ORBIT}:
            self._mode_after_flight = Mode(mode)
        if mode != self.mode or (mode == Mode.MISSION and not self.mission.running):
            self._switch(Mode(mode))
        return messages.Result.ACCEPTED

    def build_mode_order(self, word: str) -> messages.Command:
        """Return the command with which a ground station sets a mode."""
        mode = WORDS[word]
        params = (1.0, float(mode >> 16 & 255), float(mode >> 24), 0.0, 0.0, 0.0, 0.0)
        return messages.Command(messages.MavCommand.DO_SET_MODE, params)

    def _handle_set_mode_command(self, command: messages.Command) -> messages.Result:
        """Handle DO_SET_MODE. Measured: two acknowledgements, of receipt and of the change; the first accepts."""
        self.acknowledge(command, messages.Result.ACCEPTED)
        return self.set_mode(encode_custom_mode(command.integer_param(1), command.integer_param(2)))

    def _set_mode_message(self, message: messages.SetMode) -> None:
        """Handle SET_MODE, which is acknowledged like the command."""
        result = self.set_mode(message.custom_mode)
        self.acknowledge(messages.Command(messages.MavCommand.DO_SET_MODE, (0.0,) * 7), result)

    def _go_down(self, mode: Mode, text: str) -> messages.Result:
        self.voice.send_text(messages.Severity.INFO, text)
        return self.set_mode(mode)

    def _switch(self, mode: Mode) -> None:
        if self.mode == Mode.MISSION:
            self.mission.leave()
        if self.mode == Mode.ORBIT:
            self.frame.body.face_rad = None
        self._lost_set_points &= mode == Mode.RETURN
        if mode != self.mode:
            self.frame.record_event(f"mode {mode.name}")
        self.mode = mode
        self.schedule_now("HEARTBEAT")
        if self.frame.armed and not self.frame.wrecked:
            self._enter(mode)

    def _enter(self, mode: Mode) -> None:
        pilot, body = self.frame.pilot, self.frame.body
        self.frame.climbing_out = False
        match mode:
            case Mode.MISSION:
                self.begin_mission()
                self._end_mission(self.mission.enter())
            case Mode.RETURN:
                pilot.fly(self._build_home_goals())
            case Mode.LAND:
                pilot.fly([land_goal(find_stopping_place(body, LIMITS), self.params)])
            case Mode.TAKEOFF if body.on_ground:
                pilot.fly(self.frame.take_off(self._takeoff_up_m, LIMITS.climb_m_s, self.params["MPC_TKO_SPEED"]))
            case _ if body.on_ground:
                pilot.fly([])
            case Mode.ALTCTL:
                self.drift()
            case _:
                pilot.hold()

    def _end_mission(self, end: MissionEnd | None) -> None:
        match end:
            case MissionEnd.LOITER:
                self._switch(Mode.LOITER)
                if self.mission.ended_at is not None and self.frame.armed:
                    self.frame.pilot.fly([Hover(self.mission.ended_at)])
            case MissionEnd.RETURN:
                self.voice.send_text(messages.Severity.INFO, "Returning to launch")
                self._switch(Mode.RETURN)
            case None:
                return

    def _build_home_goals(self) -> Iterator[Goal]:
        body = self.frame.body
        up_m = max(self._return_height_m(), body.up_m)
        alt_m = self.home.alt_m + up_m
        self.voice.send_text(
            messages.Severity.INFO, f"RTL: start return at {alt_m:.0f} m ({up_m:.0f} m above destination)"
        )
        speed_m_s = min(max(self.params["MPC_XY_CRUISE"], 0.1), self.params["MPC_XY_VEL_MAX"])
        to = mission_store.find_return_destination(self._store.rally, self.home, body.place)
        pad = body.place if body.on_ground else to
        linger_s = max(self.params["RTL_LAND_DELAY"], 0.0)
        land = land_goal(pad, self.params)
        yield from self.frame.go_home(up_m, speed_m_s=speed_m_s, linger_s=linger_s, land=land, to=to)

    def _return_height_m(self) -> float:
        """Return the minimum height of the return: RTL_RETURN_ALT, less inside the cone over the pad."""
        height_m, cone_deg = self.params["RTL_RETURN_ALT"], self.params["RTL_CONE_ANG"]
        away_m = math.hypot(self.frame.body.east_m, self.frame.body.north_m)
        if cone_deg <= 0:
            return height_m
        if away_m <= CONE_CLOSE_M:
            return 2 * CONE_CLOSE_M
        within_m = away_m / math.tan(math.radians(cone_deg)) if cone_deg < 90 else 0.0
        return min(height_m, max(within_m, self.params["RTL_DESCEND_ALT"]))

    def _start_mission(self, command: messages.Command) -> messages.Result:
        """Handle MISSION_START: from item param1, and it arms."""
        if not self.mission.is_valid(self.now_s):
            self.voice.send_text(messages.Severity.CRITICAL, "Mission start denied! No valid mission")
            return messages.Result.DENIED
        first = command.params[0]
        if not math.isnan(first) and 0 <= first < len(self._store.items):
            self._end_mission(self.mission.set_current(int(first)))
        was_armed = self.frame.armed
        self._arming_for_mission = True
        armed = self.arm()
        self._arming_for_mission = False
        if not armed:
            return messages.Result.TEMPORARILY_REJECTED
        if not was_armed:
            self.voice.send_text(messages.Severity.INFO, "Armed by mission start")
        if self.mode == Mode.MISSION and not self.mission.running:
            self._enter(Mode.MISSION)
            return messages.Result.ACCEPTED
        return self.set_mode(Mode.MISSION)

    def _refuse_arming(self) -> str | None:
        if not self.is_ready:
            return "Arming denied: Resolve system health failures first"
        if self.params["NAV_DLL_ACT"] > 0 and (self.gcs_heard_s is None or self._link_lost):
            return "Preflight Fail: No connection to the ground control station"
        if self._charge_state >= 3:
            return "Arming denied: Low battery"
        return None

    def arm(self) -> bool:
        """Arm; in mission mode it takes off."""
        was_armed = self.frame.armed
        armed = super().arm()
        if armed and not was_armed and self.mode in {Mode.MISSION, Mode.TAKEOFF}:
            self._enter(Mode(self.mode))
        return armed

    def _refuse_interval(self, number: int) -> messages.Result:  # noqa: ARG002 - it does not say which
        return messages.Result.FAILED

    def _refuse_disarming(self) -> messages.Result:
        self.voice.send_text(messages.Severity.CRITICAL, "Disarming denied: not landed")
        return super()._refuse_disarming()

    def _on_home_moved(self) -> None:
        if self._shapes:
            self._shapes = tuple(mission_store.build_fence_shapes(self._store.fence, self.home))

    def _on_armed(self) -> None:
        self._lost_gps = False
        if not self._arming_for_mission:
            self.voice.send_text(messages.Severity.INFO, "Armed by external command")

    def _on_disarmed(self) -> None:
        self.mission.apply_landing(self.now_s)
        self.voice.send_text(
            messages.Severity.INFO, "Disarmed by external command" if self.told_to_disarm else "Disarmed by landing"
        )
        self._failsafe = self._blind = False
        self._action_due = None
        self._switch(self._mode_after_flight)

    def _on_boot(self) -> None:
        self.mode = self._mode_after_flight = Mode.LOITER
        self._link_lost = self._failsafe = self._blind = self._emergency_ordered = self.hands = self._lost_gps = False
        self._action_due = None
        self._charge_state = 1
        self.voice.muted = False
        self.mission.apply_reboot()

    def _on_radio_status(self, txbuf_pct: int) -> None:
        streams = self.streams
        if self.now_s - streams.radio_heard_s > RADIO_FORGOTTEN_S:
            streams.radio_factor = 1.0
        factor = 0.8 if txbuf_pct < 25 else 0.975 if txbuf_pct < 35 else 1.025 if txbuf_pct > 50 else 1.0
        streams.radio_factor = min(1.0, max(LEAST_FACTOR, streams.radio_factor * factor))
        streams.radio_heard_s = self.now_s

    def _slow_down(self, streams: Streams, interval_s: float) -> float:
        heard = self.now_s - streams.radio_heard_s <= RADIO_FORGOTTEN_S
        factor = streams.radio_factor if heard else 1.0
        if math.isfinite(self.vehicle.rate_bytes_s) and streams is self.schedules[0]:
            factor = min(factor, self.vehicle.rate_bytes_s / streams.bytes_s)
        return interval_s / max(LEAST_FACTOR, factor) if factor < 1.0 else interval_s

    # The mission on board.

    def _on_mission_change(self, step: mission_store.StoreStep) -> None:
        if step.fenced:
            self._load_fence()
        if step.fenced or step.swapped:
            left = self._find_item_outside_fence()
            if left is not None:
                self.voice.send_text(messages.Severity.CRITICAL, f"Geofence violation for waypoint {left + 1}")
        if step.fenced:
            self._end_mission(self.mission.give_up() if self.mission.running and not self.mission.is_feasible else None)
        if step.swapped:
            self._end_mission(self.mission.apply_new_list(step.current, self.now_s))
        if step.cleared:
            self._end_mission(self.mission.apply_clear())

    def _set_current(self, seq: int) -> bool:
        if self._store.is_busy:
            self.voice.send_text(messages.Severity.CRITICAL, "WPM: IGN WP CURR CMD: Busy")
            return False
        if not 0 <= seq < len(self._store.items):
            self.voice.send_text(messages.Severity.CRITICAL, "WPM: WP CURR CMD: Not in list")
            return False
        self._end_mission(self.mission.set_current(seq))
        return True

    # Failsafes.

    def _decide(self) -> None:
        self._lost_gps |= self.frame.armed and self.positioning.without_s(self.now_s) > 0.0
        self._end_mission(self.mission.step(self.now_s))
        if self.mission.index != self._announced and self.mission.running:
            # A new index is reported at once; a new mission with the next second's report.
            self.schedule_now("MISSION_CURRENT")
        self._announced = self.mission.index
        self._announce_landed_state()
        self._fly_guided()
        self._watch_link()
        self._watch_battery()
        self._watch_fence()
        if self._action_due is not None and self.now_s >= self._action_due[0]:
            self._switch(self._action_due[1])
            self._action_due = None

    def _announce_landed_state(self) -> None:
        before, now = self._landed_state, self.frame.landed_state
        self._landed_state = now
        if now is before:
            return
        if before is messages.LandedState.ON_GROUND:
            self.voice.send_text(messages.Severity.INFO, "Takeoff detected")
        elif now is messages.LandedState.ON_GROUND:
            self.voice.send_text(messages.Severity.INFO, "Landing detected")
        elif now is messages.LandedState.LANDING and self.mode == Mode.RETURN:
            self.voice.send_text(messages.Severity.INFO, "RTL: land at destination")

    def _hear_station(self, sender: messages.Peer, heartbeat: messages.Heartbeat) -> bool:  # noqa: ARG002 - anybody's counts
        if heartbeat.ground_station and self._link_lost:
            self._link_lost = False
            self.voice.release_withheld()
            self.voice.send_text(messages.Severity.INFO, "GCS connection regained")
        return heartbeat.ground_station

    def _load_fence(self) -> None:
        """Drop a fence that excludes home or, in the air, the vehicle: with a text, without a refusal (measured)."""
        self._shapes = ()
        held = {"Home position": Place(0.0, 0.0, 0.0)}
        if not self.frame.body.on_ground and int(self.params["GF_ACTION"]) != 0:
            held["current vehicle position"] = self.frame.body.place
        for shape in mission_store.build_fence_shapes(self._store.fence, self.home):
            left = next((name for name, place in held.items() if not mission_store.is_inside([shape], place)), None)
            if left is None:
                self._shapes = (*self._shapes, shape)
            else:
                self.voice.send_text(messages.Severity.CRITICAL, f"Geofence invalid, doesn't contain {left}")

    def _find_item_outside_fence(self) -> int | None:
        if int(self.params["GF_ACTION"]) == 0:
            return None
        here = self.frame.body.place
        for item in self._store.items:
            if mission_store.has_place(item) and self._describe_breach(mission_store.place_of(item, self.home, here)):
                return item.seq
        return None

    def _describe_breach(self, place: Place) -> str:
        """Return PX4's text for a place outside its fence; empty inside."""
        most_m, far_m = self.params["GF_MAX_VER_DIST"], self.params["GF_MAX_HOR_DIST"]
        if far_m > 0 and math.hypot(place.east_m, place.north_m) >= far_m:
            return "Geofence: exceeding maximum distance to Home"
        if most_m > 0 and place.up_m >= most_m:
            return "Geofence: exceeding maximum altitude above Home"
        return "" if mission_store.is_inside(self._shapes, place) else "Geofence: approaching or outside geofence"

    def _watch_fence(self) -> None:
        """Act once at a breach: it holds first, as for any failsafe (measured)."""
        action = int(self.params["GF_ACTION"])
        if action == 0 or not self.frame.armed or self.frame.body.on_ground:
            self._outside = False
            return
        was_outside, said = self._outside, self._describe_breach(self.frame.body.place)
        self._outside = bool(said)
        if was_outside or not said:
            return
        self.frame.record_event("failsafe fence")
        self.voice.send_text(messages.Severity.CRITICAL, said)
        if action == 2:
            self._failsafe = True
            self.voice.send_text(messages.Severity.CRITICAL, "Failsafe activated")
            self._switch(Mode.LOITER)
        elif action in {3, 5}:
            self._hold_then(Mode.RETURN if action == 3 else Mode.LAND)

    def _watch_link(self) -> None:
        """Detect ground station link loss; its action stays in effect when the link returns."""
        silence_s = self.gcs_silence_s
        if self._link_lost or silence_s is None or silence_s < self.params["COM_DL_LOSS_T"] + LOSS_MARGIN_S:
            return
        self._link_lost = True
        self.voice.muted = True
        action = int(self.params["NAV_DLL_ACT"])
        if not self.frame.armed or self.frame.body.on_ground or action == 0 or self.mode in {Mode.RETURN, Mode.LAND}:
            return
        self.frame.record_event("failsafe link")
        self._hold_then({2: Mode.RETURN, 3: Mode.LAND}.get(action))

    def _hold_then(self, mode: Mode | None) -> None:
        self._failsafe = True
        delay_s = self.params["COM_FAIL_ACT_T"]
        self.voice.send_text(messages.Severity.WARNING, f"Failsafe activated: entering Hold for {delay_s:.0f} seconds")
        self._switch(Mode.LOITER)
        self._action_due = None if mode is None else (self.now_s + self.params["COM_FAIL_ACT_T"], mode)

    def _watch_battery(self) -> None:
        """Escalate through the thresholds; COM_LOW_BAT_ACT 3 returns at critical and lands at emergency."""
        share = self.frame.battery.charge_pct / 100
        thresholds = (self.params["BAT_LOW_THR"], self.params["BAT_CRIT_THR"], self.params["BAT_EMERGEN_THR"])
        state = 1 + sum(share < threshold for threshold in thresholds)
        if state <= self._charge_state:
            return
        self._charge_state = state
        text = {2: "Low battery", 3: "Critical battery", 4: "Emergency battery level"}[state]
        self.voice.send_text(messages.Severity.CRITICAL if state > 2 else messages.Severity.WARNING, text)
        if not self.frame.armed or self.frame.body.on_ground:
            return
        action = int(self.params["COM_LOW_BAT_ACT"])
        if state == 4 and (action in {2, 3} or self._emergency_ordered):
            self.frame.record_event("failsafe battery")
            # It holds before it acts, unless a failsafe already acts; a landing continues.
            if self._failsafe:
                self._action_due = None
                self._switch(self._emergency)
            elif self.mode not in {Mode.LAND, self._emergency}:
                self._hold_then(self._emergency)
        elif state == 3 and action in {2, 3} and self.mode not in {Mode.RETURN, Mode.LAND}:
            self.frame.record_event("failsafe battery")
            self._hold_then(Mode.RETURN if action == 3 else Mode.LAND)

    # Pilots, fences, estimators.

    def _on_stick_input(self) -> None:
        if self.frame.armed and not self.frame.wrecked and self.mode >> 16 & 255 == MAIN_AUTO:
            self.voice.send_text(messages.Severity.INFO, "Pilot took over using sticks")
            self.apply_pilot_takeover("POSCTL")

    def _on_breach(self) -> None:
        self.voice.send_text(messages.Severity.WARNING, "Geofence violation")
        if not self.frame.armed:
            return  # a failsafe acts only in flight
        self._failsafe = True
        self.voice.send_text(messages.Severity.CRITICAL, "Failsafe activated: switching to Return")
        self._switch(Mode.RETURN)

    def _on_emergency(self, mode: int) -> None:
        self._emergency, self._emergency_ordered = Mode(mode), True
        self.frame.battery.charge_pct = min(self.frame.battery.charge_pct, EMERGENCY_PCT)

    def _on_lost_estimate(self) -> None:
        self._failsafe = self._blind = True
        text = "Failsafe activated: Autopilot disengaged, switching to Descend"
        self.voice.send_text(messages.Severity.CRITICAL, text)
        self._action_due = None
        self._switch(Mode.LAND)

    # Reports.

    def _current_ca(self) -> int:
        return round(self.frame.battery.current_a * 100) if self.vehicle.current_sensor else UNKNOWN_CURRENT_CA

    def _build_own(self, name: str) -> messages.Outbound | None:
        battery = self.frame.battery
        match name:
            case "HEARTBEAT":
                return messages.build_message(
                    "HEARTBEAT", type=2, autopilot=MAV_AUTOPILOT_PX4, base_mode=157 if self.frame.armed else 29,
                    custom_mode=int(self.mode), system_status=self._determine_system_status(), mavlink_version=3,
                )  # fmt: skip
            case "SYS_STATUS":
                return build_sys_status(
                    self._build_sensor_masks(), voltage_v=battery.voltage_v, current_ca=self._current_ca(),
                    remaining_pct=math.ceil(battery.charge_pct - 1e-9),
                )  # fmt: skip
            case "BATTERY_STATUS":
                consumed = (100 - battery.charge_pct) / 100 * battery.capacity_mah
                # A lithium polymer pack for all functions.
                return messages.build_message(
                    "BATTERY_STATUS", **name_cells(battery.voltage_v), type=1, battery_function=1,
                    current_battery=self._current_ca(), energy_consumed=-1,
                    current_consumed=round(consumed) if self.vehicle.current_sensor else -1,
                    battery_remaining=round(battery.charge_pct), charge_state=self._charge_state,
                )  # fmt: skip
            case "MISSION_CURRENT":
                return messages.build_message(
                    "MISSION_CURRENT", seq=self.mission.index, total=len(self._store.items) or EMPTY_TOTAL,
                    mission_state=int(self.mission.report_state(self.now_s, active=self.mode in MISSION_MODES)),
                    mission_mode=1 if self.mode in MISSION_MODES else 2,
                    mission_id=self._store.lists.mission_id,
                )  # fmt: skip
            case "ESTIMATOR_STATUS":
                # After a flight in which GPS was lost it still dead-reckons on the ground.
                reckons = self._lost_gps and not self.frame.armed
                flags = ALONE if reckons else self.positioning.flags(self.now_s)
                return messages.build_message(
                    "ESTIMATOR_STATUS", time_usec=self.boot_ms * 1000, vel_ratio=0.05, pos_horiz_ratio=0.05,
                    pos_vert_ratio=0.05, mag_ratio=0.05, hagl_ratio=0.0, tas_ratio=0.0, pos_horiz_accuracy=0.5,
                    pos_vert_accuracy=0.5, flags=flags if self.is_ready else 0,
                )  # fmt: skip
            case "ORBIT_EXECUTION_STATUS":
                return self._build_circle_report()
            case "WIND_COV":
                east, north = self.vehicle.wind_m_s
                return messages.build_message(
                    "WIND_COV", time_usec=self.boot_ms * 1000, wind_x=north, wind_y=east, wind_z=0.0, var_horiz=0.3,
                    var_vert=0.0, wind_alt=self.home.alt_m + self.frame.body.up_m, horiz_accuracy=0.5,
                    vert_accuracy=0.0,
                )  # fmt: skip
            case _:
                return None

    def _build_sensor_masks(self) -> tuple[int, int, int]:
        if not self.is_ready:
            return SENSORS_BOOT
        present, enabled, healthy = SENSORS
        healthy = healthy & ~GPS_BIT if self.positioning.without_s(self.now_s) else healthy
        armable = self.frame.armed or self._refuse_arming() is None
        return present, enabled, healthy if armable else healthy & ~PREARM_BIT

    def _determine_system_status(self) -> int:
        if not self.is_ready:
            return 0
        if self._blind:
            return 6
        if self._failsafe:
            return 5
        return 4 if self.frame.armed else 3
