"""Server of a page: a thread with its own event loop, so that no request and no slow browser delays the flight.

Each page has its own routes; the guard, the static files and the event stream are shared.
"""

from __future__ import annotations

import asyncio
import ipaddress
import itertools
import logging
import socket
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import resources
from pathlib import PurePath
from types import TracebackType
from typing import Any, Self

import uvicorn
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from executor.adapters.web import guard
from executor.errors import ConnectionFailed
from executor.supervised import WAITS_S, run_beside
from missions import Window

SEND_BYTES = 1 << 16
"""Send buffer of a connection: a few states."""
ENDS_S = 5.0
"""Seconds for the server to end."""
START_S = 10.0
TYPES: Mapping[str, str] = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".webp": "image/webp",
}
"""Content types of static files, by suffix."""
STATIC = resources.files("executor.adapters.web").joinpath("static")

ErrorHandler = Callable[[str, BaseException], None]
"""Called with the failed activity and its exception; from another thread."""


@dataclass(frozen=True, slots=True)
class WebSettings:
    """Address and content of the server."""

    host: str
    port: int
    """TCP port; 0 for any free one."""
    token: str | None
    """Required token; None if only this computer can connect."""
    names: frozenset[str] = frozenset()
    """Accepted host names, besides its own."""
    speedup: float = 1.0
    """Speed-up: flight seconds per real second."""
    ground: Mapping[str, bytes] = field(default_factory=dict)
    """Ground below the line: `ground.json`, and the pictures that it names."""
    window: Window | None = None
    """Re-plan window of the first plan."""


_uvicorn_log = logging.getLogger("uvicorn.error")
# Else it would go to the crew's terminal, with tracebacks; relevant errors go to `ErrorHandler`.
_uvicorn_log.propagate = False


class _Log(logging.Handler):
    """Pass on exceptions of requests; drop the rest, such as invalid requests."""

    def __init__(self, on_error: ErrorHandler) -> None:
        super().__init__()
        self._on_error = on_error

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, Exception):
            self._on_error("a request to the page", error)


class PageServer(ABC):
    """Serve one page; a context manager."""

    def __init__(
        self,
        settings: WebSettings,
        on_error: ErrorHandler = lambda *_: None,
        limits: guard.ConnectionLimits | None = None,
    ) -> None:
        """Prepare a server; entering the context starts it."""
        self._settings = settings
        self._on_error = on_error
        self._limits = limits or guard.ConnectionLimits()
        self._newest = guard.LatestValue()
        self._started, self._ended = threading.Event(), threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: uvicorn.Server | None = None
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._socket: socket.socket | None = None
        self._ending: asyncio.Future[None] | None = None
        self._log = _Log(on_error)
        self.address = ""
        """Address of the page, once the server listens."""

    @abstractmethod
    def build_app(self) -> ASGIApp:
        """Return the application."""

    @abstractmethod
    async def _keep_newest(self) -> None:
        """Publish new values to the stream, until the end."""

    @abstractmethod
    async def _close(self) -> None:
        """Publish the final state before the streams end."""

    @property
    def _names(self) -> frozenset[str]:
        """Return the accepted host names."""
        return frozenset({"localhost", "127.0.0.1", "[::1]", socket.gethostname().lower()}) | self._settings.names

    def _list_shared_routes(self, page: str) -> Sequence[Route]:
        """Return the routes that all pages share; `page` is the file that a browser loads first."""

        async def serve_page(_: Request) -> Response:
            return Response(STATIC.joinpath(page).read_bytes(), media_type="text/html; charset=utf-8")

        return (
            Route("/", serve_page),
            Route("/files/{name:path}", self._serve_file),
            Route("/events", self._serve_events),
        )

    def __enter__(self) -> Self:
        """Listen.

        Raises:
            ConnectionFailed: The address cannot be listened on.
        """
        host, port = self._settings.host, self._settings.port
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family, backlog=64)
        except OSError as error:
            raise ConnectionFailed(f"web: cannot listen on {host} port {port}: {error.strerror}") from error
        # Data that waits here for a slow browser is outdated when it arrives.
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
        """Stop, and disconnect browsers."""
        self._ended.set()
        loop, server = self._loop, self._server
        if loop is not None and server is not None:
            with suppress(RuntimeError):  # it has already ended
                loop.call_soon_threadsafe(self._shut_down, server)
        self._thread.join(ENDS_S)
        if self._thread.is_alive():
            self._on_error("the page", TimeoutError(f"it has not ended after {ENDS_S:g} s"))
        _uvicorn_log.removeHandler(self._log)
        if self._socket is not None:
            self._socket.close()

    def _shut_down(self, server: uvicorn.Server) -> None:
        """Send the final state to all browsers, and stop."""

        async def end() -> None:
            try:
                await self._close()
            finally:
                await self._newest.close()
                server.should_exit = True

        self._ending = asyncio.ensure_future(end())

    def _run(self) -> None:
        """Serve, and restart after every failure, until the end."""
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
        door = guard.ConnectionRegistry(self._limits)
        self._newest = guard.LatestValue()

        class AtThisDoor(guard.WebConnection):
            """Protocol that uvicorn creates for every connection."""

        AtThisDoor.door = door
        config = uvicorn.Config(
            self.build_app(), log_config=None, access_log=False, server_header=False, ws="none", lifespan="off",
            proxy_headers=False, timeout_keep_alive=5, timeout_graceful_shutdown=1, http=AtThisDoor,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        # uvicorn closes its listening socket when it ends; ours is used again.
        with self._socket.dup() as plug:
            async with (
                run_beside("the page's stream", self._keep_newest),
                run_beside("the page's door", door.close_idle_connections),
            ):
                self._started.set()
                await self._server.serve(sockets=[plug])

    def _on_loop_error(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if isinstance(error, Exception):
            self._on_error(str(context.get("message", "the page")), error)

    async def _serve_file(self, request: Request) -> Response:
        name = request.path_params["name"]
        kind, file = TYPES.get(PurePath(name).suffix), STATIC.joinpath(name)
        plain = all(part == PurePath(part).name for part in name.split("/"))
        if kind is None or not plain or not file.is_file():
            return PlainTextResponse("there is no such file", 404)
        return Response(file.read_bytes(), media_type=kind)

    async def _serve_events(self, request: Request) -> ASGIApp:  # noqa: ARG002
        return guard.EventStream(self._newest, self._limits)


def _find_own_address() -> str:
    """Return this computer's address for others in the field; sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.connect(("10.255.255.255", 9))
        except OSError:
            return socket.gethostname()
        return str(one.getsockname()[0])
