"""What the executor raises.

ExecutorError
├── SiteError          a site file that cannot be used: file, key and what was expected
├── ExtraMissing       what is asked for needs a part that is not installed
├── ConnectionFailed   an endpoint that cannot be opened, or a vehicle that never answered
├── PreflightFailed    a check before take-off that says no
│   └── VehicleRefused a vehicle that does not take its mission
└── LogError           an event log that cannot be written or read
"""


class ExecutorError(Exception):
    """Root of everything that the executor raises on purpose; the text is one line for the user."""


class SiteError(ExecutorError):
    """The site file cannot be used."""


class ExtraMissing(ExecutorError):
    """What is asked for needs an extra that is not installed."""


class ConnectionFailed(ExecutorError):
    """An endpoint cannot be opened, or nobody answers on it."""


class PreflightFailed(ExecutorError):
    """A check before take-off says no."""


class VehicleRefused(PreflightFailed):
    """A vehicle does not take what it is given: what was asked for is no bad input, the answer is no."""


class LogError(ExecutorError):
    """The event log cannot be written or read."""
