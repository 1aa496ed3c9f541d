"""What a search for a day gives back."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.scenarios.evaluate import DayEvaluation
from benchmarks.scenarios.model import DayPlan


@dataclass(frozen=True, slots=True)
class DayResult:
    """The best plan found, with its figures from the definition."""

    plan: DayPlan
    evaluation: DayEvaluation
    iterations: int
    seconds: float
    stopped_by: str
