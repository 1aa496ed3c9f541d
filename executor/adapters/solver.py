"""The planner in a separate process: compiled before take-off, with a deadline, and cancellable."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from ctypes import c_longlong
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

import planner
from executor.adapters.interrupts import end_with_parent
from executor.adapters.one_worker import SPAWNED, OneWorker
from executor.core.interface.commands import Solve
from executor.core.interface.events import Gain, NewRoute, SolveEnded
from missions import Pricing, Task, build_open_task

GIVE_UP_S = 10.0
"""Real seconds beyond its deadline after which a silent solver counts as dead."""
START_S = 120.0
"""Real seconds for a worker to start: it loads the kernels, possibly on a busy computer."""
SETTLED = 4000
"""Iterations without an improvement after which a re-plan is good enough, as vehicles fly on meanwhile."""


JUDGE_S = 0.4
"""Real seconds to compute the effect of a loss."""
JUDGE_SETTLED = 1000


REPLAN_COST = planner.Cost.MINMAX
"""Cost of re-plans: all vehicles should land soon; a sum would leave the whole rest to one vehicle until its battery is
empty."""


@dataclass(frozen=True, slots=True)
class SolverSetup:
    """Data that the worker needs before its first problem."""

    limit_s: float
    """Real seconds for one re-plan."""
    seed: int


_worker: tuple[SolverSetup, c_longlong, c_longlong] | None = None


def _prepare(setup: SolverSetup, cancelled: c_longlong, wanted: c_longlong) -> None:
    global _worker  # noqa: PLW0603 - a worker process holds exactly one setup, given when it starts
    _worker = (setup, cancelled, wanted)
    end_with_parent()
    logging.basicConfig(format="%(message)s")
    logging.getLogger("planner").setLevel(logging.INFO)  # it reports when it compiles
    planner.warm_up()


def _is_ready() -> bool:
    return _worker is not None


def _solve_in_worker(problem: Solve, pricing: Pricing, *, judging: bool = False) -> SolveEnded:
    if _worker is None:
        raise RuntimeError("the worker was not prepared")
    setup, cancelled, wanted = _worker
    if not judging:
        return solve_for_survivors(setup, problem, pricing, lambda: cancelled.value >= problem.revision)
    return solve_for_survivors(
        setup, problem, pricing, lambda: wanted.value > 0, limit_s=JUDGE_S, settled=JUDGE_SETTLED
    )


def solve_for_survivors(
    setup: SolverSetup,
    problem: Solve,
    pricing: Pricing,
    cancelled: Callable[[], bool],
    *,
    limit_s: float | None = None,
    settled: int = SETTLED,
) -> SolveEnded:
    """Plan the open segments for the survivors; runs in the worker.

    Args:
        setup: Data of the worker.
        problem: The survivors and the segments that they can take over.
        pricing: Pricing of the whole network.
        cancelled: Whether the answer is no longer needed.
        limit_s: Real seconds; by default the setup's.
        settled: Iterations without an improvement after which to stop.
    """
    task, tails = build_replan_task(pricing, problem)
    spare = {segment for segment, number in enumerate(task.segment_ids) if number in problem.left_over}
    carried = planner.build_onboard_plan(task.instance, tails)
    stop = planner.combine_stop_rules(
        planner.Seconds(setup.limit_s if limit_s is None else limit_s),
        planner.NoImprovement(settled),
        planner.Cancelled(cancelled),
    )
    try:
        own, own_tails = task, tails
        if spare:  # left-over segments must not displace the others
            own = build_open_task(apply_pace(pricing, problem), problem.open_segments, task.instance.vehicles)
            own_tails = [own.from_network(_select_task_visits(own, task.to_network(tail))) for tail in tails]
        warm = planner.warm_start(own.instance, own_tails)
        result = planner.replan(own.instance, warm=warm, cost=REPLAN_COST, stop=stop, seed=setup.seed)
    except planner.PlannerError as error:
        return SolveEnded(problem.revision, None, (), 0.0, str(error))
    if cancelled():
        return SolveEnded(problem.revision, None, (), result.seconds, "cancelled")
    candidates = [result.plan, warm]
    if spare:
        found = [task.from_network(own.to_network(route.visits)) for route in result.plan.routes]
        candidates = [planner.warm_start(task.instance, routes) for routes in (found, tails)]
    best = planner.select_best_plan(task.instance, carried.plan, candidates, spare)
    plan, names = task.plan_to_network(best), [vehicle.name for vehicle in task.instance.vehicles]
    return SolveEnded(
        problem.revision,
        tuple(NewRoute(names[route.vehicle], route.visits) for route in plan.routes),
        tuple(sorted(set(plan.uncovered) - set(problem.left_over))),
        result.seconds,
        result.stopped_by,
        _compute_gain(task.instance, carried, best, spare, names),
    )


def build_replan_task(pricing: Pricing, problem: Solve) -> tuple[Task, list[tuple[int, ...]]]:
    """Return the task to plan, and each survivor's on-board part of it."""
    vehicles = [
        planner.Vehicle(
            offer.vehicle,
            offer.start_m,
            offer.budget_pct,
            offer.consumption,
            offer.airborne,
            offer.start_up_m,
            offer.facing_m,
        )
        for offer in problem.survivors
    ]
    pricing = apply_pace(pricing, problem)
    task = build_open_task(pricing, (*problem.open_segments, *problem.left_over), vehicles)
    tails = [
        task.from_network(_select_task_visits(task, tail))
        for tail in _remove_duplicates([one.tail for one in problem.survivors])
    ]
    instance = planner.grant_onboard_budgets(task.instance, tails, [offer.most_pct for offer in problem.survivors])
    return replace(task, instance=instance), tails


def apply_pace(pricing: Pricing, problem: Solve) -> Pricing:
    """Return the pricing with the survivors' measured pace and barred segments."""
    shown = {offer.vehicle: offer.pace for offer in problem.survivors}
    models = {
        name: replace(model, pace=model.pace.combine(shown[name])) if name in shown else model
        for name, model in pricing.models.items()
    }
    barred = {offer.vehicle: frozenset(offer.barred) for offer in problem.survivors if offer.barred}
    closed = {offer.vehicle: offer.closed for offer in problem.survivors if offer.closed}
    low = frozenset(offer.vehicle for offer in problem.survivors if offer.low)
    return replace(pricing, models=models, barred=barred, locked={}, closed=closed, low_starts=low)


def _compute_gain(
    instance: planner.Instance, carried: planner.OnboardPlan, best: planner.Plan, spare: set[int], names: Sequence[str]
) -> Gain:
    now, before = planner.rate_plan(instance, best, spare), planner.rate_plan(instance, carried.plan, spare)
    return Gain(
        now.segments - before.segments,
        now.value - before.value,
        now.spare_segments - before.spare_segments,
        now.longest_s,
        before.longest_s,
        tuple(names[vehicle] for vehicle in carried.short),
    )


def _select_task_visits(task: Task, visits: Sequence[int]) -> tuple[int, ...]:
    """Return the network's visits that belong to a problem."""
    known = set(task.segment_ids)
    return tuple(visit for visit in visits if planner.segment_of(visit) in known)


def _remove_duplicates(tails: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return each survivor's on-board visits without those that another one carries too.

    A vehicle back from its pilot still has segments on board that were given to others meanwhile.
    """
    taken: set[int] = set()
    once = []
    for tail in tails:
        own = tuple(visit for visit in tail if visit >> 1 not in taken)
        taken |= {visit >> 1 for visit in own}
        once.append(own)
    return once


class SolverProcess:
    """One worker process; it is restarted if it dies."""

    def __init__(self, setup: SolverSetup, tell: Callable[[str], None] = lambda _: None) -> None:
        """Set up the worker; entering the context starts it.

        Args:
            setup: Data of the worker.
            tell: Called with a line for the crew when a worker had to be killed.
        """
        self._setup = setup
        self._tell = tell
        # No locks: a worker killed while it holds one would keep it, and the flight would wait for it.
        self._cancelled: c_longlong = SPAWNED.RawValue("q", -1)
        self._wanted: c_longlong = SPAWNED.RawValue("q", 0)
        """Number of re-plans requested; a judgement gives way to them."""
        self._worker = OneWorker(_prepare, setup, self._cancelled, self._wanted)
        self._warm = False
        """Whether the worker has answered; a restarted one must load the kernels first."""

    async def __aenter__(self) -> Self:
        """Start the worker and wait until everything is compiled."""
        await self._warm_up()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the worker, and kill it if it hangs."""
        self._cancelled.value = 2**62
        if await asyncio.to_thread(self._worker.end):
            self._tell("the solver did not stop on request, and was killed")

    async def solve(self, problem: Solve, pricing: Pricing) -> SolveEnded:
        """Return the best routes found within the limit; no routes if the worker died or was cancelled."""
        self._wanted.value += 1
        try:
            if not self._warm:
                async with asyncio.timeout(START_S):
                    await self._warm_up()
            async with asyncio.timeout(self._setup.limit_s + GIVE_UP_S):
                return await asyncio.wrap_future(self._worker.submit(_solve_in_worker, problem, pricing))
        except BrokenProcessPool:
            self._kill_worker()
            return SolveEnded(problem.revision, None, (), 0.0, "the solver's process died")
        except TimeoutError:
            self._kill_worker()
            return SolveEnded(problem.revision, None, (), 0.0, "the solver did not answer")
        finally:
            self._wanted.value -= 1

    async def judge(self, problem: Solve, pricing: Pricing) -> tuple[int, ...] | None:
        """Return the segments that a re-plan would leave over; None if a real re-plan came first or the worker died."""
        if self._wanted.value > 0:
            return None
        try:
            async with asyncio.timeout(JUDGE_S + GIVE_UP_S):
                ended = await asyncio.wrap_future(self._worker.submit(_solve_in_worker, problem, pricing, judging=True))
        except (BrokenProcessPool, TimeoutError):
            return None  # the next re-plan finds out, and restarts the worker
        return None if ended.routes is None else ended.uncovered

    def cancel(self, revision: int) -> None:
        """Stop work on this or an older revision at its next check."""
        self._cancelled.value = max(self._cancelled.value, revision)

    async def _warm_up(self) -> None:
        """Wait until the worker has loaded everything; compiling has no time limit."""
        ready = self._worker.submit(_is_ready)
        # A starting worker takes shared objects from here; they must exist until then, even if the caller gives up
        # before.
        ready.add_done_callback(lambda _: self._cancelled)
        await asyncio.wrap_future(ready)
        self._warm = True

    def _kill_worker(self) -> None:
        """End an unusable worker; another one solves the next problem."""
        self._worker.kill()
        self._warm = False
