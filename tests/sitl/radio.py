"""One half-duplex radio for several vehicles: so many bytes a second in all, and everything late."""

from __future__ import annotations

import contextlib
import random
import select
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from pymavlink.dialects.v20 import common as mav

from simulator.channel import Channel, LinkCondition

HOST = "127.0.0.1"
DATAGRAM = 65536
LOOKS_S = 0.005


class _Carried(bytes):
    """A datagram that knows where it goes."""

    vehicle: int
    up: bool

    @classmethod
    def of(cls, datagram: bytes, vehicle: int, *, up: bool) -> _Carried:
        carried = cls(datagram)
        carried.vehicle, carried.up = vehicle, up
        return carried


class Radio:
    """Stands between vehicles, which send to ports here, and the ground station's ports."""

    def __init__(self, vehicle_ports: range, station_ports: range, condition: LinkCondition) -> None:
        """Open the vehicles' ports; `running` carries."""
        self._air = Channel(condition, random.Random(3))
        self._to_vehicles = [self._socket(port) for port in vehicle_ports]
        self._to_station = [self._socket(0) for _ in vehicle_ports]
        self._station_ports = station_ports
        self._vehicles: dict[int, tuple[str, int]] = {}
        self._over = threading.Event()
        self.items: Counter[tuple[int, int]] = Counter()
        """How often each item of a mission was sent, by the vehicle's place and the item."""
        self.bytes = Counter[bool]()
        """Offered down and up."""

    @staticmethod
    def _socket(port: int) -> socket.socket:
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        opened.bind((HOST, port))
        return opened

    @contextmanager
    def running(self) -> Iterator[Radio]:
        """Carry until the end of the context."""
        thread = threading.Thread(target=self._carry)
        thread.start()
        try:
            yield self
        finally:
            self._over.set()
            thread.join()
            for one in (*self._to_vehicles, *self._to_station):
                one.close()

    def _carry(self) -> None:
        while not self._over.is_set():
            ready, _, _ = select.select([*self._to_vehicles, *self._to_station], [], [], LOOKS_S)
            for one in ready:
                with contextlib.suppress(ConnectionError):
                    self._take(one)
            for carried in self._air.due(time.monotonic()):
                assert isinstance(carried, _Carried)
                with contextlib.suppress(ConnectionError):
                    self._hand_over(carried)

    def _take(self, one: socket.socket) -> None:
        data, sender = one.recvfrom(DATAGRAM)
        up = one in self._to_station
        vehicle = self._to_station.index(one) if up else self._to_vehicles.index(one)
        if up:
            self._count(vehicle, data)
        else:
            self._vehicles[vehicle] = sender
        self.bytes[up] += len(data)
        self._air.offer(_Carried.of(data, vehicle, up=up), time.monotonic())

    def _hand_over(self, carried: _Carried) -> None:
        if not carried.up:
            self._to_station[carried.vehicle].sendto(carried, (HOST, self._station_ports[carried.vehicle]))
        elif carried.vehicle in self._vehicles:
            self._to_vehicles[carried.vehicle].sendto(carried, self._vehicles[carried.vehicle])

    def _count(self, vehicle: int, data: bytes) -> None:
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        for message in parser.parse_buffer(data) or ():
            if message.get_type() == "MISSION_ITEM_INT":
                self.items[vehicle, message.seq] += 1
