"""Exceptions of the planner.

PlannerError
├── InstanceError      the arrays of an instance do not fit each other, or hold NaN
└── PlanError          a plan names a vehicle or a visit that its instance does not have

A problem without a feasible plan is a result, never an error.
"""


class PlannerError(Exception):
    """Base class of all exceptions that the planner raises on purpose."""


class InstanceError(PlannerError):
    """The input does not form a valid instance."""


class PlanError(PlannerError):
    """The plan does not belong to the instance."""
