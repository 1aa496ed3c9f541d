"""A UDP relay between one vehicle and the ground station, whose link can be cut while the vehicle flies on."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pymavlink.dialects.v20 import common as mav

HOST = "127.0.0.1"
DATAGRAM = 65536
LOOKS_S = 0.02


class Relay:
    """Carries datagrams both ways between a vehicle, which sends to a port here, and a ground station's port."""

    def __init__(self, vehicle_port: int, station_port: int) -> None:
        """Open the vehicle's port; `running` carries."""
        self.cut = False
        """While it is set, both directions are swallowed."""
        self.slow_s = 0.0
        """Real seconds that everything to the vehicle takes, as over a slow radio."""
        self.carried: list[bytes] = []
        """What went to the vehicle."""
        self.swallowed: list[tuple[float, bytes]] = []
        """What the vehicle sent meanwhile, each with its time in seconds since 1970."""
        self._station = (HOST, station_port)
        self._to_vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to_vehicle.bind((HOST, vehicle_port))
        self._to_station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to_station.bind((HOST, 0))
        self._vehicle: tuple[str, int] | None = None
        self._over = threading.Event()
        self._on_its_way: deque[tuple[float, bytes]] = deque()

    @contextmanager
    def running(self) -> Iterator[Relay]:
        """Carry until the end of the context."""
        thread = threading.Thread(target=self._carry)
        thread.start()
        try:
            yield self
        finally:
            self._over.set()
            thread.join()
            self._to_vehicle.close()
            self._to_station.close()

    def forge(self, frame: bytes) -> None:
        """Send a frame to the ground station from the address that the vehicle's come from."""
        self._to_station.sendto(frame, self._station)

    def modes(self) -> list[tuple[float, int]]:
        """Return the modes of the heartbeats that were swallowed, each with its time in seconds since 1970."""
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        return [
            (at_s, message.custom_mode)
            for at_s, data in self.swallowed
            for message in parser.parse_buffer(data) or ()
            if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1
        ]

    def sent(self, *kinds: str) -> list[Any]:
        """Return the messages of these kinds that went to the vehicle, in their order."""
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        return [
            one for data in tuple(self.carried) for one in parser.parse_buffer(data) or () if one.get_type() in kinds
        ]

    def _carry(self) -> None:
        while not self._over.is_set():
            ready, _, _ = select.select([self._to_vehicle, self._to_station], [], [], LOOKS_S)
            self._deliver()
            # A vehicle that has not started yet, or has ended, is not there to take what is sent to it.
            with contextlib.suppress(ConnectionError):
                if self._to_vehicle in ready:
                    data, self._vehicle = self._to_vehicle.recvfrom(DATAGRAM)
                    if self.cut:
                        self.swallowed.append((time.time(), data))
                    else:
                        self._to_station.sendto(data, self._station)
            with contextlib.suppress(ConnectionError):
                if self._to_station in ready:
                    data = self._to_station.recv(DATAGRAM)
                    if self._vehicle is not None and not self.cut:
                        self._on_its_way.append((time.monotonic() + self.slow_s, data))
                        self._deliver()

    def _deliver(self) -> None:
        """Hand over what has been on its way for long enough."""
        while self._on_its_way and self._on_its_way[0][0] <= time.monotonic():
            data = self._on_its_way.popleft()[1]
            self.carried.append(data)
            if self._vehicle is not None:
                with contextlib.suppress(ConnectionError):
                    self._to_vehicle.sendto(data, self._vehicle)
