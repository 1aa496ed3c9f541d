"""The search for days of sorties: cycles of annealing around the kernel, starts side by side, the stop rule.

As in ``planner.search`` cycles grow, each from the best plan so far, and starts wait for each other at the end of each
round: the seed, the number of starts and of iterations decide the plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from planner.construct import build_random_state
from planner.kernels.arrays import RandomState
from planner.kernels.sortie_insertion import choose_bases_of_touched, measure_given_sorties, put_all_segments
from planner.kernels.sortie_schedule import SortieProblem, SortieState, SortieWorkspace, schedule_sorties
from planner.kernels.sortie_search import anneal_sorties, copy_sorties, has_better_sums
from planner.search_rounds import run_in_threads, run_rounds
from planner.sorties.sortie_evaluation import evaluate_sorties
from planner.sorties.sortie_model import Objective, Sortie, SortieInstance
from planner.sorties.sortie_result import SortieResult
from planner.sorties.sortie_state import (
    MoveTable,
    build_move_table,
    build_sortie_plan,
    build_sortie_problem,
    build_sortie_state,
    build_sortie_workspace,
    load_sorties,
)
from planner.stop_rules import Progress, StopRule, Stopwatch

BATCH = 200
"""Iterations of a start between two questions to the stop rule."""
FIRST_CYCLE = 2_000
"""Iterations of the first cycle for a few segments; each further one is half as long again."""
PER_SEGMENT = 15
"""More iterations of the first cycle for each segment."""
GROWTH = 1.5
HOT = 0.02
"""The temperature at the begin of a cycle, as a share of the mean sortie's time."""
COLD = 0.0003
"""The same at its end."""
FEW = 60
"""Segments up to which a plan is so short that it is shaken harder."""


class _Start:
    """One walk; walks share nothing that changes."""

    def __init__(self, problem: SortieProblem, table: MoveTable, first: SortieState, rng: RandomState) -> None:
        self._problem = problem
        self._current, self._trial = (build_sortie_state(problem, table) for _ in range(2))
        self.best = build_sortie_state(problem, table)
        self._memory = build_sortie_workspace(problem)
        self._temperature = np.zeros(1)
        self._rng = rng
        copy_sorties(first, self.best)

    def begin(self, leader: SortieState, temperature: float) -> None:
        """Begin a cycle from the best plan of all."""
        for state in (self._current, self._trial, self.best):
            if state is not leader:
                copy_sorties(leader, state)
        self._temperature[0] = temperature

    def run(self, cooling: float, most: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal_sorties(
            self._problem, self._current, self._trial, self.best, self._temperature, cooling, most, iterations,
            self._rng, self._memory,
        )  # fmt: skip
        return improved


class SortieSearch:
    """One search; ``run`` is all that there is to call."""

    def __init__(
        self,
        instance: SortieInstance,
        *,
        objective: Objective,
        seed: int,
        starts: int,
        initial: Sequence[Sequence[Sortie]] = (),
        table: MoveTable | None = None,
    ) -> None:
        self._watch = Stopwatch()
        self._instance = instance
        self._table = build_move_table(instance) if table is None else table
        self._problem = build_sortie_problem(instance, self._table, objective)
        able = self._problem.able.any(axis=0)
        self._impossible = bool((instance.wanted & ~able).any())
        self._idle = not able.any()
        first = self._build_first_state(initial, seed)
        self._starts = [
            _Start(self._problem, self._table, first, build_random_state(seed + number)) for number in range(starts)
        ]
        self._leader = self._starts[0]
        self._iterations = self._improved_at = 0
        self._length = FIRST_CYCLE + PER_SEGMENT * instance.segments
        self._begin()

    def _build_first_state(self, initial: Sequence[Sequence[Sortie]], seed: int) -> SortieState:
        """Return the given sorties with all open segments put in where they cost least, those far off first."""
        state, memory = build_sortie_state(self._problem, self._table), build_sortie_workspace(self._problem)
        if initial:
            load_sorties(state, initial)
            if not measure_given_sorties(self._problem, state, memory):
                state = build_sortie_state(self._problem, self._table)
        nearest_s = self._problem.out[:, :, ::2, 0].min(axis=(0, 1))
        able = self._problem.able.any(axis=0) & (state.where < 0)
        waiting = np.array(sorted(np.flatnonzero(able), key=lambda one: -nearest_s[one]), dtype=np.int64)
        put_all_segments(self._problem, state, memory, waiting, len(waiting), build_random_state(seed))
        self._schedule_anew(state, memory)
        if state.sums[0] > 0 and not initial:  # the days are too short: what yields most comes first
            for vehicle, count in enumerate(state.counts):
                own = state.order[vehicle, :count].copy()
                state.order[vehicle, :count] = own[np.argsort(-state.size[own] / state.whole[own, 0], kind="stable")]
            self._schedule_anew(state, memory)
        return state

    def _schedule_anew(self, state: SortieState, memory: SortieWorkspace) -> None:
        """Divide what every vehicle does into sorties anew, and give them their times."""
        memory.touched[:] = 1
        choose_bases_of_touched(self._problem, state, memory)
        memory.touched[:] = 0
        schedule_sorties(self._problem, state, memory)

    @property
    def is_complete(self) -> bool:
        """Whether the best plan so far inspects everything in its days."""
        best = self._leader.best
        return not self._impossible and best.sums[0] <= 0 and bool((best.where[self._instance.wanted] >= 0).all())

    def run(self, stop: StopRule) -> SortieResult:
        """Improve until ``stop`` says so."""
        reason = "nothing to do"
        if not self._idle:
            reason = run_rounds(stop, self._build_progress, self._advance, len(self._starts))
        plan = build_sortie_plan(self._instance, self._leader.best)
        return SortieResult(plan, evaluate_sorties(self._instance, plan), self._iterations, self._watch.seconds, reason)

    def _begin(self) -> None:
        self._done = 0
        best = self._leader.best
        self._most = float(best.whole[:, 0].max(initial=1.0))
        mean_s = best.sums[2] / max(1.0, best.sums[3])
        few = 15.0 if self._instance.segments <= FEW else 1.0
        hot, cold = (few * share * max(mean_s, 1.0) for share in (HOT, COLD))
        self._cooling = (cold / hot) ** (1 / self._length)
        leader = build_sortie_state(self._problem, self._table)
        copy_sorties(best, leader)
        for start in self._starts:
            start.begin(leader, hot)

    def _advance(self, allowed: int, threads: Executor | None) -> None:
        """Run a batch of every start, or what is allowed of it."""
        fair = max(1, allowed // len(self._starts))
        share = min(BATCH, fair, self._length - self._done)
        starts = self._starts[: min(len(self._starts), allowed)]
        found = run_in_threads(threads, lambda start: start.run(self._cooling, self._most, share), starts)
        for start in starts:
            if has_better_sums(self._problem, start.best.sums, self._leader.best.sums):
                self._leader = start
        if max(found) > 0:
            self._improved_at = self._iterations + max(found) * len(starts)
        self._iterations += share * len(starts)
        self._done += share
        if self._done == self._length:
            self._length = int(GROWTH * self._length)
            self._begin()

    def _build_progress(self) -> Progress:
        best = self._leader.best
        late = best.start >= 1e17
        uncovered = int(self._instance.wanted.sum()) - int(best.size[~late].sum())
        return Progress(
            iterations=self._iterations,
            since_improvement=max(0, self._iterations - self._improved_at),
            seconds=self._watch.seconds,
            value=float(best.sums[1 + self._problem.objective]),
            uncovered=uncovered,
            feasible=uncovered == 0,
            impossible=self._impossible,
        )
