"""Configuration of a simulation: vehicles, links, batteries, speed of time, faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from planner.energy import PRESETS, Drone
from simulator.errors import EndpointError, FaultSpecError, FleetError
from simulator.fault_kinds import ALL_VEHICLES, Injection, check_modes

LOOPBACK = "127.0.0.1"
OTHER_STATION = 254
PX4_RATE_BYTES_S = 1200.0
"""PX4's default MAV_0_RATE on a telemetry radio."""
EVERY_ADDRESS = "0.0.0.0"  # noqa: S104 - a ground station elsewhere is only reached from here


class AutopilotKind(Enum):
    """Autopilot that a vehicle simulates."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


@dataclass(frozen=True, slots=True)
class Endpoint:
    """The vehicle's side of a UDP link."""

    bind: tuple[str, int]
    """Local address; port 0 lets the system choose."""
    target: tuple[str, int] | None
    """Address to send to; None waits for a client."""


def parse_vehicle_endpoint(connection: str) -> Endpoint:
    """Return the vehicle's side of a connection string written for the ground station.

    ``udpin://HOST:PORT``: the ground station listens there, so the vehicle sends to it; ``udpout://HOST:PORT``: the
    ground station sends there, so the vehicle listens; with port 0 the system chooses where.

    Raises:
        EndpointError: any other string.
    """
    scheme, separator, rest = connection.partition("://")
    host, colon, port_text = rest.rpartition(":")
    port = int(port_text) if port_text.isascii() and port_text.isdigit() else -1
    least = {"udpin": 1, "udpout": 0}.get(scheme)
    if not (separator and colon and least is not None and least <= port < 65536):
        raise EndpointError(
            f"connection {connection!r} cannot be simulated: expected udpin://HOST:PORT or udpout://HOST:PORT"
        )
    host = LOOPBACK if host in {"", "localhost"} else host
    if scheme == "udpout":
        return Endpoint((host, port), None)
    # A ground station that listens on every address is reached on the loopback interface.
    target = LOOPBACK if host == EVERY_ADDRESS else host
    return Endpoint((LOOPBACK if target == LOOPBACK else EVERY_ADDRESS, 0), (target, port))


@dataclass(frozen=True, slots=True)
class Signing:
    """MAVLink 2 message signing, as configured on a vehicle."""

    key: bytes = field(repr=False)
    """32 bytes."""
    began_ticks: int
    """Signing time at the start: steps of 10 us since 2015."""
    ticks_per_s: float = 100_000.0
    """Signing ticks per simulated second; signatures follow real time at any speed."""


@dataclass(frozen=True, slots=True)
class SimCamera:
    """A camera on board."""

    name: str
    id: int = 0
    """Camera id: from 7 on its own component, below it wired to the autopilot."""
    gimbal: bool = False


@dataclass(frozen=True, slots=True)
class SimVehicle:
    """One simulated vehicle, on its pad with its autopilot just switched on."""

    name: str
    sysid: int
    autopilot: AutopilotKind
    connection: str | tuple[str, ...]
    """Connection as in the site file, from the ground station's side: ``udpin://`` or ``udpout://``, or several."""
    home_lat_deg: float
    home_lon_deg: float
    home_alt_m: float
    """Ground at the pad, above mean sea level; the terrain around it is level."""
    drone: Drone = PRESETS["mavic3"]
    charge_pct: float = 100.0
    """Charge at the start."""
    health: float = 1.0
    """Capacity relative to a new pack; a worn pack also has more internal resistance."""
    consumption: float = 1.0
    """Power relative to the energy model."""
    speed_reached: float = 1.0
    """Share of a requested ground speed that it reaches."""
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Wind as the direction in which the air moves, east and north; consumption follows air speed."""
    current_sensor: bool = True
    ready_after_s: float = 3.0
    """Simulated time from boot until it can arm. Measured: PX4 5 s, ArduPilot 42 s; shorter to save waiting."""
    transfer_patience_s: float = 0.0
    """Minimum simulated time before a mission transfer is abandoned. Real autopilots abandon sooner, but in a fast
    simulation a silent partner may be a busy computer."""
    rate_bytes_s: float = math.inf
    """PX4: MAV_0_RATE, to which it scales its streams."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Autopilot parameters that differ from the defaults."""
    seed: int = 0
    signing: Signing | None = None
    """Signing key; None neither signs nor requires signatures."""
    cameras: tuple[SimCamera, ...] = ()
    other_station: int = OTHER_STATION
    """MAVLink system id of the ground station that the fault `station` adds."""

    def __post_init__(self) -> None:
        """Check the connection; the site file has checked the numbers.

        Raises:
            EndpointError: it cannot be served.
        """
        for connection in self.connections:
            parse_vehicle_endpoint(connection)

    @property
    def connections(self) -> tuple[str, ...]:
        """Connection string of each link."""
        return (self.connection,) if isinstance(self.connection, str) else self.connection


@dataclass(frozen=True, slots=True)
class SimFleet:
    """Vehicles that fly together, the speed of time, and their faults."""

    vehicles: tuple[SimVehicle, ...]
    speedup: float = 1.0
    faults: tuple[Injection, ...] = ()
    radio: str = ""
    """Shared radio as ``parse_radio`` reads it; empty for a network. For vehicles with several links, one for each,
    separated by commas, empty for a network link."""

    def __post_init__(self) -> None:
        """Check that connections are distinct, and that faults name known vehicles.

        Raises:
            FleetError: several vehicles would have to listen on one port.
            FaultSpecError: a fault names an unknown vehicle.
        """
        every = [connection for one in self.vehicles for connection in one.connections]
        own = [parse_vehicle_endpoint(connection) for connection in every]
        listen = [connection for connection, one in zip(every, own, strict=True) if one.target is None and one.bind[1]]
        for connection in listen:
            if listen.count(connection) > 1:
                raise FleetError(f"connection {connection} belongs to more than one vehicle")
        for fault in self.faults:
            self.check_fault(fault)

    def check_fault(self, fault: Injection) -> None:
        """Check that a fault's vehicle, link and mode exist.

        Raises:
            FaultSpecError: it names an unknown vehicle, link or mode.
        """
        names = [ALL_VEHICLES, *(vehicle.name for vehicle in self.vehicles)]
        if fault.vehicle not in names:
            known = ", ".join(names)
            raise FaultSpecError(f"fault {fault.spec!r}: no vehicle {fault.vehicle!r}, expected one of {known}")
        for vehicle in self.vehicles:
            check_modes(fault, vehicle.name, vehicle.autopilot.value)
            if fault.vehicle in {ALL_VEHICLES, vehicle.name} and fault.link > len(vehicle.connections):
                raise FaultSpecError(f"fault {fault.spec!r}: {vehicle.name} has {len(vehicle.connections)} link")
