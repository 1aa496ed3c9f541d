"""One simulated vehicle as the world sees it: datagrams in, datagrams out, faults on time."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

from executor.simulator.airframe import Event
from executor.simulator.ardupilot import ArduPilot
from executor.simulator.autopilot import STEP_S, Autopilot
from executor.simulator.channel import Channel, LinkCondition
from executor.simulator.config import AutopilotKind, SimVehicle
from executor.simulator.faults import Fault, FaultKind, faults_of, is_due
from executor.simulator.mission_store import UploadFault
from executor.simulator.px4 import Px4
from executor.simulator.wire import Codec

LINK_FIELDS = {
    FaultKind.LOSS: "loss",
    FaultKind.DELAY: "delay_s",
    FaultKind.DUPLICATE: "duplicate",
    FaultKind.REORDER: "reorder",
}


def make_autopilot(vehicle: SimVehicle) -> Autopilot:
    """Return the autopilot that the vehicle has."""
    return ArduPilot(vehicle) if vehicle.autopilot is AutopilotKind.ARDUPILOT else Px4(vehicle)


class SimulatedVehicle:
    """An autopilot behind a link that may be bad; all times are simulated seconds."""

    def __init__(self, vehicle: SimVehicle, faults: Iterable[Fault] = ()) -> None:
        self.name = vehicle.name
        self.autopilot = make_autopilot(vehicle)
        self._codec = Codec(
            vehicle.sysid, every_component=vehicle.autopilot is AutopilotKind.ARDUPILOT, signing=vehicle.signing
        )
        self._pending = list(faults_of(faults, vehicle.name))
        self._condition = LinkCondition()
        rng = random.Random(f"{vehicle.seed}:{vehicle.name}")
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
            self._collect()

    def drain(self) -> list[bytes]:
        """Take away the datagrams that have reached the ground stations."""
        self._collect()
        return self._down.due(self._now_s)

    def drain_events(self) -> list[Event]:
        """Take away what really happened."""
        return self.autopilot.frame.drain_events()

    def _deliver(self) -> None:
        for datagram in self._up.due(self._now_s):
            for received in self._codec.decode(datagram):
                self.autopilot.receive(received)

    def _collect(self) -> None:
        messages = self.autopilot.voice.drain()
        if not self.autopilot.mute:
            for message in messages:
                self._down.offer(self._codec.encode(message, self._now_s), self._now_s)

    def _inject(self) -> None:
        if not self._pending:
            return
        mission_s, share = self.autopilot.mission_s, self.autopilot.flown_share
        due = [fault for fault in self._pending if is_due(fault, mission_s, share)]
        if due:
            self._pending = [fault for fault in self._pending if fault not in due]
            for fault in due:
                self.autopilot.frame.happened(f"fault {fault.spec}")
                self._apply(fault.kind, fault.value or 0.0)

    def _apply(self, kind: FaultKind, value: float) -> None:
        condition, frame = self._condition, self.autopilot.frame
        match kind:
            case FaultKind.SILENT:
                condition.silent_until_s = self._now_s + (value or math.inf)
            case FaultKind.BATTERY_STEP:
                frame.battery.lose(value)
            case FaultKind.DRAIN:
                frame.battery.drain_factor = value
            case FaultKind.CRASH:
                frame.lose_thrust()
            case FaultKind.REBOOT:
                self.autopilot.reboot()
            case FaultKind.REFUSE_UPLOAD:
                self.autopilot.store.fault = UploadFault.REFUSE
            case FaultKind.HALF_UPLOAD:
                self.autopilot.store.fault = UploadFault.HALF
            case _:
                setattr(condition, LINK_FIELDS[kind], value)
