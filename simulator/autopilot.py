"""Code that ArduPilot and PX4 share: time, scheduled telemetry, message dispatch.

A vehicle advances in fixed steps of its own time, and all its behaviour follows that time. It uses no socket, no wall
clock and no randomness: ``advance`` and ``receive`` take input, ``voice.drain()`` and ``frame.drain_events()`` return
output.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from simulator import messages, telemetry
from simulator.airframe import Airframe, AirframeSettings
from simulator.camera import Payload
from simulator.config import AutopilotKind, SimVehicle
from simulator.fault_kinds import PAYLOAD_FAULTS, InjectionKind
from simulator.files import FileServer, FileTree
from simulator.guidance import Hover, Leg, find_stopping_place
from simulator.guided import GuidedFlight
from simulator.messages import VehicleOutbox
from simulator.mission_ardupilot import ArduPilotMission
from simulator.mission_px4 import Px4Mission
from simulator.mission_store import StoreStep, mission_length_m
from simulator.params import ParamTable, defaults_for
from simulator.physics import Home, Place, Positioning
from simulator.store_ardupilot import ArduPilotStore
from simulator.store_px4 import Px4Store
from simulator.streams import MESSAGE_IDS, MESSAGE_NAMES, Streams

STEP_S = 0.05
"""Step of physics and decisions, in simulated seconds."""
BOOT_S = 5.0
"""Silence during a restart."""
FULL_PCT = 100.0
WALK_S = 15.0
"""Time until a person reaches a landed vehicle."""
PACK_S = 20.0
"""Time of a pack swap, until it has booted."""
BOOT_ANEW_S = 8.0
"""Time until PX4's simulator answers again from its pad after being killed and restarted (measured)."""
BESIDE_PAD_M = 3.0
"""Distance to home within which arming keeps the old home; simulated landings are off by less."""
DRIFT_M, DRIFT_M_S = 4.0, 0.5
"""Drift distance and speed of a vehicle in altitude hold only."""
LAST_WORDS_S = 2.0
"""Time for which a crashed vehicle still reports that it is disarmed."""
FORCE = 21196
"""param2 of COMPONENT_ARM_DISARM that stops the motors in flight."""


Handler = Callable[[messages.Command], messages.Result | None]
"""Execute a command; None sends no answer."""


class Autopilot(ABC):
    """One vehicle."""

    STREAMS_S: ClassVar[Mapping[str, float]]
    """Default streams and their intervals."""
    REFUSED: ClassVar[messages.Result]
    """Result of a rejected arm or disarm command."""
    INVALID: ClassVar[messages.Result]
    """Result of a request for an unknown message."""
    ACKNOWLEDGES_FIRST: ClassVar[bool]
    """Whether a requested message follows the acknowledgement."""
    ACKNOWLEDGES_EVERYWHERE: ClassVar[bool]
    """Whether a command is acknowledged over all links, not only the one it came from."""
    ON_ITS_BACK: ClassVar[str]
    """Reason for refusing to arm after a crash on its back."""
    KILLED: ClassVar[str]
    """Reason for refusing to arm while the kill switch is on."""
    KILL_SAYS: ClassVar[str]
    """Text sent when a pilot stops the motors."""
    WORDS: ClassVar[Mapping[str, int]]
    """Numbers of the modes that a pilot may select."""
    FIX: ClassVar[int]
    """GPS_FIX_TYPE with a fix."""
    CAPABILITIES: ClassVar[int]
    """MAV_PROTOCOL_CAPABILITY."""
    VERSION: ClassVar[tuple[int, int, int, int]]
    """Three numbers and FIRMWARE_VERSION_TYPE."""
    UNKNOWN: ClassVar[frozenset[str]]
    """Messages that this dialect lacks."""
    mission: ArduPilotMission | Px4Mission

    def __init__(
        self, vehicle: SimVehicle, manners: AirframeSettings, stores: Sequence[ArduPilotStore | Px4Store], home: Home
    ) -> None:
        self.vehicle = vehicle
        self.home = home
        self.frame = Airframe(vehicle, manners)
        px4 = vehicle.autopilot is AutopilotKind.PX4
        self.params = ParamTable(defaults_for(vehicle, self.frame.battery.capacity_mah), bytewise=px4)
        self.store, self.stores = stores[0], stores  # PX4 has one per link, ArduPilot one for all
        self.files: Sequence[FileServer] = self._make_file_servers(FileTree())
        self.voice = VehicleOutbox(tab=px4)
        self.now_s = self.boot_s = 0.0
        self.mode = 0
        self.killed = False
        """Whether the kill switch is on, which prevents arming."""
        self.hands = False
        """Whether a pilot holds the sticks; stick modes then keep their height."""
        self.positioning = Positioning()
        self.guided = GuidedFlight(self.frame, home, manners.limits)
        self._asking = 0
        """Link on which the present message arrived."""
        self.schedules = self._start_streams()
        self.gcs_heard_s: float | None = None
        """Time of the last heartbeat of its ground station; None before the first."""
        self._mission_began_s: float | None = None
        self._mission_length_m = 0.0
        self._odometer_m = 0.0
        self._rebooting_until_s: float | None = None
        self._was_armed = self._was_up = self._may_acknowledge = False
        self.landings = 0
        """Number of landings after which a person has reached it."""
        self._rests_s: float | None = None
        """Time of its last landing, until a person reaches it."""
        self.told_to_disarm = False
        """Whether a command last stopped the motors."""
        self.payload = Payload(vehicle, home, self.frame.body) if vehicle.cameras else None
        self._partner = messages.Peer(0, 0)
        """Sender of the present command."""
        self._after_ack: list[messages.Outbound] = []
        self._commands: Mapping[int, Handler] = {
            messages.MavCommand.COMPONENT_ARM_DISARM: self._handle_arm_command,
            messages.MavCommand.SET_MESSAGE_INTERVAL: self._handle_interval_command,
            messages.MavCommand.GET_MESSAGE_INTERVAL: self._handle_get_interval_command,
            messages.MavCommand.REQUEST_MESSAGE: lambda command: self._send_named(command.integer_param(0)),
            messages.MavCommand.GET_HOME_POSITION: lambda _: self._send_named(MESSAGE_IDS["HOME_POSITION"]),
            messages.MavCommand.REQUEST_AUTOPILOT_CAPABILITIES: lambda _: self._send_named(
                MESSAGE_IDS["AUTOPILOT_VERSION"]
            ),
            messages.MavCommand.PREFLIGHT_REBOOT_SHUTDOWN: self._handle_reboot_command,
            messages.MavCommand.DO_GIMBAL_MANAGER_CONFIGURE: self._handle_gimbal_command,
            messages.MavCommand.DO_CHANGE_SPEED: self._change_speed,
            **self._own_commands(),
        }
        builders = telemetry.make_builders(self)
        self._builders = {name: build for name, build in builders.items() if name not in self.UNKNOWN}

    def _make_file_servers(self, tree: FileTree) -> Sequence[FileServer]:
        """Return the MAVFTP servers: one per link, on the same files."""
        return [FileServer(tree) for _ in self.stores]

    # Inputs.

    def advance(self, until_s: float) -> None:
        """Run up to a simulated time, in whole steps."""
        while self.now_s + STEP_S <= until_s + 1e-9:
            self.now_s += STEP_S
            self._step()

    @property
    def streams(self) -> Streams:
        """Telemetry on the link that last received a message, at first link 0."""
        return self.schedules[self._asking]

    def schedule_now(self, name: str) -> None:
        """Send a streamed message now, on all links, because its content has changed."""
        for streams in self.schedules:
            streams.schedule_now(name, self.now_s)

    def receive(self, received: messages.Received) -> None:
        """Handle a message immediately."""
        self._asking = received.sender.link
        if self.frame.crashed_s is None and self._rebooting_until_s is None:
            self._dispatch(received.sender, received.body)

    def reboot(self, *, on_pad: bool = False) -> None:
        """Restart; the motors stop. A restarted simulator may put the vehicle back on its pad."""
        self._rebooting_until_s = self.now_s + (BOOT_ANEW_S if on_pad else BOOT_S)
        if on_pad:
            self.frame.put_on_pad()
        self.frame.disarm()

    def apply_pilot_takeover(self, word: str) -> None:
        """Apply a pilot's mode switch by remote control; the pilot then holds the sticks."""
        self.frame.record_event(f"pilot {word}")
        self.hands, self.killed = True, False
        self.set_mode(self.WORDS[word])

    def drift(self) -> None:
        """Hold height only: the wind carries it a few metres away."""
        here = find_stopping_place(self.frame.body, self.frame.pilot.limits)
        there = Place(here.east_m + DRIFT_M, here.north_m, here.up_m)
        self.frame.pilot.fly([Leg(here, there, DRIFT_M_S, accept_m=0.5), Hover(there)])

    def apply_injection(self, kind: InjectionKind, word: str, value: float) -> None:
        """Apply an injected fault of a pilot, fence, battery, estimator or camera."""
        if kind in PAYLOAD_FAULTS and self.payload is not None:
            self.payload.apply_camera_fault(kind.value, value)
        match kind:
            case InjectionKind.PILOT:
                self.apply_pilot_takeover(word)
            case InjectionKind.STICKS:
                self._on_stick_input()
            case InjectionKind.KILL:
                self.frame.record_event("kill")
                self.killed = True
                self.voice.send_text(messages.Severity.CRITICAL, self.KILL_SAYS)
                self.frame.kill()
            case InjectionKind.DISARM | InjectionKind.PACK if self.frame.body.on_ground:
                self._apply_ground_handling(kind, value)
            case InjectionKind.WEAK | InjectionKind.WRECK:
                self.frame.damage(lost_thrust=value, turns_over=kind is InjectionKind.WRECK)
            case InjectionKind.FENCE:
                self.frame.record_event("failsafe fence")
                self._on_breach()
            case InjectionKind.EMERGENCY:
                self._on_emergency(self.WORDS[word or "LAND"])
            case InjectionKind.EKF if self.frame.armed:  # disarmed, both autopilots ignore it
                self.frame.record_event("failsafe ekf")
                self._on_lost_estimate()

    def _apply_ground_handling(self, kind: InjectionKind, value: float) -> None:
        """Apply a person's action at the vehicle: disarm, or swap the pack while the motors are stopped."""
        if kind is InjectionKind.DISARM:
            self.frame.record_event("pilot DISARM")
            self.frame.disarm()
        elif not self.frame.armed:
            self.frame.battery.swap_pack(value or FULL_PCT)
            self._rebooting_until_s = self.now_s + PACK_S

    # Queries.

    @property
    def mission_s(self) -> float | None:
        """Seconds since the vehicle began its mission; None before."""
        return None if self._mission_began_s is None else self.now_s - self._mission_began_s

    @property
    def flown_share(self) -> float | None:
        """Distance flown since the mission began over its length then; None before."""
        if self._mission_began_s is None or self._mission_length_m <= 0:
            return None
        return (self.frame.body.flown_m - self._odometer_m) / self._mission_length_m

    @property
    def is_mute(self) -> bool:
        """Whether it sends nothing at all: restarting, or destroyed."""
        is_dead = self.frame.crashed_s is not None and self.now_s > self.frame.crashed_s + LAST_WORDS_S
        return is_dead or (self._rebooting_until_s is not None and not self._may_acknowledge)

    @property
    def boot_ms(self) -> int:
        """time_boot_ms."""
        return round((self.now_s - self.boot_s) * 1000)

    @property
    def is_ready(self) -> bool:
        """Whether boot has progressed far enough to arm."""
        return self.now_s - self.boot_s >= self.vehicle.ready_after_s

    @property
    def gps_fix(self) -> int:
        """GPS_FIX_TYPE."""
        return self.FIX if self.is_ready and not self.positioning.without_s(self.now_s) else 1

    @property
    def gcs_silence_s(self) -> float | None:
        """Seconds since the last ground station heartbeat; None before the first."""
        return None if self.gcs_heard_s is None else self.now_s - self.gcs_heard_s

    def begin_mission(self) -> None:
        """Record a mission start; fault triggers count from the first."""
        if self._mission_began_s is None:
            self._mission_began_s = self.now_s
            self._mission_length_m = mission_length_m(self.store.items, self.home)
            self._odometer_m = self.frame.body.flown_m
            self.frame.record_event("mission_started")

    def select_item(self, seq: int) -> bool:
        """Make an item the current one and report it; False if there is none."""
        selected = self._set_current(seq)
        message = self._build("MISSION_CURRENT") if selected else None
        if message is not None:
            self.voice.send([message])
        return selected

    def execute_payload_command(self, number: int, params: Sequence[float]) -> bool:
        """Execute a mission item or command for the payload; returns whether the payload handles it."""
        return self.payload is not None and self.payload.execute_item(number, params)

    def arm(self) -> bool:
        """Arm, or report the reason for refusing."""
        if self.frame.armed:
            return True
        reason = self.ON_ITS_BACK if self.frame.wrecked else self.KILLED if self.killed else self._refuse_arming()
        if reason is not None:
            self.voice.send_text(messages.Severity.CRITICAL, reason)
            return False
        # Both autopilots set home where they are armed; close to its pad, that is the pad.
        body = self.frame.body
        if math.hypot(body.east_m, body.north_m) > BESIDE_PAD_M:
            self.home.move(body.east_m, body.north_m)
            body.east_m = body.north_m = 0.0
            self._on_home_moved()
        self.frame.arm()
        self._was_armed = True
        self._on_armed()
        return True

    def acknowledge(self, command: messages.Command, result: messages.Result) -> None:
        """Acknowledge a command to its sender."""
        link = None if self.ACKNOWLEDGES_EVERYWHERE else self._asking
        self.voice.send([messages.build_command_ack(command.number, result, self._partner)], link)

    # Differences between the dialects.

    @abstractmethod
    def _own_commands(self) -> dict[int, Handler]:
        """Return the commands of this dialect besides the common ones."""

    @abstractmethod
    def _decide(self) -> None:
        """Run mission and failsafes for one step."""

    @abstractmethod
    def _refuse_arming(self) -> str | None:
        """Return the reason for refusing to arm, or None."""

    @abstractmethod
    def _on_home_moved(self) -> None:
        """Convert stored local places to a new home."""

    @abstractmethod
    def set_mode(self, mode: int) -> messages.Result:
        """Change the mode, or refuse."""

    @abstractmethod
    def build_mode_order(self, word: str) -> messages.Command:
        """Return the command with which a ground station sets a mode."""

    @abstractmethod
    def _on_breach(self) -> None:
        """Handle a fence breach."""

    @abstractmethod
    def _on_emergency(self, mode: int) -> None:
        """Handle a sudden, nearly empty battery."""

    @abstractmethod
    def _on_lost_estimate(self) -> None:
        """Handle a lost position estimate."""

    @abstractmethod
    def _on_mission_change(self, step: StoreStep) -> None:
        """Handle a change of the mission on board."""

    @abstractmethod
    def _set_current(self, seq: int) -> bool:
        """Make an item the current one; False if there is none."""

    @abstractmethod
    def _follow_set_point(self, point: messages.SetPoint) -> None:
        """Follow a set-point, or ignore it."""

    @abstractmethod
    def _set_mode_message(self, message: messages.SetMode) -> None:
        """Handle SET_MODE."""

    @abstractmethod
    def _refuse_interval(self, number: int) -> messages.Result:
        """Refuse an interval for a message that it does not have."""

    @abstractmethod
    def _on_armed(self) -> None:
        """Handle motor start."""

    @abstractmethod
    def _on_disarmed(self) -> None:
        """Handle motor stop."""

    @abstractmethod
    def _on_boot(self) -> None:
        """Clear the state that a restart loses."""

    @abstractmethod
    def _hear_station(self, sender: messages.Peer, heartbeat: messages.Heartbeat) -> bool:
        """Handle a heartbeat before it is recorded; returns whether it prevents the failsafe."""

    @abstractmethod
    def _build_own(self, name: str) -> messages.Outbound | None:
        """Return a telemetry message that the dialects fill differently; None without content."""

    @abstractmethod
    def _on_radio_status(self, txbuf_pct: int) -> None:
        """Handle a report of the radio's free buffer."""

    @abstractmethod
    def _slow_down(self, streams: Streams, interval_s: float) -> float:
        """Return the interval a stream keeps for a requested one."""

    def _on_stick_input(self) -> None:  # noqa: B027 - as ArduPilot does on its mission
        """Handle stick input by a pilot: here it has no effect."""

    def _is_mission_locked(self) -> bool:
        return False

    # One step.

    def _step(self) -> None:
        self.frame.step(self.now_s, STEP_S)
        if self.payload is not None:
            self.payload.step(self.now_s, self.boot_s, STEP_S)
        self._was_up = self._was_up or not self.frame.body.on_ground
        if self._was_armed and not self.frame.armed:
            self._rests_s = self.now_s if self._was_up else None
            self._was_armed = self._was_up = False
            self._on_disarmed()
            self.told_to_disarm = False
        if self._rests_s is not None and self.now_s - self._rests_s >= WALK_S:
            self._rests_s = None
            self.landings += 1
        if self._rebooting_until_s is not None:
            self._may_acknowledge = False
            if self.now_s >= self._rebooting_until_s:
                self._boot()
        elif self.frame.crashed_s is not None:
            self._report(only_heartbeat=True)
        else:
            if self.positioning.acts(self.now_s) and self.frame.armed:
                self.frame.record_event("failsafe gps")
                self._on_lost_estimate()
            self._decide()
            for store in self.stores:
                link = store.upload_link
                self._apply_store_step(store.tick(self.now_s), link)
            for server in self.files:
                self.voice.send(server.tick(self.now_s), server.link)
            self._report(only_heartbeat=False)

    def _boot(self) -> None:
        self._rebooting_until_s = None
        self.boot_s = self.now_s
        self.gcs_heard_s = None
        self.schedules = self._start_streams()
        for store in self.stores:
            store.forget_transfers()
        self._on_boot()

    def _start_streams(self) -> list[Streams]:
        return [Streams(self.STREAMS_S, self.now_s, self._slow_down) for _ in self.vehicle.connections]

    def _report(self, *, only_heartbeat: bool) -> None:
        for link, streams in enumerate(self.schedules):
            for name in streams.take_due(self.now_s):
                message = self._build(name) if name == "HEARTBEAT" or not only_heartbeat else None
                if message is not None:
                    self.voice.send([message], link)

    def _build(self, name: str) -> messages.Outbound | None:
        """Return a telemetry message by name; None without content."""
        builder = self._builders.get(name)
        return self._build_own(name) if builder is None else builder()

    # Message handling.

    def _dispatch(self, sender: messages.Peer, body: messages.Body) -> None:
        order = messages.describe_order(body)
        if order:
            self.frame.record_event(order, sender.sysid)
        match body:
            case messages.Heartbeat():
                if self._hear_station(sender, body):
                    self.gcs_heard_s = self.now_s
            case messages.Command():
                self._handle_command(sender, body)
            case messages.SetMode() | messages.SetPoint() | messages.MissionSetCurrent():
                self._obey(sender, body)
            case messages.ParamRequestList() | messages.ParamRequestRead() | messages.ParamSet():
                self.voice.send(self.params.answer(body), self._asking)
            case messages.RequestDataStream():
                self.streams.request(body.stream, body.rate_hz if body.start else 0, self.now_s)
            case messages.RadioStatus():
                self._on_radio_status(body.txbuf_pct)
            case messages.Timesync() | messages.Ping() | messages.FileRequest():
                self._answer(sender, body)
            case _:
                store = self.stores[self._asking % len(self.stores)]
                announced = isinstance(body, messages.ItemReceived) and store.is_receiving
                link = store.upload_link if announced else self._asking  # items may come from any
                step = store.handle(body, sender, self.now_s, locked=self._is_mission_locked())
                self._apply_store_step(step, link)

    def _obey(
        self, sender: messages.Peer, body: messages.SetMode | messages.SetPoint | messages.MissionSetCurrent
    ) -> None:
        match body:
            case messages.SetMode():
                self._partner = sender
                self._set_mode_message(body)
            case messages.SetPoint():
                self._follow_set_point(body)
            case messages.MissionSetCurrent():
                self.select_item(body.seq)

    def _answer(self, sender: messages.Peer, body: messages.Timesync | messages.Ping | messages.FileRequest) -> None:
        """Answer requests; ignore messages that are answers themselves."""
        if isinstance(body, messages.FileRequest):
            server = self.files[self._asking % len(self.files)]
            self.voice.send(server.handle(body, sender, self.now_s), self._asking)
        if isinstance(body, messages.Timesync) and body.tc1 == 0:
            answer = messages.build_message("TIMESYNC", tc1=self.boot_ms * 1_000_000, ts1=body.ts1)
            self.voice.send([answer], self._asking)
        if isinstance(body, messages.Ping) and body.target_sysid == 0:
            answer = messages.build_message(
                "PING", time_usec=body.time_usec, seq=body.seq, target_system=sender.sysid,
                target_component=sender.compid,
            )  # fmt: skip
            self.voice.send([answer], self._asking)

    def _apply_store_step(self, step: StoreStep, link: int) -> None:
        self.voice.send(step.send, link)
        for severity, text in step.texts:
            self.voice.send_text(severity, text)
        self._on_mission_change(step)

    def _handle_command(self, sender: messages.Peer, command: messages.Command) -> None:
        self._partner = sender
        handler = self._commands.get(command.number)
        result = messages.Result.UNSUPPORTED if handler is None else handler(command)
        if handler is None and self.execute_payload_command(command.number, command.params):
            result = messages.Result.ACCEPTED
        if result is not None:
            self.acknowledge(command, result)
        self.voice.send(self._after_ack, self._asking)
        self._after_ack.clear()

    def _handle_arm_command(self, command: messages.Command) -> messages.Result:
        if command.params[0] >= 0.5:
            return messages.Result.ACCEPTED if self.arm() else self.REFUSED
        if not self.frame.body.on_ground and command.params[1] != FORCE:
            return self._refuse_disarming()
        self.told_to_disarm = self.frame.armed
        self.frame.disarm()
        return messages.Result.ACCEPTED

    def _change_speed(self, command: messages.Command) -> messages.Result:
        if command.params[1] <= 0:
            return messages.Result.DENIED
        self.mission.asked_m_s = command.params[1]
        self.frame.pilot.change_speed(self.mission.speed_m_s)
        return messages.Result.ACCEPTED

    def _refuse_disarming(self) -> messages.Result:
        return self.REFUSED

    def _handle_interval_command(self, command: messages.Command) -> messages.Result:
        number = command.integer_param(0)
        name = MESSAGE_NAMES.get(number)
        if name is None or self._build(name) is None:
            return self._refuse_interval(number)
        self.streams.set_interval(name, command.params[1], self.now_s)
        return messages.Result.ACCEPTED

    def _handle_get_interval_command(self, command: messages.Command) -> messages.Result:
        number = command.integer_param(0)
        interval_s = self.streams.interval_s(MESSAGE_NAMES.get(number, ""))
        interval_us = 0 if number not in MESSAGE_NAMES else -1 if interval_s is None else round(interval_s * 1e6)
        answer = messages.build_message("MESSAGE_INTERVAL", message_id=number, interval_us=interval_us)
        self.voice.send([answer], self._asking)
        return messages.Result.ACCEPTED

    def _send_named(self, number: int) -> messages.Result:
        message = self._build(MESSAGE_NAMES.get(number, ""))
        if message is None and self.payload is not None:
            message = self.payload.build_manager_message(number)
        if message is None:
            return self.INVALID
        if self.ACKNOWLEDGES_FIRST:
            self._after_ack.append(message)
        else:
            self.voice.send([message], self._asking)
        return messages.Result.ACCEPTED

    def _handle_gimbal_command(self, command: messages.Command) -> messages.Result:
        sender = (self._partner.sysid, self._partner.compid)
        given = self.payload is not None and self.payload.change_gimbal_control(command.params, sender)
        return messages.Result.ACCEPTED if given else messages.Result.UNSUPPORTED

    def _handle_reboot_command(self, command: messages.Command) -> messages.Result:
        if command.params[0] != 1 or self.frame.armed:
            return messages.Result.DENIED
        self.reboot()
        self._may_acknowledge = True  # silent from the next step on
        return messages.Result.ACCEPTED
