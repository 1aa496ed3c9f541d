"""What the executor raises.

ExecutorError
├── SiteError          a site file that cannot be used: file, key and what was expected
├── ConnectionFailed   an endpoint that cannot be opened, or a vehicle that never answered
├── PreflightFailed    a check before take-off that says no
└── LogError           an event log that cannot be written or read
"""


class ExecutorError(Exception):
    """Root of everything that the executor raises on purpose; the text is one line for the user."""


class SiteError(ExecutorError):
    """The site file cannot be used."""


class ConnectionFailed(ExecutorError):
    """An endpoint cannot be opened, or nobody answers on it."""


class PreflightFailed(ExecutorError):
    """A check before take-off says no."""


class LogError(ExecutorError):
    """The event log cannot be written or read."""
