"""Publish a flight over MQTT and on its page, as configured in the site file; neither may delay the flight.

Their libraries are loaded only if the site uses them: loading takes long.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable, Mapping
from concurrent.futures import Future
from contextlib import ExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from executor.adapters.clock import SystemClock
from executor.core.fleet_view import FleetView, build_fleet_view
from executor.core.imaging.asset_status import AssetView
from executor.core.interface.commands import Level
from executor.core.interface.intents import Intent, IntentRecord
from executor.core.state.fleet_state import FleetState
from executor.errors import ConnectionFailed, LogError, SiteError
from executor.flight.run_start import FlightRequest, MessageSink, MqttSettings
from executor.runtime.flight_loop import Flight
from executor.site.ground_view import GroundView, compute_shown_area, encode_ground, read_ground_files
from executor.site.mqtt_and_web_keys import WebTable
from executor.supervised import call_safely, keep_going, report_on_loop

if TYPE_CHECKING:
    from executor.adapters.mqtt.publisher import Publisher


MessageCallback = Callable[[Level, str], None]
AssetsNow = Callable[[], tuple[AssetView, ...]]
LEAST_TOKEN = 16
"""Least characters of a token; shorter ones can be guessed."""


class Publication:
    """Publisher of one flight, inactive without a broker; all methods but `run` return at once and raise nothing."""

    def __init__(self, settings: MqttSettings | None, run: Path, clock: SystemClock) -> None:
        """Prepare everything; nothing is connected yet."""
        self._settings = settings
        self._clock = clock
        self._publisher: Publisher | None = None
        if settings is not None:
            from executor.adapters.mqtt.client import Outbox
            from executor.adapters.mqtt.publisher import Publisher

            self._outbox = Outbox()
            self._publisher = Publisher(settings.topics, self._outbox, run.resolve().name, clock.unix_s)

    def publish(self, work: Callable[[Publisher], None]) -> None:
        """Publish an update, if there is a broker."""
        if self._publisher is not None:
            call_safely("mqtt", work, self._publisher)

    @asynccontextmanager
    async def run(
        self,
        view: Callable[[], FleetView],
        accept: Callable[[Intent], None],
        tell: MessageCallback,
        assets: AssetsNow | None = None,
    ) -> AsyncIterator[None]:
        """Publish while the block runs, and a moment longer for pending messages.

        Args:
            view: Returns the current state.
            accept: Called with every intent.
            tell: Called with lines for the operator.
            assets: Returns the result of each asset; None if no pictures are requested.
        """
        if self._settings is None or self._publisher is None:
            yield
            return
        from executor.adapters.mqtt.client import FLUSH_S, MqttClient
        from executor.adapters.mqtt.intent_intake import IntentIntake

        settings, loop = self._settings, asyncio.get_running_loop()
        intake = IntentIntake(
            settings.rules, self._clock.unix_s, loop.time, accept, self._publisher.publish_refusal, tell
        )
        client = MqttClient(
            settings.broker, self._outbox, self._publisher.build_presence,
            settings.topics.intent_topic, intake.handle_message, tell, settings.clear,
        )  # fmt: skip
        if settings.rules.closed:
            tell(Level.INFO, f"mqtt: no intents are taken: {settings.rules.closed}")
        if settings.exposed:
            tell(Level.WARNING, f"mqtt: without tls anyone on the path to {settings.broker} can read its secrets")
        views = asyncio.create_task(
            keep_going("mqtt's views", lambda: self._publish_views(view, assets, settings.period_s)), name="mqtt views"
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
                tell(Level.WARNING, f"mqtt: the connection to {settings.broker} does not end, and is left")
            if len(self._outbox):
                tell(Level.WARNING, f"mqtt: {len(self._outbox)} messages never reached {settings.broker}")

    async def _publish_views(self, view: Callable[[], FleetView], assets: AssetsNow | None, period_s: float) -> None:
        while True:
            self._publish_view(view, assets)
            await asyncio.sleep(period_s)

    def _publish_view(self, view: Callable[[], FleetView], assets: AssetsNow | None, *, last: bool = False) -> None:
        self.publish(lambda to: to.publish_view(view()))
        if assets is not None:
            self.publish(lambda to: to.publish_assets(assets, last=last))


def check_web(table: WebTable) -> None:
    """Check the environment and load the server, before anything is connected: loading takes long.

    Raises:
        SiteError: the token is missing or too short.
    """
    if table.enabled:
        read_token(table)
        import executor.adapters.web  # noqa: F401 - a third of a second in which no vehicle would be heard


def read_token(table: WebTable) -> str | None:
    """Return the token that browsers must show; None if none is required.

    Raises:
        SiteError: it is missing or too short.
    """
    if table.token_env is None:
        return None
    value = os.environ.get(table.token_env, "")
    if (
        len(value) < LEAST_TOKEN
        or not value.isascii()
        or not value.isprintable()
        or not value.replace("-", "").isalnum()
    ):
        raise SiteError(
            f"web.token_env: expected a token of {LEAST_TOKEN} or more letters, digits or hyphens in the environment "
            f"variable {table.token_env}"
        )
    return value


@asynccontextmanager
async def serve_page(
    table: WebTable, flight: Flight, clock: SystemClock, console: MessageSink, request: FlightRequest | None = None
) -> AsyncIterator[None]:
    """Serve the page; a flight continues without it if it cannot be served.

    It also shows the flight before its launch: while the operator is asked, nothing that arrives at the loop is read.
    """
    if not table.enabled:
        yield
        return
    from executor.adapters.web.page_server import WebSettings
    from executor.adapters.web.server import WebServer

    loop = asyncio.get_running_loop()

    def now() -> tuple[FleetState, float]:
        return flight.state, clock.now_s()

    async def take(intent: Intent) -> IntentRecord:
        return flight.submit_intent(intent)

    def submit(intent: Intent) -> Future[IntentRecord]:
        return asyncio.run_coroutine_threadsafe(take(intent), loop)

    token = read_token(table)
    names = {*table.names, *(() if table.address is None else (urlsplit(table.address).hostname or "",))}
    settings = WebSettings(
        table.host,
        table.port,
        token,
        frozenset(names),
        clock.speedup,
        {} if request is None else read_shown_ground(request, console),
        None if request is None else request.plan.window,
    )
    server = WebServer(
        settings, flight.context, now, submit, partial(build_fleet_view, links=flight.describe_links),
        partial(report_on_loop, loop),
    )  # fmt: skip
    stack = ExitStack()
    try:
        await asyncio.to_thread(stack.enter_context, server)
    except ConnectionFailed as error:
        console.say(Level.WARNING, f"{error}; the flight continues without its page")
        yield
        return
    try:
        query = f"?token=${table.token_env}" if token is not None else ""
        console.say(Level.INFO, f"page: {table.address or server.address}{query}")
        yield
    finally:
        await asyncio.to_thread(stack.close)


def read_shown_ground(request: FlightRequest, console: MessageSink) -> Mapping[str, bytes]:
    """Return the background in the run directory, or at least the location of the local metres."""
    try:
        kept = read_ground_files(request.run)
    except LogError as error:
        console.say(Level.WARNING, f"{error}: the page shows no ground")
        kept = {}
    around = GroundView(*compute_shown_area(request.ground.network.positions_m))
    return kept or encode_ground(around, request.ground.network.frame)
