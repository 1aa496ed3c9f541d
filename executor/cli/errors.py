"""The commands of the command line, one function each; `executor.cli.main` registers them."""

from executor.errors import ExecutorError
from missions import MissionsError
from planner import PlannerError
from simulator.errors import SimulatorError

OUR_ERRORS = (ExecutorError, MissionsError, PlannerError, SimulatorError)
"""What is the input's fault, or the outside's: one line, no traceback."""
