"""The improvement loop around the annealing kernel: cycles, batches, the stop rule.

Annealing needs to know its length beforehand and a stop rule does not tell. So it runs in cycles of growing length,
each starting from the best plan so far: whenever the search is stopped, a good part of the work has gone into one
cycle.

While the best plan leaves something out, every second cycle is soft: it may pass through routes beyond their budgets.
Where budgets just suffice that finds the complete plan five times as often; where they do not it finds nothing, so
the hard cycles between choose what to leave out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.bounds import why_impossible
from planner.construct import (
    POWERS,
    copy_of,
    guide_weights,
    insert_open,
    plan_of,
    problem_of,
    random_state,
    state_of,
    true_weights,
)
from planner.costs import Cost
from planner.evaluate import Evaluation, evaluate
from planner.kernels.anneal import anneal, left_out, objective
from planner.kernels.arrays import FloatArray, Problem, RandomState, State, Weights
from planner.kernels.tours import copy_route
from planner.model import Instance, Plan
from planner.result import Result
from planner.stop import Progress, StopRule, Stopwatch

BATCH = 500
"""Iterations between two questions to the stop rule: some milliseconds."""
FIRST_CYCLE = 4_000
"""Iterations of the first cycle."""
HOT = 6.0
"""Temperature at the begin of a cycle, in mean transits of the plan."""
COLD = 0.01
"""Temperature at the end of a cycle."""


@dataclass(slots=True)
class _Cycle:
    """One annealing from hot to cold."""

    length: int
    temperature: FloatArray
    """(1,) float64, as the kernel has left it."""
    cooling: float
    scale: float
    """The largest load at the begin."""
    soft: bool
    """Whether routes may go beyond their budgets on the way."""
    done: int = 0

    @property
    def power(self) -> float:
        """The p-norm's p: the cycle has as many stages as there are powers."""
        return POWERS[self.done * len(POWERS) // self.length]

    @property
    def stage_left(self) -> int:
        """Iterations until the power changes or the cycle ends."""
        stage = self.done * len(POWERS) // self.length
        return -(-(stage + 1) * self.length // len(POWERS)) - self.done


class Search:
    """One search, from a first plan to the best found; ``run`` is all that there is to call."""

    def __init__(
        self, instance: Instance, *, cost: Cost, seed: int, initial: Plan | None, all_vehicles: bool, watch: Stopwatch
    ) -> None:
        self._impossible = why_impossible(instance)
        self._instance = instance
        self._cost = cost
        self._all_vehicles = all_vehicles
        self._watch = watch
        self._problem: Problem = problem_of(instance)
        self._rng: RandomState = random_state(seed)
        self._truth: Weights = true_weights(self._problem, cost, all_vehicles=all_vehicles)
        self._best: State = self._first(initial)
        self._current: State = copy_of(self._best)
        self._trial: State = copy_of(self._best)
        self._key = np.array(
            [left_out(self._problem, self._best)[0], objective(self._problem, self._truth, self._best)]
        )
        self._cycle = self._cycle_of(FIRST_CYCLE, soft=self._may_be_soft())
        self._iterations = 0
        self._improved_at = 0
        self._plan = plan_of(self._best)
        self._evaluation: Evaluation = evaluate(instance, self._plan, cost)

    def run(self, stop: StopRule, on_progress: Callable[[Progress], None] | None = None) -> Result:
        """Improve until ``stop`` says so."""
        while True:
            progress = self._progress()
            if on_progress is not None:
                on_progress(progress)
            verdict = stop(progress)
            if verdict.allowed <= 0:
                break
            self._advance(min(BATCH, verdict.allowed))
        return Result(
            plan=self._plan,
            evaluation=self._evaluation,
            feasible=progress.feasible,
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=verdict.reason,
            impossible=self._impossible,
        )

    def _first(self, initial: Plan | None) -> State:
        routes = [route.visits for route in initial.routes] if initial is not None else []
        state = state_of(self._problem, routes)
        insert_open(self._problem, self._weights(float(self._problem.effort.max()), POWERS[0], soft=False), state)
        return state

    def _weights(self, scale: float, power: float, *, soft: bool) -> Weights:
        return guide_weights(
            self._problem, self._cost, scale=scale, all_vehicles=self._all_vehicles, power=power, soft=soft
        )

    def _next_cycle(self) -> _Cycle:
        if self._cycle.soft:
            return self._cycle_of(self._cycle.length, soft=False)
        return self._cycle_of(2 * self._cycle.length, soft=self._may_be_soft())

    def _may_be_soft(self) -> bool:
        return self._impossible is None and bool((self._best.route_of < 0).any())

    def _cycle_of(self, length: int, *, soft: bool) -> _Cycle:
        for route in range(len(self._best.lengths)):
            copy_route(self._best, self._current, route)
            copy_route(self._best, self._trial, route)
        self._current.route_of[:] = self._best.route_of
        self._trial.route_of[:] = self._best.route_of
        hot = np.array([HOT * self._mean_transit()])
        return _Cycle(length, hot, (COLD / HOT) ** (1 / length), scale=float(self._best.loads.max()), soft=soft)

    def _mean_transit(self) -> float:
        """Return the mean energy that the best plan spends from visit to visit, inspections not counted."""
        inspections = self._problem.move.reshape(-1, len(self._problem.value), 2).min(axis=(0, 2))
        covered = self._best.route_of >= 0
        moves = int(covered.sum()) + int((self._best.lengths > 0).sum())
        transit = float(self._best.loads.sum() - inspections[covered].sum()) / max(1, moves)
        return max(transit, 1e-6 * float(self._problem.effort.max()), 1e-9)

    def _advance(self, iterations: int) -> None:
        """Run ``iterations``; how they are split over calls makes no difference."""
        while iterations > 0:
            batch = min(iterations, self._cycle.stage_left)
            self._batch(batch)
            iterations -= batch

    def _batch(self, iterations: int) -> None:
        guide = self._weights(self._cycle.scale, self._cycle.power, soft=self._cycle.soft)
        improved = anneal(
            self._problem, guide, self._truth, self._current, self._trial, self._best,
            self._key, self._cycle.temperature, self._cycle.cooling, iterations, self._rng,
        )  # fmt: skip
        if improved > 0:
            self._improved_at = self._iterations + improved
            self._plan = plan_of(self._best)
            self._evaluation = evaluate(self._instance, self._plan, self._cost)
        self._iterations += iterations
        self._cycle.done += iterations
        if self._cycle.done == self._cycle.length:
            self._cycle = self._next_cycle()

    def _progress(self) -> Progress:
        return Progress(
            iterations=self._iterations,
            since_improvement=self._iterations - self._improved_at,
            seconds=self._watch.seconds,
            value=self._evaluation.value,
            uncovered=len(self._plan.uncovered),
            feasible=not self._plan.uncovered and not self._evaluation.violations,
            impossible=self._impossible is not None,
        )
