"""What of ours is raised for somebody to read: bad input, or what is outside of this program."""

from executor.errors import ExecutorError
from missions import MissionsError
from planner import PlannerError
from simulator.errors import SimulatorError

OUR_ERRORS = (ExecutorError, MissionsError, PlannerError, SimulatorError)
"""What is the input's fault, or the outside's: one line, no traceback."""
