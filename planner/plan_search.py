"""The search for the routes of a single flight.

While the best plan leaves something out, every second cycle is soft: it may pass through routes beyond their budgets.
Where budgets just suffice that finds the complete plan five times as often; where they do not it finds nothing, so
the hard cycles between choose what to leave out.
"""

from __future__ import annotations

import numpy as np

from planner.bounds import explain_infeasibility
from planner.construct import (
    build_first_state,
    build_guide_weights,
    build_kernel_problem,
    build_plan,
    build_random_state,
    build_search_workspace,
    build_true_weights,
    copy_state,
)
from planner.cost import Cost
from planner.evaluate import Evaluation, evaluate
from planner.kernels.anneal import anneal, compute_objective, uncovered_value
from planner.kernels.arrays import Problem, RandomState, State, Weights
from planner.kernels.tours import copy_all
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.result import Result
from planner.search import AnnealingSearch, Cycle, Standing
from planner.stop_rules import StopRule, Stopwatch


class PlanStart:
    """One walk of the annealing kernel: where it stands, the best that it found, its chance."""

    def __init__(self, problem: Problem, truth: Weights, first: State, rng: RandomState) -> None:
        self.best = copy_state(first)
        self.key = np.array([uncovered_value(problem, first)[0], compute_objective(problem, truth, first)])
        """(2,) float64: the value that the best plan leaves out, then the cost function's: less is better."""
        self.done = 0
        self._problem = problem
        self._truth = truth
        self._current = copy_state(first)
        self._trial = copy_state(first)
        self._memory = build_search_workspace(problem)
        self._temperature = np.zeros(1)
        self._rng = rng

    @property
    def rank(self) -> list[float]:
        """The key."""
        ranked: list[float] = self.key.tolist()
        return ranked

    def begin(self, leader: PlanStart, temperature: float) -> None:
        """Begin a cycle from the best plan of ``leader``."""
        for state in (self._current, self._trial, self.best):
            if state is not leader.best:
                copy_all(leader.best, state)
        self.key[:] = leader.key
        self._memory.versions[:] += 1
        self._temperature[0] = temperature
        self.done = 0

    def run(self, guide: Weights, cooling: float, iterations: int) -> int:
        """Run iterations of the cycle; return the last that found a new best, counted from 1, or 0."""
        improved: int = anneal(
            self._problem, guide, self._truth, self._current, self._trial, self.best,
            self.key, self._temperature, cooling, iterations, self._rng, self._memory,
        )  # fmt: skip
        return improved


class PlanSearch(AnnealingSearch[PlanStart]):
    """One search; ``run`` is all that there is to call."""

    def __init__(
        self,
        instance: Instance,
        *,
        cost: Cost,
        seed: int,
        initial: Plan | None,
        all_vehicles: bool,
        watch: Stopwatch,
        starts: int = 1,
        params: SearchParams = DEFAULT_PARAMS,
    ) -> None:
        self._instance = instance
        self._cost = cost
        self._all_vehicles = all_vehicles
        self._params = params.annealing
        self._problem: Problem = build_kernel_problem(instance)
        self._inspections = self._problem.move.reshape(-1, len(self._problem.value), 2).min(axis=(0, 2))
        truth = build_true_weights(self._problem, cost, all_vehicles=all_vehicles)
        routes = [route.visits for route in initial.routes] if initial is not None else []
        first = build_first_state(self._problem, cost, routes, self._params, all_vehicles=all_vehicles)
        self._soft = False
        super().__init__(
            [PlanStart(self._problem, truth, first, build_random_state(seed + number)) for number in range(starts)],
            watch, batch=self._params.batch, impossible=explain_infeasibility(instance),
        )  # fmt: skip

    def run(self, stop: StopRule) -> Result:
        """Improve until ``stop`` says so."""
        reason = self._run_rounds(stop)
        return self._build_result(self._plan, self._evaluation, reason)

    def _build_cycle(self, before: Cycle | None) -> Cycle:
        """Return a cycle twice as long as the one before; after a soft one a hard one of its length."""
        best, params, was_soft = self._leader.best, self._params, self._soft
        self._soft = not was_soft and self._impossible is None and bool((best.route_of < 0).any())
        self._scale = float(best.loads.max())
        if before is None:
            length = params.first_cycle_leaving_out if self._soft else params.first_cycle
        else:
            length = before.length if was_soft else 2 * before.length
        transit = self._mean_transit(best)
        return Cycle(length, params.hot * transit, params.cold * transit, len(params.powers))

    def _mean_transit(self, best: State) -> float:
        """Return the mean energy that the best plan spends from visit to visit, inspections not counted."""
        covered = best.route_of >= 0
        moves = int(covered.sum()) + int((best.lengths > 0).sum())
        transit = float(best.loads.sum() - self._inspections[covered].sum()) / max(1, moves)
        return max(transit, 1e-6 * float(self._problem.effort.max()), 1e-9)

    def _improve(self, start: PlanStart, iterations: int) -> int:
        power = self._params.powers[self._cycle.stage(start.done)]
        weights = build_guide_weights(
            self._problem, self._cost, self._params,
            scale=self._scale, all_vehicles=self._all_vehicles, power=power, soft=self._soft,
        )  # fmt: skip
        return start.run(weights, self._cycle.cooling, iterations)

    def _publish(self) -> None:
        super()._publish()
        self._plan = build_plan(self._leader.best)
        self._evaluation: Evaluation = evaluate(self._instance, self._plan, self._cost)

    def _rate_best(self) -> Standing:
        uncovered = len(self._plan.uncovered)
        return Standing(self._evaluation.value, uncovered, not uncovered and not self._evaluation.violations)
