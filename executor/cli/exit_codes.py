"""The exit codes of `faultline`, and which error is which."""

from __future__ import annotations

import signal

DONE = 0
ANSWER_IS_NO = 1
"""It ran, and nothing was wrong with the input."""
NO_READER = 1
"""Nobody reads the output any more: as typer has it."""
BAD_INPUT = 2
"""The line on stderr says why."""
INTERNAL = 70
"""EX_SOFTWARE: an internal error, not of the input."""
INTERRUPTED = 128 + signal.SIGINT


def exit_code_of(error: BaseException) -> int:
    """Return what an error that has a line of its own ends with: a vehicle that refuses is no bad input."""
    from executor.errors import VehicleRefused  # `--help` needs none

    return ANSWER_IS_NO if isinstance(error, VehicleRefused) else BAD_INPUT
