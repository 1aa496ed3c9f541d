"""What the measurements raise."""

from executor.errors import ExecutorError


class BenchError(ExecutorError):
    """A measurement that cannot be made as it was asked for: one line that names what was expected."""
