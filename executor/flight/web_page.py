"""Opens the page beside a flight, as the site file wants it."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Mapping
from concurrent.futures import Future
from contextlib import ExitStack, asynccontextmanager
from functools import partial
from urllib.parse import urlsplit

from executor.adapters.clock import SystemClock
from executor.adapters.extras import Extra, describe_missing_extra
from executor.core.interface.commands import Level
from executor.core.interface.intents import Intent, IntentRecord
from executor.core.state.fleet_state import FleetState
from executor.errors import ConnectionFailed, LogError, SiteError
from executor.flight.run_start import FlightRequest, MessageSink
from executor.runtime.flight_loop import Flight
from executor.site.ground_files import encode_ground, read_ground_files
from executor.site.ground_view import GroundView, compute_shown_area
from executor.site.tables.links import WebTable
from executor.supervised import report_on_loop

LEAST_TOKEN = 16
"""Characters: shorter ones can be guessed."""


def check_web(table: WebTable) -> None:
    """Check what the environment must hold, and load the server, before anything is connected: loading takes long.

    Raises:
        SiteError: the token is missing or too short.
    """
    if table.enabled:
        _read_token(table)
        if describe_missing_extra(Extra.WEB, "the page"):
            return  # said beside the flight, which goes on without
        import executor.adapters.web  # noqa: F401 - a third of a second in which no vehicle would be heard


def _read_token(table: WebTable) -> str | None:
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
    table: WebTable, flight: Flight, clock: SystemClock, console: MessageSink, order: FlightRequest | None = None
) -> AsyncIterator[None]:
    """Serve the page; a flight goes on without it where it cannot be served.

    It shows the flight before its beginning, too: while the operator is asked, nobody reads what comes to the loop.
    """
    if not table.enabled:
        yield
        return
    if line := describe_missing_extra(Extra.WEB, "the page"):
        console.say(Level.WARNING, f"{line}; the flight goes on without it")
        yield
        return
    from executor.adapters.web import WebServer, WebSettings

    loop = asyncio.get_running_loop()

    def now() -> tuple[FleetState, float]:
        return flight.state, clock.now_s()

    async def take(intent: Intent) -> IntentRecord:
        return flight.submit_intent(intent)

    def submit(intent: Intent) -> Future[IntentRecord]:
        return asyncio.run_coroutine_threadsafe(take(intent), loop)

    token = _read_token(table)
    names = {*table.names, *(() if table.address is None else (urlsplit(table.address).hostname or "",))}
    settings = WebSettings(
        table.host,
        table.port,
        token,
        frozenset(names),
        clock.speedup,
        {} if order is None else read_shown_ground(order, console),
        None if order is None else order.plan.window,
    )
    server = WebServer(settings, flight.context, now, submit, mistake=partial(report_on_loop, loop))
    stack = ExitStack()
    try:
        await asyncio.to_thread(stack.enter_context, server)
    except ConnectionFailed as error:
        console.say(Level.WARNING, f"{error}; the flight goes on without its page")
        yield
        return
    try:
        query = f"?token=${table.token_env}" if token is not None else ""
        console.say(Level.INFO, f"page: {table.address or server.address}{query}")
        yield
    finally:
        await asyncio.to_thread(stack.close)


def read_shown_ground(order: FlightRequest, console: MessageSink) -> Mapping[str, bytes]:
    """Return what the run directory keeps of the ground, or at least where the local metres are."""
    try:
        kept = read_ground_files(order.run)
    except LogError as error:
        console.say(Level.WARNING, f"{error}: the page shows no ground")
        kept = {}
    around = GroundView(*compute_shown_area(order.ground.network.positions_m))
    return kept or encode_ground(around, order.ground.network.frame)
