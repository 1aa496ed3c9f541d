"""What a solver gives back."""

from __future__ import annotations

from dataclasses import dataclass

from planner.evaluate import Evaluation
from planner.model import Plan


@dataclass(frozen=True, slots=True)
class Result:
    """The best plan found, with its figures from the definition, and how the search went."""

    plan: Plan
    evaluation: Evaluation
    feasible: bool
    """Whether every segment is inspected and no budget exceeded."""
    iterations: int
    seconds: float
    stopped_by: str
    """The stop rule's reason."""
    impossible: str | None = None
    """Why no plan can cover everything, where that is certain; None where it is not."""
    bound: float | None = None
    """What no plan of as much covered value and as many flying vehicles can cost less than, where that was proved."""

    @property
    def gap(self) -> float | None:
        """How much of the plan's cost may be too much, as a share of it; 0 for a proven optimum."""
        if self.bound is None:
            return None
        return max(0.0, self.evaluation.value - self.bound) / max(self.evaluation.value, 1e-9)
