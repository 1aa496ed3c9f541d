"""A ground station on a real UDP socket that owes nothing to the simulator's codec."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any, Self, cast

from pymavlink.dialects.v20 import ardupilotmega as dialect

from simulator.messages import ItemReceived
from tests.patience import PATIENCE_S


class Station(asyncio.DatagramProtocol):
    """Sends messages and waits for answers."""

    def __init__(self, target: tuple[str, int] | None) -> None:
        self._target = target
        self._transport: asyncio.DatagramTransport | None = None
        self._heard: list[Any] = []
        self._news = asyncio.Event()
        self._lost = asyncio.Event()
        self._mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._mav.robust_parsing = True

    @classmethod
    @asynccontextmanager
    async def calling(cls, port: int) -> AsyncIterator[Self]:
        """Call a vehicle that listens."""
        async with cls._open(cls(("127.0.0.1", port)), None) as station:
            yield station

    @classmethod
    @asynccontextmanager
    async def listening(cls, port: int) -> AsyncIterator[Self]:
        """Listen for a vehicle that calls."""
        async with cls._open(cls(None), ("127.0.0.1", port)) as station:
            yield station

    @classmethod
    @asynccontextmanager
    async def _open(cls, station: Self, local: tuple[str, int] | None) -> AsyncIterator[Self]:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: station, local_addr=local or ("127.0.0.1", 0))
        try:
            yield station
        finally:
            transport.close()
            await station._lost.wait()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.DatagramTransport", transport)

    def connection_lost(self, exc: Exception | None) -> None:
        self._lost.set()

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._target = addr
        self._heard += self._mav.parse_buffer(data) or []
        self._news.set()

    def send(self, message: Any) -> None:
        assert self._transport is not None
        assert self._target is not None
        self._transport.sendto(message.pack(self._mav), self._target)
        self._mav.seq = (self._mav.seq + 1) % 256

    def heartbeat(self) -> None:
        self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))

    async def wait_for(self, *names: str, good: Callable[[Any], bool] = lambda _: True) -> Any:
        """Return the first such message, from those that came since the last one waited for; it must come."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                while self._heard:
                    message = self._heard.pop(0)
                    if message.get_type() in names and good(message):
                        return message
                self._news.clear()
                await self._news.wait()

    async def upload(self, items: Sequence[ItemReceived], sysid: int = 11) -> int:
        """Upload a mission and return the type of the final ACK."""
        self.send(dialect.MAVLink_mission_count_message(sysid, 1, len(items)))
        while True:
            message = await self.wait_for("MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT")
            if message.get_type() == "MISSION_ACK":
                return int(message.type)
            item = items[message.seq]
            self.send(
                dialect.MAVLink_mission_item_int_message(
                    sysid, 1, item.seq, item.frame, item.command, int(item.current), 1, *item.params, item.x, item.y,
                    item.z,
                )
            )  # fmt: skip
