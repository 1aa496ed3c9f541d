"""Endpoints, UDP, TCP and serial ports, each for all vehicles behind it, and the link to each of these vehicles.

A byte stream that breaks is opened again for as long as the links are wanted. Meanwhile its vehicles are silent, which
is what the link watchpoint is for; nothing here raises once the links are open.
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
"""Addresses, or strange systems, that are remembered."""
ENOUGH_FRAMES, ENOUGH_BEATS = 80, 5
"""Counts of frames are handed on with a HEARTBEAT once there are as many, as from a log; or, where little comes, with
every fifth."""
LATE_FRAMES = 32
"""A frame that is this far behind the newest may have been overtaken: links reorder within some tenths of a second."""
KEPT_BEATS = 8
"""HEARTBEATs of which a copy that comes late is known."""

Write = Callable[[bytes], bool]
"""Sends one frame without waiting; says whether it went anywhere."""


def discard_frame(_: bytes) -> bool:
    """Write to a vehicle that is not known yet, or not connected any more."""
    return False


class VehicleLink(Listeners):
    """Messages of one vehicle; an endpoint brings its frames and says where to write to."""

    def __init__(self, sysid: int, codec: MavlinkCodec, log: Callable[[bytes], None] = lambda _: None) -> None:
        super().__init__()
        self.sysid = sysid
        self.component = AUTOPILOT
        self.counts = LinkCounts(missing=0)
        self.write: Write = discard_frame
        """Set by the endpoint when it knows where the vehicle is."""
        self.radio: Hashable | None = None
        """The radio behind several connections, where the site says that there is one."""
        self.beside: Sequence[VehicleLink] = (self,)
        """The links of its endpoint, this one among them."""
        self.connection = ""
        """As the site file has it."""
        self.ways, self.is_alive, self.is_used = (self,), True, True
        self.take_frame: Callable[[bytes], bool] = lambda _: True
        """Called with every frame of the vehicle; whether it is news: the same may have come over another link."""
        self._codec = codec
        self._log = log
        self._arrived = self._missing = 0
        """Frames of the autopilot alone: every component numbers its own."""
        self._told = (0, 0)
        """Arrived and missing frames when they were handed on last."""
        self._bytes = self._beats_untold = 0
        """Of all frames, both ways, and its HEARTBEATs, since then."""
        self._source = ""
        self._beat_source = ""
        self._sources: set[str] = set()
        """Every address that its frames came from."""
        self._told_places: tuple[str, ...] = ()
        self._last_seq: int | None = None
        self._beat_seq: int | None = None
        """Of the newest HEARTBEAT."""
        self._beats: deque[bytes] = deque(maxlen=KEPT_BEATS)
        """The last HEARTBEATs as they came."""
        self._absent: set[int] = set()
        """Sequence numbers that were passed over, as long as they may still come."""

    @property
    def peer(self) -> Hashable | None:
        """Where it is written to: a port, or an address behind one."""
        return None if self.write is discard_frame else self.radio or self.write

    def send(self, message: messages.Outgoing) -> None:
        """Send one message; before the vehicle's address is known there is nowhere to send it."""
        if self.write is discard_frame:
            return
        frame = self._codec.encode(message, self.sysid, self.component)
        self.send_frame(frame, to_all=isinstance(message, messages.SendHeartbeat))

    def send_frame(self, frame: bytes, *, to_all: bool = False) -> None:
        """Send a frame as it is; `to_all` if it is for everybody behind the same port."""
        self._bytes += len(frame)
        if self.write(frame):
            for one in self.beside if to_all else (self,):
                if one.write == self.write:
                    one.record_sent(frame)

    def record_sent(self, frame: bytes) -> None:
        """Record a frame that this vehicle is sent, maybe with others."""
        self._log(frame)

    def describe_links(self) -> tuple[LinkView, ...]:
        """It is one link: nothing is to be told apart."""
        return ()

    def receive(self, received: DecodedFrame, source: str = "", write: Write | None = None) -> None:
        """Take a frame of this vehicle.

        Args:
            received: The frame.
            source: The address that it came from, where there is one.
            write: How to answer there; others that use the vehicle's sysid are not answered.
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
        """Hand on what came and what did not, once it is enough to say something."""
        received, missing = self._arrived - self._told[0], self._missing - self._told[1]
        self._beats_untold += 1
        if received + missing >= ENOUGH_FRAMES or self._beats_untold >= ENOUGH_BEATS:
            told = messages.Traffic(received, max(0, missing), self._bytes)
            self._told, self._bytes, self._beats_untold = (self._arrived, self._missing), 0, 0
            self.hear(told)

    def count_refused(self, refusal: FrameRejection) -> None:
        """Count a frame that claims to be this vehicle's, or came over its connection, and is not believed."""
        self.counts.refused[refusal.value] = self.counts.refused.get(refusal.value, 0) + 1

    def _note_source(self, source: str) -> None:
        """Note another address; one that comes back to an earlier one is two vehicles, not one that moved."""
        if source in self._sources:
            places = tuple(sorted(self._sources))
            if places != self._told_places:
                self._told_places = places
                self.hear(messages.DoubleHeard(self.sysid, places))
        elif len(self._sources) < MOST_SOURCES:
            self._sources.add(source)
        self._source = source

    def receive_foreign(self, received: DecodedFrame, source: str = "") -> None:
        """Take a frame that came over this vehicle's connection, of a system that is nobody's vehicle."""
        self.counts.foreign += 1
        if len(self.counts.strangers) < MOST_SOURCES:
            self.counts.strangers.setdefault(received.sysid, source)
        # A SiK radio speaks as a system of its own (51), from where the vehicle behind it does.
        if isinstance(received.message, messages.Radio) and source != self._beat_source:
            return
        told = received.message
        ordered = isinstance(told, messages.OrderSeen) and told.to in {0, self.sysid}
        if told is not None and (ordered or isinstance(told, messages.StationHeard | messages.Radio)):
            self.hear(told)

    def _is_outdated(self, received: DecodedFrame) -> bool:
        """Return whether a HEARTBEAT is older than one that came before it: its mode is one that was.

        It was passed over, or it is a copy. Whatever else seems to be behind counts anew: after a silence of any number
        of frames, or after a reboot.
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
                # A duplicate, or a frame that was overtaken on the way: then it is not missing after all.
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


Tap = Callable[[DecodedFrame, Collection[int]], None]
"""Is shown every frame of vehicles and radios, with the vehicles that it is about."""


def leave_frame(received: DecodedFrame, about: Collection[int]) -> None:
    """Do nothing with a frame."""


class Router:
    """The vehicles behind one endpoint: frames to the right link, and the way back from each."""

    def __init__(self, links: Iterable[VehicleLink], codec: MavlinkCodec, tap: Tap = leave_frame) -> None:
        """Route to these links, and show what comes of their vehicles and their radio to a tap."""
        self.codec = codec
        self._tap = tap
        self._links = {link.sysid: link for link in links}
        for link in self._links.values():
            link.beside = tuple(self._links.values())

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
                if isinstance(received.message, messages.Radio):
                    self._tap(received, self._links)
                continue
            link.receive(received, source, write)
            if link.is_used:
                self._tap(received, (received.sysid,))

    def connect_all(self, write: Write) -> None:
        """Note that all vehicles are at the other end, before they have said anything."""
        for link in self._links.values():
            link.write = write

    def accept(self, write: Write) -> None:
        """Note that somebody has called: which vehicles that are is known by what they say."""

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
        # asyncio would close the port for good at an internal error.
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
        option = getattr(socket, "TCP_USER_TIMEOUT", None)  # Linux; elsewhere the system's own patience holds
        if option is not None:
            plug.setsockopt(socket.IPPROTO_TCP, option, UNACKNOWLEDGED_MS)


class _SerialPort:
    """One opened serial port; reads and writes never wait."""

    def __init__(self, router: Router, connection: Connection) -> None:
        if sys.platform == "win32":
            raise OSError("a serial port is read on Linux and macOS (on Windows: WSL 2)")
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
    *,
    one_radio: bool = False,
    station: Sender = messages.GROUND_STATION,
    tap: Tap = leave_frame,
) -> AsyncIterator[Mapping[str, VehicleLink]]:
    """Open the links to vehicles by name; those with the same connection share one endpoint.

    Args:
        orders: The links.
        keyring: Frames are signed, and those of others that are not are refused.
        radios: Whose RADIO_STATUS is heard without a signature, as for `Codec`.
        one_radio: Whether they all lead to one radio.
        station: Our own system and component.
        tap: Is shown what comes.

    Raises:
        ConnectionFailed: a port is taken, a device is not there, or a host is not known.
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
    await asyncio.sleep(0)  # a closed transport lets go of its socket in the loop's next round


async def open_endpoint(
    connection: Connection, router: Router, stack: AsyncExitStack, *, may_be_absent: bool = False
) -> None:
    """Open an endpoint, a device maybe later, and keep it open until the stack is unwound."""
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
            # Whether the vehicle is there yet does not matter, whether its name is known does.
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
    """Open a stream, and open it again whenever it is lost, or its device was unplugged."""
    while True:
        with suppress(OSError):  # pyserial's errors are
            stream = await opens()
            try:
                await stream.lost.wait()
            finally:
                stream.close()
        await asyncio.sleep(AGAIN_S)


def describe_open_error(error: Exception) -> str:
    """Return in words why a connection cannot be opened."""
    number = error.errno if isinstance(error, OSError) else None
    if isinstance(error, socket.gaierror) or not number:
        return str(error.args[-1] if error.args else error)
    return os.strerror(number)
