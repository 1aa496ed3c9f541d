"""The connection to real brokers, which come late, go away, fall asleep and want passwords."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from executor.adapters.mqtt import client as connection
from executor.adapters.mqtt.client import MqttClient, MqttMessage, Outbox, Presence
from executor.adapters.mqtt.topics import BrokerAddress
from executor.core.interface.commands import Level
from tests.brokers import KIND, PASSWORD, USER, RealBroker, running, secured_in
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio

THERE = "t/there"
KINDS = [pytest.param("mosquitto", marks=pytest.mark.needs("mosquitto")), "amqtt"]


class Station:
    """A client at work, and what it said and got."""

    def __init__(self, broker: BrokerAddress, *, clear: bool = False) -> None:
        self.said: list[str] = []
        self.got: asyncio.Queue[tuple[bytes, bool]] = asyncio.Queue()
        self.outbox = Outbox()
        self._spoke = asyncio.Event()

        def take(payload: bytes, retained: bool) -> None:
            self.got.put_nowait((payload, retained))

        def presence(state: Presence) -> MqttMessage:
            return MqttMessage(THERE, state.value.encode(), retain=True)

        self.client = MqttClient(broker, self.outbox, presence, "t/orders", take, self._say, clear)

    def _say(self, level: Level, text: str) -> None:
        self.said.append(text)
        self._spoke.set()

    async def has_said(self, count: int) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while len(self.said) < count:
                self._spoke.clear()
                await self._spoke.wait()


@asynccontextmanager
async def station(broker: BrokerAddress, *, clear: bool = False) -> AsyncIterator[Station]:
    made = Station(broker, clear=clear)
    task = asyncio.create_task(made.client.run())
    try:
        yield made
    finally:
        made.client.close()
        async with asyncio.timeout(PATIENCE_S):
            await task


def at(port: int, **more: object) -> BrokerAddress:
    return BrokerAddress("127.0.0.1", port, "faultline-test", **more)  # type: ignore[arg-type]


@asynccontextmanager
async def watcher(port: int, topic: str = "t/#") -> AsyncIterator[Callable[[str], asyncio.Future[bytes]]]:
    """Somebody else at the broker; gives the next message on a topic, or the one that the broker holds."""
    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe(topic, qos=1)
        messages = client.messages

        async def following(wanted: str) -> bytes:
            async with asyncio.timeout(PATIENCE_S):
                async for message in messages:
                    if message.topic.matches(wanted):
                        assert isinstance(message.payload, bytes)
                        return message.payload
            raise AssertionError("the broker went away")

        yield lambda wanted: asyncio.ensure_future(following(wanted))


@pytest.mark.parametrize("kind", KINDS)
async def test_what_waits_is_sent_and_what_comes_is_taken(kind: str, tmp_path: Path) -> None:
    async with running(kind, tmp_path / "broker") as broker, watcher(broker.port) as following:
        async with station(at(broker.port)) as here:
            assert await following(THERE) == b"ONLINE"
            for number in range(30):
                here.outbox.enqueue(MqttMessage("t/events", b"%d" % number))
            assert [await following("t/events") for _ in range(30)] == [b"%d" % number for number in range(30)]
            here.outbox.put_latest(MqttMessage("t/state", b"now"))
            assert await following("t/state") == b"now"
            async with aiomqtt.Client("127.0.0.1", broker.port) as other:
                await other.publish("t/orders", b"hold", qos=1)
            assert await here.got.get() == (b"hold", False)
        assert await following(THERE) == b"OFFLINE"
    assert here.said == [f"mqtt: connected to 127.0.0.1:{broker.port}"]


async def test_what_the_broker_held_is_distinguished(tmp_path: Path) -> None:
    async with running(KIND, tmp_path / "broker") as broker:
        async with aiomqtt.Client("127.0.0.1", broker.port) as other:
            await other.publish("t/orders", b"old", qos=1, retain=True)
        async with station(at(broker.port)) as here:
            assert await here.got.get() == (b"old", True)


async def test_a_broker_that_comes_late_and_one_that_forgets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it should hold is published anew, what was to be told is told, and the operator reads of it once."""
    monkeypatch.setattr(connection, "WAITS_S", (0.1,))
    broker = RealBroker(KIND, tmp_path / "broker")
    try:
        async with station(at(broker.port)) as here:
            here.outbox.put_latest(MqttMessage("t/plan", b"plan", retain=True))
            here.outbox.enqueue(MqttMessage("t/events", b"first"))
            await here.has_said(1)
            assert "Connection refused" in here.said[0]
            assert "the flight continues" in here.said[0]
            await broker.start()
            await here.has_said(2)
            async with watcher(broker.port, "t/plan") as following:
                assert await following("t/plan") == b"plan"
            await broker.stop()
            await here.has_said(3)
            assert here.said[2].startswith("mqtt: lost the connection")
            here.outbox.enqueue(MqttMessage("t/events", b"second"))
            await broker.start()
            await here.has_said(4)
            assert here.said[3].endswith("again")
            async with watcher(broker.port, "t/+") as following:
                assert await following("t/plan") == b"plan"
    finally:
        await broker.stop()
    assert len(here.said) == 4


async def test_a_broker_that_is_suspended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It answers nothing, then everything at once; nobody waits for it, and nothing is lost."""
    monkeypatch.setattr(connection, "WAITS_S", (0.1,))
    monkeypatch.setattr(connection, "ANSWER_S", 0.5)
    async with running(KIND, tmp_path / "broker") as broker, station(at(broker.port)) as here:
        await here.has_said(1)
        broker.suspend()
        here.outbox.enqueue(MqttMessage("t/events", b"while it slept", retain=True))
        await here.has_said(2)
        assert "lost the connection" in here.said[1]
        assert "timed out" in here.said[1]
        broker.go_on()
        await here.has_said(3)
        async with watcher(broker.port, "t/events") as following:
            assert await following("t/events") == b"while it slept"
        async with watcher(broker.port, THERE) as following:
            assert await following(THERE) == b"ONLINE"


async def test_the_broker_says_so_when_we_die(tmp_path: Path) -> None:
    async with running(KIND, tmp_path / "broker") as broker, watcher(broker.port) as following:
        here = Station(at(broker.port))
        task = asyncio.create_task(here.client.run())
        assert await following(THERE) == b"ONLINE"
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert await following(THERE) == b"CONNECTIONBROKEN"


# paho leaves the socket of a handshake that failed to the garbage collector.
@pytest.mark.filterwarnings("ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("kind", KINDS)
async def test_a_password_and_tls(kind: str, tmp_path: Path) -> None:
    secured = secured_in(tmp_path)
    known = ssl.create_default_context(cafile=str(secured.authority))
    async with running(kind, tmp_path / "broker", secured=secured, password=True) as broker:
        async with station(at(broker.port, username=USER, password=PASSWORD, tls=known)) as here:
            await here.has_said(1)
        assert here.said == [f"mqtt: connected to 127.0.0.1:{broker.port}"]
        async with station(at(broker.port, username=USER, password="guessed", tls=known)) as here:  # noqa: S106
            await here.has_said(1)
        assert here.said[0].startswith("mqtt: no connection to")
        stranger = ssl.create_default_context()
        async with station(at(broker.port, username=USER, password=PASSWORD, tls=stranger)) as here:
            await here.has_said(1)
        assert "certificate verify failed" in here.said[0]
        assert PASSWORD not in repr(at(1, password=PASSWORD))


@pytest.mark.needs("mosquitto")
@pytest.mark.parametrize("protocol", ["3.1.1", "5"])
@pytest.mark.parametrize("websocket", [False, True])
async def test_every_protocol_with_and_without_a_websocket(protocol: str, websocket: bool, tmp_path: Path) -> None:
    path = "/mqtt" if websocket else None
    async with running("mosquitto", tmp_path / "broker", websocket=websocket) as broker:
        transport: Any = {"transport": "websockets", "websocket_path": path} if websocket else {}
        async with (
            aiomqtt.Client("127.0.0.1", broker.port, **transport) as other,
            station(at(broker.port, protocol=protocol, websocket_path=path)) as here,
        ):
            await here.has_said(1)
            await other.subscribe("t/#", qos=1)
            for number in range(30):
                here.outbox.enqueue(MqttMessage("t/events", b"%d" % number))
            here.outbox.put_latest(MqttMessage("t/plan", b"p" * 120_000, retain=True))
            await other.publish("t/orders", b"hold", qos=1)
            assert await here.got.get() == (b"hold", False)
            got: dict[str, list[bytes]] = {}
            async with asyncio.timeout(PATIENCE_S):
                async for message in other.messages:
                    assert isinstance(message.payload, bytes)
                    got.setdefault(message.topic.value, []).append(message.payload)
                    if len(got.get("t/events", ())) == 30 and "t/plan" in got:
                        break
            assert got["t/events"] == [b"%d" % number for number in range(30)]
            assert got["t/plan"] == [b"p" * 120_000]
    assert here.said == [f"mqtt: connected to 127.0.0.1:{broker.port}"]


@pytest.mark.filterwarnings("ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning")
@pytest.mark.needs("mosquitto")
@pytest.mark.parametrize("protocol", ["3.1.1", "5"])
async def test_a_broker_that_wants_the_clients_certificate(protocol: str, tmp_path: Path) -> None:
    secured = secured_in(tmp_path)
    known = ssl.create_default_context(cafile=str(secured.authority))
    async with running("mosquitto", tmp_path / "broker", secured=secured, clients=True) as broker:
        async with station(at(broker.port, tls=known, protocol=protocol)) as here:
            await here.has_said(1)
        assert here.said[0].startswith("mqtt: no connection to")
        known.load_cert_chain(secured.client)
        async with station(at(broker.port, tls=known, protocol=protocol)) as here:
            await here.has_said(1)
        assert here.said == [f"mqtt: connected to 127.0.0.1:{broker.port}"]


async def held(port: int) -> set[str]:
    """Return the topics of which the broker holds a message."""
    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("t/#", qos=1)
        await client.publish("t/end", b"", qos=1)
        found = set[str]()
        async for message in client.messages:
            if message.topic.value == "t/end":
                return found
            if message.retain:
                found.add(message.topic.value)
    raise AssertionError("the broker went away")


@pytest.mark.parametrize("clear", [False, True])
async def test_what_the_broker_holds_is_forgotten_where_that_is_asked_for(clear: bool, tmp_path: Path) -> None:
    async with running(KIND, tmp_path / "broker") as broker:
        async with station(at(broker.port), clear=clear) as here:
            await here.has_said(1)
            for topic in ("t/state", "t/plan"):
                here.outbox.put_latest(MqttMessage(topic, b"now", retain=True))
            here.outbox.put_latest(MqttMessage("t/gone", b"", retain=True))
        assert await held(broker.port) == ({THERE} if clear else {THERE, "t/state", "t/plan"})


async def test_an_absent_broker_delays_nothing() -> None:
    async with station(at(free_port())) as here:
        for number in range(2000):
            here.outbox.enqueue(MqttMessage("t/events", b"%d" % number))
        await here.has_said(1)
    assert here.outbox.dropped == {"t/events": 1500}


CONNACK, SUBACK, PUBACK = b"\x20\x02\x00\x00", b"\x90\x03\x00\x01\x01", b"\x40\x02\x00\x02"
HOSTILE = {
    "nothing at all": b"",
    "noise": bytes(range(256)) * 4,
    "a refusal": b"\x20\x02\x00\x05",
    "a refusal of a kind that is none": b"\x20\x02\x00\x77",
    "an answer that is too short": b"\x20\x00",
    "welcome, and noise": CONNACK + b"\xff" * 40,
    "an answer to nothing": CONNACK + SUBACK + b"\x40\x02\xff\xff" + b"\xb0\x02\xff\xff",
    "a message without end": CONNACK + SUBACK + PUBACK + b"\x30\xff\xff\xff\x7f\x00\x01t",
    "a length that never ends": CONNACK + SUBACK + PUBACK + b"\x30\xff\xff\xff\xff\xff",
    "a topic that is no text": CONNACK + SUBACK + PUBACK + b"\x30\x05\x00\x02\xff\xfe!",
    "a topic longer than its message": CONNACK + SUBACK + PUBACK + b"\x30\x03\x00\xffx",
}


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.parametrize("said", HOSTILE.values(), ids=HOSTILE)
async def test_a_broker_that_talks_nonsense(said: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is left, and called again; the operator reads of it, and nothing else happens."""
    monkeypatch.setattr(connection, "WAITS_S", (0.01,))
    monkeypatch.setattr(connection, "ANSWER_S", 0.2)
    calls: asyncio.Queue[None] = asyncio.Queue()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        calls.put_nowait(None)
        await reader.read(4096)
        writer.write(said)
        await reader.read()
        writer.close()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server, station(at(server.sockets[0].getsockname()[1])) as here:
        here.outbox.enqueue(MqttMessage("t/events", b"kept"))
        async with asyncio.timeout(PATIENCE_S):
            for _ in range(3):
                await calls.get()
        assert "mqtt: " in here.said[0]
    assert [taken.payload for taken in here.outbox.take_batch(9)] == [b"kept"]
