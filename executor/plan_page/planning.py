"""Manage the plans of the open site, and the single job that makes new ones."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from executor.errors import ExecutorError, SiteError
from executor.plan_page import plan_work
from executor.plan_page.plan_store import PlanStore
from executor.plan_page.worker import WorkCancelled, Worker
from missions import MissionsError
from planner import PlannerError

ENDS_S = 5.0
"""Real seconds after which the process of a cancelled job is killed."""
OURS = (ExecutorError, MissionsError, PlannerError)

JobState = Literal["running", "done", "cancelled", "failed"]


@dataclass(frozen=True, slots=True)
class SiteNow:
    """Present site, as the subject of a question."""

    text: str
    folder: Path
    facts: str
    """Fingerprint of everything that a plan depends on."""
    plans: PlanStore
    """Plans of the site."""


class Superseded(ExecutorError):
    """Raised when a newer question has replaced this one."""


@dataclass
class Job:
    """Search for plans."""

    number: int
    kind: str
    limit_s: float
    began_s: float = field(default_factory=time.monotonic)
    ended_s: float | None = None
    state: JobState = "running"
    error: str | None = None
    plans: Sequence[str] = ()
    first: tuple[float, float] | None = None
    """Cost of the first plan with the fewest segments left out, and the time when it was found."""
    value: float | None = None
    uncovered: int | None = None
    improved_s: float | None = None

    @property
    def elapsed_s(self) -> float:
        """Elapsed time."""
        return (time.monotonic() if self.ended_s is None else self.ended_s) - self.began_s

    def take_progress(self, value: float, uncovered: int) -> None:
        """Take the search's progress; without a plan its value is infinite."""
        if not math.isfinite(value):
            return
        if self.first is None or self.uncovered is None or uncovered < self.uncovered:
            self.first = (value, self.elapsed_s)
        if (self.uncovered, self.value) != (uncovered, value):
            self.improved_s = self.elapsed_s
        self.value, self.uncovered = value, uncovered

    def describe(self) -> dict[str, Any]:
        """Return the job for the page."""
        first, since_s = self.first or (None, None)
        better = None if not first or self.value is None else 100.0 * (first - self.value) / abs(first)
        return {
            "id": str(self.number), "kind": self.kind, "state": self.state, "elapsed_s": round(self.elapsed_s, 1),
            "limit_s": self.limit_s, "value": self.value, "uncovered": self.uncovered,
            "better_pct": None if better is None else round(better, 2),
            "since_s": None if since_s is None else round(since_s, 1),
            "improved_s": None if self.improved_s is None else round(self.improved_s, 1),
            "error": self.error, "plans": list(self.plans),
        }  # fmt: skip


class Planning:
    """Plans and jobs; runs on the server's event loop."""

    def __init__(self, changed: Callable[[], None], answers: Worker) -> None:
        """Start empty; `changed` is called when the event stream has news, `answers` reads the site."""
        self.answers, self.planner = answers, Worker("planning")
        self.store: PlanStore | None = None
        self.job: Job | None = None
        self.warm = False
        """Whether the planner is loaded: compiling it takes a while, once."""
        self._changed = changed
        self._number = 0
        self._asked = 0
        self._answering = asyncio.Lock()
        self._task: asyncio.Task[None] | None = None
        self._prepared: tuple[str | None, str] = (None, "")
        """Plan and site fingerprint for which answers were last prepared."""

    async def warm_up(self) -> None:
        """Load the kernels for plans and answers, in both processes."""
        await self.answers.run(abs, 0)  # the opened site is read first, with all processors
        await self.planner.run(plan_work.load_planner)  # this one alone compiles what is new on this computer
        await self.answers.run(plan_work.load_planner)  # a network dropped onto the page meanwhile went first
        self.warm = True
        self._changed()

    def open(self, site: Path) -> PlanStore:
        """Return the plans of a site; those of another one are no longer shown."""
        if self.store is None or self.store.site != site:
            self.store = PlanStore(site)
        return self.store

    async def refresh(self, now: SiteNow) -> None:
        """Find the stored plans, and whether the chosen one fits the present site."""
        store = now.plans
        kept = await asyncio.to_thread(store.list_new)
        if kept:
            store.summaries = {**await self.answers.run(plan_work.summarise_plans, kept), **store.summaries}
        await self.look()
        if store.chosen in store.summaries and store.facts.get(store.chosen) != now.facts:
            path = store.path_of(store.chosen)
            if not await self.answers.run(plan_work.is_stale, now.text, now.folder, path):
                store.facts[store.chosen] = now.facts
                await asyncio.to_thread(store.keep_facts)

    async def prepare(self, now: SiteNow) -> None:
        """Prepare answers about the chosen plan ahead of the first question."""
        store = now.plans
        if store.chosen not in store.summaries or self._prepared == (store.chosen, now.facts):
            return
        self._prepared = (store.chosen, now.facts)
        await self.answers.run(plan_work.prepare_answers, now.text, now.folder, store.path_of(store.chosen))

    async def look(self) -> None:
        """Take a chosen plan that another program has written."""
        store = self.store
        path = None if store is None else await asyncio.to_thread(store.take_chosen)
        if store is not None and path is not None:
            store.summaries |= await self.answers.run(plan_work.summarise_plans, [path])
            self._changed()

    def start(self, now: SiteNow, wish: plan_work.PlanSettings, after: Path | None = None) -> Job:
        """Start a planning job; with `after`, a run directory, for the segments left over by its flight.

        Raises:
            SiteError: another job is running.
        """
        if self.job is not None and self.job.state == "running":
            raise SiteError("expected nothing to be planned already; cancel it first")
        self._number += 1
        kind = "left" if after is not None else "day" if wish.day else "front" if wish.front else "plan"
        self.job = Job(self._number, kind, wish.seconds)
        self._task = asyncio.create_task(self._run(self.job, now, wish, after), name="planning")
        self._changed()
        return self.job

    async def cancel(self, number: str) -> None:
        """Cancel a job; its results are dropped."""
        job = self.job
        if job is None or str(job.number) != number or job.state != "running" or self._task is None:
            return
        self.planner.cancel(job.number)
        await asyncio.wait({self._task}, timeout=ENDS_S)
        if job.state == "running":
            self.planner.kill()
            await asyncio.wait({self._task}, timeout=ENDS_S)

    def tick(self) -> None:
        """Check the progress of the job."""
        job, (number, value, uncovered) = self.job, self.planner.progress
        if job is not None and number == job.number:
            job.take_progress(value, uncovered)

    async def show(self, now: SiteNow, name: str) -> dict[str, Any]:
        """Return the page's full view of a plan.

        Raises:
            ExecutorError: there is no such plan, or the site cannot be used.
            MissionsError: the plan is another site's.
        """
        shown = await self.answers.run(plan_work.show_plan, now.text, now.folder, now.plans.path_of(name))
        return {"summary": now.plans.describe(name, now.facts), **shown}

    async def preview_loss(self, now: SiteNow, name: str, vehicle: str, at_s: float) -> dict[str, Any]:
        """Return the survivors' routes if a vehicle were lost.

        Raises:
            Superseded: a newer question arrived meanwhile.
            ExecutorError: there is no such plan, or the site cannot be used.
            MissionsError: the plan has no such vehicle.
            PlannerError: no vehicle is left.
        """
        path = now.plans.path_of(name)
        self._asked += 1
        mine, began_s = self._asked, time.monotonic()
        async with self._answering:
            if mine != self._asked:
                raise Superseded("a newer question came")
            found = await self.answers.run(plan_work.answer_loss, now.text, now.folder, path, vehicle, at_s)
        return {**found, "seconds": round(time.monotonic() - began_s, 3)}

    async def change(
        self, now: SiteNow, name: str, changes: Sequence[plan_work.Change], *, keep: bool
    ) -> dict[str, Any]:
        """Change a plan by hand; the result is stored as a new plan, and with `keep` it becomes the chosen one.

        Raises:
            ExecutorError: there is no such plan, or a change names a missing segment or vehicle.
            MissionsError: the plan is another site's.
        """
        store = now.plans
        path = store.path_of(name)
        found = await self.answers.run(plan_work.edit_plan_by_hand, now.text, now.folder, path, changes, store.folder)
        made = found.pop("made")
        store.add([made], now.facts)
        if keep:
            await asyncio.to_thread(store.choose, made.id)
        self._changed()
        return {**found, "plan": {"summary": store.describe(made.id, now.facts), **found["plan"]}}

    async def choose(self, now: SiteNow, name: str) -> None:
        """Make a plan the one to fly.

        Raises:
            SiteError: there is none of this name, or its file cannot be written.
        """
        await asyncio.to_thread(now.plans.choose, name)
        self._changed()

    def kill(self) -> None:
        """End the processes at once."""
        self.answers.kill()
        self.planner.kill()

    async def close(self) -> None:
        """End the processes."""
        await asyncio.gather(*(asyncio.to_thread(one.close) for one in (self.answers, self.planner)))

    def describe(self, facts: str) -> Mapping[str, Any]:
        """Return the plans and the job for the page."""
        store = self.store
        return {
            "plans": [] if store is None else [store.describe(name, facts) for name in reversed(store.summaries)],
            "chosen": None if store is None else store.chosen,
            "job": None if self.job is None else self.job.describe(),
            "warm": self.warm,
        }

    async def _run(self, job: Job, now: SiteNow, wish: plan_work.PlanSettings, after: Path | None) -> None:
        store = now.plans
        try:
            made = await self.planner.run(
                plan_work.make_plans, now.text, now.folder, wish, store.folder, job.number, after
            )
            store.add(made, now.facts)
            job.plans = [one.id for one in made]
            if not wish.front:
                await asyncio.to_thread(store.choose, made[0].id)
            job.state = "done"
        except WorkCancelled:
            job.state = "cancelled"
        except OURS as error:
            job.state, job.error = "failed", str(error)
        except BaseException:
            job.state, job.error = "failed", "internal error"
            raise
        finally:
            job.ended_s = time.monotonic()
            self._changed()
        with suppress(*OURS):  # the next question reports the error
            await self.prepare(now)
