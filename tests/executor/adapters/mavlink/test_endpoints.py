"""Endpoints on the loopback interface and on a pseudo terminal."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import tty
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mav

from executor.adapters.mavlink.codec import MavlinkCodec
from executor.adapters.mavlink.endpoints import MOST_PEERS, Router, VehicleLink, _Datagrams, open_mavlink_links
from executor.core.interface.connection import parse_connection
from executor.core.interface.messages import Heartbeat, Message, MissionAck, SendHeartbeat
from executor.core.interface.ports import Link, LinkRequest
from executor.errors import ConnectionFailed
from executor.supervised import watch_internal_errors
from tests.executor.adapters.mavlink.test_codec import ARDUPILOT, Vehicle
from tests.executor.adapters.mavlink.test_endpoints_link import Frames
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio
MOST_BYTES = 8_000_000
"""More than the buffers of two sockets and ours take."""
BEAT = mav.MAVLink_heartbeat_message(2, ARDUPILOT, 0, 0, 3, 3)


def socket_on_loopback() -> socket.socket:
    plug = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    plug.bind(("127.0.0.1", 0))
    plug.setblocking(False)
    return plug


@asynccontextmanager
async def opened(connection: str, *, log: Frames | None = None) -> AsyncIterator[VehicleLink]:
    async with open_mavlink_links(
        {"uav1": LinkRequest(parse_connection(connection), 7, (log or Frames()).write)}
    ) as links:
        yield links["uav1"]


async def received(plug: socket.socket) -> bytes:
    async with asyncio.timeout(PATIENCE_S):
        return await asyncio.get_running_loop().sock_recv(plug, 2048)


def inbox(link: Link) -> asyncio.Queue[Message]:
    heard: asyncio.Queue[Message] = asyncio.Queue()
    link.listen(heard.put_nowait)
    return heard


async def next_of(heard: asyncio.Queue[Message]) -> Message:
    async with asyncio.timeout(PATIENCE_S):
        return await heard.get()


def beats(data: bytes) -> int:
    """Return how many heartbeats of a ground station these bytes are."""
    return sum(frame.get_type() == "HEARTBEAT" for frame in mav.MAVLink(None).parse_buffer(data) or ())


async def test_udpin_answers_where_the_vehicle_calls_from() -> None:
    port, log = free_port(), Frames()
    async with opened(f"udpin://127.0.0.1:{port}", log=log) as link:
        heard = inbox(link)
        with socket_on_loopback() as plug:
            plug.sendto(Vehicle().pack(BEAT), ("127.0.0.1", port))
            assert isinstance(await next_of(heard), Heartbeat)
            link.send(SendHeartbeat())
            frame = await received(plug)
    assert log.frames[-1] == frame
    assert beats(frame) == 1


async def test_what_came_while_the_computer_was_busy_is_not_lost() -> None:
    """Four hundred datagrams are more than a UDP port keeps by default, and a second of what PX4 says."""
    port = free_port()
    async with opened(f"udpin://127.0.0.1:{port}") as link:
        heard = inbox(link)
        vehicle = Vehicle()
        with socket_on_loopback() as plug:
            plug.setblocking(True)
            for _ in range(400):
                plug.sendto(vehicle.pack(BEAT), ("127.0.0.1", port))
        for _ in range(400):
            await next_of(heard)
        assert link.counts.missing == 0


async def test_udpout_calls_the_vehicle() -> None:
    with socket_on_loopback() as plug:
        async with opened(f"udpout://127.0.0.1:{plug.getsockname()[1]}") as link:
            heard = inbox(link)
            link.send(SendHeartbeat())
            async with asyncio.timeout(PATIENCE_S):
                _, address = await asyncio.get_running_loop().sock_recvfrom(plug, 2048)
            plug.sendto(Vehicle().pack(mav.MAVLink_mission_ack_message(255, 190, 0)), address)
            assert await next_of(heard) == MissionAck(0)


@pytest.mark.parametrize("scheme", ["udpin", "tcpin"])
async def test_a_port_that_is_taken_is_named(scheme: str) -> None:
    kind = socket.SOCK_DGRAM if scheme == "udpin" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as plug:
        plug.bind(("127.0.0.1", 0))
        if kind is socket.SOCK_STREAM:
            plug.listen()
        connection = f"{scheme}://127.0.0.1:{plug.getsockname()[1]}"
        with pytest.raises(ConnectionFailed, match=f"^{connection}: cannot be opened: Address already in use$"):
            async with opened(connection):
                pass


@pytest.mark.parametrize("scheme", ["udpout", "tcpout"])
async def test_a_host_that_is_not_known_is_named(scheme: str) -> None:
    connection = f"{scheme}://nowhere.invalid:14550"
    with pytest.raises(ConnectionFailed, match=f"^{connection}: cannot be opened: "):
        async with opened(connection):
            pass


async def test_a_vehicle_that_is_not_there_yet_costs_nothing() -> None:
    """The refusal of a closed port comes back as an error on the socket, which stays open."""
    port = free_port()
    async with opened(f"udpout://127.0.0.1:{port}") as link:
        link.send(SendHeartbeat())
        link.send(SendHeartbeat())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
            plug.setblocking(False)
            plug.bind(("127.0.0.1", port))
            link.send(SendHeartbeat())
            assert await received(plug)


class Peer:
    """A vehicle's end of a TCP connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, sysid: int = 7) -> None:
        self._reader, self._writer = reader, writer
        self._mav = mav.MAVLink(None, srcSystem=sysid, srcComponent=1)

    async def say(self, *, cut: int = 5) -> None:
        """Send a heartbeat in two pieces, behind the rest of a frame whose beginning was lost."""
        frame = bytes(BEAT.pack(self._mav))
        for piece in (frame[-4:] + frame[:cut], frame[cut:]):
            self._writer.write(piece)
            await self._writer.drain()
            await asyncio.sleep(0)

    async def hear(self) -> bytes:
        async with asyncio.timeout(PATIENCE_S):
            return await self._reader.readexactly(21)  # a heartbeat's frame

    async def leave(self) -> None:
        self._writer.close()
        await self._writer.wait_closed()


@asynccontextmanager
async def vehicle_at(port: int) -> AsyncIterator[asyncio.Queue[Peer]]:
    """Listen as a vehicle does; whoever calls comes out of the queue."""
    callers: asyncio.Queue[Peer] = asyncio.Queue()
    writers: list[asyncio.StreamWriter] = []

    def called(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        callers.put_nowait(Peer(reader, writer))

    server = await asyncio.start_server(called, "127.0.0.1", port)
    try:
        yield callers
    finally:
        server.close()
        for writer in writers:
            writer.close()
            await writer.wait_closed()


async def called(callers: asyncio.Queue[Peer]) -> Peer:
    async with asyncio.timeout(PATIENCE_S):
        return await callers.get()


async def test_tcpout_calls_until_the_vehicle_is_there_and_again_when_it_went_away() -> None:
    port = free_port()
    async with opened(f"tcpout://127.0.0.1:{port}") as link:
        heard = inbox(link)
        link.send(SendHeartbeat())  # lost: nobody is there
        async with vehicle_at(port) as callers:
            peer = await called(callers)
            for _ in range(2):
                await peer.say()
                assert isinstance(await next_of(heard), Heartbeat)
                link.send(SendHeartbeat())
                assert beats(await peer.hear()) == 1
                await peer.leave()
                peer = await called(callers)


async def test_tcpin_serves_several_vehicles_and_those_that_come_back() -> None:
    port = free_port()
    connection = parse_connection(f"tcpin://127.0.0.1:{port}")
    async with open_mavlink_links({f"uav{sysid}": LinkRequest(connection, sysid) for sysid in (7, 8)}) as links:
        for sysid in (7, 8, 7):
            link = links[f"uav{sysid}"]
            heard = inbox(link)
            peer = Peer(*await asyncio.open_connection("127.0.0.1", port), sysid)
            await peer.say()
            assert isinstance(await next_of(heard), Heartbeat)
            link.send(SendHeartbeat())
            assert beats(await peer.hear()) == 1
            await peer.leave()
        assert [link.counts.received for link in links.values()] == [2, 1]


async def test_a_vehicle_that_reads_nothing_costs_no_memory() -> None:
    """What a stalled stream cannot take is lost, as on the air."""
    log = Frames()
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as plug:
        plug.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        plug.bind(("127.0.0.1", 0))
        plug.listen()
        plug.setblocking(False)
        async with opened(f"tcpout://127.0.0.1:{plug.getsockname()[1]}", log=log) as link:
            async with asyncio.timeout(PATIENCE_S):
                theirs, _ = await asyncio.get_running_loop().sock_accept(plug)
                heard = inbox(link)
                theirs.sendall(Vehicle().pack(BEAT))
                await heard.get()
            with theirs:
                sent = 0
                log.frames.clear()
                while len(log.frames) == sent:
                    link.send(SendHeartbeat())
                    sent += 1
                    assert sent * len(log.frames[0]) < MOST_BYTES


@contextmanager
def wire() -> Iterator[tuple[int, str]]:
    """Yield the vehicle's end of a serial line, and the device's name at ours."""
    theirs, ours = pty.openpty()
    tty.setraw(theirs)
    try:
        yield theirs, os.ttyname(ours)
    finally:
        os.close(ours)
        os.close(theirs)


async def test_a_serial_line_carries_both_ways() -> None:
    with wire() as (theirs, device):
        async with opened(f"serial://{device}:57600") as link:
            heard = inbox(link)
            frame = Vehicle().pack(BEAT)
            os.write(theirs, frame[7:] + frame[:9])
            os.write(theirs, frame[9:])
            assert isinstance(await next_of(heard), Heartbeat)
            link.send(SendHeartbeat())
            assert beats(os.read(theirs, 2048)) == 1


async def test_a_device_that_is_not_there_is_named() -> None:
    with pytest.raises(ConnectionFailed, match=r"^serial:///dev/nothing:57600: cannot be opened: No such file"):
        async with opened("serial:///dev/nothing:57600"):
            pass


async def test_a_serial_port_that_another_program_has_is_refused() -> None:
    with wire() as (_, device):
        async with opened(f"serial://{device}:57600"):
            with pytest.raises(ConnectionFailed, match="cannot be opened: "):
                async with opened(f"serial://{device}:57600"):
                    pass


async def test_a_serial_device_that_is_unplugged_is_opened_again_when_it_is_back(tmp_path: Path) -> None:
    name = tmp_path / "ttyUSB0"
    with wire() as (old, device):
        name.symlink_to(device)
        async with opened(f"serial://{name}:57600") as link:
            heard = inbox(link)
            name.unlink()
            with wire() as (theirs, other):
                # What the link reads from has no other end any more: that is how a device goes.
                os.dup2(theirs, old)
                name.symlink_to(other)
                async with asyncio.timeout(PATIENCE_S):
                    while heard.empty():
                        os.write(theirs, Vehicle().pack(BEAT))
                        link.send(SendHeartbeat())
                        await asyncio.sleep(0.05)
                assert isinstance(await next_of(heard), Heartbeat)


async def test_datagrams_from_ever_new_addresses_fill_no_memory() -> None:
    link = VehicleLink(7, MavlinkCodec())
    port = _Datagrams(Router([link], MavlinkCodec()))
    beat = Vehicle().pack(BEAT)
    for number in range(3 * MOST_PEERS):
        port.datagram_received(beat, (f"10.0.{number % 7}.1", number))
        assert len(port._peers) <= MOST_PEERS + 1
    assert link.counts.received == 3 * MOST_PEERS


@pytest.mark.parametrize("scheme", ["udpin", "tcpin"])
async def test_a_mistake_in_reading_closes_no_port(scheme: str) -> None:
    kind = socket.SOCK_STREAM if scheme == "tcpin" else socket.SOCK_DGRAM
    port, vehicle, said = free_port(), Vehicle(), list[str]()
    was_said = asyncio.Event()

    def say(text: str) -> None:
        said.append(text)
        was_said.set()

    def mistaken(_: Message) -> None:
        raise KeyError("speed")

    with watch_internal_errors(say, None):
        async with opened(f"{scheme}://127.0.0.1:{port}") as link:
            stop = link.listen(mistaken)
            with socket.socket(socket.AF_INET, kind) as plug:
                plug.setblocking(False)
                loop = asyncio.get_running_loop()
                await loop.sock_connect(plug, ("127.0.0.1", port))
                await loop.sock_sendall(plug, vehicle.pack(BEAT))
                async with asyncio.timeout(PATIENCE_S):
                    await was_said.wait()
                stop()
                heard = inbox(link)
                await loop.sock_sendall(plug, vehicle.pack(BEAT))
                assert isinstance(await next_of(heard), Heartbeat)
    assert [line.partition(": ")[2] for line in said] == ["KeyError: 'speed'"]
