"""The way to a vehicle, in the vehicle's own time: a simulated one without sockets, a real one over UDP."""

from __future__ import annotations

import socket
import time
from typing import Protocol

from simulator.autopilot import STEP_S
from simulator.config import AutopilotKind
from simulator.fleet import SimulatedVehicle
from tests.simulator.harness import sim_vehicle

SLICE_S = STEP_S


class Wire(Protocol):
    """Carries datagrams and lets the vehicle's time pass."""

    sysid: int

    @property
    def now_s(self) -> float:
        """The vehicle's time."""
        ...

    def send(self, datagram: bytes) -> None: ...

    def listen(self) -> list[bytes]:
        """Let a moment pass and return what came."""
        ...

    def told_s(self, boot_s: float) -> None:
        """Take the vehicle's word for its time."""
        ...


class SimulatedWire:
    """To a simulated vehicle; nothing waits for real."""

    def __init__(self, kind: AutopilotKind, **changes: object) -> None:
        self._vehicle = SimulatedVehicle(sim_vehicle(kind, **changes))
        self.sysid = self._vehicle.autopilot.vehicle.sysid

    @property
    def now_s(self) -> float:
        return self._vehicle.now_s

    def send(self, datagram: bytes) -> None:
        self._vehicle.receive(datagram)

    def listen(self) -> list[bytes]:
        self._vehicle.advance(self._vehicle.now_s + SLICE_S)
        return self._vehicle.drain()

    def told_s(self, boot_s: float) -> None:
        return


class UdpWire:
    """To an autopilot that calls a UDP port; its time is what it says, and in between the wall's at its speed."""

    def __init__(self, port: int, sysid: int, speedup: float) -> None:
        self.sysid = sysid
        self._speedup = speedup
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self._socket.bind(("127.0.0.1", port))
        self._target: tuple[str, int] | None = None
        self._origin_s = 0.0
        self._heard_at = time.monotonic()
        self._now_s = 0.0

    @property
    def now_s(self) -> float:
        """It stands still half a second after the vehicle's last word, as a vehicle that gets no processor does."""
        since_s = min((time.monotonic() - self._heard_at) * self._speedup, 0.5)
        self._now_s = max(self._now_s, self._origin_s + since_s)
        return self._now_s

    def send(self, datagram: bytes) -> None:
        if self._target is not None:
            self._socket.sendto(datagram, self._target)

    def listen(self) -> list[bytes]:
        until = time.monotonic() + SLICE_S / self._speedup
        heard = []
        while (left_s := until - time.monotonic()) > 0:
            self._socket.settimeout(left_s)
            try:
                datagram, self._target = self._socket.recvfrom(4096)
            except TimeoutError:
                break
            heard.append(datagram)
        return heard

    def told_s(self, boot_s: float) -> None:
        self._origin_s, self._heard_at = boot_s, time.monotonic()

    def close(self) -> None:
        self._socket.close()
