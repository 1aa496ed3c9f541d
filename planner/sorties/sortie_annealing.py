"""The search for days of sorties: annealing in cycles, each from the best plan so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planner.construct import build_random_state
from planner.kernels.arrays import RandomState
from planner.kernels.sortie_schedule import (
    SortieProblem,
    SortieState,
    SortieWorkspace,
    choose_bases_of_touched,
    measure_given_sorties,
    put_all_segments,
    schedule_sorties,
)
from planner.kernels.sortie_search import anneal_sorties, copy_sorties
from planner.search import AnnealingSearch, Cycle, Standing
from planner.sorties.sortie_evaluation import SortieResult, evaluate_sorties
from planner.sorties.sortie_model import Objective, Sortie, SortieInstance
from planner.sorties.sortie_state import (
    MoveTable,
    build_move_table,
    build_sortie_plan,
    build_sortie_problem,
    build_sortie_state,
    build_sortie_workspace,
    load_sorties,
)
from planner.stop_rules import StopRule, Stopwatch

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


class SortieStart:
    """One walk."""

    def __init__(self, problem: SortieProblem, table: MoveTable, first: SortieState, rng: RandomState) -> None:
        self.done = 0
        self._problem = problem
        self._current, self._trial, self.best = (build_sortie_state(problem, table) for _ in range(3))
        self._memory = build_sortie_workspace(problem)
        self._temperature = np.zeros(1)
        self._rng = rng
        copy_sorties(first, self.best)

    @property
    def rank(self) -> list[float]:
        """What finds no day first, then the objective's figure, then the others."""
        late, *figures = self.best.sums[:4].tolist()
        return [late, figures[self._problem.objective], *figures]

    def begin(self, leader: SortieStart, temperature: float) -> None:
        """Begin a cycle from the best plan of ``leader``."""
        for state in (self._current, self._trial, self.best):
            if state is not leader.best:
                copy_sorties(leader.best, state)
        self._temperature[0] = temperature
        self.done = 0

    def run(self, cooling: float, most: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal_sorties(
            self._problem, self._current, self._trial, self.best, self._temperature, cooling, most, iterations,
            self._rng, self._memory,
        )  # fmt: skip
        return improved


class SortieSearch(AnnealingSearch[SortieStart]):
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
        watch = Stopwatch()
        self._instance = instance
        self._table = build_move_table(instance) if table is None else table
        self._problem = build_sortie_problem(instance, self._table, objective)
        able = self._problem.able.any(axis=0)
        self._idle = not able.any()
        first = self._build_first_state(initial, seed)
        super().__init__(
            [SortieStart(self._problem, self._table, first, build_random_state(seed + one)) for one in range(starts)],
            watch, batch=BATCH, impossible="a segment is out of reach" if (instance.wanted & ~able).any() else None,
        )  # fmt: skip

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

    def run(self, stop: StopRule) -> SortieResult:
        """Improve until ``stop`` says so."""
        reason = "nothing to do" if self._idle else self._run_rounds(stop)
        plan = build_sortie_plan(self._instance, self._leader.best)
        return SortieResult(plan, evaluate_sorties(self._instance, plan), self._iterations, self._watch.seconds, reason)

    def _build_cycle(self, before: Cycle | None) -> Cycle:
        best, segments = self._leader.best, self._instance.segments
        self._most = float(best.whole[:, 0].max(initial=1.0))
        mean_s = best.sums[2] / max(1.0, best.sums[3])
        few = 15.0 if segments <= FEW else 1.0
        hot, cold = (few * share * max(mean_s, 1.0) for share in (HOT, COLD))
        return Cycle(FIRST_CYCLE + PER_SEGMENT * segments if before is None else int(GROWTH * before.length), hot, cold)

    def _improve(self, start: SortieStart, iterations: int) -> int:
        return start.run(self._cycle.cooling, self._most, iterations)

    def _rate_best(self) -> Standing:
        best = self._leader.best
        uncovered = int(self._instance.wanted.sum()) - int(best.size[best.start < 1e17].sum())
        return Standing(float(best.sums[1 + self._problem.objective]), uncovered, uncovered == 0)
