"""Errors that the executor raises.

ExecutorError
├── SiteError          a site file that cannot be used: file, key and what was expected
├── ExtraMissing       a requested feature needs an extra that is not installed
├── ConnectionFailed   an endpoint that cannot be opened, or a vehicle that never answered
├── PreflightFailed    a check before take-off that fails
│   └── VehicleRefused a vehicle that refuses its upload
└── LogError           an event log that cannot be written or read
"""


class ExecutorError(Exception):
    """Base of all errors that the executor raises on purpose; the text is one line for the user."""


class SiteError(ExecutorError):
    """The site file cannot be used."""


class ExtraMissing(ExecutorError):
    """A requested feature needs an extra that is not installed."""


class ConnectionFailed(ExecutorError):
    """An endpoint cannot be opened, or no vehicle answers on it."""


class PreflightFailed(ExecutorError):
    """A check before take-off fails."""


class VehicleRefused(PreflightFailed):
    """A vehicle refuses its upload: the input is valid, but the vehicle does not accept it."""


class LogError(ExecutorError):
    """The event log cannot be written or read."""
