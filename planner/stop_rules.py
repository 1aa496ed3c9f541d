"""When a search ends: rules that are asked between batches of iterations, and the planner's only clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

UNLIMITED = 2**62
"""Iterations that a rule allows which does not count them."""


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a search stands."""

    iterations: int
    since_improvement: int
    """Iterations since the best plan was found, to within a batch."""
    seconds: float
    value: float
    """The cost function of the best plan."""
    uncovered: int
    """Segments that the best plan leaves out."""
    feasible: bool
    """Whether the best plan inspects everything within the budgets."""
    impossible: bool
    """Whether it is certain that no plan does."""


@dataclass(frozen=True, slots=True)
class StopVerdict:
    """A rule's answer."""

    allowed: int
    """Iterations that may run before the rule must be asked again; 0 to stop."""
    reason: str
    """Which rule it was."""


class StopRule(Protocol):
    """Decides how long a search goes on."""

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
    """Stop after exactly so many iterations: the same seed then gives the same plan on every machine."""

    limit: int

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow what is left of the limit."""
        return StopVerdict(max(0, self.limit - progress.iterations), "iterations")


@dataclass(frozen=True, slots=True)
class NoImprovement:
    """Stop when the best plan has stood for so many iterations."""

    limit: int

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow what is left since the last improvement."""
        return StopVerdict(max(0, self.limit - progress.since_improvement), "no improvement")


@dataclass(frozen=True, slots=True)
class FirstFeasible:
    """Stop at the first plan that covers everything, or when it is certain that there is none."""

    def __call__(self, progress: Progress) -> StopVerdict:
        """Allow any number of iterations while the question is open."""
        if progress.impossible:
            return StopVerdict(0, "no feasible plan exists")
        return StopVerdict(0 if progress.feasible else UNLIMITED, "first feasible")


@dataclass(frozen=True, slots=True)
class Cancelled:
    """Stop when somebody outside says so."""

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
    """Return the rule that tells where a search stands before it asks ``stop``."""
    if on_progress is None:
        return stop

    def asked(progress: Progress) -> StopVerdict:
        on_progress(progress)
        return stop(progress)

    return asked


clock_s: Callable[[], float] = time.monotonic
"""The planner's clock; tests count the processor's time, which a busy computer does not change."""


class Stopwatch:
    """Seconds since it was made."""

    def __init__(self) -> None:
        self._started_s = clock_s()

    @property
    def seconds(self) -> float:
        """Seconds since this watch was made."""
        return clock_s() - self._started_s
