"""Connection to the broker: sends the outbox, and reconnects as often as needed.

It is a separate task. The flight puts messages into the outbox and continues: cells, in which the newest message wins,
and bounded queues, as a broker may be away for the whole flight. A slow, faulty or absent broker affects only this
task.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum

import aiomqtt

from executor.adapters.mqtt.topics import BrokerAddress
from executor.core.interface.commands import Level

MOST_KEPT = 500
"""Most queued messages of a topic, besides those in flight; beyond, the oldest are dropped and counted."""


@dataclass(frozen=True, slots=True)
class MqttMessage:
    """One MQTT message."""

    topic: str
    payload: bytes
    retain: bool = False


class Outbox:
    """Messages for the broker, in sending order."""

    def __init__(self, most_kept: int = MOST_KEPT) -> None:
        self._most_kept = most_kept
        self._cells: dict[str, MqttMessage] = {}
        self._row: deque[MqttMessage] = deque()
        self._queued: set[str] = set()
        """Topics in the queue."""
        self._retained: dict[str, MqttMessage] = {}
        self._closed = False
        self._ready = asyncio.Event()
        self.dropped: dict[str, int] = {}
        """Number of dropped messages by topic."""

    def __len__(self) -> int:
        return len(self._cells) + len(self._row)

    def put_latest(self, letter: MqttMessage) -> None:
        """Queue a message, replacing one that still waits on its topic."""
        if letter.retain:
            self._retained[letter.topic] = letter
        # A topic keeps its position, so that one that changes often does not wait for ever.
        self._cells[letter.topic] = letter
        self._ready.set()

    def enqueue(self, letter: MqttMessage) -> None:
        """Queue a message after those that wait; of too many on one topic the oldest is dropped."""
        self._queued.add(letter.topic)
        self._row.append(letter)
        self._drop_oldest(letter.topic)
        self._ready.set()

    def take_batch(self, most: int) -> list[MqttMessage]:
        """Return the next messages, at most `most`; cells and queue get half each while both have some."""
        for_cells = min(len(self._cells), max(most // 2, most - len(self._row)))
        taken = [self._row.popleft() for _ in range(min(len(self._row), most - for_cells))]
        taken += [self._cells.pop(topic) for topic in list(self._cells)[:for_cells]]
        if not len(self) and not self._closed:
            self._ready.clear()
        return taken

    def return_unsent(self, unsent: Iterable[MqttMessage]) -> None:
        """Requeue messages that could not be sent; a newer one in their cell wins."""
        for letter in reversed(list(unsent)):
            if letter.topic in self._queued:
                self._row.appendleft(letter)
                self._drop_oldest(letter.topic)
            else:
                self._cells.setdefault(letter.topic, letter)
            self._ready.set()

    def resend_retained(self) -> None:
        """Queue all retained messages again: a restarted broker may have lost them."""
        for letter in self._retained.values():
            self._cells.setdefault(letter.topic, letter)
            self._ready.set()

    def list_retained(self) -> tuple[str, ...]:
        """Return the topics with a retained message."""
        return tuple(topic for topic, letter in self._retained.items() if letter.payload)

    def close(self) -> None:
        """Stop waiting: `ready` returns at once from now on."""
        self._closed = True
        self._ready.set()

    async def wait_until_ready(self) -> None:
        """Return when a message waits, or when the outbox is closed."""
        await self._ready.wait()

    def _drop_oldest(self, topic: str) -> None:
        waiting = [letter for letter in self._row if letter.topic == topic]
        if len(waiting) > self._most_kept:
            self._row.remove(waiting[0])
            self.dropped[topic] = self.dropped.get(topic, 0) + 1


ANSWER_S = 5.0
"""Seconds without a PUBACK after which the broker counts as disconnected."""
LEAST_BYTES_PER_S = 1000.0
"""Slowest usable line; it limits how long messages in flight may take."""
KEEPALIVE_S = 60
"""MQTT keep-alive. Long, as a ping waits behind a plan on a slow line; missing PUBACKs show a silent broker."""
WAITS_S = (1.0, 2.0, 4.0, 8.0, 15.0)
"""Pauses between attempts to connect; the last one repeats."""
STEADY_S = 30.0
"""Duration of a connection after which the pauses start anew."""
PROTOCOLS = {"3.1.1": aiomqtt.ProtocolVersion.V311, "5": aiomqtt.ProtocolVersion.V5}
QOS = 1
"""QoS of all messages; unacknowledged ones would fill a slow line with outdated data."""
BATCH = 10
"""Most messages in flight: 20 a second at a round trip of 0.5 s."""
INBOX = 50
"""Most incoming messages that wait; the newest are dropped."""
FLUSH_S = 3.0
"""Real seconds after the flight to send what is queued."""

_log = logging.getLogger("faultline.mqtt")
# Errors are reported by `say`, once, and not for every packet.
_log.addHandler(logging.NullHandler())
_log.propagate = False


class Presence(Enum):
    """Connection state of the publisher, in VDA 5050's terms."""

    ONLINE = "ONLINE"
    OFFLINE = "OFFLINE"
    """The flight has ended, or is no longer supervised."""
    BROKEN = "CONNECTIONBROKEN"
    """Sent by the broker as last will: the connection broke."""


@dataclass(eq=False, repr=False)
class MqttClient:
    """Publish to one broker."""

    _broker: BrokerAddress
    """Address of the broker."""
    _outbox: Outbox
    """Messages to send."""
    _presence: Callable[[Presence], MqttMessage]
    """Builds the presence message."""
    _topic: str
    """Topic to subscribe to."""
    _take: Callable[[bytes, bool], None]
    """Called with every incoming message, and whether it was retained; must not block."""
    _say: Callable[[Level, str], None]
    """Called with lines for the operator."""
    _clear: bool = False
    """Whether to clear retained messages at the end."""
    _closing: asyncio.Event = field(default_factory=asyncio.Event)
    _was_there: bool = False
    _complained: bool = False
    _dropped_told: int = 0

    async def run(self) -> None:
        """Connect, and reconnect whenever the connection ends, until `close`."""
        attempt = 0
        loop = asyncio.get_running_loop()
        while not self._closing.is_set():
            began_s = loop.time()
            try:
                # A separate task: if two task groups fail at once, Python 3.11 leaves a cancellation behind
                # in their task, which would end this one at its next wait.
                await asyncio.create_task(self._run_session(), name="mqtt session")
            except Exception as error:  # noqa: BLE001 - the boundary between the broker and the flight
                self._report_disconnection(_describe_error(error))
            attempt = 0 if loop.time() - began_s > STEADY_S else attempt + 1
            with suppress(TimeoutError):
                async with asyncio.timeout(WAITS_S[min(attempt, len(WAITS_S)) - 1] if attempt else 0.0):
                    await self._closing.wait()

    def close(self) -> None:
        """Send waiting messages, publish that the flight is offline, and end."""
        self._closing.set()
        self._outbox.close()

    async def _run_session(self) -> None:
        will = self._presence(Presence.BROKEN)
        client = aiomqtt.Client(
            self._broker.host,
            self._broker.port,
            identifier=self._broker.identifier,
            username=self._broker.username,
            password=self._broker.password,
            tls_context=self._broker.tls,
            will=aiomqtt.Will(will.topic, will.payload, QOS, will.retain),
            timeout=ANSWER_S,
            keepalive=KEEPALIVE_S,
            protocol=PROTOCOLS[self._broker.protocol],
            transport="tcp" if self._broker.websocket_path is None else "websockets",
            websocket_path=self._broker.websocket_path,
            max_queued_incoming_messages=INBOX,
            logger=_log,
        )
        try:
            async with client:
                await self._serve(client)
        finally:
            # A broker that stops answering leaves a socket open: aiomqtt closes it only on a clean disconnect.
            _close_socket(client)

    async def _serve(self, client: aiomqtt.Client) -> None:
        try:
            await client.subscribe(self._topic, QOS)
            await _publish(client, self._presence(Presence.ONLINE))
            self._on_connected()
            async with asyncio.TaskGroup() as tasks:
                reader = tasks.create_task(self._read(client), name="mqtt intents")
                await self._write(client)
                reader.cancel()
            if self._clear:
                await self._send(client, [MqttMessage(one, b"", retain=True) for one in self._outbox.list_retained()])
            await _publish(client, self._presence(Presence.OFFLINE))
        except BaseException:
            # No clean disconnect, so that the broker publishes the last will.
            _close_socket(client)
            raise

    async def _read(self, client: aiomqtt.Client) -> None:
        async for message in client.messages:
            payload = message.payload
            self._take(payload if isinstance(payload, bytes) else b"", message.retain)

    async def _write(self, client: aiomqtt.Client) -> None:
        while True:
            await self._outbox.wait_until_ready()
            batch = self._outbox.take_batch(BATCH)
            if not batch:
                return
            await self._send(client, batch)

    async def _send(self, client: aiomqtt.Client, batch: list[MqttMessage]) -> None:
        unsent = dict(enumerate(batch))
        patience_s = ANSWER_S + sum(len(letter.payload) for letter in batch) / LEAST_BYTES_PER_S

        async def one(number: int, letter: MqttMessage) -> None:
            await _publish(client, letter, patience_s)
            del unsent[number]

        try:
            async with asyncio.TaskGroup() as tasks:
                for number, letter in enumerate(batch):
                    tasks.create_task(one(number, letter), name="mqtt message")
        finally:
            self._outbox.return_unsent(unsent.values())

    def _on_connected(self) -> None:
        self._outbox.resend_retained()
        again = "again" if self._was_there else ""
        dropped = sum(self._outbox.dropped.values())
        lost = f"; {dropped - self._dropped_told} messages were dropped in the meantime" * (
            dropped > self._dropped_told
        )
        self._dropped_told = dropped
        self._was_there, self._complained = True, False
        self._say(Level.INFO, f"mqtt: connected to {self._broker} {again}".rstrip() + lost)

    def _report_disconnection(self, why: str) -> None:
        """Report a lost connection; once, however often it is retried."""
        if self._complained or self._closing.is_set():
            return
        self._complained = True
        what = "lost the connection to" if self._was_there else "no connection to"
        text = f"mqtt: {what} {self._broker} ({why}); the flight continues; trying again"
        self._say(Level.WARNING, text)


def _close_socket(client: aiomqtt.Client) -> None:
    client._client._sock_close()  # noqa: SLF001 - no other way to close it
    ended = client._disconnected  # noqa: SLF001
    if ended.done() and not ended.cancelled():
        ended.exception()  # or asyncio complains, with a traceback, that it was never retrieved


async def _publish(client: aiomqtt.Client, letter: MqttMessage, patience_s: float | None = None) -> None:
    await client.publish(letter.topic, letter.payload, QOS, letter.retain, timeout=patience_s)


def _describe_error(error: BaseException) -> str:
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    cause = error.__cause__
    text = str(cause or error) or type(error).__name__
    return " ".join(text.split())
