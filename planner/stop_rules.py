"""Stop rules, checked between batches of iterations, and the planner's only clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

UNLIMITED = 2**62
"""Iterations allowed by a rule that does not count them."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a search."""

    iterations: int
    since_improvement: int
    """Iterations since the best plan was found, to within a batch."""
    seconds: float
    value: float
    """Cost of the best plan."""
    uncovered: int
    """Segments that the best plan leaves out."""
    feasible: bool
    """Whether the best plan inspects everything within the budgets."""
    impossible: bool
    """Whether it is certain that no plan does."""
    bound: float | None = None
    """Proven lower bound on the cost so far; None if nothing is being proven."""

    @property
    def gap_pct(self) -> float:
        """Share of the cost that a better plan may save, by the bound; 100 without one."""
        if self.bound is None or self.value <= 0:
            return 100.0
        return 100.0 * max(0.0, 1.0 - self.bound / self.value)


@dataclass(frozen=True, slots=True)
class StopVerdict:
    """Answer of a stop rule."""

    allowed: int
    """Iterations that may run before the next check of the rule; 0 to stop."""
    reason: str
    """Name of the rule that stopped."""


class StopRule(Protocol):
    """Decide how long a search continues."""

    def __call__(self, progress: Progress) -> StopVerdict:
        """Return how many more iterations may run now."""
        ...


@dataclass(frozen=True, slots=True)
class Seconds:
    """Stop after a time since the call of the solver, construction included."""

    limit_s: float

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow any number of iterations before the time is over."""
        return StopVerdict(UNLIMITED if progress.seconds < self.limit_s else 0, "seconds")


@dataclass(frozen=True, slots=True)
class Iterations:
    """Stop after an exact number of iterations: the same seed then gives the same plan on every machine."""

    limit: int

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow the rest of the limit."""
        return StopVerdict(max(0, self.limit - progress.iterations), "iterations")


@dataclass(frozen=True, slots=True)
class NoImprovement:
    """Stop when the best plan has not improved for a number of iterations."""

    limit: int

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow the rest of the limit since the last improvement."""
        return StopVerdict(max(0, self.limit - progress.since_improvement), "no improvement")


@dataclass(frozen=True, slots=True)
class FirstFeasible:
    """Stop at the first plan that covers everything, or when it is certain that there is none."""

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow any number of iterations until one of these is known."""
        if progress.impossible:
            return StopVerdict(0, "no feasible plan exists")
        return StopVerdict(0 if progress.feasible else UNLIMITED, "first feasible")


@dataclass(frozen=True, slots=True)
class Cancelled:
    """Stop when ``cancelled`` returns true."""

    cancelled: Callable[[], bool]

    def __call__(self, progress: Progress) -> StopVerdict:  # noqa: ARG002 - the answer comes from outside
        """Allow any number of iterations until cancelled."""
        return StopVerdict(0 if self.cancelled() else UNLIMITED, "cancelled")


def combine_stop_rules(*rules: StopRule) -> StopRule:
    """Return the rule that stops when the first of ``rules`` does; without a rule, never."""

    def ask_strictest(progress: Progress) -> StopVerdict:
        verdicts = (rule(progress) for rule in rules)
        return min(verdicts, key=lambda verdict: verdict.allowed, default=StopVerdict(UNLIMITED, "never"))

    return ask_strictest


def add_progress_report(stop: StopRule, on_progress: Callable[[Progress], None] | None) -> StopRule:
    """Return the rule that reports progress before it checks ``stop``."""
    if on_progress is None:
        return stop

    def asked(progress: Progress) -> StopVerdict:
        on_progress(progress)
        return stop(progress)

    return asked


clock_s: Callable[[], float] = time.monotonic
"""The planner's clock; tests use processor time, which other load does not change."""


class Stopwatch:
    """Seconds since it was created."""

    def __init__(self) -> None:
        self._started_s = clock_s()

    @property
    def seconds(self) -> float:
        """Return the seconds since this watch was created."""
        return clock_s() - self._started_s
