"""What to simulate: vehicles, their link, their battery, the speed of time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from planner.energy import PRESETS, Drone
from simulator.errors import EndpointError, FaultSpecError, FleetError
from simulator.faults import ALL_VEHICLES, Injection, check_modes

LOOPBACK = "127.0.0.1"
EVERY_ADDRESS = "0.0.0.0"  # noqa: S104 - a ground station elsewhere is only reached from here


class AutopilotKind(Enum):
    """Whose behaviour a vehicle has."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


@dataclass(frozen=True, slots=True)
class Endpoint:
    """The vehicle's side of a UDP link."""

    bind: tuple[str, int]
    """Local address; port 0 lets the system choose."""
    target: tuple[str, int] | None
    """Whom to send to unasked; None waits until somebody calls."""


def parse_vehicle_endpoint(connection: str) -> Endpoint:
    """Return the vehicle's side of a connection string that is written for the ground station.

    ``udpin://HOST:PORT`` means that the ground station listens there, so the vehicle calls it; ``udpout://HOST:PORT``
    means that the ground station calls there, so the vehicle listens.

    Raises:
        EndpointError: any other string.
    """
    scheme, separator, rest = connection.partition("://")
    host, colon, port_text = rest.rpartition(":")
    port = int(port_text) if port_text.isascii() and port_text.isdigit() else 0
    if not (separator and colon and scheme in {"udpin", "udpout"} and 0 < port < 65536):
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
    """MAVLink 2 message signing as a vehicle was set up for it."""

    key: bytes = field(repr=False)
    """32 bytes."""
    began_ticks: int
    """Steps of 10 us since 2015 at the beginning of the simulation."""
    ticks_per_s: float = 100_000.0
    """In a simulated second: signatures are dated in real time, whatever the speed of the simulation."""


@dataclass(frozen=True, slots=True)
class SimCamera:
    """A camera on board."""

    name: str
    id: int = 0
    """From 7 on it is a component that speaks for itself; below it is wired to the autopilot."""
    gimbal: bool = False
    pitch_deg: float = -90.0
    """Where it looks without a gimbal."""
    triggered: bool = True
    """Whether the autopilot's trigger reaches it."""


@dataclass(frozen=True, slots=True)
class SimVehicle:
    """One simulated vehicle, standing on its pad with its autopilot just switched on."""

    name: str
    sysid: int
    autopilot: AutopilotKind
    connection: str
    """As in the site file, seen from the ground station: ``udpin://`` or ``udpout://``."""
    home_lat_deg: float
    home_lon_deg: float
    home_alt_m: float
    """Ground at the pad, above mean sea level; the ground is level around it."""
    drone: Drone = PRESETS["mavic3"]
    charge_pct: float = 100.0
    """Charge when the simulation begins."""
    health: float = 1.0
    """Capacity relative to a new pack; a worn one also has more internal resistance."""
    consumption: float = 1.0
    """Power relative to the energy model."""
    speed_reached: float = 1.0
    """Share of any speed asked of it over ground that it flies at."""
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Where the air moves to, east and north, in the air: what it uses follows from its air speed."""
    current_sensor: bool = True
    ready_after_s: float = 3.0
    """Boot until it can be armed, simulated. Measured: PX4 5 s, ArduPilot 42 s; shorter spares waiting."""
    transfer_patience_s: float = 0.0
    """A mission transfer is not given up sooner than this, simulated, though a real autopilot does: where a simulation
    runs faster than real time, a silent partner may be a busy computer."""
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Autopilot parameters that differ from the defaults."""
    seed: int = 0
    signing: Signing | None = None
    """None: it neither signs nor asks others to."""
    cameras: tuple[SimCamera, ...] = ()

    def __post_init__(self) -> None:
        """Check the figures.

        Raises:
            FleetError: a figure is out of range.
            EndpointError: the connection cannot be served.
        """
        parse_vehicle_endpoint(self.connection)
        checks = {
            "sysid": (1 <= self.sysid <= 254, "1 to 254"),
            "home_lat_deg": (abs(self.home_lat_deg) <= 89, "-89 to 89"),
            "home_lon_deg": (abs(self.home_lon_deg) <= 180, "-180 to 180"),
            "home_alt_m": (math.isfinite(self.home_alt_m), "a number"),
            "charge_pct": (0 < self.charge_pct <= 100, "above 0, up to 100"),
            "health": (0 < self.health <= 1.5, "above 0, up to 1.5"),
            "consumption": (0 < self.consumption < math.inf, "above 0"),
            "speed_reached": (0 < self.speed_reached <= 1, "above 0, up to 1"),
            "transfer_patience_s": (0 <= self.transfer_patience_s < math.inf, "0 or more"),
            "ready_after_s": (0 <= self.ready_after_s < math.inf, "0 or more"),
        }
        for key, (good, expected) in checks.items():
            if not good:
                raise FleetError(f"vehicle {self.name!r}: {key} is {getattr(self, key)}, expected {expected}")


@dataclass(frozen=True, slots=True)
class SimFleet:
    """The vehicles that fly together, the speed of time and what goes wrong."""

    vehicles: tuple[SimVehicle, ...]
    speedup: float = 1.0
    faults: tuple[Injection, ...] = ()

    def __post_init__(self) -> None:
        """Check that the vehicles can be told apart and the faults find theirs.

        Raises:
            FleetError: no vehicle, or a name, system id or connection that occurs twice, or a bad speed.
            FaultSpecError: a fault names a vehicle that is not there.
        """
        if not self.vehicles:
            raise FleetError("a simulated fleet needs at least one vehicle")
        if not 0 < self.speedup <= 200:
            raise FleetError(f"speedup is {self.speedup}, expected above 0, up to 200")
        names = [vehicle.name for vehicle in self.vehicles]
        links = [vehicle.connection for vehicle in self.vehicles]
        sysids = [str(vehicle.sysid) for vehicle in self.vehicles]
        for what, values in {
            "name": names,
            "sysid": sysids,
            "connection": [link for link in links if parse_vehicle_endpoint(link).target is None],
        }.items():  # fmt: skip
            twice = {value for value in values if values.count(value) > 1}
            if twice:
                raise FleetError(f"{what} {min(twice)} belongs to more than one vehicle")
        for fault in self.faults:
            if fault.vehicle not in {ALL_VEHICLES, *names}:
                known = ", ".join([ALL_VEHICLES, *names])
                raise FaultSpecError(f"fault {fault.spec!r}: no vehicle {fault.vehicle!r}, expected one of {known}")
            for vehicle in self.vehicles:
                check_modes(fault, vehicle.name, vehicle.autopilot.value)
