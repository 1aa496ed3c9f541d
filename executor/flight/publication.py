"""What a flight publishes over MQTT: wires the parts, and keeps them off the flight.

Loaded only where the site names a broker: it needs the extra mqtt.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from executor.adapters.clock import SystemClock
from executor.adapters.mqtt.client import FLUSH_S, MqttClient, Outbox, Subscriber
from executor.adapters.mqtt.intake import IntentIntake
from executor.adapters.mqtt.publisher import Publisher
from executor.core.fleet_view import FleetView
from executor.core.imaging.asset_status import AssetView
from executor.core.interface.commands import Level, Say
from executor.core.interface.events import Event
from executor.core.interface.intents import Intent
from executor.core.state.fleet_state import FleetState
from executor.flight.mqtt_settings import MqttSettings
from executor.supervised import keep_going, report_mistake
from missions import PlanFile, build_plan_document

MessageCallback = Callable[[Level, str], None]
AssetsNow = Callable[[], tuple[AssetView, ...]]


class Publication:
    """What one flight publishes; every method but `running` returns at once and raises nothing."""

    def __init__(self, settings: MqttSettings, run: Path, clock: SystemClock) -> None:
        """Prepare everything; nothing is connected yet."""
        self._settings = settings
        self._clock = clock
        self._outbox = Outbox()
        self._publisher = Publisher(settings.topics, self._outbox, run.resolve().name, clock.unix_s)
        self._tell: MessageCallback = lambda *_: None
        self._mistakes: set[str] = set()

    def publish_event(self, event: Event, state: FleetState) -> None:
        """Publish what an event led to."""
        self._call_safely(lambda: self._publisher.publish_event(event, state))

    def publish_line(self, line: Say, at_s: float, flight_s: float | None = None) -> None:
        """Publish a line for the operator."""
        self._call_safely(lambda: self._publisher.publish_line(line, at_s, flight_s))

    def publish_plan(self, revision: int, plan: PlanFile) -> None:
        """Publish the plan in force."""
        self._call_safely(lambda: self._publisher.publish_plan(revision, build_plan_document(plan)))

    @asynccontextmanager
    async def run(
        self,
        view: Callable[[], FleetView],
        accept: Callable[[Intent], None],
        tell: MessageCallback,
        assets: AssetsNow | None = None,
    ) -> AsyncIterator[None]:
        """Publish for as long as the block runs, and a moment longer for what still waits.

        Args:
            view: Returns the present.
            accept: Called with every intent.
            tell: Called with what the operator should know.
            assets: Returns what became of each asset; None where none asks for pictures.
        """
        self._tell = tell
        loop = asyncio.get_running_loop()
        intake = IntentIntake(
            self._settings.rules, self._clock.unix_s, loop.time, accept, self._publisher.publish_refusal, tell
        )
        subscriber = Subscriber(self._settings.topics.intent_topic, intake.handle_message)
        client = MqttClient(self._settings.broker, self._outbox, self._publisher.build_presence, subscriber, tell)
        if self._settings.rules.closed:
            tell(Level.INFO, f"mqtt: no intents are taken: {self._settings.rules.closed}")
        if self._settings.exposed:
            tell(
                Level.WARNING, f"mqtt: without tls everybody on the way to {self._settings.broker} can read its secrets"
            )
        views = asyncio.create_task(
            keep_going("mqtt's views", lambda: self._publish_views(view, assets)), name="mqtt views"
        )
        carrier = asyncio.create_task(keep_going("mqtt's connection", client.run), name="mqtt")
        try:
            yield
        finally:
            views.cancel()
            self._publish_view(view, assets, last=True)
            client.close()
            await asyncio.wait({carrier}, timeout=FLUSH_S)
            carrier.cancel()
            _, left = await asyncio.wait({views, carrier}, timeout=FLUSH_S)
            if left:
                tell(Level.WARNING, f"mqtt: the connection to {self._settings.broker} does not end, and is left")
            if len(self._outbox):
                tell(Level.WARNING, f"mqtt: {len(self._outbox)} messages never reached {self._settings.broker}")

    async def _publish_views(self, view: Callable[[], FleetView], assets: AssetsNow | None) -> None:
        while True:
            self._publish_view(view, assets)
            await asyncio.sleep(self._settings.period_s)

    def _publish_view(self, view: Callable[[], FleetView], assets: AssetsNow | None, *, last: bool = False) -> None:
        self._call_safely(lambda: self._publisher.publish_view(view()))
        if assets is not None:
            self._call_safely(lambda: self._publisher.publish_assets(assets, last=last))

    def _call_safely(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - what is told of the flight must not end it
            text = f"internal error in mqtt: {type(error).__name__}: {error}"
            if text not in self._mistakes:
                self._mistakes.add(text)
                self._tell(Level.FAULT, text)
                report_mistake("mqtt", error, said=True)
