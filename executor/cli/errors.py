"""Define the errors meant for users: bad input, or a fault outside this program."""

from executor.errors import ExecutorError
from missions import MissionsError
from planner import PlannerError
from simulator.errors import SimulatorError

OUR_ERRORS = (ExecutorError, MissionsError, PlannerError, SimulatorError)
"""Errors of the input or the outside world: one line, no traceback."""
