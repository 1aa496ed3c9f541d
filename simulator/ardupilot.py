"""ArduPilot Copter 4.7-dev as measured: modes, arming, failsafes, reports."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import ClassVar

from missions.items import Command as ItemCommand
from missions.items import Frame, MissionItem
from simulator import messages, mission_file, mission_store
from simulator.airframe import AirframeSettings
from simulator.autopilot import Autopilot, Handler
from simulator.config import SimVehicle
from simulator.files import ArduPilotFileServer, FileServer, FileTree, VirtualFile
from simulator.guidance import ThrottleDescent, find_stopping_place
from simulator.mission_ardupilot import ArduPilotMission, build_home_goals, land_goal
from simulator.params import PACKED_PARAMETERS
from simulator.physics import GPS_BIT, Home, Limits, Place, Vector, Velocity
from simulator.store_ardupilot import ArduPilotStore
from simulator.streams import MESSAGE_IDS, Streams
from simulator.telemetry import build_sys_status, name_cells

MAV_AUTOPILOT_ARDUPILOT = 3
LIMITS = Limits(accelerate_m_s2=1.5, brake_m_s2=2.0, climb_m_s=2.5, descend_m_s=2.5, vertical_m_s2=1.0, corner_m_s2=2.5)
"""Recorded: 0 to 4.3 m/s in 3 s; a right angle at 3.4 m/s; 2.49 m/s up; LOITER without a stick sinks at 2.5 m/s."""
MANNERS = AirframeSettings(LIMITS, spool_s=3.0, disarm_landed_s=2.2)
SINK_M_S = 2.5
SILENT_BATTERY_S = 2.0
"""Time after boot in which SYS_STATUS reports 0 V, -1, -1: no fault."""
SENSORS_BOOT = (0x5371FC0F, 0x52419C0F, 0x47519C0F)
SENSORS_IDLE = (0x5371FC2F, 0x53619C2F, 0x57719C2F)
SENSORS_ARMED = (0x5371FC2F, 0x5361FC2F, 0x5771FC2F)
"""From the recorded flights: (present, enabled, healthy)."""
BATTERY_BIT = 0x02000000
FENCE_BIT = 0x00100000
POLYGON_BIT = 4
"""Of FENCE_TYPE."""
BANNER = ("ArduCopter V4.7.0-dev (00000000)", "Frame: QUAD/X")
EVERY_FENCE = 0xFF
GIVES_UP_M = 100.0
"""AC_FENCE_GIVE_UP_DISTANCE."""
EKF_BOOT = 1024
"""Flags of EKF_STATUS_REPORT: 'uninitialised'."""
LOW, CRITICAL = 1, 2
MOST_SLOW_S = 2.0
"""Maximum delay that a full radio adds to every stream's interval."""
EMERGENCY_PCT = 8.0
"""Charge left by the emergency fault: enough to land."""
DEV = 0
"""FIRMWARE_VERSION_TYPE."""


class Mode(IntEnum):
    """custom_mode, as far as simulated."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    POSHOLD = 16
    BRAKE = 17


TAKEOFFS = (messages.MavCommand.NAV_TAKEOFF, messages.MavCommand.NAV_VTOL_TAKEOFF)
LANDINGS = (messages.MavCommand.NAV_LAND, messages.MavCommand.NAV_VTOL_LAND)
STICK_MODES = frozenset({Mode.STABILIZE, Mode.ALT_HOLD, Mode.LOITER, Mode.POSHOLD})
"""Modes that sink in the air without a remote control, as the throttle is low."""
ARMABLE = frozenset({*STICK_MODES, Mode.GUIDED})
FS_LAND, FS_RTL = 1, frozenset({2, 3, 4})
"""BATT_FS_*_ACT; SmartRTL has no path to follow here and acts as RTL."""


class ArduPilot(Autopilot):
    """One vehicle."""

    mission: ArduPilotMission
    store: ArduPilotStore
    STREAMS_S: ClassVar = {"HEARTBEAT": 1.0, "TIMESYNC": 10.0}
    REFUSED: ClassVar = messages.Result.FAILED
    INVALID: ClassVar = messages.Result.FAILED
    ACKNOWLEDGES_FIRST: ClassVar = True
    ACKNOWLEDGES_EVERYWHERE: ClassVar = False
    ON_ITS_BACK: ClassVar = "Arm: Leaning"
    KILLED: ClassVar = "Arm: Motors Emergency Stopped"
    KILL_SAYS: ClassVar = "RC: Motors Emergency Stopped"
    WORDS: ClassVar = Mode.__members__
    FIX: ClassVar = 6
    CAPABILITIES: ClassVar = sum(1 << bit for bit in (0, 1, 2, 3, 5, 7, 8, 13, 14, 15))
    """Missions in float and int, parameters as floats, COMMAND_INT, MAVFTP, both kinds of set-points, MAVLink 2, fence,
    rally points."""
    UNKNOWN: ClassVar = frozenset({"ALTITUDE", "ODOMETRY", "ACTUATOR_OUTPUT_STATUS", "HIL_STATE_QUATERNION"})
    VERSION: ClassVar = (4, 7, 0, DEV)

    def __init__(self, vehicle: SimVehicle) -> None:
        home = Home(vehicle.home_lat_deg, vehicle.home_lon_deg, vehicle.home_alt_m)
        store = ArduPilotStore(_build_home_item(home), vehicle.transfer_patience_s)
        super().__init__(vehicle, MANNERS, (store,), home)
        self.mode = Mode.STABILIZE
        self.mission = ArduPilotMission(self.frame, store, home, self.params, self.voice, self.execute_payload_command)
        self._gcs_failsafe = self._ekf_failsafe = False
        self._breached, self._breaches = False, 0
        self._shapes: tuple[mission_store.FenceShape, ...] = ()
        self._outside = False
        """Whether its position is outside its fence; a breach may also be injected."""
        self._fences_on = self._fences_off = 0
        self._drifts = False
        """Whether it flies a requested velocity in GUIDED."""
        self._battery_level = 0
        self._low_since_s: dict[int, float] = {}
        self._gauge_offset_pct = 0.0
        """Offset of the coulomb counter, which starts at 100 % with every boot."""

    def _own_commands(self) -> dict[int, Handler]:
        return {
            messages.MavCommand.DO_SET_MODE: lambda command: (
                self.set_mode(command.integer_param(1)) if command.integer_param(0) & 1 else messages.Result.DENIED
            ),
            messages.MavCommand.REQUEST_AUTOPILOT_CAPABILITIES: lambda command: (
                self._send_named(MESSAGE_IDS["AUTOPILOT_VERSION"]) if command.params[0] == 1 else self.INVALID
            ),
            messages.MavCommand.MISSION_START: self._start_mission,
            messages.MavCommand.DO_SET_MISSION_CURRENT: lambda command: (
                messages.Result.ACCEPTED if self.select_item(command.integer_param(0)) else messages.Result.DENIED
            ),
            messages.MavCommand.DO_PAUSE_CONTINUE: self._pause_continue,
            messages.MavCommand.NAV_RETURN_TO_LAUNCH: lambda _: self.set_mode(Mode.RTL),
            **dict.fromkeys(LANDINGS, lambda _: self.set_mode(Mode.LAND)),
            **dict.fromkeys(TAKEOFFS, self._take_off),
            messages.MavCommand.NAV_LOITER_UNLIM: lambda _: self.set_mode(Mode.LOITER),
            messages.MavCommand.DO_REPOSITION: self._reposition,
            messages.MavCommand.CONDITION_YAW: self._turn,
            messages.MavCommand.DO_FENCE_ENABLE: self._enable_fence,
            messages.MavCommand.DO_SEND_BANNER: self._say_banner,
        }

    def _say_banner(self, _: messages.Command) -> messages.Result:
        for text in BANNER:
            self.voice.send_text(messages.Severity.INFO, text)
        return messages.Result.ACCEPTED

    def _make_file_servers(self, tree: FileTree) -> Sequence[FileServer]:
        self._file_server = ArduPilotFileServer(
            tree, self._find_virtual_file, lambda text: self.voice.send_text(messages.Severity.DEBUG, text)
        )
        return [self._file_server]

    def _find_virtual_file(self, path: str) -> VirtualFile | None:
        """Return a file that represents the parameters or a list on board."""
        name, _, query = path.partition("?")
        if name == PACKED_PARAMETERS:
            with_defaults = "withdefaults=1" in query
            return VirtualFile(
                self.params.packed_bytes, lambda most: self.params.pack(most, with_defaults=with_defaults)
            )
        if name not in mission_file.NAMES:
            return None
        kind = mission_file.NAMES.index(name)
        items = (self.store.items, self.store.fence, self.store.rally)[kind]
        takes = kind == 0 and self.store.fault is mission_store.UploadFault.NONE
        return VirtualFile(
            mission_file.FILE_BYTES,
            lambda _: mission_file.build_file(kind, items),
            self._put_mission if takes else None,
        )

    def _put_mission(self, data: bytes) -> None:
        part = mission_file.read_part(data)
        if part is not None:
            step = self.store.put_file_part(part, locked=self._is_mission_locked())
            self._apply_store_step(step, self._file_server.link)

    # Modes.

    def set_mode(self, mode: int) -> messages.Result:
        """Change the mode; setting the current mode again has no effect."""
        if mode not in set(Mode):
            self.voice.send_text(messages.Severity.WARNING, f"No such mode {mode}")
            return messages.Result.FAILED
        if mode == self.mode:
            return messages.Result.ACCEPTED
        if mode == Mode.AUTO and not self._may_enter_auto():
            return messages.Result.FAILED
        if self.mode == Mode.AUTO:
            self.mission.leave()
        self.mode = Mode(mode)
        self.frame.record_event(f"mode {Mode(mode).name}")
        self.schedule_now("HEARTBEAT")
        if self.frame.wrecked:
            if mode == Mode.LAND:
                self.frame.disarm()
        elif self.frame.armed:
            self._enter(Mode(mode))
        return messages.Result.ACCEPTED

    def build_mode_order(self, word: str) -> messages.Command:
        """Return the command with which a ground station sets a mode."""
        return messages.Command(messages.MavCommand.DO_SET_MODE, (1.0, float(Mode[word]), 0.0, 0.0, 0.0, 0.0, 0.0))

    def _may_enter_auto(self) -> bool:
        if not self.frame.armed:
            return True
        if self.mission.state == messages.MissionState.NO_MISSION:
            return False
        if self.frame.body.on_ground and not self.mission.is_takeoff_next():
            self.voice.send_text(messages.Severity.CRITICAL, "Auto: Missing Takeoff Cmd")
            return False
        return True

    def _enter(self, mode: Mode) -> None:
        pilot = self.frame.pilot
        self.frame.climbing_out = self._drifts = False
        match mode:
            case Mode.AUTO:
                self.begin_mission()
                self.mission.enter()
            case Mode.RTL:
                far_m = 1000.0 * self.params["RALLY_LIMIT_KM"] or math.inf
                to = mission_store.find_return_destination(self.store.rally, self.home, self.frame.body.place, far_m)
                pilot.fly(build_home_goals(self.frame, self.params, to))
            case Mode.LAND:
                pilot.fly([land_goal(find_stopping_place(self.frame.body, LIMITS), self.params)])
            case Mode.GUIDED | Mode.BRAKE:
                pilot.hold()
            case Mode.LOITER | Mode.POSHOLD if self.hands:
                pilot.hold()
            case _ if self.hands:
                self.drift()
            case _:
                pilot.fly([ThrottleDescent(find_stopping_place(self.frame.body, LIMITS), SINK_M_S)])

    def _start_mission(self, command: messages.Command) -> messages.Result:
        """Handle MISSION_START: AUTO, and the mission from its present item; it does not arm."""
        if command.params[0] or command.params[1]:
            return messages.Result.DENIED
        if self.mode == Mode.AUTO and self.frame.armed and not self.mission.is_running:
            if not self._may_enter_auto():
                return messages.Result.FAILED
            self._enter(Mode.AUTO)
            return messages.Result.ACCEPTED
        return self.set_mode(Mode.AUTO)

    def _pause_continue(self, command: messages.Command) -> messages.Result:
        if command.params[0] == 0:
            if self.mode == Mode.AUTO and self.frame.armed and self.mission.pause():
                return messages.Result.ACCEPTED
            self.voice.send_text(messages.Severity.INFO, "Failed to pause")
            return messages.Result.FAILED
        if self.mode != Mode.AUTO:
            self.voice.send_text(messages.Severity.INFO, "Failed to resume")
            return messages.Result.FAILED
        self.mission.resume()
        return messages.Result.ACCEPTED

    def _take_off(self, command: messages.Command) -> messages.Result:
        if self.mode != Mode.GUIDED or not self.frame.armed or not self.frame.body.on_ground:
            return messages.Result.FAILED
        self.frame.pilot.fly(self.frame.take_off(command.params[6], LIMITS.climb_m_s))
        return messages.Result.ACCEPTED

    def _reposition(self, command: messages.Command) -> messages.Result:
        """Fly to a place in GUIDED; without a frame the command is unsupported."""
        if command.frame is None:
            return messages.Result.UNSUPPORTED
        where = command.place_e7
        place = None if where in {None, (0, 0)} else self.guided.locate(where, command.params[6], command.frame)
        if place is None or (self.mode != Mode.GUIDED and not command.integer_param(1) & 1):
            return messages.Result.DENIED
        if self._find_breaches(place) or self.set_mode(Mode.GUIDED) is not messages.Result.ACCEPTED:
            return messages.Result.FAILED
        self._drifts = False
        self.guided.go(place, self.mission.speed_m_s)
        return messages.Result.ACCEPTED

    def _follow_set_point(self, point: messages.SetPoint) -> None:
        """Fly to a place, or at a velocity while set-points arrive; an empty set-point stops it."""
        if self.mode != Mode.GUIDED or not self.guided.may_move:
            return
        said = self.guided.note(point, self.now_s)
        self._drifts = isinstance(self.guided.last, Velocity)
        if not said or (isinstance(self.guided.last, Vector) and self._find_breaches(self.guided.last)):
            self.frame.pilot.hold()
        else:
            self.guided.follow(self.mission.speed_m_s)

    def _turn(self, command: messages.Command) -> messages.Result:
        """Turn the nose: to a bearing, or by an angle."""
        angle_deg, direction, relative = command.params[0], command.params[2], command.params[3]
        if not 0.0 <= angle_deg <= 360.0 or relative not in {0.0, 1.0}:
            return messages.Result.FAILED
        start_rad = self.frame.body.yaw_rad if relative else 0.0
        turned = -angle_deg if relative and direction < 0 else angle_deg
        self.frame.body.face_rad = math.remainder(start_rad + math.radians(turned), 2 * math.pi)
        return messages.Result.ACCEPTED

    def _refuse_arming(self) -> str | None:
        if not self.is_ready:
            return "Arm: Need Position Estimate"
        if self.mode not in ARMABLE:
            return "Arm: Mode not armable"
        if self._battery_level:
            return "PreArm: Battery failsafe"
        return None

    def _set_mode_message(self, message: messages.SetMode) -> None:
        self.set_mode(message.custom_mode & 0xFF)

    def _refuse_interval(self, number: int) -> messages.Result:
        self.voice.send_text(messages.Severity.WARNING, f"No ap_message for mavlink id ({number})")
        return messages.Result.DENIED

    def _on_home_moved(self) -> None:
        self.store.set_home(_build_home_item(self.home))
        self._shapes = mission_store.build_fence_shapes(self.store.fence, self.home)

    def _on_armed(self) -> None:
        self.voice.send_text(messages.Severity.INFO, "Arming motors")

    def _on_disarmed(self) -> None:
        self.voice.send_text(messages.Severity.INFO, "Disarming motors")
        self._breached = self._outside = False
        self.mission.apply_disarm()

    def _on_breach(self) -> None:
        self._breached, self._breaches = True, self._breaches + 1
        self.voice.send_text(messages.Severity.NOTICE, "Circle fence breached")
        self.schedule_now("FENCE_STATUS")
        self.set_mode(Mode.RTL)

    def _on_emergency(self, mode: int) -> None:
        self.frame.battery.charge_pct = min(self.frame.battery.charge_pct, EMERGENCY_PCT)
        self._raise_battery(CRITICAL, FS_LAND if mode == Mode.LAND else min(FS_RTL))

    def _on_lost_estimate(self) -> None:
        self._ekf_failsafe = True
        self.voice.send_text(messages.Severity.CRITICAL, "EKF variance: over thresholds")
        self.voice.send_text(messages.Severity.CRITICAL, "EKF Failsafe: changed to Land Mode")
        self.set_mode(Mode.LAND)

    def _on_boot(self) -> None:
        self.mode = Mode.STABILIZE
        self.hands = self._breached = False
        self._fences_on = self._fences_off = 0
        self._gcs_failsafe = self._ekf_failsafe = False
        self.store.slow_s = 0.0
        self._battery_level = 0
        self._low_since_s.clear()
        self._gauge_offset_pct = 100.0 - self.frame.battery.charge_pct
        self.mission.apply_reboot()

    # The mission on board.

    def _on_radio_status(self, txbuf_pct: int) -> None:
        if txbuf_pct < 20:
            change_s = 0.06
        elif txbuf_pct < 50:
            change_s = 0.02
        else:
            change_s = -0.04 if txbuf_pct > 95 else -0.02 if txbuf_pct > 90 else 0.0
        streams = self.streams
        streams.radio_slow_s = self.store.slow_s = min(MOST_SLOW_S, max(0.0, streams.radio_slow_s + change_s))

    def _slow_down(self, streams: Streams, interval_s: float) -> float:
        receives = self.store.is_receiving and streams is self.schedules[self.store.upload_link]
        receives = receives or self._file_server.is_active(self.now_s)
        return (interval_s + streams.radio_slow_s) * (4.0 if receives else 1.0)

    def _is_mission_locked(self) -> bool:
        return self.frame.armed and self.mode == Mode.AUTO

    def _on_mission_change(self, step: mission_store.StoreStep) -> None:
        if step.fenced:
            self._shapes = mission_store.build_fence_shapes(self.store.fence, self.home)
        if step.truncated:
            self.mission.apply_truncation()
        if step.stored:
            self.mission.apply_stored_item()
        if step.cleared and not self._is_mission_locked():
            self.mission.apply_clear()

    def _set_current(self, seq: int) -> bool:
        return self.mission.set_current(seq)

    # Failsafes.

    def _decide(self) -> None:
        self.mission.step()
        if self._drifts and self.now_s - self.guided.heard_s > self.params["GUID_TIMEOUT"]:
            self._drifts = False
            self.frame.pilot.hold()
        if self.frame.armed:
            self._watch_gcs()
            self._watch_battery()
            self._watch_fence()

    def _hear_station(self, sender: messages.Peer, heartbeat: messages.Heartbeat) -> bool:  # noqa: ARG002 - only the id counts
        counts = sender.sysid == self.params["MAV_GCS_SYSID"]
        if counts and self._gcs_failsafe:
            # It stays in the mode that the failsafe chose.
            self._gcs_failsafe = False
            self.voice.send_text(messages.Severity.WARNING, "GCS Failsafe Cleared")
        return counts

    def _watch_fence(self) -> None:
        """Act once at a breach; more than 100 m outside it lands, whatever action is set."""
        if not self._fences or self.frame.body.on_ground:
            return
        place, was_outside = self.frame.body.place, self._outside
        found = self._find_breaches(place)
        self._outside = bool(found)
        if was_outside and not found:
            self._breached = False
            self.voice.send_text(messages.Severity.NOTICE, "Fence breach cleared")
        if was_outside or not found:
            return
        self.frame.record_event("failsafe fence")
        self._breached, self._breaches = True, self._breaches + 1
        self.voice.send_text(messages.Severity.NOTICE, f"{' and '.join(found)} fence breached")
        self.schedule_now("FENCE_STATUS")
        self.schedule_now("SYS_STATUS")
        action = int(self.params["FENCE_ACTION"])
        if action == 0:
            return
        self.voice.send_text(messages.Severity.INFO, "Manual recovery started")
        far = mission_store.distance_outside_m(self._shapes, place) > GIVES_UP_M
        self.set_mode(Mode.LAND if far or action == 2 else Mode.BRAKE if action == 4 else Mode.RTL)

    @property
    def _fences(self) -> int:
        """Enabled fence kinds, as bits of FENCE_TYPE: by parameter, or by command until it restarts."""
        on = -1 if self.params["FENCE_ENABLE"] else 0
        return (on | self._fences_on) & ~self._fences_off & int(self.params["FENCE_TYPE"])

    def _enable_fence(self, command: messages.Command) -> messages.Result:
        order, kinds = command.integer_param(0), command.integer_param(1) or EVERY_FENCE
        if order not in {0, 1}:
            return messages.Result.ACCEPTED if order == 2 else messages.Result.FAILED  # 2 is for minimum heights only
        if order and not int(self.params["FENCE_TYPE"]) & kinds & (-1 if self._shapes else ~POLYGON_BIT):
            return messages.Result.FAILED
        self._fences_on = self._fences_on | kinds if order else self._fences_on & ~kinds
        self._fences_off = self._fences_off & ~kinds if order else self._fences_off | kinds
        return messages.Result.ACCEPTED

    def _find_breaches(self, place: Place) -> list[str]:
        return [
            name
            for bit, name, out in (
                (1, "Max Alt", place.up_m > self.params["FENCE_ALT_MAX"]),
                (2, "Circle", math.hypot(place.east_m, place.north_m) > self.params["FENCE_RADIUS"]),
                (POLYGON_BIT, "Polygon", not mission_store.is_inside(self._shapes, place)),
            )
            if self._fences & bit and out
        ]

    def _watch_gcs(self) -> None:
        action, silence_s = int(self.params["FS_GCS_ENABLE"]), self.gcs_silence_s
        if self._gcs_failsafe or action == 0 or silence_s is None or silence_s < self.params["FS_GCS_TIMEOUT"]:
            return
        if int(self.params["FS_OPTIONS"]) & 2 and self.mode == Mode.AUTO:
            return
        self._gcs_failsafe = True
        self.frame.record_event("failsafe link")
        self.voice.send_text(messages.Severity.WARNING, "GCS Failsafe")
        if self.frame.body.on_ground:
            self.frame.disarm()
        elif self.mode not in {Mode.RTL, Mode.LAND}:
            self.set_mode(Mode.LAND if action == 5 else Mode.RTL)

    def _watch_battery(self) -> None:
        """Raise the battery failsafe, and never lower it: low voltage must persist, low charge acts at once."""
        for level, prefix in ((LOW, "LOW"), (CRITICAL, "CRT")):
            if self._battery_level >= level:
                continue
            low_v = self.frame.battery.voltage_v < self.params[f"BATT_{prefix}_VOLT"]
            since_s = self._low_since_s.setdefault(level, self.now_s) if low_v else self.now_s
            if not low_v:
                self._low_since_s.pop(level, None)
            left_mah = self.params["BATT_CAPACITY"] - self._consumption_mah()
            if self.now_s - since_s >= self.params["BATT_LOW_TIMER"] or left_mah < self.params[f"BATT_{prefix}_MAH"]:
                self._raise_battery(level, int(self.params[f"BATT_FS_{prefix}_ACT"]))

    def _raise_battery(self, level: int, action: int) -> None:
        self._battery_level = level
        self.frame.record_event("failsafe battery" if action else "low battery")
        word = "low" if level == LOW else "critical"
        volts, used = self.frame.battery.voltage_v, self._consumption_mah()
        self.voice.send_text(messages.Severity.WARNING, f"Battery 1 is {word} {volts:.2f}V used {used:.0f} mAh")
        self.voice.send_text(messages.Severity.WARNING, "Battery Failsafe")
        if self.frame.body.on_ground:
            self.frame.disarm()
        elif action == FS_LAND:
            self.set_mode(Mode.LAND)
        elif action in FS_RTL and self.mode != Mode.LAND:
            self.set_mode(Mode.RTL)

    # Reports.

    def _consumption_mah(self) -> float:
        battery = self.frame.battery
        return (100.0 - min(battery.charge_pct + self._gauge_offset_pct, 100.0)) / 100 * battery.capacity_mah

    def _remaining_pct(self) -> int:
        """Return the reported percentage: remaining charge over configured capacity, truncated."""
        capacity_mah = self.params["BATT_CAPACITY"]
        if self.params["BATT_MONITOR"] != 4 or capacity_mah <= 10:
            return -1
        return max(0, min(100, int(100 * (capacity_mah - self._consumption_mah()) / capacity_mah + 1e-6)))

    def _determine_system_status(self) -> int:
        if self.now_s - self.boot_s < SILENT_BATTERY_S:
            return 1
        if self._gcs_failsafe or self._battery_level or self._ekf_failsafe:
            return 5
        return 4 if self.frame.armed and not self.frame.body.on_ground else 3

    def _build_sensor_masks(self) -> tuple[int, int, int]:
        if not self.is_ready:
            return SENSORS_BOOT
        present, enabled, healthy = SENSORS_ARMED if self.frame.armed else SENSORS_IDLE
        if self._fences:
            enabled |= FENCE_BIT
            healthy = healthy & ~FENCE_BIT if self._outside else healthy | FENCE_BIT
        healthy = healthy & ~GPS_BIT if self.positioning.without_s(self.now_s) else healthy
        return present, enabled, healthy & ~BATTERY_BIT if self._battery_level else healthy

    def _build_own(self, name: str) -> messages.Outbound | None:
        battery = self.frame.battery
        current = round(battery.current_a * 100) if self.params["BATT_MONITOR"] == 4 else -1
        booting = self.now_s - self.boot_s < SILENT_BATTERY_S
        match name:
            case "HEARTBEAT":
                base = (
                    1 | 16 | 64 | (8 if self.mode in {Mode.AUTO, Mode.GUIDED, Mode.RTL, Mode.LAND, Mode.BRAKE} else 0)
                )
                return messages.build_message(
                    "HEARTBEAT", type=2, autopilot=MAV_AUTOPILOT_ARDUPILOT,
                    base_mode=base | (128 if self.frame.armed else 0),
                    custom_mode=int(self.mode), system_status=self._determine_system_status(), mavlink_version=3,
                )  # fmt: skip
            case "SYS_STATUS":
                return build_sys_status(
                    self._build_sensor_masks(), voltage_v=0.0 if booting else battery.voltage_v,
                    current_ca=-1 if booting else current, remaining_pct=-1 if booting else self._remaining_pct(),
                )  # fmt: skip
            case "BATTERY_STATUS":
                consumed = self._consumption_mah()
                known = current >= 0
                return messages.build_message(
                    "BATTERY_STATUS", **name_cells(battery.voltage_v), type=0, battery_function=0,
                    current_battery=current, current_consumed=round(consumed) if known else -1,
                    energy_consumed=round(consumed * battery.rest_v * 0.036) if known else -1,
                    battery_remaining=self._remaining_pct(), charge_state=1 + self._battery_level,
                )  # fmt: skip
            case "EKF_STATUS_REPORT":
                # The variances of a good estimate.
                return messages.build_message(
                    "EKF_STATUS_REPORT", flags=self.positioning.flags(self.now_s) if self.is_ready else EKF_BOOT,
                    velocity_variance=0.005, pos_horiz_variance=0.005, pos_vert_variance=0.001, compass_variance=0.01,
                    terrain_alt_variance=0.0,
                )  # fmt: skip
            case "MISSION_CURRENT":
                # The count excludes home, so it is the last item's number.
                return messages.build_message(
                    "MISSION_CURRENT", seq=self.mission.index, total=max(len(self.store.items) - 1, 0),
                    mission_state=int(self.mission.state), mission_mode=int(self.mode == Mode.AUTO), mission_id=0,
                )  # fmt: skip
            case "WIND":
                # Direction from which the wind comes: its degrees go from -180 to 180.
                east, north = self.vehicle.wind_m_s
                from_deg = math.degrees(math.atan2(-east, -north))
                return messages.build_message("WIND", direction=from_deg, speed=math.hypot(east, north), speed_z=0.0)
            case "FENCE_STATUS":
                return messages.build_message(
                    "FENCE_STATUS", breach_status=int(self._breached), breach_count=self._breaches,
                    breach_type=3 if self._breached else 0, breach_time=self.boot_ms, breach_mitigation=0,
                )  # fmt: skip
            case _:
                return None


def _build_home_item(home: Home) -> MissionItem:
    lat, lon = home.lat_lon_e7(0.0, 0.0)
    return MissionItem(0, Frame.GLOBAL, ItemCommand.NAV_WAYPOINT, x=lat, y=lon, z=home.alt_m)
