"""What a solver gives back, and what is known of the losses of a plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

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


@dataclass(frozen=True, slots=True)
class CriticalLoss:
    """The loss that ends a window: with it, no re-plan was found."""

    vehicle: int
    from_s: float
    to_s: float


@dataclass(frozen=True, slots=True)
class ReplanWindow:
    """From when on the fleet can absorb any one loss."""

    earliest_s: float
    """t*: from here to the end of the longest route every loss has a re-plan; 0 for a full window."""
    certified_earliest_s: float
    """No window of this plan begins earlier: the end of the latest interval with a loss that nothing repairs."""
    longest_route_s: float
    breaking: CriticalLoss | None
    """The loss just before ``earliest_s`` that has no re-plan; None for a full window."""

    @property
    def window_pct(self) -> float:
        """The window as a share of the longest route's time."""
        return self._share_pct(self.earliest_s)

    @property
    def certified_window_pct(self) -> float:
        """No window of this plan is larger."""
        return self._share_pct(self.certified_earliest_s)

    def _share_pct(self, earliest_s: float) -> float:
        if self.longest_route_s <= 0:
            return 100.0
        return 100.0 * ((self.longest_route_s - earliest_s) / self.longest_route_s)


@dataclass(frozen=True, slots=True)
class WindowResult(Result):
    """The plan with the largest window found; its value is MinMax, and feasible is no route longer than allowed."""

    window: ReplanWindow = field(kw_only=True)
    """As ``replan_window`` computes it."""


class RepairStatus(Enum):
    """What is known of a loss."""

    FEASIBLE = "feasible"
    """A re-plan was found and checked."""
    IMPOSSIBLE = "impossible"
    """It is certain that there is none."""
    NOT_FOUND = "not found"
    """None was found, and it is not certain that there is none."""


@dataclass(frozen=True, slots=True)
class LossRow:
    """A loss: one vehicle, at any time of one interval between completions."""

    vehicle: int
    from_s: float
    """The interval holds this time..."""
    to_s: float
    """...but not this one."""
    verdict: RepairStatus
    plan: Plan | None
    """The re-plan, for ``remaining(instance, plan, vehicle, from_s).instance``; None if there is none."""
