"""One half-duplex radio between several real vehicles and the ground station, in real time."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from simulator.radio import build_radios, parse_radio
from tests.sitl.real import PX4, START_REAL_S

PX4_RATE = 600
"""MAV_0_RATE of a radio that three share; without one PX4 in simulation sends ten times what passes."""
HOST = "127.0.0.1"
DATAGRAM = 65536
LOOKS_S = 0.005


class RadioRelay:
    """Stands between vehicles, which send to ports here, and the ground station's ports."""

    def __init__(self, vehicle_ports: range, station_ports: range, profile: str) -> None:
        """Open the vehicles' ports; `running` carries."""
        self._radios = build_radios(parse_radio(profile), len(vehicle_ports))
        self._to_vehicles = [self._socket(port) for port in vehicle_ports]
        self._to_station = [self._socket(0) for _ in vehicle_ports]
        self._station_ports = station_ports
        self._vehicles: dict[int, tuple[str, int]] = {}
        self._over = threading.Event()
        self.items: Counter[tuple[int, int]] = Counter()
        """How often each item of a mission was sent, by the vehicle's place and the item."""
        self.offered = Counter[bool]()
        """Bytes, down and up."""

    @property
    def dropped(self) -> int:
        """Bytes for which there was no room."""
        return sum(radio.cut_bytes for radio in {id(radio): radio for radio in self._radios}.values())

    @staticmethod
    def _socket(port: int) -> socket.socket:
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        opened.bind((HOST, port))
        return opened

    @contextmanager
    def running(self) -> Iterator[RadioRelay]:
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
        began_s = time.monotonic()
        while not self._over.is_set():
            ready, _, _ = select.select([*self._to_vehicles, *self._to_station], [], [], LOOKS_S)
            now_s = time.monotonic() - began_s
            for one in ready:
                with contextlib.suppress(ConnectionError):
                    self._take(one, now_s)
            for vehicle, radio in enumerate(self._radios):
                for up in (False, True):
                    for data in radio.take(vehicle, now_s, up=up):
                        with contextlib.suppress(ConnectionError):
                            self._hand_over(vehicle, data, up=up)

    def _take(self, one: socket.socket, now_s: float) -> None:
        data, sender = one.recvfrom(DATAGRAM)
        up = one in self._to_station
        vehicle = self._to_station.index(one) if up else self._to_vehicles.index(one)
        if up:
            self._count(vehicle, data)
        else:
            self._vehicles[vehicle] = sender
        self.offered[up] += len(data)
        self._radios[vehicle].send(vehicle, data, now_s, up=up)

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


def slowed(number: int, folder: Path) -> None:
    """Have a PX4 speak as over a radio: it does not throttle itself on a network."""
    client = Path(os.environ.get("FAULTLINE_PX4_BUILD", "")) / "bin" / "px4-mavlink"
    if not client.exists():
        pytest.skip("FAULTLINE_PX4_BUILD: expected the build directory of PX4, with bin/px4-mavlink")
    until_s = time.monotonic() + START_REAL_S
    while b"Startup script returned successfully" not in (said := (folder / "out.txt").read_bytes()):
        # One built without a module that its script ends with has ended by now.
        assert b"Startup script returned with" not in said, f"PX4 has not started: {said[-300:].decode()}"
        assert time.monotonic() < until_s, f"PX4 has not started within {START_REAL_S:g} s"
        time.sleep(0.5)
    port = str(14580 + number)
    for arguments in (
        ["stop", "-u", port],
        ["start", "-x", "-u", port, "-r", str(PX4_RATE), "-f", "-o", str(PX4.port + number)],
    ):
        subprocess.run([client, "--instance", str(number), *arguments], cwd=folder, check=True, capture_output=True)
