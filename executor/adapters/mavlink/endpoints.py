"""Endpoints (UDP, TCP and serial ports), each for all vehicles behind it, and the link to each of these vehicles.

A broken byte stream is reopened for as long as its links are needed. Meanwhile its vehicles are silent, which the link
watchpoint covers; once the links are open, nothing here raises.
"""

from __future__ import annotations

import asyncio
import os
import socket
import sys
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Hashable, Iterable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from functools import partial
from typing import cast

from executor.adapters.listeners import Listeners
from executor.adapters.mavlink.codec import DecodedFrame, FrameParser, MavlinkCodec, Sender
from executor.adapters.mavlink.frame_layout import FrameRejection, LinkSigning
from executor.core.interface import messages
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.ports import Keyring, LinkCounts, LinkRequest, LinkView
from executor.core.telemetry.vehicle_identity import AUTOPILOT
from executor.errors import ConnectionFailed
from executor.supervised import call_safely, run_beside

MOST_SOURCES = 8
"""Most addresses, or foreign systems, remembered."""
ENOUGH_FRAMES, ENOUGH_BEATS = 80, 5
"""Frames, or HEARTBEATs on a slow stream, after which frame counts are reported, with a HEARTBEAT as in a log."""
LATE_FRAMES = 32
"""Most frames behind the newest that an overtaken frame arrives: links reorder within some tenths of a second."""
KEPT_BEATS = 8
"""Number of HEARTBEATs kept to recognise late copies."""

Write = Callable[[bytes], bool]
"""Send one frame without waiting; return whether it was sent."""


def discard_frame(_: bytes) -> bool:
    """Discard a frame to a vehicle that is not known yet, or no longer connected."""
    return False


class VehicleLink(Listeners):
    """Messages of one vehicle; an endpoint delivers its frames and sets where to write."""

    def __init__(self, sysid: int, codec: MavlinkCodec, log: Callable[[bytes], None] = lambda _: None) -> None:
        super().__init__()
        self.sysid = sysid
        self.component = AUTOPILOT
        self.counts = LinkCounts(missing=0)
        self.write: Write = discard_frame
        """Set by the endpoint once it knows the vehicle's address."""
        self.radio: Hashable | None = None
        """Radio shared by several connections, if the site names one."""
        self.beside: Sequence[VehicleLink] = (self,)
        """Links of its endpoint, this one included."""
        self.connection = ""
        """Connection as in the site file."""
        self.ways, self.is_alive, self.is_used = (self,), True, True
        self.take_frame: Callable[[bytes], bool] = lambda _: True
        """Called with every frame of the vehicle; returns whether it is new, as it may have arrived over another link
        before."""
        self._codec = codec
        self._log = log
        self._arrived = self._missing = 0
        """Frames received and missing, of the autopilot alone, as each component has its own sequence numbers."""
        self._told = (0, 0)
        """Received and missing frames at the last report."""
        self._bytes = self._beats_untold = 0
        """Bytes of all frames in both directions, and HEARTBEATs, since the last report."""
        self._source = ""
        self._beat_source = ""
        self._sources: set[str] = set()
        """All source addresses of its frames."""
        self._told_places: tuple[str, ...] = ()
        self._last_seq: int | None = None
        self._beat_seq: int | None = None
        """Sequence number of the newest HEARTBEAT."""
        self._beats: deque[bytes] = deque(maxlen=KEPT_BEATS)
        """Last HEARTBEATs as received."""
        self._absent: set[int] = set()
        """Missing sequence numbers that may still arrive."""

    @property
    def peer(self) -> Hashable | None:
        """Return the address to write to: a port, or an address behind one."""
        return None if self.write is discard_frame else self.radio or self.write

    def send(self, message: messages.Outgoing) -> None:
        """Send one message; dropped until the vehicle's address is known."""
        if self.write is discard_frame:
            return
        frame = self._codec.encode(message, self.sysid, self.component)
        self.send_frame(frame, to_all=isinstance(message, messages.SendHeartbeat))

    def send_frame(self, frame: bytes, *, to_all: bool = False) -> None:
        """Send a frame unchanged; `to_all` if it is for all systems behind the same port."""
        self._bytes += len(frame)
        if self.write(frame):
            for one in self.beside if to_all else (self,):
                if one.write == self.write:
                    one.record_sent(frame)

    def record_sent(self, frame: bytes) -> None:
        """Record a frame that is sent to this vehicle, possibly among others."""
        self._log(frame)

    def describe_links(self) -> tuple[LinkView, ...]:
        """Return nothing, as there is only one link."""
        return ()

    def receive(self, received: DecodedFrame, source: str = "", write: Write | None = None) -> None:
        """Take a frame of this vehicle.

        Args:
            received: The frame.
            source: Source address, if any.
            write: How to answer there; other senders with the vehicle's sysid are not answered.
        """
        if received.own and write is not None:
            self.write = write
        if received.own and source and source != self._source:
            self._note_source(source)
        self._log(received.frame)
        self._bytes += len(received.frame)
        told = None if self._is_outdated(received) else received.message
        self._count(received)
        if isinstance(told, messages.Heartbeat):
            self.component = received.compid
            if received.own:
                self._beat_source = source
            self._report_traffic()
        if not self.take_frame(received.frame):
            return
        for message in (told, *received.more):
            if message is not None:
                self.hear(message)

    def _report_traffic(self) -> None:
        """Report frames received and missing once there are enough."""
        received, missing = self._arrived - self._told[0], self._missing - self._told[1]
        self._beats_untold += 1
        if received + missing >= ENOUGH_FRAMES or self._beats_untold >= ENOUGH_BEATS:
            told = messages.Traffic(received, max(0, missing), self._bytes)
            self._told, self._bytes, self._beats_untold = (self._arrived, self._missing), 0, 0
            self.hear(told)

    def count_refused(self, refusal: FrameRejection) -> None:
        """Count a rejected frame with this vehicle's id, or over its connection."""
        self.counts.refused[refusal.value] = self.counts.refused.get(refusal.value, 0) + 1

    def _note_source(self, source: str) -> None:
        """Note a new source address; a change back to an earlier one means two vehicles, not one that moved."""
        if source in self._sources:
            places = tuple(sorted(self._sources))
            if places != self._told_places:
                self._told_places = places
                self.hear(messages.DoubleHeard(self.sysid, places))
        elif len(self._sources) < MOST_SOURCES:
            self._sources.add(source)
        self._source = source

    def receive_foreign(self, received: DecodedFrame, source: str = "") -> None:
        """Take a frame over this vehicle's connection from a system that is not a vehicle of the site."""
        self.counts.foreign += 1
        if len(self.counts.strangers) < MOST_SOURCES:
            self.counts.strangers.setdefault(received.sysid, source)
        # A SiK radio sends as a system of its own (51), from the address of the vehicle behind it.
        if isinstance(received.message, messages.Radio) and source != self._beat_source:
            return
        told = received.message
        ordered = isinstance(told, messages.OrderSeen) and told.to in {0, self.sysid}
        if told is not None and (ordered or isinstance(told, messages.StationHeard | messages.Radio)):
            self.hear(told)

    def _is_outdated(self, received: DecodedFrame) -> bool:
        """Return whether a HEARTBEAT is older than the last one, so that its mode is outdated.

        It was overtaken, or it is a copy. Any other step back restarts the count: after a silence of any number of
        frames, or after a reboot.
        """
        if not received.own or not isinstance(received.message, messages.Heartbeat):
            return False
        last, newest, came = self._beat_seq, self._last_seq, received.frame in self._beats
        if not came:
            self._beats.append(received.frame)
        if last is not None and newest is not None and (came or received.seq in self._absent):
            older = 0 < (last - received.seq) % 256 < 128
            if older and (newest - received.seq) % 256 <= LATE_FRAMES:
                return True
        self._beat_seq = received.seq
        return False

    def _count(self, received: DecodedFrame) -> None:
        self.counts.received += 1
        if not received.own:
            return
        self._arrived += 1
        if self._last_seq is not None:
            gap = (received.seq - self._last_seq) % 256
            if gap == 0 or gap > 128:
                # A duplicate, or an overtaken frame: then it is not missing after all.
                self._missing -= received.seq in self._absent
                self._absent.discard(received.seq)
                self.counts.missing = self._missing
                return
            self._missing += gap - 1
            self._absent |= {(self._last_seq + step) % 256 for step in range(1, gap)}
            self._absent.discard(received.seq)
        self._last_seq = received.seq
        self.counts.missing = self._missing


MOST_PEERS = 1000
"""Most addresses kept: a sender can use any number of them."""
AGAIN_S = 0.5
"""Real seconds between two attempts to reopen a stream."""
STALLED_BYTES = 8192
"""Unsent bytes, 0.7 s at 115200 baud, at which a stream counts as stalled; old messages are worthless."""
UNACKNOWLEDGED_MS = 8000
"""Longest time without acknowledgement before a TCP peer counts as lost; our heartbeats probe it every second."""
READ_BYTES = 4096
RECEIVE_BYTES = 1 << 19
"""Receive buffer of a UDP port while the computer is busy: the usual 208 kB hold a fifth of a second of PX4's messages
at four times real time; the rest would be lost."""


Tap = Callable[[DecodedFrame, Collection[int]], None]
"""Called with every frame of vehicles and radios, and the vehicles that it is about."""


def leave_frame(received: DecodedFrame, about: Collection[int]) -> None:
    """Ignore a frame."""


class Router:
    """Vehicles behind one endpoint: routes frames to their links, and answers back."""

    def __init__(self, links: Iterable[VehicleLink], codec: MavlinkCodec, tap: Tap = leave_frame) -> None:
        """Route to these links, and pass their vehicles' and radio's frames to a tap."""
        self.codec = codec
        self._tap = tap
        self._links = {link.sysid: link for link in links}
        for link in self._links.values():
            link.beside = tuple(self._links.values())

    def route_frames(self, frames: Iterable[DecodedFrame], write: Write, source: str = "") -> None:
        """Route frames; a vehicle that sent one, from the address `source`, is answered with `write`."""
        for received in frames:
            link = self._links.get(received.sysid)
            if received.refused is not None:
                for one in self._links.values() if link is None else (link,):
                    one.count_refused(received.refused)
                continue
            if link is None:
                for other in self._links.values():
                    other.receive_foreign(received, source)
                if isinstance(received.message, messages.Radio):
                    self._tap(received, self._links)
                continue
            link.receive(received, source, write)
            if link.is_used:
                self._tap(received, (received.sysid,))

    def connect_all(self, write: Write) -> None:
        """Assume all vehicles at the other end, before they have sent anything."""
        for link in self._links.values():
            link.write = write

    def accept(self, write: Write) -> None:
        """Note a new connection; its messages show which vehicles it serves."""

    def disconnect(self, write: Write) -> None:
        """Note that `write` reaches no vehicle any more."""
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
        # asyncio's own datagram transport is no subclass of the class in its documentation (3.11).
        self._transport = cast("asyncio.DatagramTransport", transport)
        with suppress(OSError):
            transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        if transport.get_extra_info("peername") is not None:
            self._router.connect_all(partial(self._write, None))

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        if len(self._peers) > MOST_PEERS:
            self._peers.clear()  # active senders return with their next datagram
        write = self._peers.setdefault(addr, partial(self._write, addr))
        # asyncio would close the port for good on an internal error.
        call_safely("reading a datagram", self._receive, data, write, f"{addr[0]}:{addr[1]}")

    def _receive(self, data: bytes, write: Write, source: str) -> None:
        self._router.route_frames(self._router.codec.decode(data), write, source)

    def error_received(self, exc: Exception) -> None:
        """Ignore the error of a port without a listener; the link-loss watchpoint covers it."""

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
        else:
            self._router.accept(self._write)

    def data_received(self, data: bytes) -> None:
        call_safely("reading a connection", self._receive, data)

    def _receive(self, data: bytes) -> None:
        self._router.route_frames(self._router.codec.read(self._cutter.feed(data)), self._write)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        self._router.disconnect(self._write)
        self._peers.discard(self)
        self.lost.set()

    def close(self) -> None:
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
        option = getattr(socket, "TCP_USER_TIMEOUT", None)  # Linux only; other systems use their own time-out
        if option is not None:
            plug.setsockopt(socket.IPPROTO_TCP, option, UNACKNOWLEDGED_MS)


def _check_serial_ports() -> None:
    """Refuse serial ports on Windows; a check of its own, behind which type checkers go on."""
    if sys.platform == "win32":
        raise OSError("a serial port is read on Linux and macOS (on Windows: WSL 2)")


class _SerialPort:
    """An open serial port; reads and writes never wait."""

    def __init__(self, router: Router, connection: Connection) -> None:
        _check_serial_ports()
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
            # Bytes that the port cannot take now are lost: the receiver finds the next frame after a truncated one.
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
    *,
    one_radio: bool = False,
    station: Sender = messages.GROUND_STATION,
    tap: Tap = leave_frame,
) -> AsyncIterator[Mapping[str, VehicleLink]]:
    """Open the links to vehicles by name; those with the same connection share one endpoint.

    Args:
        orders: The links.
        keyring: Key for signing; frames of others without a valid signature are rejected.
        radios: Radios whose RADIO_STATUS is accepted without a signature, as for `MavlinkCodec`.
        one_radio: Whether all links use one radio.
        station: Our own system and component.
        tap: Called with received frames.

    Raises:
        ConnectionFailed: A port is in use, a device is missing, or a host is unknown.
    """
    links: dict[str, VehicleLink] = {}
    async with AsyncExitStack() as stack:
        for number, connection in enumerate(dict.fromkeys(order.connection for order in orders.values())):
            behind_it = [order for order in orders.values() if order.connection == connection]
            signing = None if keyring is None else LinkSigning(keyring.key, number, keyring.unix_s)
            codec = MavlinkCodec(signing, radios, frozenset(order.sysid for order in behind_it), station=station)
            behind = {
                name: VehicleLink(order.sysid, codec, order.log)
                for name, order in orders.items()
                if order.connection == connection
            }
            links |= behind
            for link in behind.values():
                link.connection = str(connection)
                link.radio = "the one radio" if one_radio else None
            try:
                may_be_absent = all(order.may_be_absent for order in behind_it)
                router = Router(behind.values(), codec, tap)
                await open_endpoint(connection, router, stack, may_be_absent=may_be_absent)
            except (OSError, ValueError) as error:
                raise ConnectionFailed(f"{connection}: cannot be opened: {describe_open_error(error)}") from error
        yield {name: links[name] for name in orders}
    await asyncio.sleep(0)  # a closed transport releases its socket in the loop's next round


async def open_endpoint(
    connection: Connection, router: Router, stack: AsyncExitStack, *, may_be_absent: bool = False
) -> None:
    """Open an endpoint, a device possibly later, and keep it open until the stack is unwound."""
    loop, address = asyncio.get_running_loop(), (connection.where, connection.number)
    match connection.scheme:
        case Scheme.UDP_IN | Scheme.UDP_OUT:
            ends = (address, None) if connection.scheme is Scheme.UDP_IN else (None, address)
            transport, _ = await loop.create_datagram_endpoint(lambda: _Datagrams(router), *ends)
            stack.callback(transport.close)
        case Scheme.TCP_IN:
            peers: set[_TcpPeer] = set()
            server = await loop.create_server(lambda: _TcpPeer(router, peers), *address)
            stack.callback(_close_connections, server, peers)
        case Scheme.TCP_OUT:
            # The vehicle may appear later, but its host name must be known now.
            await loop.getaddrinfo(*address, type=socket.SOCK_STREAM)
            peer = partial(_TcpPeer, router, set[_TcpPeer](), we_called=True)

            async def call() -> _TcpPeer:
                return (await loop.create_connection(peer, *address))[1]

            await stack.enter_async_context(run_beside(f"calling {connection}", partial(_keep_open, call)))
        case Scheme.SERIAL:
            plugged = [] if may_be_absent else [_SerialPort(router, connection)]

            async def plug() -> _SerialPort:
                return plugged.pop() if plugged else _SerialPort(router, connection)

            await stack.enter_async_context(run_beside(f"keeping {connection} open", partial(_keep_open, plug)))


def _close_connections(server: asyncio.Server, peers: set[_TcpPeer]) -> None:
    server.close()
    for peer in tuple(peers):
        peer.close()


async def _keep_open(opens: Callable[[], Awaitable[_TcpPeer | _SerialPort]]) -> None:
    """Open a stream, and reopen it whenever it is lost or its device was unplugged."""
    while True:
        with suppress(OSError):  # pyserial's errors are OSErrors
            stream = await opens()
            try:
                await stream.lost.wait()
            finally:
                stream.close()
        await asyncio.sleep(AGAIN_S)


def describe_open_error(error: Exception) -> str:
    """Return why a connection cannot be opened, in words."""
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, socket.gaierror) or not number:
        return str(error.args[-1] if error.args else error)
    return os.strerror(number)
