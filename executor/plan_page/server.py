"""Serve the plan page: the flight page's access rules, in front of a workspace."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Self

from starlette.routing import Route
from starlette.types import ASGIApp

from executor.adapters.web.guard import MOST_BODY, Guard
from executor.adapters.web.page_server import ErrorHandler, PageServer, WebSettings
from executor.plan_page import site_files
from executor.plan_page.api import build_api, refuse
from executor.plan_page.site_store import SiteStore
from executor.plan_page.worker import Worker
from executor.plan_page.workspace import Workspace
from executor.site.mqtt_and_web_keys import WebTable
from executor.supervised import run_beside

MOST_EDIT_BYTES = 4_000_000
"""Most bytes of one request of edits; an area may have many corners."""
PERIOD_S = 0.2
"""Real seconds between two progress reports of a job."""


class PlanServer(PageServer):
    """Server of one workspace; a context manager."""

    def __init__(
        self,
        table: WebTable,
        token: str | None,
        root: Path,
        store: SiteStore | None = None,
        on_error: ErrorHandler = lambda *_: None,
        reader: Worker | None = None,
    ) -> None:
        """Prepare a server.

        Args:
            table: Address to listen on.
            token: Token that browsers must show; None if only this computer can connect.
            root: Folder; only files below it may be opened.
            store: Site to open at once; none by default.
            on_error: Called with internal errors.
            reader: Worker that reads the site; a new process by default. It is ended with the server.
        """
        super().__init__(WebSettings(table.host, table.port, token, frozenset(table.names)), on_error)
        self._root, self._store, self._reader = root, store, reader
        self._workspace: Workspace | None = None

    def __enter__(self) -> Self:
        """Open the site, and listen.

        Raises:
            SiteError: the site cannot be read.
            LogError: another plan page has it open.
            ConnectionFailed: the address cannot be listened on.
        """
        if self._store is not None:
            self._store.__enter__()
        return super().__enter__()

    def build_app(self) -> ASGIApp:
        """Return the application, with a new workspace: a restarted event loop continues with the same site."""
        if self._workspace is not None:
            self._store = self._workspace.store
            self._workspace.planning.kill()
        workspace = self._workspace = Workspace(self._root, self._store, self._reader)
        workspace.tabs = lambda: len(self._newest.streams)
        api = build_api(workspace)
        shared = [*self._list_shared_routes("plan.html"), Route("/api/events", self._serve_events)]
        api.router.routes.extend(shared)
        return Guard(api, self._names, self._settings.token, _limit_body, refuse)

    async def _keep_newest(self) -> None:
        """Send news as soon as there is any."""
        workspace = self._workspace
        if workspace is None:
            return
        said = b""
        async with (
            run_beside("what is understood", workspace.run),
            run_beside("the files", workspace.watch_files),
            run_beside("the planner", workspace.planning.warm_up),
        ):
            while True:
                now = workspace.describe_news()
                if now != said:
                    said = now
                    await self._newest.put(now)
                workspace.news.clear()
                with suppress(TimeoutError):
                    await asyncio.wait_for(workspace.news.wait(), PERIOD_S)

    async def _close(self) -> None:
        if self._workspace is not None:
            await self._workspace.close()


def _limit_body(path: str) -> int:
    """Return the most bytes of a request's body."""
    if path == "/api/upload":
        return site_files.MOST_UPLOAD
    return MOST_EDIT_BYTES if path == "/api/edits" else MOST_BODY
