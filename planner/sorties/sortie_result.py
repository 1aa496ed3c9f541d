"""What a search for days of sorties gives back."""

from __future__ import annotations

from dataclasses import dataclass

from planner.sorties.sortie_evaluation import SortieEvaluation
from planner.sorties.sortie_model import SortiePlan


@dataclass(frozen=True, slots=True)
class SortieResult:
    """The best plan found, with its figures from the definition."""

    plan: SortiePlan
    evaluation: SortieEvaluation
    iterations: int
    seconds: float
    stopped_by: str
