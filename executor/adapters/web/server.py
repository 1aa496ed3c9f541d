"""Server of a flight's page.

The flight hands over only its newest state, an immutable value. Intents go the other way: a callable passes one to the
flight's own loop and returns its outcome.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import asdict
from hashlib import sha256
from pathlib import PurePath

from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from executor.adapters.intent_body import IntentBody
from executor.adapters.web.guard import ConnectionLimits, Guard
from executor.adapters.web.page_server import TYPES, ErrorHandler, PageServer, WebSettings
from executor.adapters.web.snapshot import Describe, Now, WebSnapshot
from executor.core.context import Context
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.intents import Intent, IntentRecord, Outcome
from missions import format_first_error

PERIOD_S = 0.4
"""Real seconds between two states: at most half of the second that a state may be old."""
ANSWER_S = 5.0
"""Seconds for the flight to decide about an intent."""
STATUS = {Outcome.ACCEPTED: 202, Outcome.DONE: 200, Outcome.REFUSED: 409, Outcome.FAILED: 409}

Submit = Callable[[Intent], "Future[IntentRecord]"]
"""Pass an intent to the flight; called from another thread."""


class WebServer(PageServer):
    """Serve one flight; a context manager."""

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
        """Prepare a server; entering the context starts it."""
        super().__init__(settings, on_error, limits)
        self._present = WebSnapshot(context, now, settings.speedup, describe, settings.window)
        self._etags = {name: f'"{sha256(one).hexdigest()[:20]}"' for name, one in settings.ground.items()}
        """ETags of the ground files, which browsers may cache."""
        self._submit = submit

    def build_app(self) -> ASGIApp:
        """Return the application."""
        routes = [
            *self._list_shared_routes("page.html"),
            _make_json_route("/state", self._present.encode_state),
            _make_json_route("/chart", self._present.encode_map),
            _make_json_route("/assets", self._present.encode_assets),
            _make_json_route("/clock", self._present.encode_clock),
            Route("/ground/{name}", self._serve_ground_file),
            Route("/intents", self._receive_intent, methods=["POST"]),
        ]
        return Guard(Starlette(routes=routes), names=self._names, token=self._settings.token)

    async def _close(self) -> None:
        await self._newest.put(self._present.encode_state())

    async def _keep_newest(self) -> None:
        """Build one state for all browsers, a few times a second."""
        while True:
            await self._newest.put(self._present.encode_state())
            await asyncio.sleep(PERIOD_S)

    async def _serve_ground_file(self, request: Request) -> Response:
        """Return a file that stays the same during the whole flight; 304 if the browser has it."""
        name = request.path_params["name"]
        etag = self._etags.get(name)
        if etag is None:
            return PlainTextResponse("nothing is known of the ground", 404)
        headers = {"cache-control": "private, no-cache", "etag": etag}
        if etag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        kind = TYPES.get(PurePath(name).suffix)
        return Response(self._settings.ground[name], media_type=kind, headers=headers)

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


def _record_to_plain(record: IntentRecord) -> dict[str, object]:
    intent = asdict(record.intent) | {"action": record.intent.action.value}
    rest = {"code": record.code, "text": record.text, "question": record.question, "at_s": round(record.at_s, 2)}
    return intent | {"outcome": record.outcome.value} | rest
