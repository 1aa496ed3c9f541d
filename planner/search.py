"""The improvement loop around the annealing kernel: cycles, batches, the stop rule, starts side by side.

Annealing needs to know its length beforehand and a stop rule does not tell. So it runs in cycles of growing length,
each starting from the best plan so far: whenever the search is stopped, a good part of the work has gone into one
cycle. Several starts run the same cycle in threads and wait for each other at its end, so that the seed, the number of
starts and of iterations decide the plan, however the threads take turns.

While the best plan leaves something out, every second cycle is soft: it may pass through routes beyond their budgets.
Where budgets just suffice that finds the complete plan five times as often; where they do not it finds nothing, so
the hard cycles between choose what to leave out.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from planner.bounds import explain_infeasibility
from planner.construct import (
    build_guide_weights,
    build_random_state,
    build_true_weights,
    insert_open_segments,
    plan_of,
    problem_of,
    state_of,
)
from planner.cost import Cost
from planner.evaluate import Evaluation, evaluate
from planner.kernels.arrays import Problem, State, Weights
from planner.model import Instance, Plan
from planner.params import DEFAULT_PARAMS, SearchParams
from planner.result import Result
from planner.search_rounds import run_in_threads, run_rounds
from planner.search_start import SearchStart
from planner.stop_rules import Progress, StopRule, Stopwatch


@dataclass(frozen=True, slots=True)
class _Cycle:
    """One annealing from hot to cold, the same for all starts."""

    length: int
    hot: float
    """The temperature at the begin."""
    cold: float
    """At the end."""
    scale: float
    """The largest load at the begin."""
    soft: bool
    """Whether routes may go beyond their budgets on the way."""
    powers: tuple[float, ...]
    """The p-norm's p in each stage."""

    @property
    def cooling(self) -> float:
        """Factor on the temperature after each iteration."""
        return float((self.cold / self.hot) ** (1 / self.length))

    def power(self, done: int) -> float:
        """Return the p-norm's p at this point."""
        return self.powers[done * len(self.powers) // self.length]

    def stage_iterations(self, done: int) -> int:
        """Return the iterations until the power changes or the cycle ends, 0 at its end."""
        stages = len(self.powers)
        stage = min(done * stages // self.length, stages - 1)
        return -(-(stage + 1) * self.length // stages) - done


class Search:
    """One search, from a first plan to the best found; ``run`` is all that there is to call."""

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
        self._impossible = explain_infeasibility(instance)
        self._instance = instance
        self._cost = cost
        self._all_vehicles = all_vehicles
        self._watch = watch
        self._params = params.annealing
        self._problem: Problem = problem_of(instance)
        self._inspections = self._problem.move.reshape(-1, len(self._problem.value), 2).min(axis=(0, 2))
        truth = build_true_weights(self._problem, cost, all_vehicles=all_vehicles)
        first = self._build_first_state(initial)
        self._starts = [
            SearchStart(self._problem, truth, first, build_random_state(seed + number)) for number in range(starts)
        ]
        self._leader = self._starts[0]
        self._iterations = 0
        self._improved_at = 0
        soft = self._may_be_soft()
        self._begin(self._params.first_cycle_leaving_out if soft else self._params.first_cycle, soft=soft)
        self._publish()

    def run(self, stop: StopRule) -> Result:
        """Improve until ``stop`` says so."""
        batch = self._params.batch * len(self._starts)
        reason = run_rounds(
            stop,
            self._build_progress,
            lambda most, threads: self._advance(min(batch, most), threads),
            len(self._starts),
        )
        return Result(
            plan=self._plan,
            evaluation=self._evaluation,
            feasible=self._build_progress().feasible,
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=reason,
            impossible=self._impossible,
        )

    def _build_first_state(self, initial: Plan | None) -> State:
        routes = [route.visits for route in initial.routes] if initial is not None else []
        state = state_of(self._problem, routes)
        weights = self._build_weights(float(self._problem.effort.max()), self._params.powers[0], soft=False)
        insert_open_segments(self._problem, weights, state)
        return state

    def _build_weights(self, scale: float, power: float, *, soft: bool) -> Weights:
        return build_guide_weights(
            self._problem, self._cost, self._params,
            scale=scale, all_vehicles=self._all_vehicles, power=power, soft=soft,
        )  # fmt: skip

    def _may_be_soft(self) -> bool:
        return self._impossible is None and bool((self._leader.best.route_of < 0).any())

    def _begin(self, length: int, *, soft: bool) -> None:
        best = self._leader.best
        transit = self._mean_transit(best)
        params = self._params
        self._cycle = _Cycle(
            length, params.hot * transit, params.cold * transit, float(best.loads.max()), soft, params.powers
        )
        for start in self._starts:
            start.begin(self._leader, self._cycle.hot)

    def _begin_next_cycle(self) -> None:
        """Begin the next cycle, twice as long; after a soft one a hard one of its length."""
        if self._cycle.soft:
            self._begin(self._cycle.length, soft=False)
        else:
            self._begin(2 * self._cycle.length, soft=self._may_be_soft())

    def _mean_transit(self, best: State) -> float:
        """Return the mean energy that the best plan spends from visit to visit, inspections not counted."""
        covered = best.route_of >= 0
        moves = int(covered.sum()) + int((best.lengths > 0).sum())
        transit = float(best.loads.sum() - self._inspections[covered].sum()) / max(1, moves)
        return max(transit, 1e-6 * float(self._problem.effort.max()), 1e-9)

    def _advance(self, iterations: int, threads: Executor | None = None) -> None:
        """Run ``iterations`` over all starts; how they are split over calls makes no difference to a single one."""
        while iterations > 0:
            iterations -= self._run_round(iterations, threads)

    def _run_round(self, iterations: int, threads: Executor | None) -> int:
        """Have each start do its share of ``iterations``, as far as its stage goes; return how many were done."""
        shares: list[tuple[SearchStart, Weights, int]] = []
        given = 0
        for number, start in enumerate(sorted(self._starts, key=lambda start: start.done)):
            fair = -(-(iterations - given) // (len(self._starts) - number))
            share = min(fair, self._cycle.stage_iterations(start.done))
            if share > 0:
                power = self._cycle.power(start.done)
                shares.append((start, self._build_weights(self._cycle.scale, power, soft=self._cycle.soft), share))
                given += share
        cooling = self._cycle.cooling
        found = run_in_threads(threads, lambda work: work[0].run(work[1], cooling, work[2]), shares)
        self._take_best(max(found))
        self._iterations += given
        if all(start.done == self._cycle.length for start in self._starts):
            self._begin_next_cycle()
        return given

    def _take_best(self, latest: int) -> None:
        """Publish the best start's plan if one improved, in the iteration ``latest`` of its round at the latest."""
        if latest == 0:
            return
        leader = min(self._starts, key=lambda start: start.key.tolist())
        if leader.key.tolist() < self._best_key:
            self._leader = leader
            self._improved_at = self._iterations + latest * len(self._starts)
            self._publish()

    def _publish(self) -> None:
        self._best_key: list[float] = self._leader.key.tolist()
        self._plan = plan_of(self._leader.best)
        self._evaluation: Evaluation = evaluate(self._instance, self._plan, self._cost)

    def _build_progress(self) -> Progress:
        return Progress(
            iterations=self._iterations,
            since_improvement=max(0, self._iterations - self._improved_at),
            seconds=self._watch.seconds,
            value=self._evaluation.value,
            uncovered=len(self._plan.uncovered),
            feasible=not self._plan.uncovered and not self._evaluation.violations,
            impossible=self._impossible is not None,
        )
