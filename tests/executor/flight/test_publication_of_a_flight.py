"""A flight in the core's own terms, published at real brokers in every mood: the flight is the same each time."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from operator import methodcaller
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from executor.adapters.clock import SystemClock
from executor.adapters.mqtt import client as connection
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import IntentReceived
from executor.core.interface.intents import Action, Intent
from executor.flight.publication import Publication
from executor.flight.run_start import read_mqtt_settings
from executor.site.mqtt_and_web_keys import MqttTable
from missions import build_plan_document
from tests.brokers import KIND, RealBroker, running, slowed
from tests.executor.core.stories import EVERYTHING, story
from tests.executor.flights import first_plan_file
from tests.fakes.flight import Story
from tests.patience import PATIENCE_S
from tests.ports import free_port

pytestmark = pytest.mark.asyncio
SLOW_BYTES_PER_S = 3000.0


@dataclass(slots=True)
class Published:
    """A story, and what is published of it."""

    publication: Publication
    flight: Story = field(default_factory=story)
    told: list[str] = field(default_factory=list)
    _news: asyncio.Event = field(default_factory=asyncio.Event)
    _events: int = 0
    _commands: int = 0

    async def live(self, until: Callable[[], bool]) -> None:
        """Fly until something is so; the broker's part of the program gets its turn after every step."""
        async with asyncio.timeout(PATIENCE_S):
            while not until() and not self.flight.over:
                self.flight.step()
                self.look()
                await asyncio.sleep(0)

    def look(self) -> None:
        """Publish what has happened since it was looked at last."""
        for _, event in self.flight.events[self._events :]:
            self.publication.publish(methodcaller("publish_event", event, self.flight.state))
        for at_s, command in self.flight.commands[self._commands :]:
            if isinstance(command, Say):
                self.publication.publish(methodcaller("publish_line", command, at_s))
        self._events, self._commands = len(self.flight.events), len(self.flight.commands)

    def accept(self, intent: Intent) -> None:
        self.flight.happen(IntentReceived(intent))
        self.look()

    def tell(self, level: Level, text: str) -> None:
        self.told.append(text)
        self._news.set()

    async def has_told(self, count: int) -> None:
        """Wait, without the flight, until so many things were told."""
        async with asyncio.timeout(PATIENCE_S):
            while len(self.told) < count:
                self._news.clear()
                await self._news.wait()


@asynccontextmanager
async def published(port: int, folder: Path) -> AsyncIterator[Published]:
    settings = read_mqtt_settings(MqttTable(port=port, telemetry_rate_hz=10.0), Path(), "site.toml", {})
    assert settings is not None
    here = Published(Publication(settings, folder, SystemClock()))
    here.publication.publish(lambda to: to.publish_plan(0, build_plan_document(first_plan_file())))

    def view() -> Any:
        return build_fleet_view(here.flight.context, here.flight.state, here.flight.now_s)

    async with here.publication.run(view, here.accept, here.tell):
        yield here


def lose_one(flight: Story) -> None:
    flight.crafts["uav3"].mute = True


def unpublished() -> Story:
    flight = story()
    flight.run(lambda: len(flight.state.coverage.inspected) == 1)
    lose_one(flight)
    flight.finish()
    return flight


async def steady(broker: RealBroker, here: Published) -> None:
    """Nothing happens."""


async def stopped(broker: RealBroker, here: Published) -> None:
    await broker.stop()


async def restarted(broker: RealBroker, here: Published) -> None:
    await here.has_told(1)
    await broker.stop()
    await here.has_told(2)
    await broker.start()
    await here.has_told(3)


async def suspended(broker: RealBroker, here: Published) -> None:
    broker.suspend()


async def asleep_for_a_while(broker: RealBroker, here: Published) -> None:
    await here.has_told(1)
    broker.suspend()
    await here.has_told(2)
    broker.go_on()
    await here.has_told(3)


@pytest.mark.parametrize("mood", [steady, stopped, restarted, suspended, asleep_for_a_while])
async def test_a_flight_with_a_loss_is_the_same(
    mood: Callable[[RealBroker, Published], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "WAITS_S", (0.05,))
    monkeypatch.setattr(connection, "ANSWER_S", 0.5)
    async with running(KIND, tmp_path / "broker") as broker:
        async with published(broker.port, tmp_path) as here:
            await here.live(lambda: len(here.flight.state.coverage.inspected) == 1)
            lose_one(here.flight)
            await mood(broker, here)
            await here.live(lambda: here.flight.over)
        if mood is suspended:
            broker.go_on()
    without = unpublished()
    assert here.flight.commands == without.commands
    assert here.flight.state.coverage.inspected == without.state.coverage.inspected
    assert set(here.flight.state.coverage.inspected) == EVERYTHING
    if mood in {stopped, suspended}:
        assert "messages never reached" in here.told[-1]
    else:
        assert not any("never reached" in line for line in here.told)


async def test_a_flight_without_its_broker_is_the_same(tmp_path: Path) -> None:
    async with published(free_port(), tmp_path) as here:
        await here.live(lambda: len(here.flight.state.coverage.inspected) == 1)
        lose_one(here.flight)
        await here.live(lambda: here.flight.over)
    assert here.flight.commands == unpublished().commands
    assert "messages never reached" in here.told[-1]


async def test_over_a_slow_line_the_newest_wins_and_intents_are_answered(tmp_path: Path) -> None:
    """Three kilobytes a second are less than the states are worth."""
    async with (
        running(KIND, tmp_path / "broker") as broker,
        slowed(broker.port, SLOW_BYTES_PER_S) as port,
        aiomqtt.Client("127.0.0.1", broker.port) as crew,
    ):
        await crew.subscribe("faultline/v1/#", qos=1)
        heard = Heard()
        listening = asyncio.create_task(heard.listen(crew))
        async with published(port, tmp_path) as here:
            await here.live(lambda: here.flight.inspecting("uav2", 2))
            await here.has_told(1)
            for name, action in (("h", Action.HOLD), ("r", Action.RESUME)):
                stamp = datetime.now(UTC).isoformat()
                wish = {"timestamp": stamp, "id": name, "action": action.value, "vehicle": "uav2"}
                for _ in range(2):  # the same twice is the same once
                    await crew.publish("faultline/v1/intent", json.dumps(wish), qos=1)
                await heard.answers(name, 2)
                await here.live(ended(here.flight, name))
                assert (await heard.answers(name, 3))[-1] == "done"
            await here.live(lambda: here.flight.over)
        listening.cancel()
    assert set(here.flight.state.coverage.inspected) == EVERYTHING
    assert sum(isinstance(event, IntentReceived) for _, event in here.flight.events) == 4
    numbers = [what["headerId"] for topic, what in heard.got if topic.endswith("uav2/telemetry")]
    assert numbers == sorted(set(numbers))
    assert len(numbers) <= numbers[-1] / 2, "most were overtaken by newer ones"


def ended(flight: Story, name: str) -> Callable[[], bool]:
    return lambda: flight.state.crew.intents[name].ended_s is not None


@dataclass(slots=True)
class Heard:
    """What the crew hears."""

    got: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    async def listen(self, client: aiomqtt.Client) -> None:
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            self.got.append((str(message.topic), json.loads(message.payload)))
            self._news.set()

    async def answers(self, name: str, count: int) -> list[str]:
        """Wait for so many answers to an intent, and return them."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                found = [
                    what["outcome"] for topic, what in self.got if topic.endswith("/intent/ack") and what["id"] == name
                ]
                if len(found) >= count:
                    return found
                self._news.clear()
                await self._news.wait()
