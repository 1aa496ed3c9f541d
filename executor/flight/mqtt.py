"""What a flight publishes over MQTT, where its site names a broker: wires the parts, and keeps them off the flight."""

from __future__ import annotations

import asyncio
import os
import ssl
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex

from executor.adapters.clock import SystemClock
from executor.adapters.mqtt.client import FLUSH_S, Broker, Client, Subscriber
from executor.adapters.mqtt.intake import Intake, IntakeRules
from executor.adapters.mqtt.outbox import Outbox
from executor.adapters.mqtt.payloads import Topics
from executor.adapters.mqtt.publisher import Publisher
from executor.core.commands import Level, Say
from executor.core.events import Event
from executor.core.intents import Intent
from executor.core.state import FleetState
from executor.core.view import FleetView
from executor.errors import SiteError
from executor.site.config import MqttTable, read_secret
from executor.supervised import keep_going, report_mistake
from missions import PlanFile, plan_document

Tell = Callable[[Level, str], None]


@dataclass(frozen=True, slots=True)
class Settings:
    """What a site says of its broker."""

    topics: Topics
    broker: Broker
    rules: IntakeRules
    period_s: float
    """Of telemetry, in real seconds."""
    exposed: bool
    """Whether secrets leave this computer without TLS."""


class Publication:
    """What one flight publishes; every method but `running` returns at once and raises nothing."""

    def __init__(self, settings: Settings, run: Path, clock: SystemClock) -> None:
        """Prepare everything; nothing is connected yet."""
        self._settings = settings
        self._clock = clock
        self._outbox = Outbox()
        self._publisher = Publisher(settings.topics, self._outbox, run.resolve().name, clock.unix_s)
        self._tell: Tell = lambda *_: None
        self._mistakes: set[str] = set()

    def applied(self, event: Event, state: FleetState) -> None:
        """Publish what an event led to."""
        self._safely(lambda: self._publisher.applied(event, state))

    def said(self, line: Say, at_s: float, flight_s: float | None = None) -> None:
        """Publish a line for the operator."""
        self._safely(lambda: self._publisher.said(line, at_s, flight_s))

    def plan(self, revision: int, plan: PlanFile) -> None:
        """Publish the plan in force."""
        self._safely(lambda: self._publisher.plan(revision, plan_document(plan)))

    @asynccontextmanager
    async def running(
        self, view: Callable[[], FleetView], accept: Callable[[Intent], None], tell: Tell
    ) -> AsyncIterator[None]:
        """Publish for as long as the block runs, and a moment longer for what still waits.

        Args:
            view: Returns the present.
            accept: Called with every intent.
            tell: Called with what the operator should know.
        """
        self._tell = tell
        loop = asyncio.get_running_loop()
        intake = Intake(self._settings.rules, self._clock.unix_s, loop.time, accept, self._publisher.refused, tell)
        subscriber = Subscriber(self._settings.topics.intent, intake.take)
        client = Client(self._settings.broker, self._outbox, self._publisher.presence, subscriber, tell)
        if self._settings.rules.closed:
            tell(Level.INFO, f"mqtt: no intents are taken: {self._settings.rules.closed}")
        if self._settings.exposed:
            tell(
                Level.WARNING, f"mqtt: without tls everybody on the way to {self._settings.broker} can read its secrets"
            )
        views = asyncio.create_task(keep_going("mqtt's views", lambda: self._views(view)), name="mqtt views")
        carrier = asyncio.create_task(keep_going("mqtt's connection", client.run), name="mqtt")
        try:
            yield
        finally:
            views.cancel()
            self._safely(lambda: self._publisher.view(view()))
            client.close()
            await asyncio.wait({carrier}, timeout=FLUSH_S)
            carrier.cancel()
            _, left = await asyncio.wait({views, carrier}, timeout=FLUSH_S)
            if left:
                tell(Level.WARNING, f"mqtt: the connection to {self._settings.broker} does not end, and is left")
            if len(self._outbox):
                tell(Level.WARNING, f"mqtt: {len(self._outbox)} messages never reached {self._settings.broker}")

    async def _views(self, view: Callable[[], FleetView]) -> None:
        while True:
            self._safely(lambda: self._publisher.view(view()))
            await asyncio.sleep(self._settings.period_s)

    def _safely(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 - what is told of the flight must not end it
            text = f"internal mistake in mqtt: {type(error).__name__}: {error}"
            if text not in self._mistakes:
                self._mistakes.add(text)
                self._tell(Level.FAULT, text)
                report_mistake("mqtt", error, said=True)


def settings_of(
    table: MqttTable | None, base: Path, source: str, environment: Mapping[str, str] = os.environ
) -> Settings | None:
    """Return what a site says of its broker, with the secrets that it names; None if it has none.

    Args:
        table: The site's table.
        base: The folder that the site file's paths are relative to.
        source: The site file, for messages.
        environment: Where the secrets are.

    Raises:
        SiteError: a secret is not set, or the authority's certificate cannot be used.
    """
    if table is None:
        return None
    broker = Broker(
        table.host,
        table.port or (8883 if table.tls else 1883),
        # The same at every connection of this flight, and nobody else's.
        f"faultline-{token_hex(6)}",
        read_secret(table.username_env, "mqtt.username_env", source, environment),
        read_secret(table.password_env, "mqtt.password_env", source, environment),
        _tls(table, base, source),
    )
    token = (environment.get(table.token_env) if table.token_env is not None else None) or None
    exposed = not table.is_here and not table.tls and (token, broker.username, broker.password) != (None, None, None)
    return Settings(Topics(table.prefix), broker, _rules(table, token), 1.0 / table.telemetry_rate_hz, exposed)


def _rules(table: MqttTable, token: str | None) -> IntakeRules:
    closed = ""
    if token is None and table.token_env is not None:
        closed = f"the environment variable {table.token_env} is not set"
    elif token is None and not table.is_here:
        closed = "the broker is not on this computer, and the site names no token_env"
    return IntakeRules(table.intent_max_age_s, token, closed)


def _tls(table: MqttTable, base: Path, source: str) -> ssl.SSLContext | None:
    if not table.tls:
        return None
    try:
        return ssl.create_default_context(cafile=None if table.ca_file is None else str(base / table.ca_file))
    except (OSError, ssl.SSLError) as error:
        why = error.strerror or type(error).__name__
        text = f"{source}: mqtt.ca_file: expected a certificate (PEM) in {table.ca_file}: {why}"
        raise SiteError(text) from error
