"""One simulated vehicle as the world sees it: datagrams in and out over a link that may be bad, faults on time."""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from simulator.airframe import Event
from simulator.ardupilot import ArduPilot
from simulator.autopilot import STEP_S, Autopilot
from simulator.camera import GIMBAL, CapturedImage
from simulator.config import AutopilotKind, Injection, InjectionKind, SimVehicle, faults_of, is_due
from simulator.messages import Command, Heartbeat, Peer, Received, build_message
from simulator.mission_store import UploadFault
from simulator.px4 import Px4
from simulator.truth import Truth
from simulator.wire import Codec

REORDER_HOLD_S = (0.02, 0.2)
"""How long a datagram that is to be overtaken is held back, simulated."""
QUEUE_BYTES = 2048
"""What a radio holds of what it cannot send yet; what comes to a full one is lost (SiK, serial.c: 1850)."""


@dataclass(slots=True)
class LinkCondition:
    """The state of a vehicle's link; both directions share it."""

    loss: float = 0.0
    """Share of datagrams that is lost."""
    delay_s: float = 0.0
    duplicate: float = 0.0
    """Share of datagrams that comes twice."""
    reorder: float = 0.0
    """Share of datagrams that is held back so that later ones overtake it."""
    rate_bytes_s: float = math.inf
    """What passes each way, one datagram behind the other."""
    silent_until_s: float = -math.inf
    """Simulated time until which nothing passes."""


class Channel:
    """Carries datagrams one way; times are simulated seconds."""

    def __init__(self, condition: LinkCondition, rng: random.Random) -> None:
        self._condition = condition
        self._rng = rng
        self._held: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._free_s = -math.inf
        """When all that is in its queue has been sent."""

    def offer(self, datagram: bytes, now_s: float) -> None:
        """Take a datagram that was sent at ``now_s``."""
        condition = self._condition
        if now_s < condition.silent_until_s or self._draw_chance(condition.loss):
            return
        waits_s = max(0.0, self._free_s - now_s)
        if waits_s > QUEUE_BYTES / condition.rate_bytes_s:
            return
        self._free_s = now_s + waits_s + len(datagram) / condition.rate_bytes_s
        for _ in range(2 if self._draw_chance(condition.duplicate) else 1):
            late_s = self._rng.uniform(*REORDER_HOLD_S) if self._draw_chance(condition.reorder) else 0.0
            heapq.heappush(self._held, (self._free_s + condition.delay_s + late_s, self._count, datagram))
            self._count += 1

    def take_due(self, now_s: float) -> list[bytes]:
        """Return what arrives by ``now_s``, in the order of arrival; what arrives in a silence is lost."""
        arrived = []
        while self._held and self._held[0][0] <= now_s:
            at_s, _, datagram = heapq.heappop(self._held)
            if at_s >= self._condition.silent_until_s:
                arrived.append(datagram)
        return arrived

    def _draw_chance(self, share: float) -> bool:
        return share > 0 and self._rng.random() < share


STATION = Peer(254, 190)
"""Another ground station."""
LINK_FIELDS = {
    InjectionKind.LOSS: "loss",
    InjectionKind.DELAY: "delay_s",
    InjectionKind.DUPLICATE: "duplicate",
    InjectionKind.REORDER: "reorder",
    InjectionKind.RATE: "rate_bytes_s",
}


def make_autopilot(vehicle: SimVehicle) -> Autopilot:
    """Return the autopilot that the vehicle has."""
    return ArduPilot(vehicle) if vehicle.autopilot is AutopilotKind.ARDUPILOT else Px4(vehicle)


class SimulatedVehicle:
    """An autopilot behind a link that may be bad; all times are simulated seconds."""

    def __init__(self, vehicle: SimVehicle, faults: Iterable[Injection] = ()) -> None:
        self.name = vehicle.name
        self.autopilot = make_autopilot(vehicle)
        payload = self.autopilot.payload
        speaking = frozenset() if payload is None else payload.list_components()
        self._codec = Codec(
            vehicle.sysid,
            every_component=vehicle.autopilot is AutopilotKind.ARDUPILOT,
            signing=vehicle.signing,
            others=speaking,
        )
        self._components = {
            number: Codec(vehicle.sysid, component=number, signing=vehicle.signing) for number in (*speaking, GIMBAL)
        }
        """Of cameras and the gimbal, which number their frames for themselves."""
        self._pending = list(faults_of(faults, vehicle.name))
        self._condition = LinkCondition()
        rng = random.Random(f"{vehicle.seed}:{vehicle.name}")
        self._station: Codec | None = None
        """Another ground station's transmitter, once it is there."""
        self._station_beat_s = 0.0
        self._up = Channel(self._condition, rng)
        self._down = Channel(self._condition, rng)
        self._now_s = 0.0
        self._inject()

    @property
    def now_s(self) -> float:
        """How far it has lived."""
        return self._now_s

    def receive(self, datagram: bytes) -> None:
        """Take a datagram from a ground station; an answer may be ready at once."""
        self._up.offer(datagram, self._now_s)
        self._deliver()

    def advance(self, until_s: float) -> None:
        """Live until ``until_s``, in whole steps."""
        while self._now_s + STEP_S <= until_s + 1e-9:
            self._now_s += STEP_S
            self._deliver()
            self.autopilot.advance(self._now_s)
            self._inject()
            self._send_station_heartbeat()
            self._collect()

    def drain(self) -> list[bytes]:
        """Take away the datagrams that have reached the ground stations."""
        self._collect()
        return self._down.take_due(self._now_s)

    def drain_events(self) -> list[Event]:
        """Take away what really happened."""
        return self.autopilot.frame.drain_events()

    def drain_truths(self, unix_s: Callable[[float], float]) -> list[Truth]:
        """Take away what really happened, where on the globe, and when by a machine's clock."""
        truths = []
        for event in self.drain_events():
            lat_e7, lon_e7 = self.autopilot.home.lat_lon_e7(event.place.east_m, event.place.north_m)
            truths.append(
                Truth(
                    self.name, event.what, event.t_s, unix_s(event.t_s), event.sender, lat_e7 / 1e7, lon_e7 / 1e7,
                    event.place.up_m, event.charge_pct,
                )
            )  # fmt: skip
        return truths

    def drain_shots(self) -> list[CapturedImage]:
        """Take away what came onto its cameras' cards."""
        return [] if self.autopilot.payload is None else self.autopilot.payload.drain_shots()

    def _deliver(self) -> None:
        for datagram in self._up.take_due(self._now_s):
            for received in self._codec.decode(datagram):
                payload = self.autopilot.payload
                if payload is not None and received.component in self._components:
                    if isinstance(received.body, Command):
                        payload.answer_component_command(received.body, received.component)
                else:
                    self.autopilot.receive(received)

    def _collect(self) -> None:
        messages = self.autopilot.voice.drain()
        if not self.autopilot.is_mute:
            for message in messages:
                self._down.offer(self._codec.encode(message, self._now_s), self._now_s)
        if self.autopilot.payload is not None and self.autopilot.frame.crashed_s is None:
            for said in self.autopilot.payload.drain():
                codec = self._codec if said.component is None else self._components[said.component]
                self._down.offer(codec.encode(said.message, self._now_s), self._now_s)

    def _inject(self) -> None:
        if not self._pending:
            return
        mission_s, share, frame = self.autopilot.mission_s, self.autopilot.flown_share, self.autopilot.frame
        up_m, highest_m = frame.body.up_m, frame.highest_m
        landings = self.autopilot.landings
        due = [fault for fault in self._pending if is_due(fault, mission_s, share, up_m, highest_m, landings)]
        if due:
            self._pending = [fault for fault in self._pending if fault not in due]
            for fault in due:
                self.apply_injection(fault)

    def schedule_injection(self, fault: Injection) -> None:
        """Have a fault befall this vehicle in its own time."""
        self._pending.append(fault)

    def apply_injection(self, fault: Injection) -> None:
        """Suffer a fault now, whenever it was ordered for."""
        self.autopilot.frame.record_event(f"fault {fault.spec}")
        self._apply(fault.kind, fault.value or 0.0, fault.word)

    def _apply(self, kind: InjectionKind, value: float, word: str) -> None:
        condition, frame = self._condition, self.autopilot.frame
        match kind:
            case InjectionKind.SILENT:
                condition.silent_until_s = self._now_s + (value or math.inf)
            case InjectionKind.BATTERY_STEP:
                frame.battery.remove_charge(value)
            case InjectionKind.DRAIN:
                frame.battery.drain_factor = value
            case InjectionKind.GPS:
                self.autopilot.positioning.lose(self.autopilot.now_s, value)
            case InjectionKind.CRASH:
                frame.lose_thrust()
            case InjectionKind.REBOOT:
                self.autopilot.reboot(on_pad=word == "pad")
            case InjectionKind.STATION:
                self._apply_station_order(word)
            case InjectionKind.REFUSE_UPLOAD | InjectionKind.HALF_UPLOAD:
                refuses = kind is InjectionKind.REFUSE_UPLOAD
                self.autopilot.store.fault = UploadFault.REFUSE if refuses else UploadFault.HALF
            case _ if kind in LINK_FIELDS:
                setattr(condition, LINK_FIELDS[kind], value)
            case _:
                self.autopilot.apply_injection(kind, word, value)

    def _apply_station_order(self, word: str) -> None:
        """Let another ground station order a mode; from now on its heartbeat is on the air."""
        if self._station is None:
            self._station = Codec(STATION.sysid, component=STATION.compid)
            self._station_beat_s = self._now_s
        self.autopilot.frame.record_event(f"station {word}")
        self.autopilot.receive(Received(STATION, self.autopilot.build_mode_order(word)))

    def _send_station_heartbeat(self) -> None:
        if self._station is None or self._now_s < self._station_beat_s:
            return
        self._station_beat_s += 1.0
        self.autopilot.receive(Received(STATION, Heartbeat(ground_station=True)))
        beat = build_message(
            "HEARTBEAT", type=6, autopilot=8, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
        )
        self._down.offer(self._station.encode(beat, self._now_s), self._now_s)
