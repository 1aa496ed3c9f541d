"""The server: a thread with an event loop of its own, so that no request and no slow browser delays the flight.

The flight hands over nothing but its newest state, which is a value. An intent goes the other way, by a callable that
hands it to the flight's own loop and returns what became of it.
"""

from __future__ import annotations

import asyncio
import ipaddress
import itertools
import logging
import socket
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from importlib import resources
from pathlib import PurePath
from types import TracebackType
from typing import Any, Self

import uvicorn
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from executor.adapters.intent_body import IntentBody
from executor.adapters.web.guard import (
    ConnectionLimits,
    ConnectionRegistry,
    EventStream,
    Guard,
    LatestValue,
    WebConnection,
)
from executor.adapters.web.snapshot import Describe, Now, WebSnapshot
from executor.core.context import Context
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.intents import Intent, IntentRecord, Outcome
from executor.errors import ConnectionFailed
from executor.supervised import WAITS_S, run_beside
from missions import Window, format_first_error

PERIOD_S = 0.4
"""Real seconds between two states: at most half of the second that a state may be old."""
SEND_BYTES = 1 << 16
"""Room for what is on the way to a browser: a few states."""
ANSWER_S = 5.0
"""How long the flight may take to decide about an intent."""
START_S = 10.0
TYPES: Mapping[str, str] = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".webp": "image/webp",
}
"""Of the files that browsers are given, by what their names end in."""
STATIC = resources.files("executor.adapters.web").joinpath("static")
STATUS = {Outcome.ACCEPTED: 202, Outcome.DONE: 200, Outcome.REFUSED: 409, Outcome.FAILED: 409}

ErrorHandler = Callable[[str, BaseException], None]
"""Called with what died, and of what; from another thread."""
Submit = Callable[[Intent], "Future[IntentRecord]"]
"""Hands an intent to the flight; called from another thread."""


@dataclass(frozen=True, slots=True)
class WebSettings:
    """Where the server listens."""

    host: str
    port: int
    """0 for a free one."""
    token: str | None
    """What has to be shown; None where only this computer can connect."""
    names: frozenset[str] = frozenset()
    """Host names that it answers to, beside its own."""
    speedup: float = 1.0
    """Seconds of the flight in a real one."""
    ground: Mapping[str, bytes] = field(default_factory=dict)
    """What lies below the line: `ground.json`, and the pictures that it names."""
    window: Window | None = None
    """The re-plan window of the first plan."""


_uvicorn_log = logging.getLogger("uvicorn.error")
# It would go to the crew's terminal, tracebacks and all; what matters of it goes to `ErrorHandler`.
_uvicorn_log.propagate = False


class _Log(logging.Handler):
    """Hands on what a request died of; the rest, such as that somebody sent nonsense, is nobody's concern."""

    def __init__(self, on_error: ErrorHandler) -> None:
        super().__init__()
        self._on_error = on_error

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, Exception):
            self._on_error("a request to the page", error)


class WebServer:
    """Serves one flight; a context manager."""

    def __init__(
        self,
        settings: WebSettings,
        context: Context,
        now: Now,
        submit: Submit,
        describe: Describe = build_fleet_view,
        on_error: ErrorHandler = lambda *_: None,
        limits: ConnectionLimits | None = None,
    ) -> None:
        """Prepare a server; entering it makes it listen."""
        self._settings = settings
        self._present = WebSnapshot(context, now, settings.speedup, describe, settings.window)
        self._etags = {name: f'"{sha256(one).hexdigest()[:20]}"' for name, one in settings.ground.items()}
        """What browsers, which may keep these files, tell them by."""
        self._submit = submit
        self._on_error = on_error
        self._limits = limits or ConnectionLimits()
        self._newest = LatestValue()
        self._started, self._ended = threading.Event(), threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: uvicorn.Server | None = None
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._socket: socket.socket | None = None
        self._ending: asyncio.Future[None] | None = None
        self._log = _Log(on_error)
        self.address = ""
        """Where the page is, once it listens."""

    def build_app(self) -> ASGIApp:
        """Return the application."""
        routes = [
            Route("/", self._serve_page),
            Route("/files/{name}", self._serve_file),
            _make_json_route("/state", self._present.encode_state),
            _make_json_route("/chart", self._present.encode_map),
            _make_json_route("/assets", self._present.encode_assets),
            _make_json_route("/clock", self._present.encode_clock),
            Route("/ground/{name}", self._serve_ground_file),
            Route("/events", self._serve_events),
            Route("/intents", self._receive_intent, methods=["POST"]),
        ]
        names = frozenset({"localhost", "127.0.0.1", "[::1]", socket.gethostname().lower()}) | self._settings.names
        return Guard(Starlette(routes=routes), names=names, token=self._settings.token)

    def __enter__(self) -> Self:
        """Listen.

        Raises:
            ConnectionFailed: the address cannot be listened on.
        """
        host, port = self._settings.host, self._settings.port
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family, backlog=64)
        except OSError as error:
            raise ConnectionFailed(f"web: cannot listen on {host} port {port}: {error.strerror}") from error
        # What waits here for a slow browser is old by the time that it arrives.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
        port = self._socket.getsockname()[1]
        shown = _find_own_address() if ipaddress.ip_address(host).is_unspecified else host
        self.address = f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"
        _uvicorn_log.addHandler(self._log)
        self._thread.start()
        self._started.wait(START_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop; browsers that still look are let go."""
        self._ended.set()
        loop, server = self._loop, self._server
        if loop is not None and server is not None:
            with suppress(RuntimeError):  # it has ended by itself
                loop.call_soon_threadsafe(self._shut_down, server)
        self._thread.join(ANSWER_S)
        if self._thread.is_alive():
            self._on_error("the page", TimeoutError(f"it has not ended after {ANSWER_S:g} s"))
        _uvicorn_log.removeHandler(self._log)
        if self._socket is not None:
            self._socket.close()

    def _shut_down(self, server: uvicorn.Server) -> None:
        """Show everybody how it ended, and stop."""

        async def end() -> None:
            try:
                await self._newest.put(self._present.encode_state())
            finally:
                await self._newest.close()
                server.should_exit = True

        self._ending = asyncio.ensure_future(end())

    def _run(self) -> None:
        """Serve, and again whenever that dies, until the end."""
        for attempt in itertools.count():
            try:
                asyncio.run(self._serve())
            except (Exception, SystemExit) as error:  # noqa: BLE001 - the boundary of the thread; uvicorn exits
                self._on_error("the page", error)
            if self._ended.wait(WAITS_S[min(attempt, len(WAITS_S) - 1)]):
                return

    async def _serve(self) -> None:
        if self._socket is None:
            return
        loop = self._loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._on_loop_error)
        door = ConnectionRegistry(self._limits)
        self._newest = LatestValue()

        class AtThisDoor(WebConnection):
            """What uvicorn makes of every connection."""

        AtThisDoor.door = door
        config = uvicorn.Config(
            self.build_app(), log_config=None, access_log=False, server_header=False, ws="none", lifespan="off",
            proxy_headers=False, timeout_keep_alive=5, timeout_graceful_shutdown=1, http=AtThisDoor,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        # uvicorn closes what it listens on when it ends; ours is listened on again.
        with self._socket.dup() as plug:
            async with (
                run_beside("the page's stream", self._broadcast_states),
                run_beside("the page's door", door.close_idle_connections),
            ):
                self._started.set()
                await self._server.serve(sockets=[plug])

    def _on_loop_error(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if isinstance(error, Exception):
            self._on_error(str(context.get("message", "the page")), error)

    async def _broadcast_states(self) -> None:
        """Make one state for everybody, a few times a second."""
        while True:
            await self._newest.put(self._present.encode_state())
            await asyncio.sleep(PERIOD_S)

    async def _serve_page(self, request: Request) -> Response:  # noqa: ARG002
        return Response(STATIC.joinpath("page.html").read_bytes(), media_type="text/html; charset=utf-8")

    async def _serve_file(self, request: Request) -> Response:
        name = request.path_params["name"]
        kind, file = TYPES.get(PurePath(name).suffix), STATIC.joinpath(name)
        if kind is None or PurePath(name).name != name or not file.is_file():
            return PlainTextResponse("there is no such file", 404)
        return Response(file.read_bytes(), media_type=kind)

    async def _serve_ground_file(self, request: Request) -> Response:
        """Answer with a file that is the same during the whole flight: a browser that has it is told so."""
        name = request.path_params["name"]
        etag = self._etags.get(name)
        if etag is None:
            return PlainTextResponse("nothing is known of the ground", 404)
        headers = {"cache-control": "private, no-cache", "etag": etag}
        if etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        kind = TYPES.get(PurePath(name).suffix)
        return Response(self._settings.ground[name], media_type=kind, headers=headers)

    async def _serve_events(self, request: Request) -> ASGIApp:  # noqa: ARG002
        return EventStream(self._newest, self._limits)

    async def _receive_intent(self, request: Request) -> Response:
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            return PlainTextResponse("expected content-type application/json", 415)
        try:
            wish = IntentBody.model_validate_json(await request.body())
        except ClientDisconnect:
            return PlainTextResponse("the body did not come", 400)
        except ValidationError as error:
            return PlainTextResponse(format_first_error(error), 422)
        try:
            async with asyncio.timeout(ANSWER_S):
                record = await asyncio.wrap_future(self._submit(wish.build_intent("page")))
        except TimeoutError:
            return PlainTextResponse("the flight does not answer", 503)
        return JSONResponse(_record_to_plain(record), STATUS[record.outcome])


def _make_json_route(path: str, content: Callable[[], bytes]) -> Route:
    async def answer(_: Request) -> Response:
        return Response(content(), media_type="application/json")

    return Route(path, answer)


def _find_own_address() -> str:
    """Return the address under which others in the field reach this computer; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.connect(("10.255.255.255", 9))
        except OSError:
            return socket.gethostname()
        return str(one.getsockname()[0])


def _record_to_plain(record: IntentRecord) -> dict[str, object]:
    intent = asdict(record.intent) | {"action": record.intent.action.value}
    rest = {"code": record.code, "text": record.text, "question": record.question, "at_s": round(record.at_s, 2)}
    return intent | {"outcome": record.outcome.value} | rest
