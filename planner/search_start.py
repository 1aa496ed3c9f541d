"""One walk of the annealing kernel: where it stands, the best that it found, its chance."""

from __future__ import annotations

import numpy as np

from planner.construct import copy_of, memory_of
from planner.kernels.anneal import anneal, compute_objective, uncovered_value
from planner.kernels.arrays import Problem, RandomState, State, Weights
from planner.kernels.tours import copy_all


class SearchStart:
    """One of the starts of a search; starts share nothing that changes, so each may run in a thread of its own."""

    def __init__(self, problem: Problem, truth: Weights, first: State, rng: RandomState) -> None:
        self.best = copy_of(first)
        self.key = np.array([uncovered_value(problem, first)[0], compute_objective(problem, truth, first)])
        """(2,) float64: the value that the best plan leaves out, then the cost function's: less is better."""
        self.done = 0
        """Iterations of the cycle under way."""
        self._problem = problem
        self._truth = truth
        self._current = copy_of(first)
        self._trial = copy_of(first)
        self._memory = memory_of(problem)
        self._temperature = np.zeros(1)
        self._rng = rng

    def begin(self, leader: SearchStart, temperature: float) -> None:
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
        self.done += iterations
        return improved
