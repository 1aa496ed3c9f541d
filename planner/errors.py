"""What the planner raises.

PlannerError
├── InstanceError      the arrays of an instance do not fit each other, or hold NaN
├── ParamsError        what a search is tuned by is not what it takes
└── PlanError          a plan names a vehicle or a visit that its instance does not have

A problem without a feasible plan is a result, never an error.
"""


class PlannerError(Exception):
    """Root of everything that the planner raises on purpose."""


class InstanceError(PlannerError):
    """The instance cannot be built from what was given."""


class ParamsError(PlannerError, ValueError):
    """A search cannot be tuned like this: the field and what was expected."""


class PlanError(PlannerError):
    """The plan does not belong to the instance."""
