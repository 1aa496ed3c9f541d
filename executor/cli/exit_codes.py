"""Define the exit codes of `faultline`, and the code of each error."""

from __future__ import annotations

import signal

DONE = 0
ANSWER_IS_NO = 1
"""The command ran on valid input, and the answer is no."""
NO_READER = 1
"""The reader of the output is gone; typer's own code."""
BAD_INPUT = 2
"""Bad input; the line on stderr says why."""
INTERNAL = 70
"""EX_SOFTWARE: an internal error, not a fault of the input."""
INTERRUPTED = 128 + signal.SIGINT


def exit_code_of(error: BaseException) -> int:
    """Return the exit code of an error with its own message: a vehicle's refusal is not bad input."""
    from executor.errors import VehicleRefused  # not needed for `--help`

    return ANSWER_IS_NO if isinstance(error, VehicleRefused) else BAD_INPUT
