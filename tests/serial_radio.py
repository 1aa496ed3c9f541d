"""A telemetry radio at a serial port: a pseudo terminal that can be unplugged, behind it vehicles that speak UDP."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pymavlink.dialects.v20 import common as mav

from tests.patience import PATIENCE_S


class SerialRadio:
    """Carries what vehicles send to their station's ports to one device, and what is written to it to all of them."""

    def __init__(self, device: Path) -> None:
        """Describe a radio that is not plugged in."""
        self.device = device
        self.beats_missed = 0
        """HEARTBEATs of vehicles since it was unplugged."""
        self._plugs: list[socket.socket] = []
        self._vehicles: dict[socket.socket, tuple[str, int]] = {}
        self._ends: tuple[int, int] | None = None
        self._missed = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    @contextmanager
    def beside(self, ports: list[int]) -> Iterator[None]:
        """Listen where vehicles send to, and plug the radio in."""
        try:
            for port in ports:
                plug = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                plug.bind(("127.0.0.1", port))
                plug.setblocking(False)
                self._plugs.append(plug)
                self._loop.add_reader(plug, self._bring, plug)
            self.plug()
            yield
        finally:
            self.unplug()
            for plug in self._plugs:
                self._loop.remove_reader(plug)
                plug.close()

    def plug(self) -> None:
        """Make the device: another one than before, by the same name, as the system does."""
        self._ends = pty.openpty()
        for end in self._ends:
            tty.setraw(end)
            os.set_blocking(end, False)
        self._loop.add_reader(self._ends[0], self._take)
        self.device.symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        """Take the device away: whoever has it open reads its end."""
        if self._ends is not None:
            self.device.unlink()
            self._loop.remove_reader(self._ends[0])
            for end in self._ends:
                os.close(end)
            self._ends, self.beats_missed = None, 0

    async def missed(self, beats: int) -> None:
        """Return when so many HEARTBEATs of vehicles were not carried: one a second of each."""
        async with asyncio.timeout(PATIENCE_S):
            while self.beats_missed < beats:
                self._missed.clear()
                await self._missed.wait()

    def _bring(self, plug: socket.socket) -> None:
        data, self._vehicles[plug] = plug.recvfrom(65536)
        if self._ends is None:
            parsed = mav.MAVLink(None).parse_buffer(data) or ()
            self.beats_missed += sum(frame.get_type() == "HEARTBEAT" for frame in parsed)
            self._missed.set()
        else:
            with suppress(OSError):  # what it cannot take is lost
                os.write(self._ends[0], data)

    def _take(self) -> None:
        if self._ends is None:
            return
        with suppress(OSError):
            data = os.read(self._ends[0], 65536)
            for plug, vehicle in self._vehicles.items():
                plug.sendto(data, vehicle)
