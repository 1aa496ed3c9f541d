"""One half-duplex radio for several vehicles: so many bytes a second in all, and everything late."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager

from pymavlink.dialects.v20 import common as mav

from simulator.fleet import QUEUE_BYTES

HOST = "127.0.0.1"
DATAGRAM = 65536
LOOKS_S = 0.005
GROUND = -1


class Radio:
    """Stands between vehicles, which send to ports here, and the ground station's ports.

    Ground and vehicles each have a queue, which drops what comes when it is full, and take turns on the air.
    """

    def __init__(self, vehicle_ports: range, station_ports: range, rate_bytes_s: float, delay_s: float) -> None:
        """Open the vehicles' ports; `running` carries."""
        self._rate_bytes_s, self._delay_s = rate_bytes_s, delay_s
        self._to_vehicles = [self._socket(port) for port in vehicle_ports]
        self._to_station = [self._socket(0) for _ in vehicle_ports]
        self._station_ports = station_ports
        self._vehicles: dict[int, tuple[str, int]] = {}
        self._queues: dict[int, deque[tuple[int, bytes]]] = {
            node: deque() for node in (GROUND, *range(len(vehicle_ports)))
        }
        """What each end has to say, with the vehicle that it is from, or for."""
        self._turns = deque(self._queues)
        self._free_s = 0.0
        self._on_air: deque[tuple[float, bool, int, bytes]] = deque()
        self._over = threading.Event()
        self.items: Counter[tuple[int, int]] = Counter()
        """How often each item of a mission was sent, by the vehicle's place and the item."""
        self.offered, self.dropped = Counter[bool](), Counter[bool]()
        """Bytes, down and up."""

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
            self._transmit(time.monotonic())
            while self._on_air and self._on_air[0][0] <= time.monotonic():
                _, up, vehicle, data = self._on_air.popleft()
                with contextlib.suppress(ConnectionError):
                    self._hand_over(vehicle, data, up=up)

    def _take(self, one: socket.socket) -> None:
        data, sender = one.recvfrom(DATAGRAM)
        up = one in self._to_station
        vehicle = self._to_station.index(one) if up else self._to_vehicles.index(one)
        if up:
            self._count(vehicle, data)
        else:
            self._vehicles[vehicle] = sender
        self.offered[up] += len(data)
        queue = self._queues[GROUND if up else vehicle]
        if sum(len(waiting) for _, waiting in queue) + len(data) > QUEUE_BYTES:
            self.dropped[up] += len(data)
        else:
            queue.append((vehicle, data))

    def _transmit(self, now_s: float) -> None:
        """Let everybody who has something to say have a turn, until the air is taken."""
        while self._free_s <= now_s and any(self._queues.values()):
            while not self._queues[self._turns[0]]:
                self._turns.rotate(-1)
            node = self._turns[0]
            self._turns.rotate(-1)
            vehicle, data = self._queues[node].popleft()
            self._free_s = max(self._free_s, now_s - LOOKS_S) + len(data) / self._rate_bytes_s
            self._on_air.append((self._free_s + self._delay_s, node == GROUND, vehicle, data))

    def _hand_over(self, vehicle: int, data: bytes, *, up: bool) -> None:
        if not up:
            self._to_station[vehicle].sendto(data, (HOST, self._station_ports[vehicle]))
        elif vehicle in self._vehicles:
            self._to_vehicles[vehicle].sendto(data, self._vehicles[vehicle])

    def _count(self, vehicle: int, data: bytes) -> None:
        parser = mav.MAVLink(None)
        parser.robust_parsing = True
        for message in parser.parse_buffer(data) or ():
            if message.get_type() == "MISSION_ITEM_INT":
                self.items[vehicle, message.seq] += 1
