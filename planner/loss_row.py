"""What is known of the loss of one vehicle under a plan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from planner.model import Plan


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
