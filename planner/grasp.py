"""The paper's own solver, the baseline for the search.

Greedy randomised adaptive search of Nekovar, Faigl and Saska (2021), "Multi-tour Set Traveling Salesman Problem in
planning power transmission line inspection", as implemented in the authors' public solver
(github.com/fnekovar/ms-tsp-solver). A run:

- construction: of all insertions of an open segment, into any route, at any position, in either direction, one is drawn
  from the quarter that gives the cheapest routes;
- local search in rounds, with one neighbour per segment. The first neighbour of a round is accepted even if it is
  worse, then each one better than the last, unless it is one of the last n / 4 solutions that ended a round (tabu);
- four neighbourhoods: a random visit moved to a random position, moved to the best position, exchanged with the best
  other visit, or reversed. No move takes a vehicle's last visit. They are drawn in proportion to their scores: 5 each
  at first and again after every 20 rounds, 1 for the neighbourhood that a round ended with, 5 for the one drawn last if
  the round gave a new best solution, and always 1 for the first of them;
- the run ends after 200 rounds without a new best solution; then a dynamic program sets the directions of each route's
  visits.

The best position and the best other visit are selected as in the authors' code, see ``shift_best`` and ``swap_best``.
Selecting by the whole plan's cost instead lowers the median by 3 to 8 %: a better solver, but not the one that the
paper used.

Differences from their solver: all three cost functions, a budget and energies per vehicle, equal candidates in the list
counted as often as they occur. If every neighbour is tabu, the round counts as one without improvement; theirs would
never end. If no vehicle has two visits, a last one may be taken; theirs would never end either.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import TYPE_CHECKING

import numpy as np

from planner.bounds import explain_infeasibility
from planner.errors import InstanceError
from planner.evaluate import Cost, Evaluation, Result, evaluate
from planner.model import BARRED_PCT, Instance, Plan
from planner.search import Search
from planner.solve import solve
from planner.stop_rules import Progress, StopRule, StopVerdict, Stopwatch, add_progress_report

if TYPE_CHECKING:
    from planner.kernels.grasp_walk import GraspWalk

RUNS = 50
"""Number of runs in the paper, of which the best plan is kept."""
PATIENCE = 200
"""Rounds without improvement that end a run."""
BATCH = 20
"""Rounds between two checks of the stop rule: some milliseconds."""


def solve_grasp(
    instance: Instance,
    *,
    cost: Cost,
    stop: StopRule,
    seed: int = 0,
    runs: int = RUNS,
    all_vehicles: bool = False,
    on_progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Return the best plan of a number of runs of the paper's solver.

    Every segment that some vehicle may inspect is inspected, if necessary beyond a budget: c-MinSum and MinComb charge
    K_C for that, MinMax ignores budgets. ``Result.feasible`` and the violations of the evaluation show whether it
    happened.

    Args:
        instance: the problem.
        cost: the cost function to minimise.
        stop: ends the solver before its last run. One iteration is one round of the local search; checked at least
            every 20. Time does not include loading the kernels.
        seed: seed of all randomness.
        runs: number of runs.
        all_vehicles: penalise plans that leave a vehicle without a visit. Few do without a penalty, because no move
            takes a vehicle's last visit.
        on_progress: called whenever ``stop`` is checked.

    Raises:
        InstanceError: ``runs`` is less than 1.
    """
    if runs < 1:
        raise InstanceError(f"runs is {runs}, expected 1 or more")
    if instance.segments == 0:
        return solve(instance, cost=cost, stop=stop)
    return _GraspRuns(instance, cost, seed, all_vehicles=all_vehicles).run(runs, add_progress_report(stop, on_progress))


class _GraspRuns(Search):
    """The runs in sequence, and the best plan so far."""

    def __init__(self, instance: Instance, cost: Cost, seed: int, *, all_vehicles: bool) -> None:
        # Imported here, as in solve.py: it loads numba.
        from planner.kernels import grasp_walk
        from planner.plan_search import build_kernel_problem, build_random_state, build_true_weights

        super().__init__(Stopwatch(), batch=BATCH, impossible=explain_infeasibility(instance))
        self._kernels = grasp_walk
        self._instance = instance
        self._cost = cost
        self._problem = build_kernel_problem(instance)
        soft = cost.function.excess
        self._weights = build_true_weights(self._problem, cost, all_vehicles=all_vehicles)._replace(excess=soft)
        self._rng = build_random_state(seed)
        self._done = 0
        self._lowest = np.inf
        self._plan: Plan
        self._evaluation: Evaluation
        self._walk = self._start_walk()
        self._keep_better()

    def run(self, runs: int, stop: StopRule) -> Result:
        """Run all runs, until ``stop`` ends the search."""
        reason = self._run_rounds(lambda progress: stop(progress) if self._done < runs else StopVerdict(0, "runs"))
        return self._build_result(self._plan, self._evaluation, reason)

    def _start_walk(self) -> GraspWalk:
        """Return a new run after construction, before local search."""
        from planner.kernels.anneal import compute_objective
        from planner.plan_search import build_empty_state, copy_state

        current = build_empty_state(self._problem)
        self._kernels.construct(self._problem, self._weights, current, BARRED_PCT / 2, self._rng)
        walk = self._kernels.GraspWalk(
            current=current,
            trial=copy_state(current),
            best=copy_state(current),
            cost=np.array([compute_objective(self._problem, self._weights, current)]),
            scores=np.zeros(4, dtype=np.int64),
            counts=np.zeros(3, dtype=np.int64),
            tabu=np.zeros(max(1, len(self._problem.value) // 4), dtype=np.int64),
        )
        self._kernels.forbid_current(walk)
        return walk

    def _advance(self, iterations: int, threads: Executor | None = None) -> None:  # noqa: ARG002 - runs take turns
        """Run up to ``iterations`` rounds of a run; if it ends earlier, begin the next one."""
        if not self._walk.current.lengths.any():  # no segment may be inspected by any vehicle
            self._done, self._iterations = self._done + 1, self._iterations + 1
            return
        done = self._kernels.improve(self._problem, self._weights, self._walk, iterations, PATIENCE, self._rng)
        self._iterations += done
        self._keep_better()
        if done < iterations:
            self._done += 1
            self._walk = self._start_walk()

    def _keep_better(self) -> None:
        """Keep the best of the run, with its visits oriented optimally, if it is better than that of all runs."""
        from planner.kernels.anneal import compute_objective
        from planner.kernels.tours import orient_visits
        from planner.plan_search import build_plan, copy_state

        state = copy_state(self._walk.best)
        came_from = np.zeros((len(self._problem.value), 2), dtype=np.int64)
        for route in range(len(state.lengths)):
            orient_visits(self._problem, state, route, came_from)
        cost = compute_objective(self._problem, self._weights, state)
        if cost < self._lowest:
            self._lowest = cost
            self._plan = build_plan(state)
            self._evaluation = evaluate(self._instance, self._plan, self._cost)
            self._improved_at = self._iterations

    def _rate_best(self) -> tuple[float, int, bool]:
        left = len(self._plan.uncovered)
        return self._evaluation.value, left, not left and not self._evaluation.violations
