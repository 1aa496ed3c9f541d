"""What the measurements raise."""

from executor.errors import ExecutorError


class BenchError(ExecutorError):
    """A measurement that cannot be made as it was asked for: one line that names what was expected."""


class FlightNotFlown(ExecutorError):
    """A flight in virtual time did not begin, or came to no end."""
