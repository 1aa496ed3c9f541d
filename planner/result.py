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
