"""The search for the plan of a day: cycles of annealing around the kernel, starts side by side, the stop rule.

As in ``planner.search`` cycles grow, each from the best plan so far, and starts wait for each other at the end of each
round: the seed, the number of starts and of iterations decide the plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np
import numpy.typing as npt

from benchmarks.scenarios.construct import copy_day, day_memory, day_plan, day_problem, day_state
from benchmarks.scenarios.evaluate import evaluate_day
from benchmarks.scenarios.kernels.day import NEVER, DayProblem, DayState, divide
from benchmarks.scenarios.kernels.dayinsertion import insert_tasks
from benchmarks.scenarios.kernels.daysearch import anneal_day, measure_day
from benchmarks.scenarios.model import DayInstance
from benchmarks.scenarios.result import DayResult
from planner.construct import build_random_state
from planner.kernels.arrays import RandomState
from planner.search_rounds import run_in_threads, run_rounds
from planner.stop_rules import Progress, StopRule, Stopwatch

BATCH = 250
"""Iterations of a start between two questions to the stop rule: a few milliseconds."""
FIRST_CYCLE = 1_000
"""Iterations of the first cycle; each further one is half as long again."""
GROWTH = 1.5
LONGEST_CYCLE = 30_000
HOT = 0.3
"""The temperature at the begin of a cycle, as a share of the longest trip that is allowed."""
COLD = 0.005
"""The same at its end."""
SHARE = 0.1
"""What the mean of all ends weighs against the last one in the search."""

HASTE = 0.1
"""The same of the mean time at which tasks are brought home."""


class _Start:
    """One walk; walks share nothing that changes."""

    def __init__(self, problem: DayProblem, first: DayState, rng: RandomState) -> None:
        self.best = copy_day(first)
        self.key = np.zeros(3)
        measure_day(first, self.key)
        self._problem = problem
        self._current = copy_day(first)
        self._trial = copy_day(first)
        self._memory = day_memory(problem)
        self._measured = np.zeros(3)
        self._temperature = np.zeros(1)
        self._rng = rng

    def begin(self, leader: _Start, temperature: float) -> None:
        """Begin a cycle from the best plan of ``leader``."""
        for state in (self._current, self._trial, self.best):
            if state is not leader.best:
                for target, source in zip(state, leader.best, strict=True):
                    target[:] = source
        self.key[:] = leader.key
        self._temperature[0] = temperature

    def run(self, cooling: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal_day(
            self._problem, self._current, self._trial, self.best, self.key, self._temperature, cooling, iterations,
            self._rng, self._memory, self._measured,
        )  # fmt: skip
        return improved


class DaySearch:
    """One search; ``run`` is all that there is to call."""

    def __init__(
        self, instance: DayInstance, *, seed: int, starts: int, initial: Sequence[Sequence[int]], watch: Stopwatch
    ) -> None:
        self._instance = instance
        self._watch = watch
        self._problem = day_problem(instance, SHARE / len(instance.vehicles), HASTE / max(1, len(instance.tasks)))
        able: npt.NDArray[np.bool_] = np.any(self._problem.able, axis=0, keepdims=True)[0]
        self._idle = not able.any()
        first = self._first(initial, able, seed)
        self._uncovered = len(instance.tasks) - int(first.lengths.sum())
        self._starts = [_Start(self._problem, first, build_random_state(seed + number)) for number in range(starts)]
        self._leader = self._starts[0]
        self._iterations = 0
        self._improved_at = 0
        self._length = FIRST_CYCLE
        self._begin()

    def _first(self, initial: Sequence[Sequence[int]], able: npt.NDArray[np.bool_], seed: int) -> DayState:
        """Return the given visits with all open tasks put in where they cost least."""
        state, memory = day_state(self._problem), day_memory(self._problem)
        waiting = able.copy()
        for vehicle, visits in enumerate(initial):
            kept = [visit for visit in visits if self._problem.able[vehicle, visit >> 1]]
            state.visits[vehicle, : len(kept)] = kept
            state.lengths[vehicle] = len(kept)
            divide(self._problem, state, memory, vehicle)
            waiting[[visit >> 1 for visit in kept]] = False
        left = np.flatnonzero(waiting).astype(np.int64)
        insert_tasks(self._problem, state, memory, left, len(left), build_random_state(seed))
        return state if state.ends.max() < NEVER else self._one_by_one(able, seed)

    def _one_by_one(self, able: npt.NDArray[np.bool_], seed: int) -> DayState:
        """Return a plan of the tasks that fit beside each other.

        A task that can only be done from where a vehicle stands, no depot, is done by its first trip or not at all.
        """
        state = day_state(self._problem)
        rng = build_random_state(seed)
        hardest_first = sorted(np.flatnonzero(able), key=lambda task: int(self._problem.able[:, task].sum()))
        for task in hardest_first:
            trial = copy_day(state)
            fits = insert_tasks(
                self._problem, trial, day_memory(self._problem), np.array([task], dtype=np.int64), 1, rng
            )
            if fits and trial.ends.max() < NEVER:
                state = trial
        return state

    def run(self, stop: StopRule) -> DayResult:
        """Improve until ``stop`` says so."""
        reason = "nothing to do"
        if not self._idle:
            reason = run_rounds(stop, self._progress, self._advance, len(self._starts))
        plan = day_plan(self._instance, self._problem, self._leader.best)
        return DayResult(
            plan=plan,
            evaluation=evaluate_day(self._instance, plan),
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=reason,
        )

    def _begin(self) -> None:
        self._done = 0
        hot, cold = (share * self._instance.capacity_s for share in (HOT, COLD))
        self._cooling = (cold / hot) ** (1 / self._length)
        for start in self._starts:
            start.begin(self._leader, hot)

    def _advance(self, allowed: int, threads: Executor | None) -> None:
        """Run a batch of every start, or what is allowed of it."""
        fair = max(1, allowed // len(self._starts))
        share = min(BATCH, fair, self._length - self._done)
        starts = self._starts[: min(len(self._starts), allowed)]
        found = run_in_threads(threads, lambda start: start.run(self._cooling, share), starts)
        leader = min(self._starts, key=lambda start: start.key.tolist())
        if leader.key.tolist() < self._leader.key.tolist() or max(found) > 0:
            self._leader = leader
            self._improved_at = self._iterations + max(found) * len(starts)
        self._iterations += share * len(starts)
        self._done += share
        if self._done == self._length:
            self._length = min(int(GROWTH * self._length), LONGEST_CYCLE)
            self._begin()

    def _progress(self) -> Progress:
        return Progress(
            iterations=self._iterations,
            since_improvement=max(0, self._iterations - self._improved_at),
            seconds=self._watch.seconds,
            value=float(self._leader.key[0]),
            uncovered=self._uncovered,
            feasible=self._uncovered == 0,
            impossible=not self._problem.able.any(axis=0).all(),
        )
