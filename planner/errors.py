"""What the planner raises.

PlannerError
├── InstanceError      the arrays of an instance do not fit each other, or hold NaN
└── PlanError          a plan names a vehicle or a visit that its instance does not have

A problem without a feasible plan is a result, never an error.
"""


class PlannerError(Exception):
    """Root of everything that the planner raises on purpose."""


class InstanceError(PlannerError):
    """The instance cannot be built from what was given."""


class PlanError(PlannerError):
    """The plan does not belong to the instance."""
