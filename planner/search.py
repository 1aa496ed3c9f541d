"""The main loop of all searches: the stop rule, rounds, and cycles of annealing with parallel starts.

Annealing needs to know its length beforehand, which a stop rule does not give. So it runs in cycles of growing length,
each starting from the best plan so far: whenever the search stops, a good part of the work has gone into one cycle.
Several starts run the same cycle in threads and wait for each other at its end, so the plan depends only on the seed,
the number of starts and the number of iterations, not on thread timing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, Generic, Self, TypeVar

import numpy as np
import numpy.typing as npt

from planner.evaluate import Evaluation, Result
from planner.model import Plan
from planner.stop_rules import Progress, StopRule, Stopwatch

R = TypeVar("R")
StateT = TypeVar("StateT")
RandomState = npt.NDArray[np.uint64]


class SearchRecord(ABC):
    """Progress of a search, and its result."""

    def __init__(self, watch: Stopwatch, *, impossible: str | None = None) -> None:
        self._watch = watch
        self._impossible = impossible
        self._iterations = 0
        self._improved_at = 0

    @abstractmethod
    def _rate_best(self) -> tuple[float, int, bool]:
        """Return the quality of the best plan: value, uncovered and feasible of ``Progress``."""

    def _build_progress(self) -> Progress:
        value, uncovered, feasible = self._rate_best()
        return Progress(
            iterations=self._iterations,
            since_improvement=max(0, self._iterations - self._improved_at),
            seconds=self._watch.seconds,
            value=value,
            uncovered=uncovered,
            feasible=feasible,
            impossible=self._impossible is not None,
        )

    def _build_result(self, plan: Plan, evaluation: Evaluation, stopped_by: str) -> Result:
        return Result(
            plan=plan,
            evaluation=evaluation,
            feasible=self._rate_best()[2],
            iterations=self._iterations,
            seconds=self._watch.seconds,
            stopped_by=stopped_by,
            impossible=self._impossible,
        )


class Search(SearchRecord):
    """One search from a first plan to the best found: checks the stop rule, counts iterations, reports progress."""

    def __init__(self, watch: Stopwatch, *, batch: int, starts: int = 1, impossible: str | None = None) -> None:
        super().__init__(watch, impossible=impossible)
        self._batch = batch * starts
        """Maximum number of iterations between two checks of the stop rule."""
        self._threads = starts

    @abstractmethod
    def _advance(self, iterations: int, threads: Executor | None = None) -> None:
        """Run ``iterations``, and count them."""

    def _run_rounds(self, stop: StopRule) -> str:
        """Run the iterations that the stop rule allows, until it ends the search; return the reason."""
        with ThreadPoolExecutor(self._threads) if self._threads > 1 else nullcontext() as threads:
            while (verdict := stop(self._build_progress())).allowed > 0:
                self._advance(min(self._batch, verdict.allowed), threads)
        return verdict.reason


def run_in_threads(threads: Executor | None, work: Callable[..., R], *of_each: Iterable[object]) -> list[R]:
    """Return the results of all work items, computed in threads if there are any."""
    return list((map if threads is None else threads.map)(work, *of_each))


@dataclass(frozen=True, slots=True)
class Cycle:
    """One annealing from hot to cold, the same for all starts."""

    length: int
    hot: float
    """Start temperature."""
    cold: float
    """End temperature."""
    stages: int = 1
    """Number of parts, all of the same length."""

    @property
    def cooling(self) -> float:
        """Factor on the temperature after each iteration."""
        return float((self.cold / self.hot) ** (1 / self.length))

    def stage(self, done: int) -> int:
        """Return the stage at this point, the last one at the end."""
        return min(done * self.stages // self.length, self.stages - 1)

    def stage_iterations(self, done: int) -> int:
        """Return the iterations until the stage ends, 0 at the end of the cycle."""
        return -(-(self.stage(done) + 1) * self.length // self.stages) - done


class SearchStart(ABC, Generic[StateT]):
    """One of the walks of a search; they share no mutable state, so each may run in its own thread."""

    def __init__(
        self, states: tuple[StateT, StateT, StateT], copy: Callable[[StateT, StateT], None], rng: RandomState
    ) -> None:
        self.current, self.trial, self.best = states
        """Current state, work space, and the best plan found."""
        self.done = 0
        """Iterations done in the current cycle."""
        self.temperature = np.zeros(1)
        self.rng = rng
        self._copy = copy

    @property
    @abstractmethod
    def rank(self) -> list[float]:
        """Return the rank of its best plan: less is better, the first figure that differs decides."""

    def begin(self, leader: Self, temperature: float) -> None:
        """Begin a cycle from the best plan of ``leader``."""
        for state in (self.current, self.trial, self.best):
            if state is not leader.best:
                self._copy(leader.best, state)
        self.temperature[0] = temperature
        self.done = 0


SearchStartT = TypeVar("SearchStartT", bound=SearchStart[Any])


class AnnealingSearch(Search, Generic[SearchStartT]):
    """A search in cycles of annealing."""

    def __init__(self, starts: Sequence[SearchStartT], watch: Stopwatch, *, batch: int, impossible: str | None) -> None:
        super().__init__(watch, batch=batch, starts=len(starts), impossible=impossible)
        self._starts = starts
        self._leader = starts[0]
        self._begin_cycle(None)
        self._publish()

    @abstractmethod
    def _build_cycle(self, before: Cycle | None) -> Cycle:
        """Return the next cycle, from the leader's best plan; ``before`` is None for the first one."""

    @abstractmethod
    def _improve(self, start: SearchStartT, iterations: int) -> int:
        """Run iterations of one start within a stage; return the last that found a new best, from 1, or 0."""

    def _publish(self) -> None:
        """Make the leader's best plan that of the search."""
        self._best_rank = self._leader.rank

    def _begin_cycle(self, before: Cycle | None) -> None:
        self._cycle = self._build_cycle(before)
        for start in self._starts:
            start.begin(self._leader, self._cycle.hot)

    def _advance(self, iterations: int, threads: Executor | None = None) -> None:
        """Run ``iterations`` over all starts; splitting them over several calls makes no difference to a start."""
        while iterations > 0:
            iterations -= self._run_round(iterations, threads)

    def _run_round(self, iterations: int, threads: Executor | None) -> int:
        """Run each start's share of ``iterations``, at most to the end of its stage; return how many were done."""
        going: list[SearchStartT] = []
        shares: list[int] = []
        for number, start in enumerate(sorted(self._starts, key=lambda start: start.done)):
            fair = -(-(iterations - sum(shares)) // (len(self._starts) - number))
            share = min(fair, self._cycle.stage_iterations(start.done))
            if share > 0:
                going.append(start)
                shares.append(share)
        found = run_in_threads(threads, self._improve, going, shares)
        for start, share in zip(going, shares, strict=True):
            start.done += share
        self._take_best(max(found))
        self._iterations += sum(shares)
        if all(start.done == self._cycle.length for start in self._starts):
            self._begin_cycle(self._cycle)
        return sum(shares)

    def _take_best(self, latest: int) -> None:
        """Publish the best start's plan if one improved, at the latest in iteration ``latest`` of its round."""
        if latest == 0:
            return
        leader = min(self._starts, key=lambda start: start.rank)
        if leader.rank < self._best_rank:
            self._leader = leader
            self._improved_at = self._iterations + latest * len(self._starts)
            self._publish()
