"""Errors that the simulator raises.

ValueError
└── SimulatorError
    ├── FaultSpecError     a fault that cannot be parsed, or that names an unknown vehicle
    ├── EndpointError      a connection string that no simulated vehicle can serve
    └── FleetError         vehicles that cannot fly together
"""


class SimulatorError(ValueError):
    """Root of all errors that the simulator raises on purpose."""


class FaultSpecError(SimulatorError):
    """The fault cannot be used."""


class EndpointError(SimulatorError):
    """The connection string cannot be served."""


class FleetError(SimulatorError):
    """The fleet cannot be simulated."""
