"""Links through MAVSDK 4, which owns the sockets, finds the systems, checks the frames and sends our heartbeat.

Whole messages pass through its MavlinkDirect plugin, so that every dialogue is faultline's own, and tolerates what
MAVSDK's mission transfer treats as the end: ArduPilot's INVALID_SEQUENCE during an upload. This backend lacks sequence
numbers, so losses are not counted, and negative integer parameters of PX4, whose bits are no number in MAVSDK's
messages; those are neither read nor set.

MAVSDK's threads need care: it frees our callback as soon as it is removed, even while one of its threads runs it, so
callbacks are kept for as long as those threads run.
"""

from __future__ import annotations

import asyncio
import atexit
import functools
import json
import socket
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Protocol

from executor.adapters.extras import Extra, require_extra
from executor.adapters.listeners import Listeners
from executor.core.interface.connection import Connection, Scheme
from executor.core.interface.messages import Heartbeat, Message, Outgoing, StationHeard
from executor.core.interface.ports import LinkCounts, LinkRequest, LinkView
from executor.core.telemetry.vehicle_identity import AUTOPILOT
from executor.errors import ConnectionFailed

if TYPE_CHECKING:
    from mavsdk import Mavsdk
    from mavsdk.plugins.mavlink_direct import MavlinkDirect, MavlinkMessage
    from mavsdk.system import System

WANTED_BY = 'backend = "mavsdk"'
"""Setting in the site file that needs MAVSDK."""
MOST_AT_ONCE = 16
"""Most MAVSDK instances in one process; 24 crashed it (measured). One serves a whole fleet."""


def load_mavsdk() -> None:
    """Load MAVSDK, and keep its log off standard output, which is for results; silence shows in the link anyway.

    Raises:
        ExtraMissing: MAVSDK is not installed.
        ConnectionFailed: It cannot be loaded.
    """
    require_extra(Extra.MAVSDK, WANTED_BY)
    try:
        import mavsdk  # noqa: F401 - tests the import
    except Exception as error:
        # Without its native library it raises its own error, which then cannot be imported.
        reason = str(error).partition("\n")[0]
        raise ConnectionFailed(f"backend mavsdk: expected the package mavsdk 4 on this machine: {reason}") from error
    _silence_mavsdk_log()


@functools.cache
def _silence_mavsdk_log() -> None:
    from mavsdk import logging as chatter

    chatter.log_subscribe(lambda *_: True)
    atexit.register(chatter.log_unsubscribe)


def create_ground_station(station: tuple[int, int]) -> Mavsdk:
    """Return a MAVSDK with its own threads and this system and component; `destroy` ends them.

    Both block, so do not call them on the event loop.
    """
    from mavsdk import Configuration, Mavsdk

    # MAVSDK's default, system 245, would not keep ArduPilot's ground-station failsafe from acting (measured).
    return Mavsdk(Configuration.create_manual(*station, True))


def add_mavsdk_connection(mavsdk: Mavsdk, connection: str) -> None:
    """Open a connection.

    Raises:
        ConnectionFailed: MAVSDK cannot open it.
    """
    result = mavsdk.add_any_connection(connection)
    if result.value:
        reason = result.name.lower().replace("_", " ")
        raise ConnectionFailed(f"{connection}: cannot be opened by MAVSDK: {reason}")


ENDS_S = 10.0
"""Real seconds for MAVSDK to end; a hanging thread is abandoned."""

Fields = Mapping[str, object]
"""Message fields by MAVLink name, as in JSON: null for non-finite numbers."""


class Translator(Protocol):
    """Convert MAVLink fields to our messages and back."""

    @property
    def station(self) -> tuple[int, int]:
        """Return our own system and component."""

    def read_fields(
        self, name: str, sysid: int, compid: int, fields: Fields
    ) -> tuple[bytes, tuple[Message, ...]] | None:
        """Return a frame for the log and its messages; None for an unknown message.

        Messages of components other than the vehicle's autopilot about themselves are ignored.
        """

    def write_fields(self, message: Outgoing, sysid: int, compid: int) -> tuple[str, Fields, bytes] | None:
        """Return the MAVLink name and fields, and a frame for the log; None if JSON cannot represent them."""


class MavsdkLink(Listeners):
    """Messages of one vehicle through MAVSDK; runs on the event loop."""

    def __init__(self, order: LinkRequest, translator: Translator) -> None:
        super().__init__()
        self.sysid = order.sysid
        self.connection = str(order.connection)
        self.ways, self.is_alive = (self,), True
        self.component = AUTOPILOT
        self.counts = LinkCounts(missing=None)
        self._log = order.log
        self._translator = translator
        self._direct: MavlinkDirect | None = None

    @property
    def is_found(self) -> bool:
        """Return whether MAVSDK has found the system."""
        return self._direct is not None

    @property
    def peer(self) -> None:
        """Return None: MAVSDK owns the sockets, and sends the heartbeats."""
        return

    def describe_links(self) -> tuple[LinkView, ...]:
        """Return nothing, as there is only one link."""
        return ()

    def send(self, message: Outgoing) -> None:
        """Send one message; dropped until the system is found."""
        if self._direct is None:
            return
        from mavsdk.plugins.mavlink_direct import MavlinkDirectError, MavlinkMessage

        written = self._translator.write_fields(message, self.sysid, self.component)
        if written is None:
            return
        name, fields, frame = written
        try:
            self._direct.send_message(
                MavlinkMessage(name, *self._translator.station, self.sysid, self.component, json.dumps(fields))
            )
        except MavlinkDirectError:
            return  # a message that cannot be sent is lost, as on the air
        self._log(frame)

    def attach(self, system: System) -> None:
        """Attach the system that MAVSDK has found."""
        self._direct = _subscribe(system, "", self._receive)

    def detach(self) -> list[object]:
        """Detach the system before MAVSDK ends; return the references to keep until it has."""
        kept = [] if self._direct is None else _collect_references(self._direct)
        self._direct = None
        return kept

    def _receive(self, message: MavlinkMessage) -> None:
        self.counts.received += 1
        read = _read(self._translator, message)
        if read is None:
            return
        frame, heard = read
        self._log(frame)
        for one in heard:
            if isinstance(one, Heartbeat):
                self.component = message.component_id
            self.hear(one)


def _subscribe(system: System, name: str, take: Callable[[MavlinkMessage], None]) -> MavlinkDirect:
    """Receive one system's messages with this name on the event loop; without a name, all."""
    from mavsdk.plugins.mavlink_direct import MavlinkDirect

    loop, direct = asyncio.get_running_loop(), MavlinkDirect(system)
    # MAVSDK calls from its own thread; the flight runs on the event loop.
    direct.subscribe_message(name, lambda message, _: loop.call_soon_threadsafe(take, message))
    return direct


def _collect_references(direct: MavlinkDirect) -> list[object]:
    """Return the references to keep until MAVSDK has ended.

    At its end the plugin frees the callbacks for C while calls may still be in MAVSDK's queue: without this, a process
    died in about one of two hundred ends (measured).
    """
    return [direct, *vars(direct).get("_subscriptions", {}).values()]


def _read(translator: Translator, message: MavlinkMessage) -> tuple[bytes, tuple[Message, ...]] | None:
    # A text may contain a tab, as PX4's do.
    fields = json.loads(message.fields_json, strict=False)
    return translator.read_fields(message.message_name, message.system_id, message.component_id, fields)


class _Systems:
    """All systems that MAVSDK finds: the links' vehicles, and any ground stations."""

    def __init__(self, mavsdk: Mavsdk, links: Iterable[MavsdkLink], translator: Translator) -> None:
        self._mavsdk = mavsdk
        self._links = tuple(links)
        self._translator = translator
        self._others: dict[int, MavlinkDirect] = {}
        self._ending = False

    def attach_new_systems(self) -> None:
        """Attach the systems found since the last call."""
        for system in () if self._ending else self._mavsdk.get_systems():
            number = system.get_system_id()
            wanted = [link for link in self._links if link.sysid == number]
            for link in wanted:
                if not link.is_found:
                    link.attach(system)
            if not wanted and number not in self._others:
                self._others[number] = _subscribe(system, "HEARTBEAT", self._dispatch_stations)

    def detach(self) -> list[object]:
        """Detach all systems before MAVSDK ends; return the references to keep until it has."""
        self._ending = True
        kept = [link.detach() for link in self._links] + [
            _collect_references(direct) for direct in self._others.values()
        ]
        return [one for held in kept for one in held]

    def _dispatch_stations(self, message: MavlinkMessage) -> None:
        read = _read(self._translator, message)
        for heard in () if read is None else read[1]:
            if isinstance(heard, StationHeard):
                # MAVSDK does not tell which connection it is on.
                for link in self._links:
                    link.hear(heard)


@asynccontextmanager
async def open_mavsdk_links(
    orders: Mapping[str, LinkRequest], translator: Translator
) -> AsyncIterator[Mapping[str, MavsdkLink]]:
    """Open the links to vehicles by name through one MAVSDK.

    Raises:
        ConnectionFailed: MAVSDK is missing, a port is in use, a device is missing, or a host is unknown.
    """
    links = {name: MavsdkLink(order, translator) for name, order in orders.items()}
    if not orders:
        yield links
        return
    load_mavsdk()
    loop = asyncio.get_running_loop()
    mavsdk = await asyncio.to_thread(create_ground_station, translator.station)

    systems = _Systems(mavsdk, links.values(), translator)
    try:
        mavsdk.subscribe_on_new_system(lambda _: loop.call_soon_threadsafe(systems.attach_new_systems))
        for connection in dict.fromkeys(order.connection for order in orders.values()):
            if connection.scheme is Scheme.UDP_IN:
                _expect_free(connection)
            add_mavsdk_connection(mavsdk, str(connection))
        yield links
    finally:
        kept = systems.detach()
        # It waits for its threads, which may be about to pass a message to the loop.
        ending = asyncio.ensure_future(asyncio.to_thread(mavsdk.destroy))
        ending.add_done_callback(lambda _: kept.clear())
        await asyncio.wait({ending}, timeout=ENDS_S)


def _expect_free(connection: Connection) -> None:
    """Check that the port is free: MAVSDK shares it silently, and each program would get half the frames (measured)."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plug:
            plug.bind((connection.where, connection.number))
    except OSError as error:
        raise ConnectionFailed(f"{connection}: cannot be opened: {error.strerror or error}") from error
