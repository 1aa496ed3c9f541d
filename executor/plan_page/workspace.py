"""Hold the page's workspace: one site, its view, its plans and the running job.

It runs on the server's event loop. The site file is read and written in a thread; the rest of the work is done by two
processes: one plans, the other answers questions meanwhile.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from executor.errors import ExecutorError, SiteError
from executor.plan_page import site_files
from executor.plan_page.plan_store import sum_up_facts
from executor.plan_page.planning import OURS, Planning, SiteNow
from executor.plan_page.site_problems import SiteProblem, check_text
from executor.plan_page.site_store import SiteStore
from executor.plan_page.site_view import SiteView, read_site_view, stamp_files
from executor.plan_page.worker import Worker, make_reader
from missions.files import json_text

LOOK_S = 2.0
"""Real seconds between two checks for changes by other programs."""
SOON_S = 0.4
"""Real seconds that a response waits for the site to be read; later results follow on the event stream."""
NOTHING = SiteView([])


class StaleRevision(ExecutorError):
    """Raised for a change of a site that has changed meanwhile."""


class Workspace:
    """Workspace of the page."""

    def __init__(self, root: Path, store: SiteStore | None = None, reader: Worker | None = None) -> None:
        """Start with an open site, or without one.

        Args:
            root: Folder; only files below it may be opened.
            store: The site.
            reader: Worker that reads it; a new process by default.
        """
        self.root = root.absolute()
        self.store = store
        self.view = NOTHING
        self.revision = int(1000 * time.time())
        """Grows with every change of the site, and across restarts, so that an open tab notices them."""
        self.checked = self.revision
        """Revision that `view` belongs to."""
        self.news = asyncio.Event()
        """Set when the event stream has something to send."""
        for folder in {self.root} if store is None else {self.root, store.path.parent}:
            site_files.remove_drafts(folder)
        self.planning = Planning(self.news.set, reader or make_reader())
        self.tabs: Callable[[], int] = lambda: 0
        self._values: Mapping[str, Any] = {}
        self._problems: list[SiteProblem] = []
        self._lock = asyncio.Lock()
        self._wanted = asyncio.Event()
        self._known = asyncio.Condition()
        self._stamps: Sequence[object] = ()
        self._facts = ""
        self._take_change()

    # State

    def describe(self) -> dict[str, Any]:
        """Return the workspace for the page."""
        store = self.store
        history = None if store is None else store.history
        fresh = self.checked == self.revision
        return {
            "revision": self.revision,
            "checked": self.checked,
            "folder": str(self.root),
            "site": None if store is None or history is None else {
                "path": self.name_file(store.path), "name": store.path.stem, "text": history.text,
            },
            "values": self._values,
            "problems": self.view.problems if fresh else self._problems,
            "undo": None if history is None else history.undo_label,
            "redo": None if history is None else history.redo_label,
            "network": None if self.view.network is None else {
                "digest": self.view.digest, "segments": self.view.segments,
            },
            **self.planning.describe(self._facts),
            "saved": store is None or store.saved,
            "save_error": None if store is None else store.save_error,
            "tabs": self.tabs(),
        }  # fmt: skip

    def describe_news(self) -> bytes:
        """Return the event stream's message: enough to tell whether to request more."""
        store = self.store
        self.planning.tick()
        plans = self.planning.describe(self._facts)
        return json_text({
            "revision": self.revision, "checked": self.checked, "tabs": self.tabs(),
            "saved": store is None or store.saved,
            "job": plans["job"], "chosen": plans["chosen"], "warm": plans["warm"],
            "plans": [one["id"] + "*" * one["stale"] for one in plans["plans"]],
        }).encode()  # fmt: skip

    @property
    def now(self) -> SiteNow:
        """Present site, as the subject of a question.

        Raises:
            SiteError: none is open.
        """
        store = self._expect_store()
        return SiteNow(store.history.text, store.path.parent, self._facts, self.planning.open(store.path))

    def expect_revision(self, revision: int) -> None:
        """Check that the page has seen the present revision.

        Raises:
            StaleRevision: the site has changed.
        """
        if revision != self.revision:
            raise StaleRevision("the site was changed elsewhere, in another tab or program; this is its present state")

    def name_file(self, path: Path) -> str:
        """Return a file's path relative to the folder of this page."""
        with suppress(ValueError):
            return path.resolve().relative_to(self.root.resolve()).as_posix()
        return str(path)

    @property
    def folder(self) -> Path:
        """Folder of the site file, whether it exists yet or not."""
        return self.root if self.store is None else self.store.path.parent

    # Actions

    async def open_file(self, path: Path | None) -> None:
        """Open a site; for a network make one, None for the bundled network; for a plan open the site next to it.

        Raises:
            ExecutorError: it cannot be opened; the previous site stays open.
            MissionsError: a network that cannot be used.
        """
        kind = "network" if path is None else await asyncio.to_thread(site_files.find_kind, path)
        if path is None or kind == "network":
            folder = self.root if path is None else path.parent
            path = await self.planning.answers.run(site_files.make_site, folder, path)
        elif kind == "plan":
            path = site_files.find_site_of_plan(path)
        path = path.absolute()
        async with self._lock:
            before = self.store
            if before is not None and before.path == path:
                return
            store = await asyncio.to_thread(SiteStore(path).__enter__)
            self.store, self.view = store, NOTHING
            if before is not None:
                await asyncio.to_thread(before.__exit__, None, None, None)
            self._take_change()

    async def upload(self, name: str, content: AsyncIterator[bytes], *, as_network: bool) -> str:
        """Store a file; a network starts a new site. Return its name relative to the site's folder.

        Raises:
            ExecutorError: it cannot be stored.
            MissionsError: a network that cannot be used; it is not stored.
        """
        path = await site_files.receive_file(self.folder, name, content)
        if as_network:
            try:
                await self.open_file(path)
            except BaseException:
                path.unlink(missing_ok=True)
                raise
        return path.name

    async def change(self, revision: int, work: Callable[[SiteStore], None]) -> None:
        """Change the site file, in a thread.

        Raises:
            StaleRevision: the site has changed.
            SiteError: none is open, or this cannot be done.
        """
        async with self._lock:
            store = self._expect_store()
            await self._look()
            self.expect_revision(revision)
            await asyncio.to_thread(work, store)
            self._take_change()

    async def choose_for_flight(self, plan: str) -> tuple[Path, Path]:
        """Make a plan the chosen one; return the files of the site and of the plan, which match the page.

        Raises:
            SiteError: the site is not on disk, or there is no such plan.
        """
        now, store = self.now, self._expect_store()
        if not store.saved:
            raise SiteError("expected a site that is saved before it is flown")
        await self.planning.choose(now, plan)
        return store.path, now.plans.file

    async def wait_until_checked(self, within_s: float = SOON_S) -> None:
        """Wait until the present site is read, up to a time limit."""
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s), self._known:
                await self._known.wait_for(lambda: self.checked == self.revision)

    async def run(self) -> None:
        """Read every new revision of the site, forever."""
        while True:
            await self._wanted.wait()
            self._wanted.clear()
            revision, store = self.revision, self.store
            if store is None:
                continue
            try:
                view = await self.planning.answers.run(read_site_view, store.history.text, store.path.parent)
            except ExecutorError as error:
                view = SiteView([SiteProblem(path=None, message=str(error))])
            async with self._known:
                self.view, self.checked = view, revision
                self._known.notify_all()
            self.news.set()
            with suppress(*OURS):  # the next question reports a dead process
                await self.planning.refresh(self.now)
            self.news.set()

    async def watch_files(self) -> None:
        """Read changes by other programs, and retry failed saves, forever."""
        while True:
            await asyncio.sleep(LOOK_S)
            async with self._lock:
                await self._look()
            with suppress(*OURS):
                await self.planning.look()
                if self.store is not None:
                    await self.planning.prepare(self.now)

    async def close(self) -> None:
        """Save unsaved changes, and end the processes."""
        async with self._lock:
            if self.store is not None:
                await asyncio.to_thread(self.store.__exit__, None, None, None)
            await self.planning.close()

    def _expect_store(self) -> SiteStore:
        if self.store is None:
            raise SiteError("expected a site; none is open")
        return self.store

    async def _look(self) -> None:
        store = self.store
        if store is None:
            return
        was = (store.saved, store.save_error)
        if await asyncio.to_thread(store.look):
            self._take_change()
        stamps = await asyncio.to_thread(stamp_files, self._values, store.path.parent)
        if stamps != self._stamps:
            self._stamps = stamps
            self._facts = sum_up_facts(self._values, stamps)
            self._wanted.set()
        if was != (store.saved, store.save_error):
            self.news.set()

    def _take_change(self) -> None:
        if self.store is None:
            return
        self.revision += 1
        self.planning.open(self.store.path)
        values, _, self._problems = check_text(self.store.history.text)
        self._values = json.loads(json.dumps(values, default=str))  # TOML also has times
        self._stamps = stamp_files(values, self.store.path.parent)
        self._facts = sum_up_facts(self._values, self._stamps)
        self._wanted.set()
        self.news.set()
