"""Endpoints: UDP, TCP and serial ports, each for all vehicles behind it.

A byte stream that breaks is opened again for as long as the links are wanted. Meanwhile its vehicles are silent, which
is what the link watchpoint is for; nothing here raises once the links are open.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import AsyncIterator, Collection, Iterable, Mapping
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from functools import partial
from typing import cast

from executor.adapters.mavlink.codec import DecodedFrame, MavlinkCodec, Sender
from executor.adapters.mavlink.frame_layout import LinkSigning
from executor.adapters.mavlink.frame_parser import FrameParser
from executor.adapters.mavlink.link import VehicleLink, Write, discard_frame
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.ports import Keyring, LinkRequest
from executor.errors import ConnectionFailed
from executor.supervised import call_safely, run_beside

MOST_PEERS = 1000
"""Addresses that are kept: anybody can send from any number of them."""
AGAIN_S = 0.5
"""Real seconds between two attempts to open a stream again."""
STALLED_BYTES = 8192
"""A stream that has so much unsent, 0.7 s at 115200 baud, takes no more: old messages are worth nothing."""
UNACKNOWLEDGED_MS = 8000
"""A TCP peer that acknowledges nothing for so long is gone; our heartbeats ask it every second."""
READ_BYTES = 4096
RECEIVE_BYTES = 1 << 19
"""What may wait in a UDP port while the computer is busy: the usual 208 kB are a fifth of a second of what PX4 says at
four times real time, and the rest would be lost."""


class Router:
    """The vehicles behind one endpoint: frames to the right link, and the way back from each."""

    def __init__(self, links: Iterable[VehicleLink], codec: MavlinkCodec) -> None:
        """Route to these links."""
        self.codec = codec
        self._links = {link.sysid: link for link in links}

    def route_frames(self, frames: Iterable[DecodedFrame], write: Write, source: str = "") -> None:
        """Hand frames on; a vehicle that sent one, from the address `source`, is answered with `write`."""
        for received in frames:
            link = self._links.get(received.sysid)
            if received.refused is not None:
                for one in self._links.values() if link is None else (link,):
                    one.count_refused(received.refused)
                continue
            if link is None:
                for other in self._links.values():
                    other.receive_foreign(received, source)
                continue
            link.receive(received, source, write)

    def connect_all(self, write: Write) -> None:
        """Note that all vehicles are at the other end, before they have said anything."""
        for link in self._links.values():
            link.write = write

    def disconnect(self, write: Write) -> None:
        """Note that nobody is reached with `write` any more."""
        for link in self._links.values():
            if link.write == write:
                link.write = discard_frame


class _Datagrams(asyncio.DatagramProtocol):
    """A UDP port."""

    def __init__(self, router: Router) -> None:
        self._router = router
        self._transport: asyncio.DatagramTransport | None = None
        self._peers: dict[tuple[str, int], Write] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # asyncio's own datagram transport is no subclass of the class that its documentation names (3.11).
        self._transport = cast("asyncio.DatagramTransport", transport)
        with suppress(OSError):
            transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        if transport.get_extra_info("peername") is not None:
            self._router.connect_all(partial(self._write, None))

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        if len(self._peers) > MOST_PEERS:
            self._peers.clear()  # who still sends is there again with the next datagram
        write = self._peers.setdefault(addr, partial(self._write, addr))
        # asyncio would close the port for good at a mistake of ours.
        call_safely("reading a datagram", self._receive, data, write, f"{addr[0]}:{addr[1]}")

    def _receive(self, data: bytes, write: Write, source: str) -> None:
        self._router.route_frames(self._router.codec.decode(data), write, source)

    def error_received(self, exc: Exception) -> None:
        """A port where nobody listens yet answers with an error; the link-loss watchpoint covers it."""

    def _write(self, addr: tuple[str, int] | None, frame: bytes) -> bool:
        if self._transport is None or self._transport.is_closing():
            return False
        self._transport.sendto(frame, addr)
        return True


class _TcpPeer(asyncio.Protocol):
    """One TCP connection."""

    def __init__(self, router: Router, peers: set[_TcpPeer], *, we_called: bool = False) -> None:
        self.lost = asyncio.Event()
        self._router = router
        self._peers = peers
        self._we_called = we_called
        self._cutter = FrameParser(systems=router.codec.systems)
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)
        self._peers.add(self)
        _end_when_unacknowledged(transport.get_extra_info("socket"))
        if self._we_called:
            self._router.connect_all(self._write)

    def data_received(self, data: bytes) -> None:
        call_safely("reading a connection", self._receive, data)

    def _receive(self, data: bytes) -> None:
        self._router.route_frames(self._router.codec.read(self._cutter.feed(data)), self._write)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        self._router.disconnect(self._write)
        self._peers.discard(self)
        self.lost.set()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def _write(self, frame: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing() or transport.get_write_buffer_size() > STALLED_BYTES:
            return False
        transport.write(frame)
        return True


def _end_when_unacknowledged(plug: socket.socket) -> None:
    with suppress(OSError):
        plug.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        option = getattr(socket, "TCP_USER_TIMEOUT", None)  # Linux; elsewhere the system's own patience holds
        if option is not None:
            plug.setsockopt(socket.IPPROTO_TCP, option, UNACKNOWLEDGED_MS)


class _SerialPort:
    """One opened serial port; reads and writes never wait."""

    def __init__(self, router: Router, connection: Connection) -> None:
        import serial

        self.lost = asyncio.Event()
        self._router = router
        self._cutter = FrameParser(systems=router.codec.systems)
        # Exclusive: two programs on one port would each read half of the frames.
        self._port = serial.Serial(connection.where, connection.number, timeout=0, write_timeout=0, exclusive=True)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._port.fileno(), self._on_readable)
        router.connect_all(self._write)

    def close(self) -> None:
        if self._port.is_open:
            self._router.disconnect(self._write)
            self._loop.remove_reader(self._port.fileno())
            self._port.close()
            self.lost.set()

    def _on_readable(self) -> None:
        try:
            data = os.read(self._port.fileno(), READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data = b""
        if data:
            call_safely("reading a serial port", self._receive, data)
        else:
            self.close()  # the device was unplugged

    def _receive(self, data: bytes) -> None:
        self._router.route_frames(self._router.codec.read(self._cutter.feed(data)), self._write)

    def _write(self, frame: bytes) -> bool:
        if not self._port.is_open:
            return False
        try:
            # What the port cannot take now is lost: the receiver finds the next frame behind a half one.
            return os.write(self._port.fileno(), frame) == len(frame)
        except (BlockingIOError, InterruptedError):
            return False
        except OSError:
            self.close()
            return False


@asynccontextmanager
async def open_mavlink_links(
    orders: Mapping[str, LinkRequest],
    keyring: Keyring | None = None,
    radios: Collection[Sender] | None = None,
) -> AsyncIterator[Mapping[str, VehicleLink]]:
    """Open the links to vehicles by name; those with the same connection share one endpoint.

    Args:
        orders: The links.
        keyring: Frames are signed, and those of others that are not are refused.
        radios: Whose RADIO_STATUS is heard without a signature, as for `Codec`.

    Raises:
        ConnectionFailed: a port is taken, a device is not there, or a host is not known.
    """
    links: dict[str, VehicleLink] = {}
    async with AsyncExitStack() as stack:
        for number, connection in enumerate(dict.fromkeys(order.connection for order in orders.values())):
            behind_it = [order for order in orders.values() if order.connection == connection]
            signing = None if keyring is None else LinkSigning(keyring.key, number, keyring.unix_s)
            codec = MavlinkCodec(signing, radios, frozenset(order.sysid for order in behind_it))
            behind = {
                name: VehicleLink(order.sysid, codec, order.log)
                for name, order in orders.items()
                if order.connection == connection
            }
            links |= behind
            try:
                await _open(connection, Router(behind.values(), codec), stack)
            except (OSError, ValueError) as error:
                raise ConnectionFailed(f"{connection}: cannot be opened: {_describe_error(error)}") from error
        yield {name: links[name] for name in orders}
    await asyncio.sleep(0)  # a closed transport lets go of its socket in the loop's next round


async def _open(connection: Connection, router: Router, stack: AsyncExitStack) -> None:
    """Open an endpoint, and keep it open until the stack is unwound."""
    loop, address = asyncio.get_running_loop(), (connection.where, connection.number)
    match connection.scheme:
        case Scheme.UDP_IN:
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(router), local_addr=address)
            stack.callback(transport.close)
        case Scheme.UDP_OUT:
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(router), remote_addr=address)
            stack.callback(transport.close)
        case Scheme.TCP_IN:
            peers: set[_TcpPeer] = set()
            server = await loop.create_server(lambda: _TcpPeer(router, peers), *address)
            stack.callback(_close_connections, server, peers)
        case Scheme.TCP_OUT:
            # Whether the vehicle is there yet does not matter, whether its name is known does.
            await loop.getaddrinfo(*address, type=socket.SOCK_STREAM)
            await stack.enter_async_context(
                run_beside(f"calling {connection}", partial(_keep_connecting, address, router))
            )
        case Scheme.SERIAL:
            plug = _SerialDevice(router, connection)
            await stack.enter_async_context(run_beside(f"keeping {connection} open", plug.keep_open))


def _close_connections(server: asyncio.Server, peers: set[_TcpPeer]) -> None:
    server.close()
    for peer in tuple(peers):
        peer.abort()


async def _keep_connecting(address: tuple[str, int], router: Router) -> None:
    """Connect, and connect again whenever the connection is lost."""
    loop = asyncio.get_running_loop()
    while True:
        with suppress(OSError):
            _, peer = await loop.create_connection(lambda: _TcpPeer(router, set(), we_called=True), *address)
            try:
                await peer.lost.wait()
            finally:
                peer.abort()
        await asyncio.sleep(AGAIN_S)


class _SerialDevice:
    """A serial device that may be unplugged."""

    def __init__(self, router: Router, connection: Connection) -> None:
        """Open it.

        Raises:
            OSError: it is not there.
        """
        self._router = router
        self._connection = connection
        self._port: _SerialPort | None = _SerialPort(router, connection)

    async def keep_open(self) -> None:
        """Wait until the device is unplugged, and open it again when it is back."""
        while True:
            with suppress(OSError):  # pyserial's errors are
                port = self._port or _SerialPort(self._router, self._connection)
                self._port = None
                try:
                    await port.lost.wait()
                finally:
                    port.close()
            await asyncio.sleep(AGAIN_S)


def _describe_error(error: Exception) -> str:
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, socket.gaierror) or not number:
        return str(error.args[-1] if error.args else error)
    return os.strerror(number)
