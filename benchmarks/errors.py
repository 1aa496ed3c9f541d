"""Errors of the measurements."""

from executor.errors import ExecutorError


class BenchError(ExecutorError):
    """A measurement that cannot be made as requested: one line that names what was expected."""


class FlightNotFlown(ExecutorError):
    """A flight in virtual time did not begin, or did not end."""
