"""UAVs that speak real MAVLink 2 over UDP, with battery, wind, losses and faults to order.

They behave like ArduPilot Copter 4.7-dev and PX4 v1.17.0 as those were measured, traps included, and share nothing with
the program that flies them.
"""

from executor.simulator.config import AutopilotKind, SimFleet, SimVehicle, vehicle_endpoint
from executor.simulator.errors import EndpointError, FaultSpecError, FleetError, SimulatorError
from executor.simulator.faults import Fault, FaultKind, parse_fault
from executor.simulator.fleet import run_fleet
from executor.simulator.truth import Truth, TruthWriter, read_truths

__all__ = [
    "AutopilotKind",
    "EndpointError",
    "Fault",
    "FaultKind",
    "FaultSpecError",
    "FleetError",
    "SimFleet",
    "SimVehicle",
    "SimulatorError",
    "Truth",
    "TruthWriter",
    "parse_fault",
    "read_truths",
    "run_fleet",
    "vehicle_endpoint",
]
