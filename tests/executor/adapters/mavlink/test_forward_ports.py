"""Ports of other stations on the loopback interface: they are opened, called, lost and opened again."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from typing import TypeVar

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink import forward
from executor.adapters.mavlink.endpoints import VehicleLink, open_mavlink_links
from executor.adapters.mavlink.forward import Forwarder, open_station_ports
from executor.core.forwarding import ForwardRules
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import Heartbeat, Message, OrderSeen, StationActed
from executor.core.interface.ports import LinkRequest
from executor.errors import ConnectionFailed
from tests.executor.adapters.mavlink.test_codec import Vehicle
from tests.executor.adapters.mavlink.test_endpoints import BEAT, inbox, next_of, received, socket_on_loopback
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio
LOCAL = "127.0.0.1"
Heard = TypeVar("Heard", bound=Message)
RTL = bytes(mav.MAVLink_command_long_message(7, 1, 20, 0, *[0.0] * 7).pack(mav.MAVLink(None, 250, 190)))


class Ground:
    """Our end of one vehicle, and the vehicle."""

    def __init__(self, link: VehicleLink, plug: socket.socket, port: int) -> None:
        self.link, self._plug, self._port = link, plug, port
        self.heard = inbox(link)
        self.vehicle = Vehicle()

    def beat(self) -> bytes:
        frame = self.vehicle.pack(BEAT)
        self._plug.sendto(frame, (LOCAL, self._port))
        return frame

    async def hear(self, kind: type[Heard]) -> Heard:
        while not isinstance(message := await next_of(self.heard), kind):
            pass
        return message

    async def order(self) -> bytes:
        return await received(self._plug)


@asynccontextmanager
async def beside(*connections: str, strict: bool = True) -> AsyncIterator[Ground]:
    """Yield our end of a vehicle with ports for other stations, once the vehicle was heard."""
    port, now_s = free_port(), asyncio.get_running_loop().time
    forwarder = Forwarder(ForwardRules(255, frozenset({7}), allow_orders=True), now_s)
    order = LinkRequest(parse_connection(f"udpin://{LOCAL}:{port}"), 7)
    with socket_on_loopback() as plug:
        async with open_mavlink_links({"uav1": order}, tap=forwarder.tap) as links:
            forwarder.links[7] = links["uav1"]
            ground = Ground(links["uav1"], plug, port)
            ports = [parse_connection(text) for text in connections]
            async with open_station_ports(forwarder, ports, strict=strict):
                ground.beat()
                await ground.hear(Heartbeat)
                yield ground


async def read_frame(reader: asyncio.StreamReader, frame: bytes) -> None:
    async with asyncio.timeout(PATIENCE_S):
        assert await reader.readexactly(len(frame)) == frame


async def test_a_station_that_we_call_by_udp_hears_at_once_and_orders() -> None:
    with socket_on_loopback() as station:
        async with beside(f"udpout://{LOCAL}:{station.getsockname()[1]}") as ground:
            assert len(await received(station)) > 0  # the first
            frame = ground.beat()
            async with asyncio.timeout(PATIENCE_S):
                data, ours = await asyncio.get_running_loop().sock_recvfrom(station, 2048)
            assert data == frame
            station.sendto(RTL, ours)
            assert await ground.order() == RTL
            assert await ground.hear(OrderSeen) == OrderSeen(20, None, 250, 7)


async def test_a_station_that_calls_us_by_udp_hears_once_it_has_spoken() -> None:
    port = free_port()
    async with beside(f"udpin://{LOCAL}:{port}") as ground:
        with socket_on_loopback() as station:
            station.sendto(RTL, (LOCAL, port))
            assert await ground.order() == RTL
            frame = ground.beat()
            assert await received(station) == frame


async def test_stations_that_call_us_by_tcp_hear_without_a_word_of_theirs() -> None:
    port = free_port()
    async with beside(f"tcpin://{LOCAL}:{port}") as ground:
        first, wrote = await asyncio.open_connection(LOCAL, port)
        second, other = await asyncio.open_connection(LOCAL, port)
        with closing(wrote), closing(other):
            wrote.write(RTL[:9])
            other.write(RTL)
            assert await ground.order() == RTL
            wrote.write(RTL[9:])
            assert await ground.order() == RTL, "whatever it was cut into"
            frame = ground.beat()
            await read_frame(first, frame)
            await read_frame(second, frame)


async def test_a_station_that_we_call_by_tcp_is_called_again_when_it_is_lost() -> None:
    port, came = free_port(), asyncio.Queue[tuple[asyncio.StreamReader, asyncio.StreamWriter]]()

    async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        came.put_nowait((reader, writer))

    async with asyncio.timeout(PATIENCE_S):
        server = await asyncio.start_server(take, LOCAL, port)
        async with server, beside(f"tcpout://{LOCAL}:{port}") as ground:
            _, first = await came.get()
            first.transport.abort()
            lost = await ground.hear(StationActed)
            reader, second = await came.get()
            opened = await ground.hear(StationActed)
            await read_frame(reader, ground.beat())
            second.close()
    assert (lost, opened) == (
        StationActed(0, 0, f"tcpout://{LOCAL}:{port} is lost; it is opened again"),
        StationActed(0, 0, f"tcpout://{LOCAL}:{port} is open again"),
    )


async def test_a_port_that_is_taken_is_one_line_before_the_flight() -> None:
    with socket_on_loopback() as plug:
        connection = f"udpin://{LOCAL}:{plug.getsockname()[1]}"
        with pytest.raises(
            ConnectionFailed, match=f"^forward.to: {connection}: cannot be opened: Address already in use$"
        ):
            async with beside(connection):
                pass


async def test_a_port_that_is_taken_does_not_keep_us_from_vehicles_in_the_air(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forward, "AGAIN_S", 0.05)
    with socket_on_loopback() as plug:
        port = plug.getsockname()[1]
        async with beside(f"udpin://{LOCAL}:{port}", strict=False) as ground:
            ground.beat()
            failed = await ground.hear(StationActed)
            assert failed == StationActed(
                0, 0, f"udpin://{LOCAL}:{port}: cannot be opened: Address already in use", passed=False
            )
            plug.close()
            while failed == StationActed(0, 0, failed.words, passed=False):
                failed = await ground.hear(StationActed)
            assert failed.words == f"udpin://{LOCAL}:{port} is open again"
            with socket_on_loopback() as station:
                async with asyncio.timeout(PATIENCE_S):
                    station.sendto(RTL, (LOCAL, port))
                    assert await ground.order() == RTL


async def test_an_unknown_host_is_one_line_before_the_flight() -> None:
    with pytest.raises(ConnectionFailed, match=r"^forward\.to: .*: cannot be opened: "):
        async with beside("udpout://no.such.host.invalid:14550"):
            pass
